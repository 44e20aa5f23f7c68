"""Frames with truth in one call."""

from __future__ import annotations

import numpy as np
import phasmid
import pytest
from conftest import small


def test_sequence_and_own_patterns() -> None:
    capture, truth = phasmid.render(small(), "sphere", seed=3)
    device = phasmid.Device(small(), "sphere", seed=3)
    assert np.array_equal(capture.frames, device.scan().frames)
    assert np.array_equal(truth.depth_mm, device.truth().depth_mm, equal_nan=True)

    white = np.full((2, 480, 854), 255, dtype=np.uint8)
    white[1] = 0
    capture, truth = phasmid.render(small(), "plane", patterns=white, noise=False)
    lit = truth.flags & truth.LIT != 0
    assert lit.any() and (capture.frames[0][lit] > capture.frames[1][lit]).all()
    assert [pattern["kind"] for pattern in capture.manifest.patterns] == ["image", "image"]


@pytest.mark.parametrize(
    ("patterns", "message"),
    [
        (np.zeros((1, 480, 854)), "an array of float64"),
        (np.zeros((480, 854), dtype=np.uint8), "(480, 854)"),
        (np.zeros((1, 480, 853), dtype=np.uint8), "853 x 480"),
        (np.zeros((0, 480, 854), dtype=np.uint8), "frame"),
    ],
)
def test_patterns_of_another_kind_are_refused(patterns: object, message: str) -> None:
    with pytest.raises((phasmid.InputError, phasmid.SeveralErrors)) as refused:
        phasmid.render(small(), "plane", patterns=patterns)  # type: ignore[arg-type]
    assert message in str(refused.value).replace("[", "(").replace("]", ")")

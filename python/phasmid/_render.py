"""Frames with ground truth in one call."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from . import _phasmid
from ._capture import Capture, Truth
from ._device import Device
from ._documents import profile_of
from ._errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ._documents import ProfileLike, SceneLike

__all__ = ["render"]


def render(
    profile: ProfileLike = "pmp-bench",
    scene: SceneLike = "torso",
    sequence: str | None = None,
    *,
    patterns: ArrayLike | None = None,
    **options: Any,
) -> tuple[Capture, Truth]:
    """Render a sequence, and the truth of what the camera sees.

    Parameters
    ----------
    profile, scene : str, path, dict, Profile, Scene
        As for `Device`.
    sequence : str, optional
        A sequence of the profile; the first by default.
    patterns : array of uint8, shape (n, rows, columns), optional
        Images to project instead, with as many rows and columns as the projector has.
    **options
        Further options of `Device`, such as ``seed``, ``noise`` or ``samples``.

    Returns
    -------
    Capture, Truth
        The frames, each copied once, and maps that are not copied.

    Raises
    ------
    InputError
        If the sequence does not exist, if patterns have another size than the projector, or as for `Device`.

    Examples
    --------
    >>> import numpy as np
    >>> stripes = np.zeros((1, 480, 854), dtype=np.uint8)
    >>> stripes[:, :, ::8] = 255
    >>> capture, truth = render("webcam-grey", "plane", patterns=stripes, noise=False)
    >>> capture.frames.shape, truth.depth_mm.shape
    ((1, 480, 640), (480, 640))
    """
    if patterns is None:
        with Device(profile, scene, **options) as device:
            return device.scan(sequence), device.truth()
    if sequence is not None or "sequences" in options:
        raise InputError("patterns", "patterns and a sequence", "one of them")
    import numpy as np

    loaded = profile_of(profile)
    images = np.ascontiguousarray(patterns)
    projector = loaded.to_dict()["projector"]
    size = {key: projector[key] for key in ("width_px", "height_px")}
    with tempfile.TemporaryDirectory(prefix="phasmid-") as folder:
        files = [f"{i}.png" for i in range(len(images))]
        _phasmid.write_png(cast(Any, images), [str(Path(folder, file)) for file in files])
        frames = [{"pattern": {"kind": "image", "file": file}} for file in files]
        manifest = _phasmid.Manifest.parse_json(json.dumps({"projector": size, "frame": frames}))
        path = Path(folder, "patterns.toml")
        path.write_text(manifest.toml(), encoding="utf-8")
        with Device(loaded, scene, sequences=[path], **options) as device:
            return device.scan("patterns"), device.truth()

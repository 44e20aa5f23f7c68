"""Calibration."""

from __future__ import annotations

import numpy as np
import phasmid
import pytest


def test_calibration_is_off_the_truth_by_what_it_states() -> None:
    profile = phasmid.Profile("pmp-bench")
    scale = profile.to_dict()["calibration"].get("board_scale") or 1.0
    board = phasmid.board("dots", scale=scale)
    shape = {"kind": "board", "board": board, "ink": 0.06}
    scene = phasmid.Scene("board").with_(**{"object[0].shape": shape, "object[0].albedo": 0.45})
    device = phasmid.Device(profile, scene)
    distance = profile.to_dict()["calibration"].get("distance_mm")
    captures = []
    for pose in phasmid.board_poses(board, device.rig, count=6, distance_mm=distance):
        device.place(0, *pose)
        captures.append(device.scan("pmp-12-xy"))
    dark = phasmid.Capture(np.zeros_like(captures[0].frames), captures[0].manifest)
    # Frames need not be contiguous.
    captures[0].frames = np.asfortranarray(captures[0].frames)
    calibration = phasmid.calibrate([*captures, dark], board)
    assert list(calibration.poses) == [0, 1, 2, 3, 4, 5] and list(calibration.left_out) == [6]
    assert calibration.camera_errors.rms_px < 0.1
    true = {"camera.fx": device.rig.camera.matrix[0, 0], "camera.cy": device.rig.camera.matrix[1, 2]}
    for parameter in calibration.parameters:
        if parameter.name in true:
            assert abs(parameter.value - true.pop(parameter.name)) < 5 * parameter.sigma
    assert not true
    decoding = phasmid.decode(captures[-1], rig=calibration.rig)
    score = phasmid.compare(decoding, device.truth(), device.rig)
    assert score.points > 10_000 and score.gross_error_rate < 0.01 and score.inlier_rmse_mm < 0.5

    with pytest.raises(phasmid.RejectedError) as refused:
        phasmid.calibrate(captures[:1], board)
    assert refused.value.reason and refused.value.reason in str(refused.value)


def test_boards_are_checked() -> None:
    assert phasmid.board("dots")["pitch_mm"] == 6.0
    with pytest.raises(phasmid.InputError, match="board: unknown variant `stripes`"):
        phasmid.board({"pattern": "stripes"})
    with pytest.raises(phasmid.InputError, match="board.pitch_mm: -25"):
        phasmid.board("chess", scale=-1)
    with pytest.raises(phasmid.InputError):
        phasmid.board("chess", scale=float("nan"))

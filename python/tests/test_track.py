"""Tracking of a patient."""

from __future__ import annotations

from pathlib import Path

import phasmid
import pytest


@pytest.fixture(scope="module")
def planning(tmp_path_factory: pytest.TempPathFactory) -> phasmid.Planning:
    folder = tmp_path_factory.mktemp("planning")
    phasmid.export_planning("p02-man-mean", folder, spacing_mm=12)
    with pytest.raises(phasmid.InputError, match="force"):
        phasmid.export_planning("p02-man-mean", folder, spacing_mm=12)
    return phasmid.Planning(folder)


def test_patient_is_tracked_until_told(planning: phasmid.Planning) -> None:
    scene = phasmid.Scene("treatment-room")
    place = scene.to_dict()["rig"]
    camera = phasmid.Profile("sgrt-pod").to_dict()["camera"]
    middle = {"width_px": 320, "height_px": 240, "sensor_width_mm": camera["sensor_width_mm"] / 2}
    profile = phasmid.Profile({"extends": "sgrt-pod", "name": "middle", "camera": middle})
    with phasmid.Device(profile, scene, clock="fast").serve() as serving:
        at = serving.endpoints
        scanner = phasmid.Scanner.connect(at.camera, at.control, frame_timeout_s=120)
        with phasmid.Pod("foot", scanner, place["position_mm"], place["rotation_deg"]) as pod:
            with pytest.raises(phasmid.DeviceError, match="closed"):
                scanner.scan()
            results = phasmid.track([pod], planning, scans=1)
            assert [result.scan for result in results] == [0]
            assert results[0].tumour is not None and 1 < results[0].tumour.off_mm < 8
            assert results[0].held and results[0].skin is not None
            # The pod is there for another call, which a true value ends.
            assert len(phasmid.track([pod], planning, lambda result: result.scan == 1)) == 2

            def refuse(result: phasmid.Tracked) -> None:
                raise KeyError(result.scan)

            with pytest.raises(KeyError):
                phasmid.track([pod], planning, refuse)
            for options, message in [
                ({"scans": 0}, "scans: 0; expected 1 or more"),
                ({"duration_s": 0.0}, "duration: 0 s"),
                ({"tolerance_mm": 0.0}, "tolerance_mm: 0"),
                ({"enter": 2.0}, "enter: 2"),
                ({"settle_s": -1.0}, "settle_s: -1"),
            ]:
                with pytest.raises(phasmid.InputError, match=message):
                    phasmid.track([pod], planning, **options)
        with pytest.raises(phasmid.DeviceError, match="pod: it is closed"):
            phasmid.track([pod], planning)
    with pytest.raises(phasmid.InputError, match="pods: 0"):
        phasmid.track([], planning)


def test_folder_without_a_plan_is_refused(tmp_path: Path) -> None:
    with pytest.raises(phasmid.Error, match="planning.toml"):
        phasmid.Planning(tmp_path)

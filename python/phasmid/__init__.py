"""A structured-light 3D scanner that exists only in software: emulated device, host and decoder.

>>> import phasmid
>>> device = phasmid.Device("webcam-grey", "sphere", seed=1)
>>> capture = device.scan("quick-4")
>>> decoding = phasmid.decode(capture)
>>> score = phasmid.compare(decoding, device.truth(), device.rig)
>>> score.inlier_rmse_mm < 1
True

Millimetres, seconds and degrees, unless a name says another unit. The rig's frame is the camera's: x right, y
down, z forward.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ._calibrate import BoardPose, Calibration, Parameter, Residuals, board, board_poses, calibrate
    from ._capture import Capture, FrameInfo, Truth
    from ._decode import AxisMap, Cloud, Creases, DecodeOptions, Decoder, Decoding, Score, compare, decode
    from ._device import Control, Device, Endpoints, Serving
    from ._documents import Manifest, NoiseModel, Profile, Rig, Scene, View
    from ._errors import (
        DeviceError,
        Error,
        InputError,
        Interrupted,
        OperatingSystemError,
        RejectedError,
        SeveralErrors,
    )
    from ._render import render
    from ._scanner import Scanner
    from ._service import Service, Struck
    from ._track import Planning, Pod, SkinPose, Tracked, TumourPosition, export_planning, track

    #: Version of the package, which is the workspace's.
    __version__: str

__all__ = [
    "AxisMap",
    "BoardPose",
    "Calibration",
    "Capture",
    "Cloud",
    "Control",
    "Creases",
    "DecodeOptions",
    "Decoder",
    "Decoding",
    "Device",
    "DeviceError",
    "Endpoints",
    "Error",
    "FrameInfo",
    "InputError",
    "Interrupted",
    "Manifest",
    "NoiseModel",
    "OperatingSystemError",
    "Parameter",
    "Planning",
    "Pod",
    "Profile",
    "RejectedError",
    "Residuals",
    "Rig",
    "Scanner",
    "Scene",
    "Score",
    "Service",
    "Serving",
    "SeveralErrors",
    "SkinPose",
    "Struck",
    "Tracked",
    "Truth",
    "TumourPosition",
    "View",
    "board",
    "board_poses",
    "calibrate",
    "compare",
    "decode",
    "export_planning",
    "render",
    "track",
]

#: Names of each module, which is imported when one of them is used: the command and an unused plugin of pytest
#: need none.
_NAMES = {
    "_calibrate": "BoardPose Calibration Parameter Residuals board board_poses calibrate",
    "_capture": "Capture FrameInfo Truth",
    "_decode": "AxisMap Cloud Creases DecodeOptions Decoder Decoding Score compare decode",
    "_device": "Control Device Endpoints Serving",
    "_documents": "Manifest NoiseModel Profile Rig Scene View",
    "_errors": "DeviceError Error InputError Interrupted OperatingSystemError RejectedError SeveralErrors",
    "_render": "render",
    "_scanner": "Scanner",
    "_service": "Service Struck",
    "_track": "Planning Pod SkinPose Tracked TumourPosition export_planning track",
}
_HOMES = {name: module for module, names in _NAMES.items() for name in names.split()}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return import_module("._phasmid", __name__).VERSION
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f".{_HOMES[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, "__version__"})

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

from . import _phasmid
from ._calibrate import BoardPose, Calibration, Parameter, Residuals, board, board_poses, calibrate
from ._capture import Capture, FrameInfo, Truth
from ._decode import AxisMap, Cloud, Creases, DecodeOptions, Decoder, Decoding, Score, compare, decode
from ._device import Control, Device, Endpoints, Serving, Struck
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
from ._track import Planning, Pod, SkinPose, Tracked, TumourPosition, export_planning, track

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

#: Version of the package, which is the workspace's.
__version__: str = _phasmid.VERSION

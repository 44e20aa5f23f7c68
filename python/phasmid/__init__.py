"""A structured-light 3D scanner that exists only in software."""

from . import _phasmid
from ._errors import (
    DeviceError,
    Error,
    InputError,
    Interrupted,
    OperatingSystemError,
    RejectedError,
    SeveralErrors,
)

__all__ = [
    "DeviceError",
    "Error",
    "InputError",
    "Interrupted",
    "OperatingSystemError",
    "RejectedError",
    "SeveralErrors",
]

#: Version of the package, which is the workspace's.
__version__: str = _phasmid.VERSION

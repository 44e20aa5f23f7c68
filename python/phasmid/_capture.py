"""Captures and their truth."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, NamedTuple

from ._documents import Manifest, Rig

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["Capture", "FrameInfo", "Truth"]


class FrameInfo(NamedTuple):
    """Identity and time of a frame."""

    #: A device never repeats one. Cameras without frame identity count their frames.
    id: int
    #: Position of the projected pattern in the sequence, if the camera reports it.
    pattern_index: int | None
    #: Start of the exposure in nanoseconds of the camera's clock.
    exposure_start_ns: int
    #: End of the exposure in nanoseconds of the camera's clock.
    exposure_end_ns: int


@dataclass(repr=False, eq=False)
class Capture:
    """The frames of a sequence, as a host receives them.

    Attributes
    ----------
    frames : ndarray of uint8 or uint16, shape (frames, rows, columns)
        Grey levels in digital numbers, in the manifest's order.
    manifest : Manifest
        The projected sequence, one pattern per frame.
    calibration : Rig, optional
        The calibration that the device reports.
    idn : str
        The device's answer to ``*IDN?``.
    info : list of FrameInfo
        Identity and time of each frame; empty if they are not known.
    """

    frames: NDArray[np.uint8] | NDArray[np.uint16]
    manifest: Manifest
    calibration: Rig | None = None
    idn: str = ""
    info: list[FrameInfo] = field(default_factory=list)

    @classmethod
    def _of(cls, parts: tuple[Any, ...]) -> Capture:
        frames, manifest, rig, idn, info = parts
        calibration = None if rig is None else Rig._of(rig)
        return cls(frames, Manifest._of(manifest), calibration, idn, [FrameInfo(*i) for i in info])

    def __repr__(self) -> str:
        count, height, width = self.frames.shape
        return f"<phasmid.Capture of {count} frames, {width} x {height} px, {self.frames.dtype}, {self.idn!r}>"

    def to_npz(self, path: str | os.PathLike[str]) -> None:
        """Write the capture as an archive of numpy, which is replaced if it exists.

        Parameters
        ----------
        path : str or path
            ``.npz`` is added to a path without it. The arrays are ``frames``, ``id``, ``pattern_index`` (-1 where unknown), ``exposure_start_ns`` and
            ``exposure_end_ns``; ``manifest`` and ``calibration`` are TOML, ``idn`` is text.
        """
        import numpy as np

        columns = zip(*self.info) if self.info else ((), (), (), ())
        ids, indices, starts, ends = columns
        np.savez(
            os.fspath(path),
            frames=self.frames,
            manifest=np.array(self.manifest.to_toml()),
            calibration=np.array(self.calibration.to_toml() if self.calibration else ""),
            idn=np.array(self.idn),
            id=np.array(ids, dtype=np.uint64),
            pattern_index=np.array([-1 if i is None else i for i in indices], dtype=np.int64),
            exposure_start_ns=np.array(starts, dtype=np.uint64),
            exposure_end_ns=np.array(ends, dtype=np.uint64),
        )


@dataclass(repr=False, eq=False)
class Truth:
    """What is really in front of a device, pixel by pixel; no physical scanner knows it.

    All maps have the shape (rows, columns), vectors (rows, columns, 3). Floats are float32, NaN where there
    is nothing. Positions are in the rig's frame, which is the camera's: x right, y down, z forward.

    Attributes
    ----------
    depth_mm
        z of the surface at the pixel's centre.
    projector_x, projector_y
        Projector column and row of that point, also in shadow and outside the projector's field.
    point_mm, normal
        That point, and the unit normal of the surface, towards the camera.
    object
        Number of the object in the scene (uint16), `NO_OBJECT` if there is none.
    albedo
        Fraction of light that the surface reflects diffusely.
    irradiance_w_m2
        Irradiance by the projector's full white; 0 in shadow and outside its field.
    mean_dn, modulation_dn
        Signal without noise, and its modulation by the finest fringes.
    noise_dn
        Standard deviation of the noise at ``mean_dn``.
    flags
        Sum (uint8) of `SEEN`, `LIT`, `SQUARE`, `CREASE`, `SATURATED`, `UNRESOLVED` and `MOVING`.
    """

    #: The camera's ray meets a surface.
    SEEN = 1
    #: The point is in the projector's field and not in shadow.
    LIT = 2
    #: Both rays meet the surface at less than 80 degrees from its normal.
    SQUARE = 4
    #: The pixel covers more than one facet, object or shadow.
    CREASE = 8
    #: Some frame of the finest fringes is saturated.
    SATURATED = 16
    #: The finest fringes are unresolved.
    UNRESOLVED = 32
    #: The surface moves or deforms.
    MOVING = 64
    #: Value of ``object`` where the camera sees none.
    NO_OBJECT = 65535

    depth_mm: NDArray[np.float32]
    projector_x: NDArray[np.float32]
    projector_y: NDArray[np.float32]
    point_mm: NDArray[np.float32]
    normal: NDArray[np.float32]
    object: NDArray[np.uint16]
    albedo: NDArray[np.float32]
    irradiance_w_m2: NDArray[np.float32]
    mean_dn: NDArray[np.float32]
    modulation_dn: NDArray[np.float32]
    noise_dn: NDArray[np.float32]
    flags: NDArray[np.uint8]

    def __repr__(self) -> str:
        height, width = self.depth_mm.shape
        return f"<phasmid.Truth of {width} x {height} px>"

    def to_npz(self, path: str | os.PathLike[str]) -> None:
        """Write the maps as an archive of numpy, which is replaced if it exists; ``.npz`` is added to a path
        without it."""
        import numpy as np

        np.savez(os.fspath(path), **{f.name: getattr(self, f.name) for f in fields(self)})

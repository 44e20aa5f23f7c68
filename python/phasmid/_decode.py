"""Frames to surfaces, and surfaces compared with the truth."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, Literal, TypedDict, cast

from . import _phasmid
from ._capture import Capture, Truth
from ._documents import Manifest, NoiseModel, Rig, manifest_of, rig_of
from ._errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray
    from typing_extensions import Unpack

    from ._documents import ManifestLike, RigLike

__all__ = ["AxisMap", "Cloud", "Creases", "DecodeOptions", "Decoder", "Decoding", "Score", "compare", "decode"]


class DecodeOptions(TypedDict, total=False):
    """Options of `decode` and of `Decoder`."""

    #: Keep mixed pixels, which see two surfaces at once; False by default.
    keep_mixed: bool
    #: Unwrap a single wrapped period spatially; False by default.
    unwrap_spatial: bool
    #: Minimum modulation in DN; 2 by default.
    min_modulation_dn: float
    #: Minimum modulation relative to half of white minus black; 0.25 by default.
    min_contrast: float
    #: Maximum standard deviation of a phase in radians; 0.15 by default.
    max_phase_sigma_rad: float
    #: Weight the steps by their shot noise; False by default.
    weighted: bool
    #: Treatment of the error due to held projector pixels; "correct" by default.
    held: Literal["off", "state", "correct", "smooth"]
    #: Reject pixels whose steps contradict each other; True by default.
    consistency: bool
    #: The camera's noise; by default that of the calibration, else an estimate from the frames.
    noise: NoiseModel | None


_DEFAULTS: DecodeOptions = {
    "keep_mixed": False,
    "unwrap_spatial": False,
    "min_modulation_dn": 2.0,
    "min_contrast": 0.25,
    "max_phase_sigma_rad": 0.15,
    "weighted": False,
    "held": "correct",
    "consistency": True,
    "noise": None,
}


@dataclass(repr=False, eq=False)
class AxisMap:
    """Projector coordinates along one axis. All maps have the shape (rows, columns).

    Attributes
    ----------
    coordinate : ndarray of float32
        Projector coordinate in pixels, NaN where invalid.
    sigma : ndarray of float32
        Its standard deviation due to noise, NaN where invalid.
    verdict : ndarray of uint8
        0 where valid, else the number of the reason in `VERDICTS`.
    sampling : ndarray of float32, optional
        Standard uncertainty due to held projector pixels; None if it is negligible throughout or not asked for.
    wrapped_px : float, optional
        The period that coordinates are known modulo, if the fringe order is unresolved.
    """

    #: Reasons by number; 0 is "valid".
    VERDICTS = tuple(_phasmid.verdicts())

    coordinate: NDArray[np.float32]
    sigma: NDArray[np.float32]
    verdict: NDArray[np.uint8]
    sampling: NDArray[np.float32] | None = None
    wrapped_px: float | None = None

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Where the pixel has a coordinate."""
        return cast("NDArray[np.bool_]", self.verdict == 0)

    def __repr__(self) -> str:
        return f"<phasmid.AxisMap, {int(self.valid.sum())} of {self.verdict.size} pixels valid>"


@dataclass(repr=False, eq=False)
class Cloud:
    """Measured points in the rig's frame, which is the camera's: x right, y down, z forward.

    Attributes
    ----------
    points : ndarray of float32, shape (n, 3)
        In millimetres.
    normals : ndarray of float32, shape (n, 3)
        Unit normals towards the camera.
    intensity : ndarray of float32, shape (n,)
        White minus black over the camera's range, 0 to 1.
    sigma_mm : ndarray of float32, shape (n,)
        Standard deviation along the camera's ray, in millimetres.
    """

    points: NDArray[np.float32]
    normals: NDArray[np.float32]
    intensity: NDArray[np.float32]
    sigma_mm: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.points)

    def __repr__(self) -> str:
        return f"<phasmid.Cloud of {len(self)} points>"

    def to_npz(self, path: str | os.PathLike[str]) -> None:
        """Write the columns as an archive of numpy, which is replaced if it exists."""
        import numpy as np

        np.savez(os.fspath(path), **{f.name: getattr(self, f.name) for f in fields(self)})

    def to_open3d(self) -> Any:
        """Return an ``open3d.geometry.PointCloud`` with normals and grey colours, in millimetres.

        Raises
        ------
        ImportError
            If Open3D is not installed.
        """
        import numpy as np
        import open3d  # type: ignore[import-not-found, unused-ignore]

        cloud = open3d.geometry.PointCloud()
        cloud.points = open3d.utility.Vector3dVector(self.points.astype(np.float64))
        cloud.normals = open3d.utility.Vector3dVector(self.normals.astype(np.float64))
        grey = np.repeat(np.clip(self.intensity, 0, 1)[:, None].astype(np.float64), 3, axis=1)
        cloud.colors = open3d.utility.Vector3dVector(grey)
        return cloud

    def to_trimesh(self) -> Any:
        """Return a ``trimesh.PointCloud`` with grey colours, in millimetres.

        Raises
        ------
        ImportError
            If trimesh is not installed.
        """
        import numpy as np
        import trimesh  # type: ignore[import-not-found, import-untyped, unused-ignore]

        make: Any = trimesh.PointCloud

        grey = (np.clip(self.intensity, 0, 1) * 255).astype(np.uint8)
        colors = np.stack([grey, grey, grey, np.full_like(grey, 255)], axis=1)
        return make(self.points, colors=colors)


@dataclass(repr=False, eq=False)
class Decoding:
    """A decoded capture. All maps have the shape (rows, columns) and may be changed in place.

    Attributes
    ----------
    manifest : Manifest
        The projected sequence.
    decoder : Decoder
        Decodes further captures of the same sequence, size and calibration.
    x, y : AxisMap, optional
        Projector columns and rows, as far as the sequence encodes them.
    modulation : ndarray of float32
        Modulation of the finest fringes in DN.
    intensity : ndarray of float32
        White minus black over the camera's range, 0 to 1.
    depth : ndarray of float32, optional
        z in the camera's frame in millimetres, NaN where invalid; None without a calibration.
    depth_sigma : ndarray of float32, optional
        Its standard deviation due to noise and held projector pixels, in millimetres.
    noise : NoiseModel, optional
        The noise that the standard deviations are computed from.
    notes : list of str
        Notes about the decoding.
    """

    manifest: Manifest
    decoder: Decoder
    x: AxisMap | None
    y: AxisMap | None
    modulation: NDArray[np.float32]
    intensity: NDArray[np.float32]
    depth: NDArray[np.float32] | None
    depth_sigma: NDArray[np.float32] | None
    noise: NoiseModel | None = None
    notes: list[str] = field(default_factory=list)

    @property
    def verdict(self) -> NDArray[np.uint8]:
        """0 where every decoded axis is valid, else the number of a reason in `AxisMap.VERDICTS`; a new array if
        two axes are decoded."""
        import numpy as np

        maps = [axis.verdict for axis in (self.x, self.y) if axis is not None]
        return maps[0] if len(maps) == 1 else np.where(maps[0] != 0, maps[0], maps[1])

    def cloud(self) -> Cloud:
        """Return the points of all pixels with a depth; copies the maps once.

        Raises
        ------
        InputError
            If a map has another type or shape than it had.
        """
        return Cloud(*self.decoder._inner.cloud(self))

    def summary(self) -> dict[str, Any]:
        """Return coverage, precision and the number of rejected pixels by reason; copies the maps once."""
        return cast("dict[str, Any]", json.loads(self.decoder._inner.summary(self)))

    def write_ply(self, path: str | os.PathLike[str]) -> None:
        """Write the points as a PLY file, which is replaced if it exists.

        Raises
        ------
        OperatingSystemError
            If the file cannot be written.
        """
        self.decoder._inner.write_ply(self, path)

    def to_npz(self, path: str | os.PathLike[str]) -> None:
        """Write the maps as an archive of numpy, which is replaced if it exists.

        Parameters
        ----------
        path : str or path
            Gets the ending ``.npz`` if it has none. The arrays are ``x``, ``x_sigma``, ``x_verdict``, the same of ``y``, ``modulation``, ``intensity``,
            ``depth`` and ``depth_sigma``, as far as they exist.
        """
        import numpy as np

        arrays: dict[str, NDArray[Any]] = {"modulation": self.modulation, "intensity": self.intensity}
        for name, axis in (("x", self.x), ("y", self.y)):
            if axis is not None:
                arrays[name] = axis.coordinate
                arrays[f"{name}_sigma"] = axis.sigma
                arrays[f"{name}_verdict"] = axis.verdict
        if self.depth is not None and self.depth_sigma is not None:
            arrays["depth"] = self.depth
            arrays["depth_sigma"] = self.depth_sigma
        np.savez(os.fspath(path), **cast(Any, arrays))

    def __repr__(self) -> str:
        height, width = self.intensity.shape
        valid = int((self.verdict == 0).sum())
        depth = "with" if self.depth is not None else "without"
        return f"<phasmid.Decoding of {width} x {height} px, {valid} valid, {depth} depth>"


class Decoder:
    """Decodes frames of one sequence from one camera; keeps its tables for many captures.

    Parameters
    ----------
    manifest : Manifest, str, path or dict
        The projected sequence; a str is TOML.
    width, height : int
        Columns and rows of the frames.
    rig : Rig, str, path or dict, optional
        The calibration. Without one there are coordinates but no depth.
    **options
        See `DecodeOptions`.

    Raises
    ------
    InputError
        If the sequence determines no projector coordinate, or if the calibration does not match it.
    """

    def __init__(
        self,
        manifest: ManifestLike,
        width: int,
        height: int,
        rig: RigLike | None = None,
        **options: Unpack[DecodeOptions],
    ) -> None:
        self.manifest = manifest_of(manifest)
        self.rig = rig_of(rig)
        self.width = width
        self.height = height
        self.options = options
        unknown = options.keys() - _DEFAULTS.keys()
        if unknown:
            raise InputError("option", ", ".join(sorted(unknown)), ", ".join(_DEFAULTS))
        inner = None if self.rig is None else self.rig._inner
        every: dict[str, Any] = {**_DEFAULTS, **options}
        self._inner = _phasmid.Decoder(self.manifest._inner, width, height, inner, **every)

    def decode(self, frames: Capture | ArrayLike) -> Decoding:
        """Decode the frames of a sequence.

        Parameters
        ----------
        frames : Capture or ndarray of uint8 or uint16, shape (frames, rows, columns)
            Read where they are if they are contiguous, else copied once.

        Returns
        -------
        Decoding
            Maps that are not copied.

        Raises
        ------
        InputError
            If the number, size or type of the frames is another than that of the sequence.
        """
        x, y, modulation, intensity, depth, depth_sigma, noise, notes = self._inner.decode(_array(frames))
        return Decoding(
            self.manifest,
            self,
            None if x is None else AxisMap(*x),
            None if y is None else AxisMap(*y),
            modulation,
            intensity,
            depth,
            depth_sigma,
            None if noise is None else NoiseModel(*noise),
            notes,
        )

    def __repr__(self) -> str:
        calibration = "with" if self.rig is not None else "without"
        return (
            f"<phasmid.Decoder of {len(self.manifest)} frames, {self.width} x {self.height} px, "
            f"{calibration} a calibration>"
        )

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return _remade, (self.manifest, self.width, self.height, self.rig, self.options)


def _remade(manifest: Manifest, width: int, height: int, rig: Rig | None, options: DecodeOptions) -> Decoder:
    return Decoder(manifest, width, height, rig, **options)


def _array(frames: Capture | ArrayLike) -> Any:
    """Return the frames as a contiguous array."""
    import numpy as np

    array = np.asarray(frames.frames if isinstance(frames, Capture) else frames)
    return np.require(array, requirements=["C", "A"])


def decode(
    frames: Capture | ArrayLike,
    manifest: ManifestLike | None = None,
    rig: RigLike | None = None,
    **options: Unpack[DecodeOptions],
) -> Decoding:
    """Decode frames to a surface with a standard deviation for each pixel.

    Parameters
    ----------
    frames : Capture or ndarray of uint8 or uint16, shape (frames, rows, columns)
        Read where they are if they are contiguous, else copied once.
    manifest : Manifest, str, path or dict, optional
        The projected sequence; by default the capture's. Parsing a str (TOML) takes longer than
        decoding small frames: for many calls make a `Manifest`, or a `Decoder`.
    rig : Rig, str, path or dict, optional
        The calibration; by default the capture's. Without any there are coordinates but no depth.
    **options
        See `DecodeOptions`.

    Raises
    ------
    InputError
        If the sequence determines no projector coordinate, or if frames or calibration do not match it.

    Examples
    --------
    >>> import phasmid
    >>> capture = phasmid.Device("webcam-grey", "sphere").scan("quick-4")
    >>> decoding = phasmid.decode(capture)
    >>> decoding.depth.shape
    (480, 640)
    """
    if isinstance(frames, Capture):
        manifest = frames.manifest if manifest is None else manifest
        rig = frames.calibration if rig is None else rig
    if manifest is None:
        raise InputError("manifest", "None", "the projected sequence, unless the frames are a Capture")
    array = _array(frames)
    if array.ndim != 3:
        raise InputError("frames", f"{array.ndim} axes", "the shape (frames, rows, columns)")
    _, height, width = array.shape
    return Decoder(manifest, width, height, rig, **options).decode(array)


@dataclass(frozen=True)
class Creases:
    """Errors of pixels that see more than one facet, object or shadow; NaN where there is none."""

    points: int
    coverage: float
    gross_error_rate: float
    inlier_rmse_mm: float
    mae_mm: float


@dataclass(frozen=True)
class Score:
    """Errors of a surface over the pixels that see one smooth surface; NaN where there is none.

    Attributes
    ----------
    points : int
        Pixels with a measured point.
    coverage : float
        Share of valid pixels among those that are lit, seen, and struck below 80 degrees by both rays.
    gross_error_rate : float
        Share of points more than 1 mm off in depth, or where there is nothing to see.
    inlier_rmse_mm : float
        Root mean square depth error of the other points.
    mae_mm : float
        Mean absolute depth error of all points with a true depth.
    hausdorff_mm : float
        Largest distance between the two surfaces, both ways.
    mdta_mm : float
        Mean distance to the other surface, both ways.
    bound_mm : float
        Root mean square of the bound that noise sets to the depth error.
    ratio_to_bound : float
        Root mean square of the inliers' errors, each over the bound of its pixel.
    error_over_sigma : float
        Root mean square of error over stated standard deviation, up to 5 of them.
    beyond_5_sigma : float
        Share of points beyond 5 stated standard deviations.
    crease : Creases
        The same errors where a pixel sees more than one facet, object or shadow.
    """

    points: int
    coverage: float
    gross_error_rate: float
    inlier_rmse_mm: float
    mae_mm: float
    hausdorff_mm: float
    mdta_mm: float
    bound_mm: float
    ratio_to_bound: float
    error_over_sigma: float
    beyond_5_sigma: float
    crease: Creases


def compare(decoding: Decoding, truth: Truth, rig: RigLike) -> Score:
    """Compare a decoded surface with the truth of the scan; copies the maps of both once.

    Parameters
    ----------
    decoding : Decoding
        A surface with depth.
    truth : Truth
        The truth of its scan.
    rig : Rig, str, path or dict
        The true rig, `Device.rig`.

    Raises
    ------
    InputError
        If the surface has no depth.
    DeviceError
        If the sizes differ.

    Examples
    --------
    >>> import phasmid
    >>> device = phasmid.Device("webcam-grey", "sphere", exact_calibration=True)
    >>> decoding = phasmid.decode(device.scan("quick-4"))
    >>> score = phasmid.compare(decoding, device.truth(), device.rig)
    >>> score.coverage > 0.95 and score.gross_error_rate < 1e-3
    True
    """
    known = rig_of(rig)
    if known is None:
        raise InputError("rig", "None", "the true rig")
    figures = json.loads(_phasmid.compare(decoding, truth, known._inner))

    def numbers(of: dict[str, Any]) -> dict[str, Any]:
        return {name: float("nan") if value is None else value for name, value in of.items()}

    crease = Creases(**numbers(figures.pop("crease")))
    return Score(**numbers(figures), crease=crease)

"""Profiles, scenes, sequences and calibrations."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar, cast

from . import _phasmid
from ._errors import InputError

if TYPE_CHECKING:
    from typing import TypeAlias

    import numpy as np
    from numpy.typing import NDArray
    from typing_extensions import Self

    #: A built-in name, the path of a TOML file, a dict, or the document itself.
    ProfileLike: TypeAlias = "str | os.PathLike[str] | Mapping[str, Any] | Profile"
    SceneLike: TypeAlias = "str | os.PathLike[str] | Mapping[str, Any] | Scene"
    #: TOML, the path of a TOML file, a dict, or the document itself.
    ManifestLike: TypeAlias = "str | os.PathLike[str] | Mapping[str, Any] | Manifest"
    RigLike: TypeAlias = "str | os.PathLike[str] | Mapping[str, Any] | Rig"

__all__ = ["Manifest", "NoiseModel", "Profile", "Rig", "Scene", "View"]

_T = TypeVar("_T")


def to_json(value: object) -> str:
    """Return a value as JSON; arrays and numbers of numpy count as lists and numbers."""

    def plain(other: Any) -> object:
        if hasattr(other, "tolist"):
            return other.tolist()
        if isinstance(other, os.PathLike):
            return os.fspath(other)
        raise InputError("value", repr(other), "a number, text, boolean, list or dict")

    return json.dumps(value, default=plain)


class _Document:
    """A profile or a scene."""

    _class: Any
    _inner: Any

    def __init__(self, source: str | os.PathLike[str] | Mapping[str, Any]) -> None:
        if isinstance(source, Mapping):
            self._inner = self._class.parse(to_json(source))
        else:
            self._inner = self._class.load(source)

    @classmethod
    def _of(cls, inner: Any) -> Self:
        made = cls.__new__(cls)
        made._inner = inner
        return made

    @property
    def name(self) -> str:
        """Name of the document."""
        return cast(str, self._inner.name)

    def with_(self, **changes: Any) -> Self:
        """Return a copy with other values of some fields. If the document is a file, the copy reads it again,
        as unpickling does.

        Parameters
        ----------
        **changes
            Values by the path of the field, such as ``camera.sensor.read_noise_e`` or
            ``object[0].position_mm``.

        Raises
        ------
        InputError
            If there is no such field, or if its value is not allowed.
        """
        pairs = [(field, to_json(value)) for field, value in changes.items()]
        return self._of(self._inner.with_changes(pairs))

    def to_dict(self) -> dict[str, Any]:
        """Return all fields, with their defaults where the source has none."""
        return cast("dict[str, Any]", json.loads(self._inner.json()))

    def __repr__(self) -> str:
        return f"<phasmid.{type(self).__name__} {self.name!r}>"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, type(self)) and self.to_dict() == other.to_dict()

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return _restored, (type(self), *self._inner.state())


def _restored(cls: type[_Document], *state: Any) -> _Document:
    return cls._of(cls._class.restored(*state))


class Profile(_Document):
    """A device: its camera, projector, port and sequences.

    Parameters
    ----------
    source : str, path or dict
        A built-in name or the path of a TOML file; or the fields as a dict, in which ``extends`` may name
        the profile to start from.

    Raises
    ------
    InputError
        If there is no such profile, or if a field is unknown or not allowed.

    Examples
    --------
    >>> profile = Profile("webcam-grey").with_(**{"camera.sensor.read_noise_e": 5})
    >>> profile.to_dict()["camera"]["sensor"]["read_noise_e"]
    5.0
    >>> Profile({"extends": "webcam-grey", "name": "small", "camera": {"width_px": 64}}).name
    'small'
    """

    _class = _phasmid.Profile


class Scene(_Document):
    """Objects and lights in front of a device.

    Parameters
    ----------
    source : str, path or dict
        A built-in name or the path of a TOML file; or the fields as a dict, in which ``extends`` may name
        the scene to start from.

    Raises
    ------
    InputError
        If there is no such scene, or if a field is unknown or not allowed.

    Examples
    --------
    >>> Scene("plane").with_(**{"object[0].position_mm": [0, 0, 900]}).to_dict()["object"][0]["position_mm"]
    [0.0, 0.0, 900.0]
    """

    _class = _phasmid.Scene


class _Toml:
    """A document that is TOML: a sequence or a calibration."""

    _class: Any
    _inner: Any

    def __init__(self, source: str | os.PathLike[str] | Mapping[str, Any]) -> None:
        if isinstance(source, Mapping):
            self._inner = self._class.parse_json(to_json(source))
        elif isinstance(source, str):
            self._inner = self._class.parse(source, type(self).__name__.lower())
        else:
            self._inner = self._class.read(source)

    @classmethod
    def _of(cls, inner: Any) -> Self:
        made = cls.__new__(cls)
        made._inner = inner
        return made

    def to_dict(self) -> dict[str, Any]:
        """Return all fields."""
        return cast("dict[str, Any]", json.loads(self._inner.json()))

    def to_toml(self) -> str:
        """Return the document as TOML."""
        return cast(str, self._inner.toml())

    def __eq__(self, other: object) -> bool:
        return isinstance(other, type(self)) and bool(self._inner == other._inner)

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return type(self), (self.to_toml(),)


class Manifest(_Toml):
    """A projected sequence: the patterns in their order, and the size of the projector.

    Parameters
    ----------
    source : str, path or dict
        TOML, the path of a TOML file (a `pathlib.Path`), or the fields as a dict.

    Raises
    ------
    InputError
        If a field is unknown or not allowed.
    OperatingSystemError
        If the file cannot be read.

    Examples
    --------
    >>> size = {"width_px": 912, "height_px": 1140}
    >>> manifest = Manifest({"projector": size, "frame": [{"pattern": {"kind": "white"}}]})
    >>> len(manifest), manifest.size
    (1, (912, 1140))
    """

    _class = _phasmid.Manifest

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows of the projector."""
        size = self.to_dict()["projector"]
        return size["width_px"], size["height_px"]

    @property
    def patterns(self) -> list[dict[str, Any]]:
        """The pattern of each frame."""
        return [frame["pattern"] for frame in self.to_dict()["frame"]]

    def __len__(self) -> int:
        return len(self._inner)

    def __repr__(self) -> str:
        width, height = self.size
        return f"<phasmid.Manifest of {len(self)} patterns, {width} x {height} px>"


@dataclass(frozen=True, eq=False)
class View:
    """A camera or projector, with the lens model of OpenCV.

    Attributes
    ----------
    width_px, height_px : int
        Columns and rows.
    matrix : ndarray of float64, shape (3, 3)
        Focal lengths and principal point in pixels; the centre of the first pixel is at 0.
    distortion : ndarray of float64, shape (5,)
        k1, k2, p1, p2, k3.
    rotation : ndarray of float64, shape (3, 3)
        Turns directions in the view's frame into directions in the rig's frame.
    translation_mm : ndarray of float64, shape (3,)
        The pupil in the rig's frame, in millimetres.
    """

    width_px: int
    height_px: int
    matrix: NDArray[np.float64]
    distortion: NDArray[np.float64]
    rotation: NDArray[np.float64]
    translation_mm: NDArray[np.float64]

    @classmethod
    def _of(cls, fields: dict[str, Any]) -> View:
        import numpy as np

        lens, pose = fields["lens"], fields["rig_from_view"]
        (fx, fy), (cx, cy) = lens["focal_px"], lens["principal_px"]
        return cls(
            lens["width_px"],
            lens["height_px"],
            np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]], dtype=np.float64),
            np.array(lens["distortion"], dtype=np.float64),
            np.array(pose["rotation"], dtype=np.float64),
            np.array(pose["translation_mm"], dtype=np.float64),
        )


class NoiseModel(NamedTuple):
    """A camera's noise in digital numbers (DN), by the linear model of EMVA 1288."""

    #: System gain in DN per electron.
    gain_dn_per_e: float
    #: Standard deviation of the dark signal in DN, without quantisation.
    read_noise_dn: float
    #: Mean dark signal in DN.
    black_level_dn: float
    #: Signal from which a pixel counts as saturated, in DN.
    saturation_dn: float

    def variance_dn2(self, mean_dn: _T) -> _T:
        """Return the variance in DN^2 of a pixel with this mean signal in DN; a number or an array."""
        light = cast(Any, mean_dn) - self.black_level_dn
        return cast(_T, self.read_noise_dn**2 + 1 / 12 + self.gain_dn_per_e * light * (light > 0))


class Rig(_Toml):
    """A calibration: camera, projector, and the camera's noise. The rig's frame is the camera's: x right, y
    down, z forward, in millimetres.

    Parameters
    ----------
    source : str, path or dict
        TOML, the path of a TOML file (a `pathlib.Path`), or the fields as a dict.

    Raises
    ------
    InputError
        If a field is unknown or not allowed.
    OperatingSystemError
        If the file cannot be read.
    """

    _class = _phasmid.Rig

    @property
    def camera(self) -> View:
        """The camera."""
        return View._of(self.to_dict()["camera"])

    @property
    def projector(self) -> View:
        """The projector, as an inverse camera."""
        return View._of(self.to_dict()["projector"])

    @property
    def noise(self) -> NoiseModel | None:
        """The camera's noise, if it is known."""
        noise = self.to_dict().get("noise")
        return NoiseModel(**noise) if noise else None

    def __repr__(self) -> str:
        camera, projector = self.camera, self.projector
        return (
            f"<phasmid.Rig: camera {camera.width_px} x {camera.height_px} px, projector "
            f"{projector.width_px} x {projector.height_px} px>"
        )


def profile_of(source: ProfileLike) -> Profile:
    """Return a profile from whatever describes one."""
    return source if isinstance(source, Profile) else Profile(source)


def scene_of(source: SceneLike) -> Scene:
    """Return a scene from whatever describes one."""
    return source if isinstance(source, Scene) else Scene(source)


def manifest_of(source: ManifestLike) -> Manifest:
    """Return a manifest from whatever describes one."""
    return source if isinstance(source, Manifest) else Manifest(source)


def rig_of(source: RigLike | None) -> Rig | None:
    """Return a calibration from whatever describes one."""
    return source if source is None or isinstance(source, Rig) else Rig(source)

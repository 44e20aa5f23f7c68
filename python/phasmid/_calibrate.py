"""Calibration of a scanner from captures of a board."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple, cast

from . import _phasmid
from ._capture import Capture
from ._documents import Rig, rig_of, to_json
from ._errors import InputError
from ._numbers import whole

if TYPE_CHECKING:
    from typing import TypeAlias

    from ._documents import RigLike

    #: "dots", "chess", or the fields of a board.
    BoardLike: TypeAlias = "str | Mapping[str, Any]"

__all__ = ["BoardPose", "Calibration", "Parameter", "Residuals", "board", "board_poses", "calibrate"]


@dataclass(frozen=True)
class Residuals:
    """Lengths of residuals, in pixels."""

    count: int
    mean_px: float
    rms_px: float
    max_px: float


class Parameter(NamedTuple):
    """An estimated parameter."""

    #: Such as ``camera.fx`` or ``projector.k1``.
    name: str
    #: ``px``, ``mm``, ``rad``, or empty.
    unit: str
    value: float
    #: Standard deviation.
    sigma: float


class BoardPose(NamedTuple):
    """The pose of a board in the camera's frame, as `Device.place` takes it."""

    position_mm: tuple[float, float, float]
    rotation_deg: tuple[float, float, float]


@dataclass(frozen=True)
class Calibration:
    """A calibrated rig.

    Attributes
    ----------
    rig : Rig
        The rig, with the covariance of its parameters.
    poses : dict of BoardPose
        The pose of the board in each capture that was used, by the capture's index.
    left_out : dict of str
        Why a capture was not used, by its index.
    camera_errors, projector_errors : Residuals
        Distances between observed and predicted points, in pixels of each.
    parameters : list of Parameter
        All estimated parameters.
    variance_factor : float
        Sum of squared whitened residuals over the degrees of freedom: about 1 if the covariances are right.
    condition : float
        Condition number of the correlation matrix of the rig's parameters.
    warnings : list of str
        Reasons to doubt the result.
    """

    rig: Rig
    poses: dict[int, BoardPose]
    left_out: dict[int, str]
    camera_errors: Residuals
    projector_errors: Residuals
    parameters: list[Parameter] = field(repr=False)
    variance_factor: float
    condition: float
    warnings: list[str]


def board(kind: BoardLike = "dots", *, scale: float = 1.0) -> dict[str, Any]:
    """Return the fields of a board.

    Parameters
    ----------
    kind : str or dict
        "dots", "chess", or fields to check.
    scale : float
        Factor of its lengths.

    Raises
    ------
    InputError
        If a field is not allowed.

    Examples
    --------
    >>> board("chess", scale=0.5)
    {'pattern': 'chess', 'columns': 9, 'rows': 6, 'pitch_mm': 12.5}
    """
    return cast("dict[str, Any]", json.loads(_phasmid.board(to_json(kind), scale)))


def board_poses(
    kind: BoardLike,
    rig: RigLike,
    *,
    count: int = 8,
    distance_mm: float | None = None,
    seed: int = 0,
) -> list[BoardPose]:
    """Return poses in which a rig sees a board, for a calibration.

    Parameters
    ----------
    kind : str or dict
        "dots", "chess", or the fields of a board.
    rig : Rig, str, path or dict
        Its nominal calibration.
    count : int
        Number of poses.
    distance_mm : float, optional
        Depth of the board's middle; by default where the fields of camera and projector meet.
    seed : int
        Equal seeds give equal poses.

    Raises
    ------
    InputError
        If the board cannot be shown to this rig.
    """
    known = rig_of(rig)
    if known is None:
        raise InputError("rig", "None", "a calibration")
    found = _phasmid.board_poses(
        to_json(kind),
        1.0,
        known._inner,
        count=whole("count", count),
        distance_mm=distance_mm,
        seed=whole("seed", seed, bits=64),
    )
    return [BoardPose(*pose) for pose in found]


def calibrate(
    captures: Iterable[Capture],
    kind: BoardLike = "dots",
    *,
    scale: float = 1.0,
    robust: bool = True,
) -> Calibration:
    """Calibrate a scanner from captures of a board in several poses; copies the frames once.

    Parameters
    ----------
    captures : iterable of Capture
        Each of a sequence with patterns along both axes.
    kind : str or dict
        "dots", "chess", or the fields of the board.
    scale : float
        Factor of the board's lengths.
    robust : bool
        Whether to exclude outliers and inconsistent poses.

    Raises
    ------
    RejectedError
        If too few captures show the board, or if the poses do not determine the rig.
    """
    rig, text = _phasmid.calibrate(list(captures), to_json(kind), scale, robust)
    figures = json.loads(text)

    def index(name: str) -> int:
        return int(name.rsplit(" ", 1)[1])

    return Calibration(
        rig=Rig._of(rig),
        poses={
            index(pose["name"]): BoardPose(tuple(pose["position_mm"]), tuple(pose["rotation_deg"]))
            for pose in figures["poses"]
        },
        left_out={index(name): why for name, why in figures["left_out"]},
        camera_errors=Residuals(**figures["camera_errors"]),
        projector_errors=Residuals(**figures["projector_errors"]),
        parameters=[Parameter(**parameter) for parameter in figures["parameters"]],
        variance_factor=figures["variance_factor"],
        condition=figures["condition"],
        warnings=figures["warnings"],
    )

"""Tracking of a patient by the skin surface."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

from . import _phasmid
from ._closing import Closing
from ._numbers import three, whole
from ._scanner import Scanner

__all__ = ["Planning", "Pod", "SkinPose", "Tracked", "TumourPosition", "export_planning", "track"]


def export_planning(
    patient: str | os.PathLike[str],
    folder: str | os.PathLike[str],
    *,
    spacing_mm: float = 4.0,
    ct: bool = False,
    force: bool = False,
) -> None:
    """Write the planning folder of a generated patient: skin, tumour and the motion of both.

    Parameters
    ----------
    patient : str or path
        A built-in name, such as "p02-man-mean", or the path of a TOML file.
    folder : str or path
        Created if it does not exist.
    spacing_mm : float
        Spacing of the displacement fields, 1 to 20.
    ct : bool
        Also write the computed tomogram.
    force : bool
        Overwrite existing files.

    Raises
    ------
    InputError
        If the patient does not exist, or if files exist and ``force`` is not set.
    OperatingSystemError
        If a file cannot be written.
    """
    _phasmid.export_planning(patient, folder, spacing_mm, ct, force)


class Planning:
    """A patient as planned: the skin, the tumour, and how both move.

    Parameters
    ----------
    folder : str or path
        A planning folder, see `export_planning`.

    Raises
    ------
    InputError, OperatingSystemError
        If the folder's data are missing or not valid.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self._inner = _phasmid.Planning.load(folder)
        self._folder = os.fspath(folder)

    @property
    def tumour_mm(self) -> tuple[float, float, float]:
        """Planned position of the tumour in the room frame, in millimetres."""
        x, y, z = self._inner.tumour_mm
        return x, y, z

    def __repr__(self) -> str:
        return f"<phasmid.Planning in {self._folder!r}>"


class Pod(Closing):
    """A scanner at a known place in the treatment room. The pod takes over the scanner.

    Parameters
    ----------
    name : str
        Appears in messages.
    scanner : Scanner
        A connected scanner.
    position_mm, rotation_deg : three floats
        Pose of its camera in the room frame, as ``rig`` in a station or scene: millimetres from the isocentre,
        degrees about the room's x, then y, then z axis.
    """

    def __init__(
        self,
        name: str,
        scanner: Scanner,
        position_mm: Iterable[float],
        rotation_deg: Iterable[float],
    ) -> None:
        self.name = name
        self._inner = _phasmid.Pod(
            name, scanner._inner, three("position_mm", position_mm), three("rotation_deg", rotation_deg)
        )

    def finish(self) -> None:
        """Close the ports, as `Scanner.finish` does."""
        self._inner.finish()

    def _close(self) -> None:
        self.finish()

    def __repr__(self) -> str:
        return f"<phasmid.Pod {self.name!r}>"


@dataclass(frozen=True)
class SkinPose:
    """Displacement of the skin as a rigid body, about the isocentre, with standard deviations.

    Attributes
    ----------
    shift_mm, shift_sd_mm : list of float
        LAT, LNG and VRT (x, y and z) in millimetres.
    rotation_deg, rotation_sd_deg : list of float
        Pitch, roll and yaw (about x, y and z) in degrees.
    """

    shift_mm: list[float]
    shift_sd_mm: list[float]
    rotation_deg: list[float]
    rotation_sd_deg: list[float]


@dataclass(frozen=True)
class TumourPosition:
    """Position of the tumour according to the motion model, with standard deviations.

    Attributes
    ----------
    position_mm, sd_mm : list of float
        Centroid in the room frame, in millimetres.
    off_mm, off_sd_mm : float
        Distance from the planned position, in millimetres.
    modes, modes_sd : list of float
        Coefficients of the motion model, in standard deviations of planning.
    rms_mm : float
        Root mean square distance of the fitted points from the surface, in millimetres.
    coverage : float
        Fraction of the tracked part of the skin on which points were measured.
    """

    position_mm: list[float]
    sd_mm: list[float]
    off_mm: float
    off_sd_mm: float
    modes: list[float]
    modes_sd: list[float]
    rms_mm: float
    coverage: float


@dataclass(frozen=True)
class Tracked:
    """The result of one scan by all pods, in the room frame: the fixed frame of IEC 61217 with its origin at the
    isocentre.

    Attributes
    ----------
    scan : int
        Number of the scan, from 0.
    time_s : float
        Device time at the end of the last exposure.
    middle_s : float, optional
        Device time halfway from the start of the first exposure to the end of the last; None if
        the links carry no times.
    points : int
        Total number of points that the pods measured.
    skin : SkinPose, optional
        Pose of the skin; None if tracking has lost the skin.
    tumour : TumourPosition, optional
        Position of the tumour; None if tracking has lost the skin.
    held : str, optional
        Why the beam is held; None if it may be on.
    warnings : list of str
        Reasons to doubt the result.
    decoding_s, latency_s : float
        Host time to decode, and from the last frame to this result.
    """

    scan: int
    time_s: float
    middle_s: float | None
    points: int
    skin: SkinPose | None
    tumour: TumourPosition | None
    held: str | None
    warnings: list[str] = field(default_factory=list)
    decoding_s: float = 0.0
    latency_s: float = 0.0

    @classmethod
    def _of(cls, fields: dict[str, Any]) -> Tracked:
        skin, tumour = fields.pop("skin"), fields.pop("tumour")
        return cls(
            skin=None if skin is None else SkinPose(**skin),
            tumour=None if tumour is None else TumourPosition(**tumour),
            **fields,
        )


def track(
    pods: Iterable[Pod],
    planning: Planning,
    on_scan: Callable[[Tracked], object] | None = None,
    *,
    on_message: Callable[[str], object] | None = None,
    tolerance_mm: float = 5.0,
    scans: int | None = None,
    duration_s: float | None = None,
    deviations: float = 2.0,
    enter: float = 0.8,
    settle_s: float = 0.5,
    stale_s: float = 0.4,
) -> list[Tracked]:
    """Track a patient: scan with one pod after the other, and evaluate each scan while the next one runs.

    Parameters
    ----------
    pods : iterable of Pod
        The pods of the room. Their ports stay open, so another call can use them.
    planning : Planning
        The patient in the planned position, head first and supine.
    on_scan : callable, optional
        Called with each result. Tracking ends when it returns a true value.
    on_message : callable, optional
        Called with a message if a scan is overdue, or if a pod's fringes are not sinusoidal.
    tolerance_mm : float
        Maximum distance of the tumour from its planned position, 0.001 to 1000.
    scans : int, optional
        Number of scans. Without it and ``duration_s``, tracking goes on until ``on_scan`` or Ctrl-C ends it.
    duration_s : float, optional
        Device time after which tracking ends, in seconds.
    deviations : float
        Number of standard deviations added to a quantity before it is compared with its tolerance.
    enter : float
        Fraction of the tolerance within which the beam may come on.
    settle_s, stale_s : float
        Time in seconds that all quantities must stay within ``enter`` before the beam comes on;
        maximum age of a result in seconds.

    Returns
    -------
    list of Tracked
        All results. If an exception ends the call, only ``on_scan`` has received the results.

    Raises
    ------
    InputError
        If there are no pods, or if an option is out of range.
    DeviceError, OperatingSystemError
        If a pod fails.
    """
    results: list[Tracked] = []
    ended = False

    def tell(text: str) -> bool:
        nonlocal ended
        fields = json.loads(text)
        # A further scan may have been evaluated before the pods end.
        if ended:
            return True
        if "scan" in fields:
            results.append(Tracked._of(fields))
            ended = on_scan is not None and bool(on_scan(results[-1]))
            return ended
        if on_message is not None:
            if "overdue" in fields:
                on_message(f"scan {fields['overdue']} is overdue: the beam is held, {fields['held']}")
            else:
                on_message(f"pod {fields['pod']}: {fields['doubtful']}")
        return False

    _phasmid.track(
        [pod._inner for pod in pods],
        planning._inner,
        tell,
        tolerance_mm=tolerance_mm,
        scans=None if scans is None else whole("scans", scans, bits=64),
        duration_s=duration_s,
        deviations=deviations,
        enter=enter,
        settle_s=settle_s,
        stale_s=stale_s,
    )
    return results

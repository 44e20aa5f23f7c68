"""A scanner at its addresses, emulated or physical."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from . import _phasmid
from ._capture import Capture, Truth
from ._closing import Closing
from ._documents import manifest_of, rig_of
from ._progress import ProgressLike, reporter

if TYPE_CHECKING:
    from typing_extensions import Self

    from ._documents import ManifestLike, RigLike

__all__ = ["Scanner"]


class Scanner(Closing):
    """A scanner, emulated or physical, with an open camera and control port. `connect` makes one."""

    def __init__(self, inner: _phasmid.Scanner, control: str) -> None:
        self._inner = inner
        self._control = control

    @classmethod
    def connect(
        cls,
        camera: str | os.PathLike[str],
        control: str | os.PathLike[str],
        *,
        sequence: str | None = None,
        manifest: ManifestLike | None = None,
        dialect: str | os.PathLike[str] | None = None,
        calibration: RigLike | None = None,
        reply_timeout_s: float = 10.0,
        frame_timeout_s: float = 10.0,
    ) -> Self:
        """Connect to the camera and the control port of a device.

        A free-running camera is stopped; `finish` lets it run again.

        Parameters
        ----------
        camera : str
            ``/dev/videoN``, ``socket:PATH``, ``tcp:HOST:PORT`` or ``usb:HOST:PORT/BUSID``.
        control : str or path
            Path of the serial port.
        sequence : str, optional
            Sequence to select; by default the selected one.
        manifest : Manifest, str, path or dict, optional
            The sequence, for a device that does not report it.
        dialect : str or path, optional
            Dialect of the port: a built-in name or a TOML file. By default that of the ``device.json`` beside
            the port, else SCPI.
        calibration : Rig, str, path or dict, optional
            Used instead of the device's own.
        reply_timeout_s, frame_timeout_s : float
            Maximum time to wait for a reply or for the device to open, and for a frame.

        Raises
        ------
        InputError
            If an address is invalid.
        OperatingSystemError, DeviceError
            If a port cannot be opened or the device does not answer.
        """
        known, rig = None if manifest is None else manifest_of(manifest)._inner, rig_of(calibration)
        inner = _phasmid.Scanner.connect(
            camera,
            control,
            sequence=sequence,
            manifest=known,
            dialect=dialect,
            calibration=None if rig is None else rig._inner,
            reply_timeout_s=reply_timeout_s,
            frame_timeout_s=frame_timeout_s,
        )
        return cls(inner, os.fspath(control))

    def scan(self, *, progress: ProgressLike = None) -> Capture:
        """Scan once. A run with a missing, repeated, foreign or damaged frame is repeated once.

        Parameters
        ----------
        progress : callable or True, optional
            Called with the number of frames done and of all; True shows a bar of ``tqdm``.

        Returns
        -------
        Capture
            Each frame is copied once, into one block.

        Raises
        ------
        DeviceError
            If the device refuses, does not answer, sends invalid data, or keeps failing.
        """
        with reporter(progress, "frames") as report:
            return Capture._of(self._inner.scan(report))

    def select(self, sequence: str) -> None:
        """Select the sequence of the following scans."""
        self._inner.select(sequence)

    @property
    def selected(self) -> str | None:
        """The sequence that is selected in the device, if it reports it."""
        return self._inner.selected()

    def truth(self) -> Truth:
        """Return the truth of the selected sequence with the scene as it stands now, so ask right after a scan.

        Raises
        ------
        InputError
            If the device has no service channel, as no physical one has.
        """
        return Truth(**self._inner.truth())

    def finish(self) -> None:
        """Close the ports, and let a camera run again that was free-running before."""
        self._inner.finish()

    def _close(self) -> None:
        self.finish()

    def __repr__(self) -> str:
        return f"<phasmid.Scanner at {self._control!r}>"

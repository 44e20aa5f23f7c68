"""An emulated device, in memory and served."""

from __future__ import annotations

import json
import os
import time
import weakref
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, cast

from . import _phasmid
from ._capture import Capture, Truth
from ._closing import Closing
from ._documents import Profile, Rig, Scene, profile_of, scene_of, to_json
from ._errors import DeviceError, InputError
from ._numbers import three, whole
from ._progress import ProgressLike, reporter
from ._service import Service, Struck, fault_of

if TYPE_CHECKING:
    from ._documents import ProfileLike, SceneLike

__all__ = ["Control", "Device", "Endpoints", "Serving"]


class Control:
    """The control port of a device in memory, with the methods of a serial port."""

    # Not the `Device` that owns this object, because a reference cycle is freed late.
    def __init__(self, inner: _phasmid.Device, name: str) -> None:
        self._inner = inner
        self._name = name
        self._replies = b""
        #: The last 1000 messages sent and received, in order.
        self.log: deque[tuple[Literal["sent", "received"], bytes]] = deque(maxlen=1000)

    def write(self, data: bytes | str) -> int:
        """Send bytes, and let device time pass until no operation is pending.

        Parameters
        ----------
        data : bytes or str
            A str is sent as UTF-8, with a newline at its end if it has none.
        """
        if isinstance(data, str):
            data = (data if data.endswith("\n") else data + "\n").encode()
        replies = self._inner.control(data)
        self.log.append(("sent", data))
        self.log.append(("received", replies))
        self._replies += replies
        return len(data)

    def read(self, size: int = -1) -> bytes:
        """Return the bytes received, at most ``size`` of them if ``size`` is 0 or more."""
        end = len(self._replies) if size < 0 else size
        data, self._replies = self._replies[:end], self._replies[end:]
        return data

    def readline(self) -> bytes:
        """Return the next line with its newline, or the part received so far."""
        return self.read(self._replies.find(b"\n") + 1 or len(self._replies))

    def query(self, command: str) -> str:
        """Send a command and return the first line of its answer, without the newline.

        Examples
        --------
        >>> import phasmid
        >>> phasmid.Device("webcam-grey", "plane").control.query("*IDN?")[:19]
        'Phasmid,webcam-grey'
        """
        self.read()
        self.write(command)
        return self.readline().decode().rstrip("\r\n")

    def __repr__(self) -> str:
        return f"<phasmid.Control of {self._name!r}>"


@dataclass(frozen=True)
class Endpoints:
    """Where a served device can be reached, as in its ``device.json``.

    Attributes
    ----------
    name : str
        The device's answer to ``*IDN?``.
    control : str
        Path of the control port, a pseudo-terminal.
    camera : str
        Address of the camera: ``/dev/videoN``, ``usb:HOST:PORT/BUSID`` or ``socket:PATH``.
    camera_socket : str
        Address of the frame socket, which exists in addition to any other camera.
    run_dir : str
        Directory with the endpoints.
    camera_tcp, control_usb, usb, dialect, service : str, optional
        Address of the frames over TCP; path of the control port over USB; address of the USB device; dialect of
        the control port; socket of the service channel.
    baud : int, optional
        Bit rate of the control port; None if transmission takes no time.
    """

    name: str
    control: str
    camera: str
    camera_socket: str
    run_dir: str
    camera_tcp: str | None = None
    control_usb: str | None = None
    usb: str | None = None
    dialect: str | None = None
    service: str | None = None
    baud: int | None = None

    @classmethod
    def _of(cls, text: str) -> Endpoints:
        fields = json.loads(text)
        known = {name: fields[name] for name in cls.__dataclass_fields__ if name in fields}
        return cls(run_dir=os.path.dirname(fields["control"]), **known)


def schedule_of(faults: Mapping[str, Any] | Iterable[Mapping[str, Any]]) -> Mapping[str, Any]:
    """Return a schedule of faults."""
    if isinstance(faults, Mapping):
        return cast("Mapping[str, Any]", faults)
    return {"fault": list(faults)}


class Serving(Closing):
    """A device that is being served, until `stop` or the end of the ``with`` block. `Device.serve` makes one. In a
    forked child it does nothing.

    Attributes
    ----------
    endpoints : Endpoints
        Addresses of the device.
    """

    def __init__(self, endpoints: Endpoints, end: Callable[[], object]) -> None:
        self.endpoints = endpoints
        # Also runs at the end of the interpreter, while the device's threads can still be joined.
        self._end = weakref.finalize(self, end)

    @property
    def service(self) -> Service:
        """The service channel: faults, moves, time and truth.

        Raises
        ------
        DeviceError
            If the device has no service channel.
        """
        if self.endpoints.service is None:
            raise DeviceError(f"{self.endpoints.run_dir}: the device has no service channel")
        return Service(self.endpoints.service)

    def stop(self) -> None:
        """End the device and wait until it has ended.

        Raises
        ------
        DeviceError, OperatingSystemError
            If the device had already ended with this error.
        """
        self._end()

    def _close(self) -> None:
        self.stop()

    def __repr__(self) -> str:
        state = "at" if self._end.alive else "ended, was at"
        return f"<phasmid.Serving {state} {self.endpoints.control!r}>"


class Device(Closing):
    """An emulated scanner in memory, on a clock of its own that does not wait: no sockets, no processes.

    Threads may share a device: one uses it while the others wait. A process that forks should make a new
    one if another of its threads may be using it.

    Parameters
    ----------
    profile : Profile, str, path or dict
        The device: a built-in name, the path of a TOML file, or fields.
    scene : Scene, str, path or dict
        The scene in front of the device: a built-in name, the path of a TOML file, or fields.
    seed : int
        Seed of the noise. Equal seeds give equal frames on every machine.
    clock : {"real", "fast", "stepped"}
        How time passes when the device is served.
    backend : {"cpu", "gpu", "auto"}
        Where frames are rendered.
    samples : int
        Rays per pixel: 1, 4, 16 or 64.
    time_samples : int
        Instants per exposure at which a moving scene is rendered, 1 to 256.
    motion_tolerance : float
        Error in projector pixels, 0 to 1, up to which the geometry of a moving scene is interpolated between
        instants instead of computed at each; 0 computes it at each.
    noise, exact_calibration : bool, optional
        Whether the sensor has noise, and whether the device reports its exact rig; by default as the profile
        says.
    dialect : str or path, optional
        Dialect of the control port instead of the profile's.
    sequences : list of paths
        Manifests of further sequences, with their images beside them.
    faults : list of dicts, or dict
        Faults as in a schedule, such as ``{"what": "dropped", "when": {"nth": 3}}``; or a schedule, which also
        has the ``seed`` of their chances.

    Raises
    ------
    InputError
        If the profile, scene, a file or an option is not valid.
    SeveralErrors
        If several of them are not.

    Examples
    --------
    >>> with Device("webcam-grey", "sphere", seed=1) as device:
    ...     capture = device.scan("quick-4")
    >>> capture.frames.shape, capture.frames.dtype
    ((13, 480, 640), dtype('uint8'))
    """

    def __init__(
        self,
        profile: ProfileLike = "pmp-bench",
        scene: SceneLike = "torso",
        *,
        seed: int = 0,
        clock: Literal["real", "fast", "stepped"] = "real",
        backend: Literal["cpu", "gpu", "auto"] = "cpu",
        samples: int = 1,
        time_samples: int = 4,
        motion_tolerance: float = 0.01,
        noise: bool | None = None,
        exact_calibration: bool | None = None,
        dialect: str | os.PathLike[str] | None = None,
        sequences: Iterable[str | os.PathLike[str]] = (),
        faults: Mapping[str, Any] | Iterable[Mapping[str, Any]] = (),
    ) -> None:
        if clock not in ("real", "fast", "stepped"):
            raise InputError("clock", repr(clock), '"real", "fast" or "stepped"')
        self.profile: Profile = profile_of(profile)
        self.scene: Scene = scene_of(scene)
        self._clock = clock
        self._inner = _phasmid.Device(
            self.profile._inner,
            self.scene._inner,
            seed=whole("seed", seed, bits=64),
            backend=backend,
            samples=whole("samples", samples),
            time_samples=whole("time_samples", time_samples),
            motion_tolerance=float(motion_tolerance),
            noise=noise,
            exact_calibration=exact_calibration,
            dialect=dialect,
            sequences=list(sequences),
            faults=to_json(schedule_of(faults)),
        )
        # For the log of a failed test, as long as somebody keeps it.
        self._last_capture: weakref.ref[Capture] | None = None
        #: The control port.
        self.control = Control(self._inner, self.profile.name)

    def scan(self, sequence: str | None = None, *, progress: ProgressLike = None) -> Capture:
        """Scan over port and camera, as a host does.

        Parameters
        ----------
        sequence : str, optional
            One of `sequences`; the first by default.
        progress : callable or True, optional
            Called with the number of frames done and the total number; True shows a ``tqdm`` bar.

        Returns
        -------
        Capture
            Each frame is copied once, into one block.

        Raises
        ------
        InputError
            If the device has no such sequence.
        DeviceError
            If the scan fails, as with faults that a host cannot recover from.
        """
        with reporter(progress, "frames") as report:
            capture = Capture._of(self._inner.scan(sequence, report))
        self._last_capture = weakref.ref(capture)
        return capture

    @property
    def sequences(self) -> list[str]:
        """Names of the device's sequences."""
        return self._inner.sequences()

    def truth(self, *, frame: int | None = None, time_s: float | None = None) -> Truth:
        """Return the truth of the last scan; its maps are not copied.

        Parameters
        ----------
        frame : int, optional
            The scene in the middle of the exposure of this frame, from 0.
        time_s : float, optional
            The scene at this device time in seconds. By default, in the middle of the scan.

        Raises
        ------
        DeviceError
            If there has been no scan.
        InputError
            If the sequence has no such frame.
        """
        if frame is not None and time_s is not None:
            raise InputError("truth", "a frame and a time", "one of them")
        if frame is not None:
            return Truth(**self._inner.frame_truth(whole("frame", frame)))
        if time_s is not None:
            return Truth(**self._inner.truth_at(time_s))
        return Truth(**self._inner.truth())

    @property
    def factory_calibration(self) -> Rig:
        """The calibration that the device reports: its factory's, with errors, unless made with
        ``exact_calibration``."""
        return Rig._of(self._inner.factory_calibration())

    @property
    def rig(self) -> Rig:
        """The true rig, which no host knows."""
        return Rig._of(self._inner.rig())

    @property
    def time_s(self) -> float:
        """Device time since power-on, in seconds."""
        return self._inner.time_s()

    def wait(self, time_s: float) -> None:
        """Let device time pass, in seconds; it takes only as long as the device has something to do."""
        self._inner.wait(time_s)

    def place(
        self,
        object: int,
        position_mm: Iterable[float],
        rotation_deg: Iterable[float] = (0.0, 0.0, 0.0),
    ) -> None:
        """Move an object of the scene.

        Parameters
        ----------
        object : int
            Index of the object in the scene, counted from 0.
        position_mm, rotation_deg : three floats
            As in the scene's file.

        Raises
        ------
        InputError
            If there is no such object or a number is not finite; the scene is then unchanged.
        """
        self._inner.place(
            whole("object", object), three("position_mm", position_mm), three("rotation_deg", rotation_deg)
        )

    def inject(self, fault: Mapping[str, Any] | str, **fields: Any) -> int:
        """Inject a fault from now on, and return its number.

        Parameters
        ----------
        fault : str or dict
            The kind of fault, or the whole fault as in a schedule; ``phasmid faults list`` lists the kinds.
        **fields
            Further fields, such as ``times=1`` or ``when={"nth": 3}``.

        Examples
        --------
        >>> import phasmid
        >>> device = phasmid.Device("webcam-grey", "plane")
        >>> device.inject("dropped", when={"nth": 3}, times=1)
        1
        >>> _ = device.scan("quick-4")  # The host repeats the run.
        >>> [struck.what for struck in device.struck]
        ['dropped']
        """
        return self._inner.inject(to_json(fault_of(fault, fields)))

    def clear_faults(self) -> None:
        """Remove all faults."""
        self._inner.clear_faults()

    @property
    def struck(self) -> list[Struck]:
        """The faults that have occurred, in order."""
        return [Struck(**struck) for struck in json.loads(self._inner.struck())]

    def serve(
        self,
        run_dir: str | os.PathLike[str] | None = None,
        *,
        tcp: int | None = None,
        camera: str | os.PathLike[str] | None = None,
        usb: bool = False,
        record: str | os.PathLike[str] | None = None,
        notice: Callable[[str], object] | None = None,
    ) -> Serving:
        """Serve the device on threads of its own: a control port and a frame socket. The object in memory is
        closed then.

        Parameters
        ----------
        run_dir : str or path, optional
            Directory for the endpoints; by default a private one in the temporary directory.
        tcp : int, optional
            Also serve frames on this TCP port of the loopback interface; 0 picks a free one.
        camera : str or path, optional
            Also deliver frames to this v4l2loopback node; "auto" picks a free one.
        usb : bool
            Also be a USB device with camera and serial port, exported over USB/IP.
        record : str or path, optional
            Also record every byte and frame with its time in this file, which must not exist, for
            ``phasmid replay`` and ``phasmid record info``.
        notice : callable, optional
            Receives messages for the operator, on a thread of the device.

        Raises
        ------
        InputError, OperatingSystemError, DeviceError
            If the directory cannot be used, or if the system refuses a port, a socket or a device. The object in
            memory is closed then as well.

        Examples
        --------
        >>> import phasmid
        >>> with phasmid.Device("webcam-grey", "plane", clock="fast").serve() as serving:
        ...     at = serving.endpoints
        ...     with phasmid.Scanner.connect(at.camera, at.control) as scanner:
        ...         len(scanner.scan().frames)
        13
        """
        inner = self._inner.serve(
            run_dir=run_dir,
            clock=self._clock,
            tcp=None if tcp is None else whole("tcp", tcp, bits=16),
            camera=camera,
            usb=usb,
            record=None if record is None else (record, int(time.time())),
            notice=notice,
        )
        return Serving(Endpoints._of(inner.endpoints()), inner.stop)

    def close(self) -> None:
        """Free the memory of the device; later calls raise an error."""
        self._inner.close()

    def _close(self) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<phasmid.Device {self.profile.name!r} in front of {self.scene.name!r}>"

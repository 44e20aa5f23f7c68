"""The service channel of a served device: access to what no physical scanner has."""

from __future__ import annotations

import json
import socket
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, cast

from ._documents import to_json
from ._errors import DeviceError, OperatingSystemError

__all__ = ["Service", "Struck"]

#: Maximum time for an answer: frames in flight are finished first.
_TIMEOUT_S = 60.0


@dataclass(frozen=True)
class Struck:
    """A fault that has occurred.

    Attributes
    ----------
    time_ns : int
        Device time in nanoseconds.
    fault : int
        Number of the fault, from 1.
    what : str
        Kind of fault.
    frame : int, optional
        The frame that it struck.
    command : str, optional
        The command that it struck, or whose answer.
    """

    time_ns: int
    fault: int
    what: str
    frame: int | None = None
    command: str | None = None


def fault_of(fault: Mapping[str, Any] | str, fields: Mapping[str, Any]) -> dict[str, Any]:
    """Return a fault as in a schedule."""
    return {**({"what": fault} if isinstance(fault, str) else fault), **fields}


class Service:
    """The service channel of a served device.

    Parameters
    ----------
    path : str
        Path of the socket, `Endpoints.service`.
    """

    def __init__(self, path: str) -> None:
        self.path = path

    def ask(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Send a request and return the answer.

        Parameters
        ----------
        request : dict
            As the book lists them, except for maps: ``{"get": "device"}``.

        Raises
        ------
        DeviceError
            If the device refuses the request.
        OperatingSystemError
            If the device cannot be reached.
        """
        try:
            with socket.socket(socket.AF_UNIX) as connection:
                connection.settimeout(_TIMEOUT_S)
                connection.connect(self.path)
                with connection.makefile("rwb") as stream:
                    stream.write(to_json(request).encode() + b"\n")
                    stream.flush()
                    line = stream.readline()
        except OSError as error:
            message = error.strerror or str(error)
            raise OperatingSystemError(self.path, message, error.errno) from error
        if not line:
            raise DeviceError(f"{self.path}: the device has closed the channel")
        answer = json.loads(line)
        if "error" in answer:
            raise DeviceError(f"{self.path}: {answer['error']}")
        return cast("dict[str, Any]", answer)

    def inject(self, fault: Mapping[str, Any] | str, **fields: Any) -> int:
        """Inject a fault from now on, as `Device.inject` does, and return its number."""
        return cast(int, self.ask({"fault": fault_of(fault, fields)})["fault"])

    def clear_faults(self) -> None:
        """Remove all faults."""
        self.ask({"clear_faults": "all"})

    @property
    def struck(self) -> list[Struck]:
        """The faults that have occurred, in order."""
        return [Struck(**struck) for struck in self.ask({"get": "faults"})["faults"]["struck"]]

    def place(
        self,
        object: int,
        position_mm: Iterable[float],
        rotation_deg: Iterable[float] = (0.0, 0.0, 0.0),
    ) -> None:
        """Move an object of the scene, as `Device.place` does."""
        position, rotation = list(position_mm), list(rotation_deg)
        self.ask({"place": {"object": object, "position_mm": position, "rotation_deg": rotation}})

    def set(self, field: str, value: float | str | list[float]) -> None:
        """Set a field of the scene from the next exposure on, as the option ``--set`` does.

        Examples
        --------
        >>> import phasmid
        >>> with phasmid.Device("webcam-grey", "sphere").serve() as serving:
        ...     serving.service.set("object[1].albedo", 0.3)
        ...     serving.service.ask({"get": "fields"})["fields"]["object"][1]["albedo"]
        0.3
        """
        self.ask({"set": f"{field}={json.dumps(value)}"})

    def include(self, term: str, included: bool) -> None:
        """Include or exclude a term of image formation, such as ``"noise"``, whatever the scene needs."""
        self.ask({"term": {"term": term, "included": included}})

    def trigger(self) -> None:
        """Give a pulse to the external trigger input."""
        self.ask({"do": "trigger"})

    def step(self, time_s: float) -> None:
        """Advance the time of a device with the clock "stepped", in seconds."""
        self.ask({"clock": {"step_ns": round(time_s * 1e9)}})

    def pace(self, clock: Literal["real", "fast", "stepped"]) -> None:
        """Let the time of the device, and of all that share its clock, pass in another way from now on.

        >>> import phasmid
        >>> with phasmid.Device("webcam-grey", "plane").serve() as serving:
        ...     serving.service.pace("stepped")
        ...     serving.service.ask({"get": "clock"})["clock"]["pace"]
        'stepped'
        """
        self.ask({"clock": {"pace": clock}})

    def __repr__(self) -> str:
        return f"<phasmid.Service at {self.path!r}>"

"""Exceptions, with the fields of the errors in Rust."""

from __future__ import annotations

__all__ = [
    "DeviceError",
    "Error",
    "InputError",
    "Interrupted",
    "RejectedError",
    "SeveralErrors",
    "OperatingSystemError",
]


class Error(Exception):
    """Base of all exceptions of Phasmid. The message is written for users."""


class InputError(Error, ValueError):
    """A mistake in the input.

    Parameters
    ----------
    place : str
        Where it is: a file and line, a field, an address or an argument.
    found : str
        What is there.
    expected : str
        What is allowed there.
    """

    def __init__(self, place: str, found: str, expected: str) -> None:
        super().__init__(place, found, expected)
        self.place = place
        self.found = found
        self.expected = expected

    def __str__(self) -> str:
        return f"{self.place}: {self.found}; expected {self.expected}"


class RejectedError(Error, ValueError):
    """Input that a computation rejects, such as captures that do not determine a calibration.

    Parameters
    ----------
    message : str
        The whole message.
    reason : str, optional
        The reason alone.
    """

    def __init__(self, message: str, reason: str | None = None) -> None:
        super().__init__(message, reason)
        self.message = message
        self.reason = reason

    def __str__(self) -> str:
        return self.message


class OperatingSystemError(Error, OSError):
    """An error of the operating system.

    Parameters
    ----------
    place : str
        The file or address.
    message : str
        The system's message.
    number : int, optional
        The system's number of the error; also the attribute ``errno``.
    """

    # OSError takes its arguments before `__init__` sees them.
    def __new__(cls, place: str, message: str, number: int | None = None) -> OperatingSystemError:
        return super().__new__(cls)

    def __init__(self, place: str, message: str, number: int | None = None) -> None:
        super().__init__()
        self.args = (place, message, number)
        self.place = place
        self.message = message
        self.errno = number
        self.strerror = message
        self.filename = place

    def __str__(self) -> str:
        return f"{self.place}: {self.message}"


class DeviceError(Error, RuntimeError):
    """A device, a link or the other side of one failed or broke its protocol."""


class Interrupted(Error):
    """The call was ended early."""


class SeveralErrors(Error, ValueError):
    """Errors that were found together.

    Parameters
    ----------
    errors : list of Error
        The errors, in order.
    """

    def __init__(self, errors: list[Error]) -> None:
        super().__init__(errors)
        self.errors = errors

    def __str__(self) -> str:
        return "\n".join(str(error) for error in self.errors)

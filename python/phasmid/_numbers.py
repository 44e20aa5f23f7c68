"""Numbers and vectors, checked before they reach types of fixed size."""

from __future__ import annotations

import operator
from collections.abc import Iterable

from ._errors import InputError


def whole(name: str, value: int, bits: int = 32) -> int:
    """Return a whole number that is not negative, and has at most this many bits."""
    try:
        number = operator.index(value)
    except TypeError:
        number = -1
    if not 0 <= number < 1 << bits:
        raise InputError(name, repr(value), f"a whole number from 0 to {(1 << bits) - 1}")
    return number


def three(name: str, values: Iterable[float]) -> list[float]:
    """Return the components of a vector."""
    try:
        x, y, z = (float(value) for value in values)
    except (TypeError, ValueError):
        raise InputError(name, repr(values), "three numbers") from None
    return [x, y, z]

"""The ``with`` block of what has to be closed."""

from __future__ import annotations

from types import TracebackType
from typing import TYPE_CHECKING

from ._errors import Error

if TYPE_CHECKING:
    from typing_extensions import Self


class Closing:
    """Closed at the end of a ``with`` block. If an exception ends the block, that one is raised."""

    def _close(self) -> None:
        raise NotImplementedError

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        try:
            self._close()
        except Error:
            if value is None:
                raise

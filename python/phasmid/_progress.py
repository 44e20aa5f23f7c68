"""Progress of long calls."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Generator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from typing import TypeAlias

    #: A function of the number of parts done and of all; or True for a bar of tqdm.
    ProgressLike: TypeAlias = "Callable[[int, int], object] | bool | None"
else:
    ProgressLike = object


@contextlib.contextmanager
def reporter(progress: ProgressLike, unit: str) -> Generator[Callable[[int, int], object] | None]:
    """Yield the function that is called with the progress."""
    if progress is not True:
        yield progress or None
        return
    from tqdm.auto import tqdm  # type: ignore[import-untyped, unused-ignore]

    # None: no bar unless standard error is a terminal.
    with tqdm(unit=f" {unit}", disable=None) as bar:

        def show(done: int, of: int) -> None:
            bar.total = of
            bar.update(done - bar.n)

        yield show

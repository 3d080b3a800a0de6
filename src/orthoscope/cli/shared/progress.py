"""Progress bars on stderr, handed down to the rooms below as plain callables."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

__all__ = ["bar"]

# Lines that tell how far the work is are so many seconds apart.
LINE_EVERY = 15.0


@contextmanager
def bar(title: str, *, lines: bool = False) -> Iterator[Callable[..., None]]:
    """A callable (done, total, name...) that draws a bar; silent where stderr is no terminal.

    Args:
        title: what the bar counts.
        lines: whether a line now and then takes the bar's place where stderr is no terminal, for work of minutes.
    """
    if not sys.stderr.isatty():
        yield _now_and_then(title) if lines else lambda done, total, *name: None
        return
    from tqdm import tqdm

    from orthoscope.files.printable import printable

    with tqdm(desc=title, file=sys.stderr, leave=False) as drawn:

        def show(done: int, total: int, *name: str) -> None:
            drawn.total = total
            drawn.set_postfix_str(printable(name[0]) if name else "", refresh=False)
            drawn.update(done - drawn.n)

        yield show


def _now_and_then(title: str) -> Callable[..., None]:
    """Tells how far the work is, a line each time that LINE_EVERY has gone by."""
    from orthoscope.cli.shared.printing import tell

    began = last = time.monotonic()

    def show(done: int, total: int, *name: str) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= LINE_EVERY:
            last = now
            tell(f"{title:<10} {done} of {total}, {now - began:.0f} s", err=True)

    return show

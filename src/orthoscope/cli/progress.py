"""Progress bars on stderr, handed down to the rooms below as plain callables."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

__all__ = ["bar"]


@contextmanager
def bar(title: str) -> Iterator[Callable[..., None]]:
    """A callable (done, total, name...) that draws a bar; silent where stderr is no terminal.

    Args:
        title: what the bar counts.
    """
    if not sys.stderr.isatty():
        yield lambda done, total, *name: None
        return
    from tqdm import tqdm

    from orthoscope.files.printable import printable

    with tqdm(desc=title, file=sys.stderr, leave=False) as drawn:

        def show(done: int, total: int, *name: str) -> None:
            drawn.total = total
            drawn.set_postfix_str(printable(name[0]) if name else "", refresh=False)
            drawn.update(done - drawn.n)

        yield show

"""Linear algebra with one thread of BLAS, whatever the machine has and whatever is set in its environment.

The systems here are small: threads of BLAS spend more time waiting for each other than they save, the more so
the more cores there are, and sums that are divided among them come out with other last digits. What is worth
doing at the same time is done by us (photographs, folds, entries). The number of threads is that of the whole
process; it is what it was again when the last of the functions that run has ended. Where a thread of the
user's own has limited BLAS (threadpoolctl), that limit stands.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

__all__ = ["one_thread", "with_one_thread"]

P = ParamSpec("P")
Result = TypeVar("Result")


class _OneThread:
    """As a context: BLAS has one thread while anybody is inside."""

    def __init__(self) -> None:
        self._lock, self._inside = threading.Lock(), 0
        self._controller: Any = None
        self._limit: Any = None

    def __enter__(self) -> None:
        with self._lock:
            if self._inside == 0:
                if self._controller is None:  # finding the libraries takes a moment, limiting them none
                    from threadpoolctl import ThreadpoolController

                    self._controller = ThreadpoolController().select(user_api="blas")
                self._limit = self._controller.limit(limits=1)
                self._limit.__enter__()
            self._inside += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._inside -= 1
            if self._inside == 0:
                self._limit.__exit__(None, None, None)


one_thread = _OneThread()


def with_one_thread(work: Callable[P, Result]) -> Callable[P, Result]:
    """The function, BLAS having one thread while it runs."""

    @wraps(work)
    def alone(*args: P.args, **settings: P.kwargs) -> Result:
        with one_thread:
            return work(*args, **settings)

    return alone

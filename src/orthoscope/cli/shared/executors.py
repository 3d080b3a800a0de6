"""Where many photographs or trials are worked on at once: threads or processes here, or a Dask cluster.

Each is a `concurrent.futures.Executor` that is handed down; what is left to do when a verb is stopped, by
Ctrl-C or by SIGTERM, is dropped, and nobody stays behind: threads finish the photograph that they are at,
unless it keeps them for seconds, processes go at once, even where their parent was killed.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from typing import NoReturn

from orthoscope.machine.cores import at_once

__all__ = ["cluster", "leave_threads", "processes", "single_threaded", "stopped_by_sigterm", "threads"]

# These variables of the environment tell numpy's libraries how many threads to use.
THREAD_VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
# Threads that are stopped may finish what they are at within this time, seconds.
PATIENCE = 3.0
# A scheduler has to answer within this time, seconds.
ANSWER_TIMEOUT = 10


@contextmanager
def threads(jobs: int | None, address: str | None = None) -> Iterator[Executor]:
    """An executor for work that OpenCV does, which lets other threads run.

    Args:
        jobs: how many threads; as many as there are cores by default.
        address: of a Dask scheduler, whose workers then take the threads' place.
    """
    from concurrent.futures import ThreadPoolExecutor

    with cluster(address) if address else _here(ThreadPoolExecutor(at_once(jobs))) as executor:
        yield executor


@contextmanager
def processes(jobs: int | None, address: str | None = None) -> Iterator[Executor | None]:
    """An executor for work that Python does; None for one job, which needs none.

    Args:
        jobs: how many fresh processes; as many as there are cores by default.
        address: of a Dask scheduler, whose workers then take the processes' place.
    """
    jobs = at_once(jobs)
    if address:
        with cluster(address) as executor:
            yield executor
    elif jobs == 1:
        yield None
    else:
        import multiprocessing
        from concurrent.futures import ProcessPoolExecutor

        with _here(
            ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), _serve), then=_end_children
        ) as executor:
            yield executor


@contextmanager
def cluster(address: str) -> Iterator[Executor]:
    """The workers of a running Dask scheduler; one that dies has its work done by the others.

    Args:
        address: of the scheduler, such as tls://192.168.1.5:8786; whoever owns it runs code here, since
            results come back as Python's pickles.
    Raises:
        InputError: `distributed` is not installed, or nobody answers.
    """
    from orthoscope.geometry.arrays import InputError

    try:
        from distributed import Client
    except ImportError as error:
        raise InputError(
            "--cluster needs Dask, which is not installed; say pip install 'orthoscope[cluster]', or drop"
            " --cluster."
        ) from error
    try:
        client = Client(address, timeout=ANSWER_TIMEOUT, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise InputError(
            f"no Dask scheduler answers at {address!r}; expected one such as tls://192.168.1.5:8786. Start it"
            " first."
        ) from error
    with client, stopped_by_sigterm():
        executor = client.get_executor(pure=False)
        try:
            yield executor
        except BaseException:
            executor.shutdown(wait=False)
            raise


@contextmanager
def single_threaded() -> Iterator[None]:
    """Lets numpy, where it is not loaded yet, compute with one thread: sums then do not depend on the cores."""
    before = {name: os.environ.get(name) for name in THREAD_VARIABLES}
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextmanager
def _here(executor: Executor, *, then: Callable[[], None] = lambda: None) -> Iterator[Executor]:
    """An executor of this machine, whose waiting work is dropped when the block is left by an error or a stop.

    Args:
        executor: the one.
        then: what is done after the dropping.
    """
    with stopped_by_sigterm():
        try:
            yield executor
        except BaseException:
            executor.shutdown(wait=False, cancel_futures=True)
            then()
            _wait_for_others()
            raise
        executor.shutdown(wait=True)


@contextmanager
def stopped_by_sigterm() -> Iterator[None]:
    """Lets SIGTERM stop the block as Ctrl-C does; only the main thread can say so."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def leave_threads(code: int) -> NoReturn:
    """Exit, also where a thread still waits, as for a file that does not come."""
    _wait_for_others()
    if _others():
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    sys.exit(code)


def _others() -> list[threading.Thread]:
    """Threads that Python would wait for."""
    return [one for one in threading.enumerate() if one is not threading.current_thread() and not one.daemon]


def _wait_for_others() -> None:
    """Let threads finish what they are at, for a while."""
    end = time.monotonic() + PATIENCE
    for thread in _others():
        thread.join(max(0.0, end - time.monotonic()))


def _serve() -> None:
    """How a process begins: deaf to Ctrl-C, which is its parent's to hear, and gone when its parent is."""
    import multiprocessing

    parent = multiprocessing.parent_process()
    assert parent is not None

    def follow() -> None:
        parent.join()
        os._exit(1)

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=follow, daemon=True).start()


def _end_children() -> None:
    """Ask every process that this one has started to end."""
    import multiprocessing

    for child in multiprocessing.active_children():
        child.terminate()

"""How a verb leaves: each error becomes one message and an exit code, the same for all verbs."""

from __future__ import annotations

import errno
import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import click

from orthoscope.cli.shared.executors import leave_threads
from orthoscope.cli.shared.printing import tell

__all__ = ["errors_as_exit_codes", "leave_unless_usable"]

# The verb did what it was asked for.
DONE = 0
# The data cannot answer, or the machine is too small for them.
CANNOT_ANSWER = 1
# The command, or what it was given, is wrong.
WRONG_COMMAND = 2
# The verdict is "do not use", and --strict was asked for.
NOT_TO_BE_USED = 3
# It was stopped from the keyboard, as shells count it: 128 and the signal's number.
STOPPED = 130
# A place that takes no more bytes: a full disk, a full share of it, a broken device, a file at its limit.
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EFBIG)
# Messages list photographs with reasons, each on a line of its own after this; any other line end is escaped.
LISTED = "\n  "


@contextmanager
def errors_as_exit_codes() -> Iterator[None]:
    """Leave the process with a message and a code where an error comes out of the block."""
    try:
        yield
    except click.exceptions.Exit as leave:
        sys.exit(leave.exit_code)
    except (click.Abort, KeyboardInterrupt):
        tell("stopped; files already written are whole", err=True)
        leave_threads(STOPPED)
    except click.ClickException as error:
        error.show(shown := io.StringIO())
        tell(*shown.getvalue().rstrip("\n").split("\n"), err=True)
        sys.exit(WRONG_COMMAND)
    except BrokenPipeError:
        _print_no_more()
        sys.exit(DONE)
    except OSError as error:
        if error.errno not in FULL:
            raise
        _print_no_more()
        tell(
            f"orthoscope: what is printed or written finds no place ({error.strerror}); free some.", err=True
        )
        sys.exit(WRONG_COMMAND)
    except ModuleNotFoundError as error:
        from orthoscope.machine.missing import how_to_install

        if (told := how_to_install(error)) is None:
            raise
        tell(f"orthoscope: {told}", err=True)
        sys.exit(WRONG_COMMAND)
    except MemoryError:
        tell(
            "orthoscope: there is not enough memory for this; give it smaller pictures or --jobs 1.", err=True
        )
        sys.exit(CANNOT_ANSWER)
    except (ValueError, RuntimeError) as error:
        _leave(error)


def leave_unless_usable(grade: str, *, strict: bool) -> None:
    """Leave with a code of its own where a camera must not be used, for scripts that go by it.

    Args:
        grade: of the verdict.
        strict: whether that was asked for; else whoever reads the verdict decides.
    """
    from orthoscope.evaluation.verdict.grades import Grade

    if strict and grade == Grade.NO:
        sys.exit(NOT_TO_BE_USED)


def _leave(error: Exception) -> None:
    """Exit with the message and code of an error of ours; any other is a defect and keeps its traceback."""
    from concurrent.futures import BrokenExecutor

    from orthoscope.geometry.arrays import CalibrationError, InputError

    if str(error) == "embedded null byte":  # as Python says of a path, before any check of ours
        error = InputError(
            "a path has a NUL in it; expected the name of a file or folder. Choose another place."
        )
    if isinstance(error, BrokenExecutor):
        tell(
            "orthoscope: a process that worked on this was ended from outside, perhaps for want of memory; run"
            " it again with --jobs 1.",
            err=True,
        )
        sys.exit(CANNOT_ANSWER)
    if not isinstance(error, InputError | CalibrationError):
        raise error
    first, *listed = str(error).split(LISTED)
    tell(f"orthoscope: {first}", *(f"  {line}" for line in listed), err=True)
    sys.exit(WRONG_COMMAND if isinstance(error, InputError) else CANNOT_ANSWER)


def _print_no_more() -> None:
    """Sends what waits to be printed nowhere, since Python would try once more when it ends, and complain."""
    try:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (OSError, ValueError):
        return  # what stands in stdout's place is no file

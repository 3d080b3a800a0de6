"""The command line: each verb one arrow of the flow, in a file of its own.

Numbers go to stdout, progress and remarks to stderr. Exit 0: done; 1: the data cannot answer; 2: the command
or what it was given is wrong. Nothing but click is imported here and at the head of a verb, so that `--help`
is instant.
"""

from __future__ import annotations

import errno
import io
import os
import sys

import click

from orthoscope.cli.calibrate import calibrate
from orthoscope.cli.compare import compare
from orthoscope.cli.demo import demo
from orthoscope.cli.detect import detect
from orthoscope.cli.evaluate import evaluate
from orthoscope.cli.executors import leave_threads, single_threaded, stopped_by_sigterm
from orthoscope.cli.export import convert, export, tools
from orthoscope.cli.given_files import keeping_inputs
from orthoscope.cli.paper import paper
from orthoscope.cli.report import report
from orthoscope.cli.simulate import simulate
from orthoscope.cli.straighten import straighten
from orthoscope.cli.target import target
from orthoscope.cli.telling import tell
from orthoscope.cli.undistort import undistort
from orthoscope.version import __version__

__all__ = ["main", "verbs"]

# A place that takes no more bytes: a full disk, a full share of it, a broken device, a file at its limit.
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EFBIG)
EXAMPLE = """\b
Example:
  orthoscope calibrate photos/ --target chessboard:9x6:25mm -o camera/
"""


@click.group(
    epilog=EXAMPLE, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110}
)
@click.version_option(__version__, prog_name="orthoscope")
def verbs() -> None:
    """Photographs of a flat target in, a camera that can be trusted out."""


for verb in (
    calibrate,
    detect,
    evaluate,
    compare,
    undistort,
    straighten,
    export,
    convert,
    tools,
    report,
    simulate,
    target,
    demo,
    paper,
):
    assert verb.callback, "a verb does something"
    verb.callback = keeping_inputs(verb.callback)
    verbs.add_command(verb)


def main() -> None:
    """Run the command line, BLAS with one thread; errors become one message and an exit code."""
    try:
        with single_threaded(), stopped_by_sigterm():
            verbs(standalone_mode=False)
    except click.exceptions.Exit as leave:
        sys.exit(leave.exit_code)
    except (click.Abort, KeyboardInterrupt):
        tell("stopped; files already written are whole", err=True)
        leave_threads(130)
    except click.ClickException as error:
        error.show(shown := io.StringIO())
        tell(*shown.getvalue().rstrip("\n").split("\n"), err=True)
        sys.exit(2)
    except BrokenPipeError:
        _print_no_more()
        sys.exit(0)
    except OSError as error:
        if error.errno not in FULL:
            raise
        _print_no_more()
        tell(
            f"orthoscope: what is printed or written finds no place ({error.strerror}); free some.", err=True
        )
        sys.exit(2)
    except ModuleNotFoundError as error:
        from orthoscope.geometry.missing import how_to_install

        if (told := how_to_install(error)) is None:
            raise
        tell(f"orthoscope: {told}", err=True)
        sys.exit(2)
    except MemoryError:
        tell(
            "orthoscope: there is not enough memory for this; give it smaller pictures or --jobs 1.", err=True
        )
        sys.exit(1)
    except (ValueError, RuntimeError) as error:
        _leave(error)


# Messages list photographs with reasons, each on a line of its own after this; any other line end is escaped.
LISTED = "\n  "


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
        sys.exit(1)
    if not isinstance(error, InputError | CalibrationError):
        raise error
    first, *listed = str(error).split(LISTED)
    tell(f"orthoscope: {first}", *(f"  {line}" for line in listed), err=True)
    sys.exit(2 if isinstance(error, InputError) else 1)


def _print_no_more() -> None:
    """Sends what waits to be printed nowhere, since Python would try once more when it ends, and complain."""
    try:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (OSError, ValueError):
        return  # what stands in stdout's place is no file

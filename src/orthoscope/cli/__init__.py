"""The command line: each verb one arrow of the flow, in a file of its own.

Numbers go to stdout, progress and remarks to stderr; `exit_codes.py` says how a verb leaves. Nothing but click is imported here and at the head of a verb, so that `--help`
is instant.
"""

from __future__ import annotations

import click

from orthoscope.cli.calibrate import calibrate
from orthoscope.cli.compare import compare
from orthoscope.cli.demo import demo
from orthoscope.cli.detect import detect
from orthoscope.cli.evaluate import evaluate
from orthoscope.cli.export import convert, export, tools
from orthoscope.cli.paper import paper
from orthoscope.cli.report import report
from orthoscope.cli.shared.executors import single_threaded, stopped_by_sigterm
from orthoscope.cli.shared.exit_codes import errors_as_exit_codes
from orthoscope.cli.shared.kept_inputs import keeping_inputs
from orthoscope.cli.simulate import simulate
from orthoscope.cli.straighten import straighten
from orthoscope.cli.target import target
from orthoscope.cli.undistort import undistort
from orthoscope.machine.memory import collect_seldom, keep_freed_memory
from orthoscope.version import __version__

__all__ = ["main", "verbs"]

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
    collect_seldom()
    keep_freed_memory()
    with errors_as_exit_codes(), single_threaded(), stopped_by_sigterm():
        verbs(standalone_mode=False)

"""The report's figures as files for a paper: SVG and PDF, drawn by matplotlib, which `orthoscope[figures]`
brings.
"""

from __future__ import annotations

import io
from pathlib import Path

from orthoscope.evaluation.evaluate import Evaluation
from orthoscope.files.whole_files import write_bytes, write_text
from orthoscope.geometry.arrays import InputError

__all__ = ["check_matplotlib", "write_figures"]


def write_figures(evaluation: Evaluation, folder: str | Path) -> list[Path]:
    """Write every figure that suits the evaluation, as SVG and as PDF; the same evaluation gives the same
    bytes.

    Args:
        folder: where to; made where it is missing.
    Raises:
        InputError: matplotlib is not installed, or the place cannot be written.
    """
    check_matplotlib()
    from orthoscope.report.figures import to_svg
    from orthoscope.report.plates import PLATES

    written = []
    for plate in PLATES:
        if not plate.suits(evaluation):
            continue
        figure, place = plate.draw(evaluation), Path(folder) / plate.name
        write_text(place.with_suffix(".svg"), to_svg(figure, plate.name).replace("var(--sans)", "sans-serif"))
        content = io.BytesIO()
        figure.savefig(
            content, format="pdf", metadata={"CreationDate": None, "Producer": None, "Creator": None}
        )
        write_bytes(place.with_suffix(".pdf"), content.getvalue())
        written += [place.with_suffix(".svg"), place.with_suffix(".pdf")]
    return written


def check_matplotlib() -> None:
    """Check that matplotlib is there.

    Raises:
        InputError: it is not installed.
    """
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise InputError(
            "figures for print need matplotlib, which is not installed; say pip install"
            " 'orthoscope[figures]'."
        ) from error

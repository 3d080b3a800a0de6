"""The report: one HTML file that needs no network and draws itself, from an evaluation.

Words and tables are HTML as they stand; the numbers of the figures go in as JSON, and the one script
(script/) draws them. A policy in the page itself forbids the browser to load anything, and to run or to style
by anything but what has the hash of our own script and style. The same evaluation gives the same bytes:
nothing of the day or the machine goes in.
"""

from __future__ import annotations

import base64
import hashlib
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import msgspec

from orthoscope.evaluation.evaluate import Evaluation
from orthoscope.files.whole_files import write_text
from orthoscope.report import sections
from orthoscope.report.data.rounded import PLACE_UNITS, RESIDUAL_UNITS
from orthoscope.report.data.trust import trust
from orthoscope.report.data.views import views
from orthoscope.report.html import Html, raw, tag
from orthoscope.report.panels import PANELS
from orthoscope.report.pictures import Pictures
from orthoscope.targets.left_out import LEFT_OUT_REASON

__all__ = ["closed_page", "report_page", "write_report"]

# The page's script has these files of script/ as its parts; the last begins.
SCRIPT_PARTS = (
    "data",
    "state",
    "plot",
    "drawing",
    "residuals",
    "fields",
    "trust",
    "lens_curve",
    "solid",
    "boards",
    "target",
    "choice",
    "comparison",
    "photographs",
    "tabs",
    "all",
)


def report_page(evaluation: Evaluation, *, pictures: Pictures | None = None) -> str:
    """The page as text.

    Args:
        pictures: the photographs that it shows (`pictures_of`); none by default.
    """
    pictures = pictures or Pictures()
    found = {panel.name: panel.data(evaluation) for panel in PANELS}
    found["trust"] = trust(evaluation)
    calibration = evaluation.calibration
    detections = calibration.detections
    width, height = detections.image_size
    data = {
        "frame": {"width": width, "height": height},
        "units": {"place": PLACE_UNITS, "residual": RESIDUAL_UNITS},
        "centre": [calibration.camera.intrinsics.cx, calibration.camera.intrinsics.cy],
        "columns": detections.target.grid and detections.target.grid[0],
        "views": views(evaluation),
        "leftOut": [entry.image for entry in detections.set_aside if entry.reason == LEFT_OUT_REASON],
        "large": pictures.large and pictures.large[0],
        "panels": {name: told for name, told in found.items() if not isinstance(told, str)},
    }
    count = len(detections.views)
    title = f"Calibration report: {count} photograph{'' if count == 1 else 's'}, {detections.target.name}"
    body = [
        sections.opening(evaluation),
        tag(
            "main",
            sections.first_screen(evaluation, found["trust"], pictures),
            sections.key_figures(evaluation),
            sections.what_to_know(evaluation),
            sections.photographs_section(evaluation, pictures),
            sections.figures(found),
            sections.before_and_after_section(pictures),
            sections.numbers_section(evaluation),
            sections.set_aside(detections),
        ),
        sections.closing(evaluation),
    ]
    return closed_page(title, body, data=data, version=calibration.version)


def write_report(evaluation: Evaluation, path: str | Path, *, pictures: Pictures | None = None) -> None:
    """Write the page to a file, as a whole or not at all: an interrupted run leaves what was there before.

    Args:
        pictures: the photographs that it shows (`pictures_of`); none by default.
    Raises:
        InputError: the file cannot be written.
    """
    write_text(path, report_page(evaluation, pictures=pictures))


def closed_page(title: str, body: list[Html], *, data: Any = None, version: str, style: str = "") -> str:
    """A whole HTML file that loads nothing.

    Args:
        title: of the window.
        body: what stands in it.
        data: what the script draws; without it there is no script.
        version: of orthoscope.
        style: rules beside those of page.css.
    """
    style = _part("page.css") + style
    script = _script() if data is not None else ""
    allowed = f"'sha256-{_hash(script)}'" if script else "'none'"
    policy = f"default-src 'none'; img-src data:; style-src 'sha256-{_hash(style)}'; script-src {allowed}"
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", http_equiv="Content-Security-Policy", content=policy),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", name="generator", content=f"orthoscope {version}"),
        tag("title", title),
        tag("style", raw(style)),
    )
    if script:
        numbers = tag("script", raw(_json(data)), type="application/json", id="data")
        body = [*body, numbers, tag("script", raw(script))]
    return f"<!DOCTYPE html>\n{tag('html', head, tag('body', body), lang='en')}\n"


@cache
def _script() -> str:
    """The one script: its parts in their order, of which each uses what stands before it."""
    parts = "\n".join(_part(f"script/{name}.js") for name in SCRIPT_PARTS)
    return f'"use strict";\n(() => {{\n{parts}}})();\n'


@cache
def _part(name: str) -> str:
    return files("orthoscope.report").joinpath(name).read_text("utf-8")


def _hash(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def _json(data: Any) -> str:
    """JSON that cannot end the element it stands in."""
    text = msgspec.json.encode(data).decode()
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")

"""Curves, tables and single trials as CSV.

Six significant digits; an empty field is a number that does not exist.  Lines end in a line feed.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from typing import Any

from orthoscope.paper.curves import Curves
from orthoscope.paper.entries import PaperEntry
from orthoscope.paper.eq7_searches import Eq7Search
from orthoscope.paper.trials import Judgement, Outcome
from orthoscope.version import __version__

__all__ = ["curves_csv", "entries_csv", "members_csv", "table_csv", "trials_csv"]

JUDGEMENT = Judgement._fields


def curves_csv(curves: Curves, level: str) -> str:
    """Means over trials, a row for each level and method; level: the name of its column."""
    columns = (
        level,
        "method",
        "training_nce",
        "test_nce",
        "test_nce_standard_error",
        "noisy_test_nce",
        "true_pose_nce",
        "trials",
        "failures",
    )
    return table_csv(
        columns,
        (
            row
            for curve in curves.values()
            for row in zip(
                curve.levels,
                [curve.name] * len(curve.levels),
                curve.training_nce,
                curve.test_nce,
                curve.test_error,
                curve.noisy_test_nce,
                curve.true_pose_nce,
                curve.trials,
                curve.failures,
                strict=True,
            )
        ),
    )


def trials_csv(outcomes: Sequence[Outcome], entries: Sequence[PaperEntry], *, seed: int) -> str:
    """Every trial of every method, a row each: errors, camera, and what makes the same row again.

    Args:
        outcomes: of the trials.
        entries: who took part, for their settings.
        seed: of the run.
    """
    columns = ("study", "scene", "level", "method", "trial", *JUDGEMENT, "settings", "seed", "orthoscope")
    settings = {entry.name: _settings(entry) for entry in entries}
    rows = (
        (o.study, o.scene, o.level, o.entry, o.trial, *o.judgement, settings[o.entry], seed, __version__)
        for o in outcomes
    )
    return table_csv(columns, rows)


def entries_csv(entries: Sequence[PaperEntry], *, seed: int) -> str:
    """What each name stands for: method, settings, the seed of the run and the version that made it."""
    rows = ((entry.name, entry.called, _settings(entry), seed, __version__) for entry in entries)
    return table_csv(("name", "method", "settings", "seed", "orthoscope"), rows)


def _settings(entry: PaperEntry) -> str:
    return " ".join(f"{name}={value}" for name, value in entry.settings.items())


def members_csv(members: Sequence[Eq7Search]) -> str:
    """The cameras of eq. (7) and of its rivals."""
    return table_csv(
        ("scene", "search", "J", *JUDGEMENT), ((m.scene, m.name, m.J, *m.judgement) for m in members)
    )


def table_csv(columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """A header and rows."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([_field(value) for value in row] for row in rows)
    return text.getvalue()


def _field(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}" if value == value else ""
    return str(value)

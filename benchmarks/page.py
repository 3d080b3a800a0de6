"""Results on disk, and the page that is made of them: budgets first, ratios before absolute figures."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.peers import Peers
from benchmarks.rows import Part, Row

__all__ = ["Measured", "Results", "page", "read_results", "write_results"]

HEAD = """# orthoscope beside its peers

Made by `make bench`; do not edit. A ratio is this project's figure over the peer's, from the same run on the same machine: below 1 we
are better. Times are the best of several turns.
"""
# More programs than this, with our own, are not ours alone.
QUIET_LOAD = 4.0
WORDS = {True: "yes", False: "**no**", None: ""}


@dataclass(frozen=True)
class Measured:
    """A part, and where it was measured: machine, versions of the peers that were asked, reasons why others
    could not be, duration, how many programs ran at once (the load average, at its largest).
    """

    part: Part
    machine: str
    versions: dict[str, str]
    missing: dict[str, str]
    seconds: float
    load: float = 0.0


@dataclass(frozen=True)
class Results:
    """What has been measured, by the name of the part."""

    parts: dict[str, Measured] = field(default_factory=dict)

    def with_part(
        self, name: str, part: Part, *, machine: str, peers: Peers, seconds: float, load: float = 0.0
    ) -> Results:
        """The same with this part's new figures."""
        measured = Measured(part, machine, dict(peers.versions), dict(peers.missing), seconds, load)
        return Results({**self.parts, name: measured})


def write_results(path: Path, results: Results) -> None:
    """As JSON."""
    told = {name: asdict(measured) for name, measured in results.parts.items()}
    path.write_text(json.dumps(told, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def read_results(path: Path) -> Results:
    """What was written before; nothing where there is no file."""
    if not path.exists():
        return Results()
    told = json.loads(path.read_text(encoding="utf-8"))
    return Results({name: _measured(entry) for name, entry in told.items()})


def page(results: Results) -> str:
    """The results as Markdown."""
    parts = results.parts.values()
    return "\n".join(
        [HEAD, *_where(results), "", *_budgets(results), *(line for one in parts for line in _of_part(one))]
    )


def _measured(entry: dict[str, Any]) -> Measured:
    part = entry["part"]
    rows = [Row(**row) for row in part["rows"]]
    return Measured(**{**entry, "part": Part(**{**part, "rows": rows})})


def _where(results: Results) -> list[str]:
    """Machine and versions, and the peers that were not there."""
    machines = dict.fromkeys(one.machine for one in results.parts.values())
    versions = dict.fromkeys(version for one in results.parts.values() for version in one.versions.values())
    missing = {name: why for one in results.parts.values() for name, why in one.missing.items()}
    lines = [f"Machine: {'; '.join(machines)}.", f"Versions: {', '.join(versions)}."]
    lines += [f"Missing: {name} ({why}); see README.md." for name, why in missing.items()]
    shared = [one.load for one in results.parts.values() if one.load > QUIET_LOAD]
    if shared:
        lines.append(
            f"**The machine was shared**: up to {max(shared):.0f} programs wanted a core at once while it was"
            " measured. Ratios of CPU time stand, since contenders take turns; what is said by the clock does"
            " not."
        )
    lines.append(f"Measured in {sum(one.seconds for one in results.parts.values()) / 60.0:.0f} minutes.")
    return lines


def _budgets(results: Results) -> list[str]:
    """Every row that has a budget, those that miss it first."""
    judged = [
        (one.part.title, row)
        for one in results.parts.values()
        for row in one.part.rows
        if row.at_most is not None
    ]
    met = sum(bool(row.met) for _, row in judged)
    lines = [
        f"## Budgets: {met} of {len(judged)} met",
        "",
        "| | quantity | against | measured | at most | met |",
        "|---|---|---|---:|---:|---|",
    ]
    return lines + [
        f"| {title} | {row.quantity} | {row.peer} | {_number(row.judged)}{_own_unit(row)} |"
        f" {_number(row.at_most)} | {WORDS[row.met]} |"
        for title, row in sorted(judged, key=lambda pair: bool(pair[1].met))
    ]


def _of_part(one: Measured) -> list[str]:
    lines = ["", f"## {one.part.title}", "", one.part.about, ""]
    lines += [
        "| quantity | ratio | at most | met | orthoscope | peer | | against | remarks |",
        "|---|---:|---:|---|---:|---:|---|---|---|",
    ]
    lines += [
        f"| {row.quantity} | {_number(row.ratio)} | {_number(row.at_most)} | {WORDS[row.met]} "
        f"| {_number(row.ours)} | {_number(row.theirs)} | {row.unit} | {row.peer} | {row.note} |"
        for row in one.part.rows
    ]
    return [
        *lines,
        "",
        *one.part.appendix,
        "",
        *(f"- {remark}" for remark in one.part.remarks),
        f"- Measured in {one.seconds:.0f} s.",
    ]


def _own_unit(row: Row) -> str:
    """The unit of a figure that stands for itself."""
    return f" {row.unit}" if not row.peer and row.unit else ""


def _number(value: float | None) -> str:
    """Three digits, as many more as tell a number near 1 from 1, or nothing."""
    if value is None:
        return ""
    if value != 1.0 and abs(value - 1.0) < 1e-3:
        return f"1{value - 1.0:+.1e}"
    return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.3g}"

"""The table of docs/formats.md, made from the records: what each tool's file holds, where its pixels are,
what is lost.

python -m orthoscope.formats.described      prints it
"""

from __future__ import annotations

from orthoscope.formats.record import Format
from orthoscope.formats.table import FORMATS
from orthoscope.models.lenses.table import FREE, LENSES

__all__ = ["table_of_tools"]

HEADINGS = (
    "`--to`",
    "file",
    "lenses, with the tool's word",
    "first pixel",
    "skew",
    "fx, fy",
    "poses",
    "lost or to know",
)


def table_of_tools() -> str:
    """A Markdown table with a row for each tool."""
    rows = [HEADINGS, ("---",) * len(HEADINGS), *map(_row, FORMATS.values())]
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def _row(record: Format) -> tuple[str, ...]:
    files = f"{record.title}: {', '.join(f'`{suffix}`' for suffix in record.suffixes)}"
    return (
        f"`{record.name}`",
        files if record.knows_size else f"{files}; knows no image size",
        _lenses(record),
        f"{record.pixel_origin:g}",
        "yes" if record.skew else "fitted away",
        "two" if record.two_focals else "one",
        "yes" if record.poses else "no",
        record.remarks,
    )


def _lenses(record: Format) -> str:
    """Lens by lens: the tool's words, those that are only read in brackets; the angle that it ends at."""
    told = []
    for name in record.lens_names:
        holdings = [holding for holding in record.holdings if holding.lens == name]
        words = dict.fromkeys(holding.word for holding in holdings if holding.written)
        read = dict.fromkeys(h.word for h in holdings if not h.written and h.word not in words)
        end = min(holding.farthest_deg for holding in holdings)
        kept = ", ".join([*words, *(f"({word})" for word in read)])
        coefficients = max((holding.coefficients for holding in holdings if holding.written), key=len)
        coefficients = [key for key in coefficients if name == FREE or key in LENSES[name].names()]
        every = name == FREE or kept == name
        told.append(
            f"{name}"
            + ("" if every else f" ({' '.join(coefficients)}) as {kept}" if coefficients else f" as {kept}")
            + (f", to {end:g}°" if end < 180 else "")
        )
    return "; ".join(told)


if __name__ == "__main__":
    print(table_of_tools(), end="")

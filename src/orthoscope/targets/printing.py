"""A target on paper: its drawing in true size, a ruler to check that, and its description beside it.

A page is rectangles, discs and lines of text in millimetres from the paper's top left. Each format writes the
same page: PDF and SVG as vectors (1 pt = 25.4/72 mm), DXF for laser and plotter (R12, y upwards), PNG in
dots. What is printed differs from the drawing by the printer's scale only, which the ruler shows.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Callable
from typing import NamedTuple
from xml.sax.saxutils import escape

import numpy as np

from orthoscope.geometry.arrays import Float, InputError, ndarray
from orthoscope.targets.lengths import parse_length
from orthoscope.targets.target import Target

__all__ = ["PAPERS", "PRINT_FORMATS", "Page", "page_of"]

PAPERS = {
    "A4": (210.0, 297.0),
    "letter": (215.9, 279.4),
    "A3": (297.0, 420.0),
    "tabloid": (279.4, 431.8),
    "A2": (420.0, 594.0),
    "A1": (594.0, 841.0),
    "A0": (841.0, 1189.0),
}
# Printers leave this much white.
MARGIN_MM = 5.0
# This much is left below the board, for ruler and description.
STRIP_MM = 12.0
# The ruler has this length.
RULER_MM = 100.0
# The ruler is divided by this.
TICK_MM = 10.0
# The ruler's lines have this thickness.
LINE_MM = 0.2
# Letters have this height.
TEXT_MM = 3.0
# A PNG has so many dots an inch: a dot is 0.04 mm.
DOTS_PER_INCH = 600.0
# A PNG has at most so many dots.
MOST_DOTS = 2e8


class Text(NamedTuple):
    """A line of text; x, y: mm, where its base line begins."""

    x: float
    y: float
    words: str


class Page(NamedTuple):
    """A sheet of paper.

    Attributes:
        width, height: mm.
        rectangles: (n,4) mm, x and y of one corner, then of the opposite one.
        discs: (k,3) mm, centre and radius.
        holes: (h,3) mm, white ones inside rectangles.
        texts: what is written.
    """

    width: float
    height: float
    rectangles: Float[ndarray, "n 4"]
    discs: Float[ndarray, "k 3"]
    holes: Float[ndarray, "h 3"]
    texts: tuple[Text, ...]


def page_of(target: Target, *, paper: str | None = None) -> Page:
    """A target on paper, upright or lying as it fits.

    Args:
        target: what to print.
        paper: a name out of PAPERS or WIDTHxHEIGHT such as 600x400mm; by default the smallest that it fits
            on.
    Raises:
        InputError: the target cannot be drawn, the paper is not known, or the target does not fit.
    """
    drawing = target.drawing()
    discs = drawing.discs[:, :2]
    ends = [drawing.rectangles.reshape(-1, 2), discs - drawing.discs[:, 2:], discs + drawing.discs[:, 2:]]
    black = np.concatenate(ends) * 1e3
    low, size = black.min(0), np.ptp(black, axis=0)
    width, height = _sheet(target.name, size, paper)
    step = np.array([0.5 * (width - size[0]), 0.5 * (height - STRIP_MM - size[1])]) - low
    ruler, mark = _ruler(width, height)
    words = Text(MARGIN_MM + mark.x + 16.0, height - MARGIN_MM - 1.0, target.name)
    return Page(
        width,
        height,
        np.concatenate([drawing.rectangles * 1e3 + np.tile(step, 2), ruler]),
        drawing.discs * 1e3 + np.array([*step, 0.0]),
        drawing.holes * 1e3 + np.array([*step, 0.0]),
        (mark, words),
    )


def _sheet(name: str, size: ndarray, paper: str | None) -> tuple[float, float]:
    """Width and height of the paper, turned so that a board of this size (mm) fits."""
    papers = PAPERS if paper is None else {paper: _paper(paper)}
    for sides in papers.values():
        for width, height in (sides, sides[::-1]):
            if size[0] + 2 * MARGIN_MM <= width and size[1] + 2 * MARGIN_MM + STRIP_MM <= height:
                return width, height
    raise InputError(
        f"target {name!r} is {size[0]:.0f} x {size[1]:.0f} mm and does not fit on {paper or list(PAPERS)[-1]}"
        f" with a margin of {MARGIN_MM:g} mm and a ruler. Choose larger paper or a smaller target."
    )


def _paper(text: str) -> tuple[float, float]:
    named = {name.lower(): sides for name, sides in PAPERS.items()}
    if text.lower() in named:
        return named[text.lower()]
    found = re.fullmatch(r"([0-9.]+)x([0-9.]+)([a-z]+)", text.strip())
    if not found:
        raise InputError(
            f"paper {text!r} is not known; expected {', '.join(PAPERS)} or a size such as 600x400mm."
        )
    width, height = (round(parse_length(found[i] + found[3]) * 1e3, 6) for i in (1, 2))
    return width, height


def _ruler(width: float, height: float) -> tuple[Float[ndarray, "n 4"], Text]:
    """A line with ticks at the bottom left, and its length."""
    length = min(RULER_MM, TICK_MM * np.floor((width - 2 * MARGIN_MM - 20.0) / TICK_MM))
    left, y = MARGIN_MM + 1.0, height - MARGIN_MM - 1.0
    at = left + np.arange(0.0, length + 0.5 * TICK_MM, TICK_MM)
    ticks = np.stack(
        [at - 0.5 * LINE_MM, np.full_like(at, y - 3.0), at + 0.5 * LINE_MM, np.full_like(at, y)], axis=1
    )
    line = np.array([[left, y, left + length, y + LINE_MM]])
    return np.concatenate([line, ticks]), Text(left + length + 2.0, y, f"{length:g} mm")


def svg(page: Page) -> bytes:
    """The page as SVG, its unit a millimetre."""
    boxes = page.rectangles
    path = "".join(f"M{_f(a)} {_f(b)}H{_f(c)}V{_f(d)}H{_f(a)}Z" for a, b, c, d in boxes)
    discs = "".join(
        f'<circle cx="{_f(x)}" cy="{_f(y)}" r="{_f(r)}"{fill}/>'
        for some, fill in ((page.discs, ""), (page.holes, ' fill="#fff"'))
        for x, y, r in some
    )
    texts = "".join(
        f'<text x="{_f(x)}" y="{_f(y)}" font-family="Helvetica, Arial, sans-serif" font-size="{TEXT_MM:g}">'
        f"{escape(words)}</text>"
        for x, y, words in page.texts
    )
    size = f'width="{_f(page.width)}mm" height="{_f(page.height)}mm"'
    view = f'viewBox="0 0 {_f(page.width)} {_f(page.height)}"'
    sheet = f'<rect width="{_f(page.width)}" height="{_f(page.height)}" fill="#fff"/>'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} {view}>{sheet}'
        f'<path d="{path}"/>{discs}{texts}</svg>\n'
    ).encode()


def pdf(page: Page) -> bytes:
    """The page as PDF 1.4."""
    point = 72.0 / 25.4
    marks = [f"{point:.9f} 0 0 {-point:.9f} 0 {page.height * point:.6f} cm 0 g"]  # mm, y downwards
    marks += [f"{_f(a)} {_f(b)} {_f(c - a)} {_f(d - b)} re" for a, b, c, d in page.rectangles]
    marks.append("f")
    marks += [_pdf_disc(*disc) for disc in page.discs]
    marks += ["1 g", *(_pdf_disc(*disc) for disc in page.holes), "0 g"] if len(page.holes) else []
    for x, y, words in page.texts:
        plain = words.encode("latin-1", "replace").decode("latin-1")
        plain = re.sub(r"([\\()])", r"\\\1", plain)
        marks.append(f"BT /F1 1 Tf {TEXT_MM:g} 0 0 {-TEXT_MM:g} {_f(x)} {_f(y)} Tm ({plain}) Tj ET")
    content = zlib.compress("\n".join(marks).encode("latin-1"))
    box = f"[0 0 {_f(page.width * point)} {_f(page.height * point)}]"
    objects = [
        b"<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
        b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        f"<< /Type /Page /Parent 2 0 R /MediaBox {box} /Contents 4 0 R".encode()
        + b" /Resources << /Font << /F1 5 0 R >> >> >>",
        f"<< /Length {len(content)} /Filter /FlateDecode >>\nstream\n".encode() + content + b"\nendstream",
        b"<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
    ]
    out, places = b"%PDF-1.4\n%\xe2\xe3\xcf\xd3\n", []
    for number, body in enumerate(objects, 1):
        places.append(len(out))
        out += f"{number} 0 obj\n".encode() + body + b"\nendobj\n"
    table = "".join(f"{place:010d} 00000 n \n" for place in places)
    end = f"xref\n0 {len(objects) + 1}\n0000000000 65535 f \n{table}"
    end += f"trailer << /Size {len(objects) + 1} /Root 1 0 R >>\nstartxref\n{len(out)}\n%%EOF\n"
    return out + end.encode()


def _pdf_disc(x: float, y: float, r: float) -> str:
    """Four Bezier curves, which leave the circle by 3e-4 of its radius."""
    k = 0.5522847498 * r
    curves = [
        (x + r, y + k, x + k, y + r, x, y + r),
        (x - k, y + r, x - r, y + k, x - r, y),
        (x - r, y - k, x - k, y - r, x, y - r),
        (x + k, y - r, x + r, y - k, x + r, y),
    ]
    return f"{_f(x + r)} {_f(y)} m " + " ".join(" ".join(map(_f, curve)) + " c" for curve in curves) + " f"


def dxf(page: Page) -> bytes:
    """The page as DXF R12: black rectangles as SOLID, discs as CIRCLE (white ones on a layer `white`),
    millimetres, y upwards.
    """
    lines: list[object] = [0, "SECTION", 2, "ENTITIES"]
    for a, b, c, d in page.rectangles:
        top, bottom = page.height - b, page.height - d
        lines += [0, "SOLID", 8, "black"]
        for i, (x, y) in enumerate(((a, bottom), (c, bottom), (a, top), (c, top))):
            lines += [10 + i, _f(x), 20 + i, _f(y), 30 + i, "0"]
    layers = [("black", *disc) for disc in page.discs] + [("white", *disc) for disc in page.holes]
    for layer, x, y, r in layers:
        lines += [0, "CIRCLE", 8, layer, 10, _f(x), 20, _f(page.height - y), 30, "0", 40, _f(r)]
    for x, y, words in page.texts:
        lines += [
            0,
            "TEXT",
            8,
            "text",
            10,
            _f(x),
            20,
            _f(page.height - y),
            30,
            "0",
            40,
            f"{TEXT_MM:g}",
            1,
            words,
        ]
    lines += [0, "ENDSEC", 0, "EOF"]
    return "".join(f"{line}\n" for line in lines).encode("ascii", "replace")


def png(page: Page) -> bytes:
    """The page as PNG, black and white, with its resolution; coarser where the paper is large."""
    import cv2

    dots = min(DOTS_PER_INCH / 25.4, (MOST_DOTS / (page.width * page.height)) ** 0.5)  # a mm
    picture = np.full((round(page.height * dots), round(page.width * dots)), 255, np.uint8)
    for a, b, c, d in np.rint(page.rectangles * dots).astype(int):
        picture[min(b, d) : max(b, d), min(a, c) : max(a, c)] = 0
    rounds = [(0, disc) for disc in page.discs * dots] + [(255, disc) for disc in page.holes * dots]
    for level, (x, y, r) in rounds:
        rows, columns = np.mgrid[int(y - r) - 1 : int(y + r) + 2, int(x - r) - 1 : int(x + r) + 2]
        inside = (rows + 0.5 - y) ** 2 + (columns + 0.5 - x) ** 2 <= r * r
        picture[rows[inside], columns[inside]] = level
    for x, y, words in page.texts:
        place = (round(x * dots), round(y * dots))
        cv2.putText(
            picture, words, place, cv2.FONT_HERSHEY_SIMPLEX, TEXT_MM * dots / 22.0, 0, max(1, round(dots / 8))
        )
    height, width = picture.shape
    rows_ = np.pad(np.packbits(picture > 127, axis=1), ((0, 0), (1, 0)))  # a filter byte before each row
    a_metre = round(dots * 1e3)
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        _chunk(name, body)
        for name, body in (
            (b"IHDR", struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0)),
            (b"pHYs", struct.pack(">IIB", a_metre, a_metre, 1)),
            (b"IDAT", zlib.compress(rows_.tobytes(), 6)),
            (b"IEND", b""),
        )
    )


def _chunk(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))


def _f(value: float) -> str:
    """A number to a tenth of a micrometre."""
    return f"{value:.4f}".rstrip("0").rstrip(".")


PRINT_FORMATS: dict[str, Callable[[Page], bytes]] = {".pdf": pdf, ".svg": svg, ".png": png, ".dxf": dxf}

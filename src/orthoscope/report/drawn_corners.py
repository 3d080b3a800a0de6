"""A view whose photograph is not at hand, as the page shows it: its corners on a plain ground."""

from __future__ import annotations

from orthoscope.geometry.arrays import evenly
from orthoscope.report.html import Html, tag
from orthoscope.targets.detections import View

__all__ = ["drawn_corners"]

# So many corners, evenly picked, show where a target is.
MOST_DRAWN = 60
# A dot is so many times smaller than the image's longer side.
SIDES_OF_DOT = 55


def drawn_corners(view: View, image_size: tuple[int, int]) -> Html:
    """The corners of a view in its frame, as SVG.

    Args:
        image_size: (width, height) pixels.
    """
    width, height = image_size
    some = evenly(len(view.pixels), MOST_DRAWN) if len(view.pixels) else []
    dots = "".join(f"M{round(x)} {round(y)}h0" for x, y in view.pixels[some].tolist())
    path = tag("path", d=dots, stroke_width=f"{max(width, height) / SIDES_OF_DOT:.1f}")
    return tag("svg", path, viewBox=f"0 0 {width} {height}", class_="no-picture", aria_hidden="true")

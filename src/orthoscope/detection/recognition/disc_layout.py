"""Grids of discs by the lattice that they make: symmetric or asymmetric, how many, and how large."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from orthoscope.detection.discs.disc_links import diameter_in_steps, numbered
from orthoscope.detection.discs.disc_outlines import fitted_whole, outlines_near, smoothed
from orthoscope.detection.discs.disc_spots import spots
from orthoscope.detection.small_copies import resized
from orthoscope.geometry.arrays import Int, ndarray
from orthoscope.geometry.ellipses import Ellipses
from orthoscope.targets.board import Board
from orthoscope.targets.circles import Circles

__all__ = ["disc_boards"]

# The longer side of the copy in which discs are looked for, pixels.
COPY_SIDE = 1280
# A grid has at least so many discs.
FEWEST_DISCS = 12
# This share of a grid's places has a disc.
LEAST_FILLED_SHARE = 0.97
# The spacing of a grid as it is then described, metres.
NOMINAL = 0.02


def disc_boards(greys: Sequence[ndarray]) -> Iterator[Board]:
    """The grids of discs that photographs (h,w) show whole, most often seen first."""
    seen: Counter[tuple[int, int, str]] = Counter()
    diameters: dict[tuple[int, int, str], list[float]] = {}
    for grey in greys:
        copy = resized(grey, COPY_SIDE)
        for picture in (copy, 255 - copy):
            best: tuple[int, tuple[int, int, str], float] = (0, (0, 0, ""), 0.0)
            for found in spots(picture):
                which, places = numbered(found)
                layout = _layout(places) if len(which) >= FEWEST_DISCS else None
                if layout and len(which) > best[0]:
                    discs = fitted_whole(
                        picture,
                        outlines_near(smoothed(picture), Ellipses(found.centres[which], found.axes[which])),
                    ).ellipses
                    best = len(which), layout, diameter_in_steps(discs, places)
            if best[0]:
                seen[best[1]] += 1
                diameters.setdefault(best[1], []).append(best[2])
                break
    for counts, _ in seen.most_common(2):
        columns, rows, layout = counts
        nearest = 1.0 if layout == "symmetric" else np.sqrt(2.0)
        diameter = round(float(np.median(diameters[counts])) * nearest * NOMINAL, 4)
        yield Circles(columns, rows, NOMINAL, layout, min(diameter, 0.95 * nearest * NOMINAL))


def _layout(places: Int[ndarray, "n 2"]) -> tuple[int, int, str] | None:
    """Counts and layout of discs at these places of a lattice of neighbours; None where they fill none."""
    columns, rows = (places.max(0) - places.min(0) + 1).tolist()
    if len(places) >= LEAST_FILLED_SHARE * columns * rows:
        return max(columns, rows), min(columns, rows), "symmetric"
    turned = np.stack([places[:, 0] - places[:, 1], places.sum(1)], axis=1)
    across, down = (turned.max(0) - turned.min(0) + 1).tolist()
    if len(places) < LEAST_FILLED_SHARE * across * down // 2:
        return None
    columns, rows = (across // 2, down) if across % 2 == 0 else (down // 2, across)
    return columns, rows, "asymmetric"

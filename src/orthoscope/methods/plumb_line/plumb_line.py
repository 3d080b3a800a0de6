"""The lens of photographs without any target, from edges that ought to be straight (the plumb line).

1. edges, to a part of a pixel (edges.py);
2. one coefficient of the division model, linearly and by consent of most (division.py);
3. the edges that it makes straight, and of these the lens about a centre of its own with a loss that forgives
   (mldc/lens_from_lines.py, distances measured in the photograph);
4. the edges that this lens makes straight, chosen anew from all, and the lens of these, until no edge
changes.

What straightness cannot tell is how large the straight image is: the camera has the unit of the lens for its
focal length, and its pictures are straight whatever that is.
D. C. Brown, Close-range camera calibration, 1971; F. Devernay and O. Faugeras, Straight lines have to be
straight, MVA 13(1), 2001, who choose edges as here: by how straight the lens makes them.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from orthoscope.geometry.arrays import CalibrationError, Float, Int, ndarray
from orthoscope.machine.blas import with_one_thread
from orthoscope.methods.mldc.lens_about_centre import CENTRE, parse_centred_lens
from orthoscope.methods.mldc.lens_from_lines import StraightLens, lens_of_lines
from orthoscope.methods.mldc.line_residuals import Straightness
from orthoscope.methods.plumb_line.division import bend_of_edges, division_of_edges, off_straight
from orthoscope.methods.plumb_line.edges import Edge
from orthoscope.models.camera import Camera
from orthoscope.solve.least_squares import Options
from orthoscope.solve.losses import LOSSES

__all__ = ["PlumbLine", "lens_of_edges"]

# Edges shorter than this share of the diagonal bend too little to say anything.
SHORTEST = 0.08
# So many edges are used at most, the longest.
MOST_EDGES = 600
# With fewer a lens is a guess.
FEWEST_EDGES = 8
# An edge belongs where its rms is below this many times the usual one of edges that belong, pixels at least
# so much.
BELONGS, LEAST_PX = 2.5, 0.15
# Edges are chosen anew so often at most.
CHOICES = 6
OPTIONS = Options(max_steps=60, tolerance=1e-7)
FORGIVING_PX = 0.15


CENTRE_HELD = "the edges do not tell the distortion centre; it is taken at the image's centre"


class LineFormula(NamedTuple):
    """What a lens may be: as `parse_centred_lens` reads it, and whether its centre is free."""

    lens: str
    centre: bool


# Errors along an edge are alike: a deviation is so many times what independent points would make it.
ALIKE_FACTOR = 3.0
# A centre less certain than this share of the diagonal is not known.
VAGUE_CENTRE_SHARE = 0.03
# The first stands in where the edges do not tell a distortion centre. The others have a coefficient more than
# edges often ask for: what a stiffer one gets wrong shows where there are few edges, at the frame's corners.
FORMULAS = (
    LineFormula("division", False),
    LineFormula("brown:k1,k2", True),
    LineFormula("kannala_brandt:k1,k2", True),
)


class PlumbLine(NamedTuple):
    """The lens that makes edges straight.

    Attributes:
        camera: its pin-hole is the lens's own frame, about the distortion centre; how large straight pictures
            are, straightness does not tell.
        edges: all that were looked at.
        used: whether each was taken for the image of a straight line.
        rms_px: of the distances of their points from straight, in the photograph.
        assumptions: what the edges do not tell, sentences.
    """

    camera: Camera
    edges: tuple[Edge, ...]
    used: ndarray
    rms_px: float
    assumptions: tuple[str, ...]


@with_one_thread
def lens_of_edges(edges: Sequence[Edge], image_size: tuple[int, int], *, lens: str = "auto") -> PlumbLine:
    """The lens that makes the edges of one camera's photographs straight.

    Args:
        edges: of all photographs.
        image_size: of each, (width, height) pixels.
        lens: a name of LENSES, or with the coefficients to free; radial ones, since it has a centre of its
            own. `auto` takes that of FORMULAS which the edges speak for.
    Raises:
        CalibrationError: there are too few long edges, or too few agree on a lens.
        InputError: the lens is none.
    """
    formulas = FORMULAS if lens == "auto" else (LineFormula(lens, False), LineFormula(lens, True))
    edges = _long(edges, image_size)
    _check_enough(len(edges), "long enough to show how they are bent")
    value = division_of_edges(edges, image_size)
    used = _belonging(bend_of_edges(edges, image_size, value))
    formula, straight, bent = _best(edges, used, image_size, formulas)
    for _ in range(CHOICES):
        before, used = used, _belonging(bent)
        if (used == before).all():
            break
        formula, straight, bent = _best(edges, used, image_size, (formula,))
    rms = float(np.sqrt((bent[used] ** 2).mean()))
    said = straight.assumptions or (() if formula.centre else (CENTRE_HELD,))
    return PlumbLine(straight.camera, tuple(edges), used, rms, said)


def _best(
    edges: Sequence[Edge], used: ndarray, image_size: tuple[int, int], formulas: Sequence[LineFormula]
) -> tuple[LineFormula, StraightLens, Float[ndarray, " e"]]:
    """The formula that the used edges speak for, its lens, and how far from straight it leaves every edge."""
    _check_enough(int(used.sum()), "that one lens makes straight")
    chosen = [edge for edge, one in zip(edges, used, strict=True) if one]
    fits = [(formula, _fitted(chosen, image_size, formula)) for formula in formulas]
    told = [fit for fit in fits if fit[0].centre and _tells_centre(fit[1])]
    formula, straight = min(told or fits[:1], key=lambda fit: _score(fit[1], len(chosen)))
    return formula, straight, _bend(edges, straight.camera)


def _fitted(edges: Sequence[Edge], image_size: tuple[int, int], formula: LineFormula) -> StraightLens:
    """The formula's lens that makes these edges straightest."""
    return lens_of_lines(
        partial(Straightness, *_points(edges)),
        image_size,
        *parse_centred_lens(formula.lens),
        measure="photograph",
        loss=LOSSES["cauchy"](FORGIVING_PX),
        options=OPTIONS,
        centre=formula.centre,
    )


def _tells_centre(straight: StraightLens) -> bool:
    """Whether the edges tell the distortion centre, and not only guess it."""
    at = [straight.free.index(name) for name in CENTRE if name in straight.free]
    deviation = ALIKE_FACTOR * np.sqrt(np.diag(straight.covariance)[at].max(initial=0.0))
    return bool(at) and bool(deviation <= VAGUE_CENTRE_SHARE * np.hypot(*straight.camera.image_size))


def _score(straight: StraightLens, edges: int) -> float:
    """Schwarz's criterion, two draws an edge (how bent, how skew), since errors along it are alike."""
    return 2 * edges * float(np.log(straight.solution.cost)) + len(straight.free) * float(np.log(2 * edges))


def _long(edges: Sequence[Edge], image_size: tuple[int, int]) -> list[Edge]:
    """The edges that say something, the longest first."""
    least = SHORTEST * float(np.hypot(*image_size))
    return sorted((edge for edge in edges if edge.length > least), key=lambda edge: -edge.length)[:MOST_EDGES]


def _check_enough(count: int, which: str) -> None:
    if count < FEWEST_EDGES:
        raise CalibrationError(
            f"the photographs have {count} edges {which}; a lens needs {FEWEST_EDGES}. Take photographs"
            " of buildings, shelves or tiles that fill the frame, or of a target: orthoscope calibrate."
        )


def _belonging(bent: Float[ndarray, " e"]) -> ndarray:
    """Which edges are as straight as most of those that belong are."""
    usual = float(np.median(bent[bent < 1.0])) if (bent < 1.0).any() else np.inf
    return bent < max(BELONGS * usual, LEAST_PX)


def _points(edges: Sequence[Edge]) -> tuple[Float[ndarray, "2 n"], Int[ndarray, " n"]]:
    """The points of edges one after the other, and the number of each one's edge."""
    line = np.repeat(np.arange(len(edges)), [len(edge.pixels) for edge in edges])
    return np.concatenate([edge.pixels for edge in edges]).T, line


def _bend(edges: Sequence[Edge], camera: Camera) -> Float[ndarray, " e"]:
    """How far from straight a lens leaves each edge: rms, about pixels of the photograph; infinite where it
    does not see it.
    """
    straight = camera.undistort_pixels(np.concatenate([edge.pixels for edge in edges]))
    ends = np.cumsum([len(edge.pixels) for edge in edges]) - 1
    first = np.concatenate([[0], ends[:-1] + 1])
    length = np.array([edge.length for edge in edges])
    with np.errstate(invalid="ignore", divide="ignore"):
        bent = off_straight(straight, edges) * length / np.hypot(*(straight[ends] - straight[first]).T)
    return np.where(np.isfinite(bent), bent, np.inf)

"""The lens that makes rows and columns straight, found without being told anything.

Straightness alone has poor starts: a centre that moves before the coefficients are about right runs away, as
Basu and Licardie saw with few points (the paper, section 4). So in this order: every start that the formula
names, and for a lens of the angle every field of view; from the few that bend the lines least, the
coefficients alone with a loss that forgives; then with the centre. Two things the lines may not tell. A
centre: it is then held at the image's, and that is said. The scale of a lens of the angle, which its
coefficients make up for where the view is not wide: it then stays at the field of view that was tried. The
lens's own camera has the lens frame for its K: cx and cy are the distortion centre.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from orthoscope.fitting.identifiability import LEAST_NOISE_PX
from orthoscope.fitting.observations import Observations
from orthoscope.fitting.starts.initial_camera import FIELDS_OF_VIEW
from orthoscope.geometry.arrays import CalibrationError, Float, ndarray
from orthoscope.methods.mldc.lens_about_centre import CENTRE, straightened_parameters
from orthoscope.methods.mldc.line_residuals import Straightness
from orthoscope.methods.mldc.lines_in_views import SeenLines
from orthoscope.methods.mldc.straightened_lines import StraightenedLines, by_lens
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.charts import EQUIDISTANT
from orthoscope.models.lenses.lens import Formula
from orthoscope.models.parameters import Parameters
from orthoscope.solve.block_system import shared_covariance
from orthoscope.solve.least_squares import Options, Solution, solve
from orthoscope.solve.losses import Cauchy, Linear, Loss
from orthoscope.targets.target import Target

__all__ = ["MEASURES", "StraightLens", "fit_straight_lens", "lens_of_lines"]

# So many starts are followed to their end.
STARTS_TRIED = 3
# Errors beyond this share of the longer side hardly count in the first fit.
FORGIVING_SHARE = 0.002
# A centre less certain than this share of the diagonal is not known.
VAGUE_SHARE = 0.1
# Costs that differ by less than this share are as good as one another.
EQUAL_SHARE = 0.01
# The scale of a lens of the angle is given so many steps to show that it matters.
PROBING_STEPS = 50

SCALE = "frame_scale"
OWN_NAMES = {
    "centre_x": "cx",
    "centre_y": "cy",
    SCALE: "fx=fy",
}  # parameters of the lens frame, as those of the lens's own camera


Lines = Any  # Straightness or StraightenedLines, each with unknowns of its own that have a `camera`
# Where the distance of a corner from its line is measured.
MEASURES: dict[str, Callable[[Observations, SeenLines, tuple[str, ...]], Lines]] = {
    "photograph": Straightness.of,
    "straight-image": StraightenedLines,
}


class StraightLens(NamedTuple):
    """What straightness tells: the lens's own camera, the parameters that were free (as lens_about_centre.py
    names them), their covariance.
    """

    camera: Camera
    free: tuple[str, ...]
    covariance: Float[ndarray, "k k"]
    assumptions: tuple[str, ...]
    solution: Solution[Any]

    def straight_slopes(
        self, names: Sequence[str], pixels: Float[ndarray, "2 *batch"]
    ) -> Float[ndarray, "k 2 *batch"]:
        """How straight pixels, those of the lens's own camera without its lens, move with free parameters,
        where corners stay in the photograph.
        """
        K, shape = self.camera.intrinsics, pixels.shape
        x = (pixels.reshape(2, -1) - [[K.cx], [K.cy]]) / K.fx
        parameters = Parameters.of(OWN_NAMES.get(name, name) for name in names)
        slopes = K.fx * by_lens(self.camera, x, parameters)
        moved_frame = {"centre_x": [[1.0], [0.0]], "centre_y": [[0.0], [1.0]], SCALE: x}
        for slope, name in zip(slopes, names, strict=True):
            slope += moved_frame.get(name, 0.0)
        return slopes.reshape(-1, *shape)


def fit_straight_lens(
    observations: Observations,
    target: Target,
    image_size: tuple[int, int],
    lens: type[Formula],
    coefficients: tuple[str, ...],
    *,
    measure: str,
    loss: Loss,
    options: Options,
) -> StraightLens:
    """The lens, about a centre of its own, that makes the lines straightest, by least squares.

    Args:
        measure: of MEASURES, where distances are measured.
    Raises:
        CalibrationError: the lines say too little for so many coefficients, or the lens cannot see the
            corners.
    """
    lines = SeenLines.of(observations, target)
    return lens_of_lines(
        partial(MEASURES[measure], observations, lines),
        image_size,
        lens,
        coefficients,
        measure=measure,
        loss=loss,
        options=options,
    )


def lens_of_lines(
    problem_of: Callable[[tuple[str, ...]], Lines],
    image_size: tuple[int, int],
    lens: type[Formula],
    coefficients: tuple[str, ...],
    *,
    measure: str,
    loss: Loss,
    options: Options,
    centre: bool = True,
) -> StraightLens:
    """The lens, about a centre of its own or a given one, that makes lines of any kind straightest.

    Args:
        problem_of: the straightness of the lines over these parameters of the lens's own camera.
        image_size: (width, height) pixels.
        lens: the formula.
        coefficients: those to free.
        measure: of MEASURES, where distances are measured.
        loss: how large errors count.
        options: of the solver.
        centre: whether the lens has a centre of its own; it stands at the image's else.
    Raises:
        CalibrationError: as `fit_straight_lens`.
    """

    def problem(free: tuple[str, ...]) -> Lines:
        return problem_of(tuple(OWN_NAMES.get(name, name) for name in free))

    free = straightened_parameters(lens, coefficients)
    free = free if centre else tuple(name for name in free if name not in CENTRE)
    shape = tuple(name for name in free if name not in CENTRE)
    starts = _likeliest(problem(free), image_size, lens)
    straight = _result(
        problem(free),
        free,
        _best([_followed(problem(free), problem(shape), start, loss, options) for start in starts]),
    )
    if measure == "straight-image" and problem(free).shrinks(straight.solution.unknowns):
        raise CalibrationError(
            "the lens that makes the lines straightest in the straightened image shrinks that image to a"
            " point, which"
            " shortens all distances. Measure in the photograph: --set measure=photograph."
        )
    if not _tells_centre(straight, problem(free)):
        free, told = (
            shape,
            ("the rows and columns do not tell the distortion centre; it is taken at the image's centre",),
        )
        found = [
            solve(problem(free), problem(free).start(start), loss=loss, options=options) for start in starts
        ]
        straight = _result(problem(free), free, _best(found))._replace(assumptions=told)
    return (
        straight
        if lens.chart is not EQUIDISTANT
        else _with_scale(straight, problem((*free, SCALE)), loss, options)
    )


def _result(problem: Lines, free: tuple[str, ...], found: Solution[Any]) -> StraightLens:
    return StraightLens(
        found.unknowns.camera, free, shared_covariance(found.sums, problem.measurements), (), found
    )


def _with_scale(straight: StraightLens, problem: Lines, loss: Loss, options: Options) -> StraightLens:
    """The same with the frame's scale free too, where that makes the lines straighter."""
    tried = solve(
        problem,
        straight.solution.unknowns,
        loss=loss,
        options=replace(options, max_steps=min(PROBING_STEPS, options.max_steps)),
    )
    if not tried.cost < (1.0 - EQUAL_SHARE) * straight.solution.cost:
        return straight
    found = solve(problem, tried.unknowns, loss=loss, options=options)
    return _result(problem, (*straight.free, SCALE), found)._replace(assumptions=straight.assumptions)


def _followed(problem: Lines, held: Lines, start: Camera, loss: Loss, options: Options) -> Solution[Any]:
    """Coefficients first, with the centre held, then all."""
    forgiving, rough = Cauchy(FORGIVING_SHARE * max(start.image_size)), Options(max_steps=30, tolerance=1e-4)
    return solve(
        problem,
        solve(held, held.start(start), loss=forgiving, options=rough).unknowns,
        loss=loss,
        options=options,
    )


def _best(solutions: list[Solution[Any]]) -> Solution[Any]:
    """The likeliest start's, unless another's cost is really lower."""
    least = min(solution.cost for solution in solutions)
    return next(solution for solution in solutions if solution.cost <= (1.0 + EQUAL_SHARE) * least)


def _likeliest(problem: Lines, image_size: tuple[int, int], lens: type[Formula]) -> list[Camera]:
    """The starts under which the lines are least bent as they are, the best first.

    Raises:
        CalibrationError: as `fit_straight_lens` does.
    """
    _check_enough(problem)
    cameras = _starts(image_size, lens)
    bent = np.array([problem.linearise(problem.start(camera), Linear()).cost for camera in cameras])
    usable = np.flatnonzero(np.isfinite(bent))
    if not len(usable):
        raise CalibrationError(
            f"the lens {lens.__name__} cannot see as far from its axis as these corners are. "
            "Use a lens of the angle: --lens kannala_brandt."
        )
    return [cameras[i] for i in usable[np.argsort(bent[usable], kind="stable")][:STARTS_TRIED]]


def _starts(image_size: tuple[int, int], lens: type[Formula]) -> list[Camera]:
    """The lens's own cameras to try, about the image's centre; the unit of a lens of the plane is the image's
    longer side.
    """
    width, height = image_size
    diagonal = float(np.hypot(width, height))
    scales = diagonal / FIELDS_OF_VIEW if lens.chart is EQUIDISTANT else (float(max(image_size)),)
    return [
        Camera(
            image_size, Intrinsics(scale, scale, 0.5 * (width - 1), 0.5 * (height - 1)), lens(**coefficients)
        )
        for scale in map(float, scales)
        for coefficients in lens.starts
    ]


def _check_enough(problem: Lines) -> None:
    """Check that not each line could be met by bending the lens.

    Raises:
        CalibrationError: it could.
    """
    said, unknowns = problem.measurements - 2 * problem.lines, len(problem.free)
    if said < unknowns:
        raise CalibrationError(
            f"{problem.lines} lines with {problem.measurements} corners say {said} things about straightness,"
            f" fewer than the {unknowns} unknowns of the lens. Photograph a target with longer rows, take"
            " more photographs, or free fewer coefficients, as in --lens pfet:a3."
        )


def _tells_centre(straight: StraightLens, problem: Lines) -> bool:
    """Whether the centre, if it was free, is in the image and certain enough."""
    at = [straight.free.index(name) for name in CENTRE if name in straight.free]
    (width, height), K = straight.camera.image_size, straight.camera.intrinsics
    sigma = np.sqrt(
        straight.solution.cost / max(problem.measurements - 2 * problem.lines - len(straight.free), 1)
    )
    deviation = np.sqrt(np.diag(straight.covariance)[at].max(initial=0.0)) * max(
        1.0, LEAST_NOISE_PX / max(sigma, 1e-150)
    )
    return (
        0 <= K.cx <= width - 1
        and 0 <= K.cy <= height - 1
        and bool(deviation < VAGUE_SHARE * np.hypot(width, height))
    )

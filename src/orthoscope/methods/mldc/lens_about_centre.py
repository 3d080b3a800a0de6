"""A lens about a centre of its own, from pairs; and what pairs, and what straight lines, can tell of one.

The paper's lens does not stand about the principal point.  Such a camera has a lens frame L, and
    pixel = L lens(L^-1 K ray),    L = [s 0 centre_x; 0 s centre_y; 0 0 1]:
the straight pixel K ray is moved towards or from the centre. Beside the lens's coefficients these may be
free:

    centre_x, centre_y   the distortion centre, pixels; one place in the photograph and in the straight
                         image (the paper's u0, v0)
    stretch              K <- A K, A stretching the straight image about the centre
    frame_scale          s, the unit of the lens's radius: a convention for a lens of the plane, while a lens
                         of the angle has its angles from it. Of pairs it is not asked all the same: K tells
                         it, and coefficients make up for what K has wrong; of lines only where they tell it
                         (lens_from_lines.py)

How large the straight image is, is a convention too, and formulas differ in what they leave to it: `pfet` has
a slope of its own at the centre, a1; `fet` has scale times l; the others have slope 1 (`fov` one that goes
with w). So of pairs, where K is given, a1 or scale is free, and for the others K stretches, or the pairs
could not be met. Straightness does not change with the size of the straight image: there slopes stay as they
start, 1, and K takes up the rest; all that is left of `fet` is then the frame's scale. A ring a0 of `pfet` is
0 unless `pfet:a0,...` asks for it: it tears the image at the centre. Decentering (p1, p2) and a centre of its
own are one thing twice, to first order; who frees decentering by name holds the centre where it starts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from orthoscope.fitting.lens_fit import Pairs, fit_pairs
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.lens import Formula, Lens
from orthoscope.models.lenses.table import Fet, Pfet, parse_lens
from orthoscope.models.parameters import Parameters
from orthoscope.solve.least_squares import Options, Solution, solve
from orthoscope.solve.losses import Loss

__all__ = [
    "CENTRE",
    "GAUGE",
    "SCALE",
    "fit_centred_lens",
    "paired_parameters",
    "parse_centred_lens",
    "polynomial_of_radii",
    "refit_centred_lens",
    "straightened_parameters",
]

CENTRE = ("centre_x", "centre_y")
OFF_CENTRE = (
    "p1",
    "p2",
    "s1",
    "s2",
    "s3",
    "s4",
    "tau_x",
    "tau_y",
)  # what a centre of its own stands for, but for small print
# The coefficient that scales the photograph; the others have none.
SCALE: dict[type[Lens], str] = {Pfet: "a1", Fet: "scale"}
# The coefficient that does what a stretched straight image does, so that one of both is held.
GAUGE: dict[type[Lens], str] = {Pfet: "a1", Fet: "l"}


def parse_centred_lens(text: str) -> tuple[type[Formula], tuple[str, ...]]:
    """As `parse_lens`, for a lens with a centre of its own: `auto` is the paper's `pfet`, and only radial
    coefficients are free by default.

    Raises:
        InputError: as `parse_lens` does.
    """
    kind, free = parse_lens("pfet" if text == "auto" else text)
    return kind, free if ":" in text else tuple(name for name in free if name not in OFF_CENTRE)


def paired_parameters(lens: type[Formula], coefficients: Sequence[str]) -> tuple[str, ...]:
    """What is asked of pairs: the coefficients, what scales, and the centre."""
    centre = CENTRE if set(coefficients).isdisjoint(OFF_CENTRE) else ()
    return tuple(dict.fromkeys((*coefficients, SCALE.get(lens, "stretch"), *centre)))


def straightened_parameters(lens: type[Formula], coefficients: Sequence[str]) -> tuple[str, ...]:
    """What is asked of straight lines: the coefficients but for slopes, or the frame's scale where that is
    all there is, and the centre.
    """
    shape = (
        ("frame_scale",)
        if lens.scaled_by
        else tuple(name for name in coefficients if name != SCALE.get(lens))
    )
    return (*shape, *(CENTRE if set(coefficients).isdisjoint(OFF_CENTRE) else ()))


def fit_centred_lens(
    rays: Float[ndarray, "n 3"],
    pixels: Float[ndarray, "n 2"],
    *,
    pinhole: Camera,
    lens: str = "pfet",
    centre: tuple[float, float] | None = None,
    loss: Loss | None = None,
    options: Options | None = None,
) -> Solution[Camera]:
    """The camera with this pin-hole whose lens best takes each ray to its pixel: the paper's section 3.2, for
    any lens.

    The centre starts at the principal point, s is K's mean focal length, coefficients start in closed form
    for `pfet` (eq. 10), for others where the formula says. Least squares are over both coordinates of a
    pixel; eq. (9) has the radial one alone, since eq. (2) says that there is no other, but where the centre
    is not known yet there is.

    Args:
        rays: any length.
        pinhole: its K says where they are seen straight; the lens it has does not matter.
        lens: as `parse_centred_lens` reads it.
        centre: of distortion where it is known, pixels; it is found else.
    Raises:
        CalibrationError: the formula cannot see these rays.
        InputError: a lens that is none.
    """
    kind, coefficients = parse_centred_lens(lens)
    free = paired_parameters(kind, coefficients)
    K = pinhole.intrinsics
    focal = 0.5 * (K.fx + K.fy)
    free = free if centre is None else tuple(name for name in free if name not in CENTRE)
    camera = replace(pinhole, lens_frame=Intrinsics(focal, focal, *(centre or (K.cx, K.cy))))
    lenses = (
        [_closed_form(rays, pixels, camera, free)]
        if kind is Pfet
        else [kind(**start) for start in kind.starts]
    )
    problem = Pairs(rays, pixels, free, columns=partial(_columns, K=K), moved=partial(_moved, K=K))
    return fit_pairs(problem, [replace(camera, lens=lens) for lens in lenses], loss=loss, options=options)


def refit_centred_lens(
    rays: Float[ndarray, "n 3"],
    pixels: Float[ndarray, "n 2"],
    *,
    start: Camera,
    free: Sequence[str],
    loss: Loss | None = None,
    options: Options | None = None,
) -> Solution[Camera]:
    """The same from a camera that is near already, over the parameters that are named.

    Args:
        rays, pixels: pairs, rays of any length.
        start: a camera with a lens frame; its K says where rays are seen straight.
        free: coefficients, the centre, `stretch`.
        loss: how large errors count.
        options: of the solver.
    """
    K = start.intrinsics
    problem = Pairs(rays, pixels, free, columns=partial(_columns, K=K), moved=partial(_moved, K=K))
    return solve(problem, start, loss=loss, options=options)


def polynomial_of_radii(
    straight: Float[ndarray, " n"], distorted: Float[ndarray, " n"], *, powers: Sequence[int]
) -> Float[ndarray, " p"]:
    """The a_t that minimise the sum of (r_d - sum a_t r_p^t)^2, t in powers: the paper's eq. (9) and (10),
    the centre being known.

    Its normal equations, x = (W.W)^T W^T w in print for (W^T W)^-1 W^T w, would square the condition of W;
    this is an orthogonal decomposition, of columns of like size.
    """
    reach, exponents = straight.max(), np.asarray(powers)
    columns = (straight / reach)[:, None] ** exponents
    return np.linalg.lstsq(columns, distorted, rcond=None)[0] / reach**exponents


def _closed_form(rays: ndarray, pixels: ndarray, camera: Camera, free: Sequence[str]) -> Pfet:
    """The `pfet` whose free coefficients are those of eq. (10) about the lens frame's centre; rays without a
    straight pixel have no say.
    """
    frame = _frame(camera)
    front = rays[:, 2] > 0
    straight = frame.to_plane(camera.intrinsics.to_pixels(rays[front, :2] / rays[front, 2:]))
    names = [name for name in free if name in Pfet.names()]
    radii = np.hypot(*straight.T), np.hypot(*frame.to_plane(pixels[front]).T)
    values = polynomial_of_radii(*radii, powers=[int(name[1]) for name in names])
    return Pfet(**dict(zip(names, map(float, values), strict=True)))


def _columns(
    camera: Camera, rays: ndarray, free: Sequence[str], *, K: Intrinsics
) -> tuple[Float[ndarray, "k 2 n"], Float[ndarray, "2 n"]]:
    """d(u, v) by each free parameter, and (u, v); the camera's K is A K of the one given."""
    image = camera.linearise(rays.T, [name for name in free if name != "stretch"])
    by = dict(zip((name for name in free if name != "stretch"), image.by_parameters(), strict=True))
    stretch = camera.intrinsics.fx / K.fx
    if "stretch" in free:
        x, y, z = np.linalg.solve(_frame(camera).matrix, camera.intrinsics.matrix) @ rays.T
        by_x, by_y = (np.array([of_u[i], of_v[i]]) for of_u, of_v in [image.by_ray] for i in (0, 1))
        by["stretch"] = by_x * x + by_y * y
        for name, slope in (
            ("centre_x", by_x),
            ("centre_y", by_y),
        ):  # A stretches about the centre, and moves with it
            if name in by:
                by[name] = by[name] + (1.0 - stretch) * slope * z / _frame(camera).fx
    return np.stack([by[name] for name in free]), np.stack([image.u, image.v])


def _moved(camera: Camera, free: Sequence[str], step: ndarray, *, K: Intrinsics) -> Camera:
    """The camera after a step; `stretch` steps by its logarithm."""
    steps = dict(zip(free, map(float, step), strict=True))
    stretch = camera.intrinsics.fx / K.fx * float(np.exp(np.clip(steps.pop("stretch", 0.0), -1.0, 1.0)))
    moved = Parameters.of(steps).moved(camera, np.array(list(steps.values())))
    return replace(moved, intrinsics=_stretched(K, stretch, _frame(moved)))


def _stretched(K: Intrinsics, stretch: float, centre: Intrinsics) -> Intrinsics:
    """A K: the straight image stretched about the lens frame's centre."""
    cx, cy = centre.cx + stretch * (K.cx - centre.cx), centre.cy + stretch * (K.cy - centre.cy)
    return Intrinsics(stretch * K.fx, stretch * K.fy, cx, cy, stretch * K.skew)


def _frame(camera: Camera) -> Intrinsics:
    """The lens frame, which cameras have here."""
    assert camera.lens_frame is not None
    return camera.lens_frame

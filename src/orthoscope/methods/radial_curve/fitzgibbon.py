"""Fitzgibbon's linear solver for the division model, for planar grids.

With p the pixel about the centre, r its radius and p / (1 + l r^2) its straight place, a view's homography
H says

    x (h_3 X) - (1 + l r^2) (h_1 X) = 0,    y (h_3 X) - (1 + l r^2) (h_2 X) = 0

for each corner: (D_1 + l D_2) h = 0, linear in h for a known l. D_1'(D_1 + l D_2) h = 0 is an eigenvalue
problem of nine unknowns: of its real l the one is taken under which the equations are met best, in each view
by itself; the median over the views is the lens. The centre is taken at the image's. It is a start and no
more: noise biases it, and `fccm` with this lens refines it.
A. Fitzgibbon, Simultaneous linear estimation of multiple view geometry and lens distortion, CVPR 2001, for
two views of a plane; here one of both is the target itself, which has no lens.
"""

from __future__ import annotations

import numpy as np

from orthoscope.fitting.calibration import Calibration
from orthoscope.fitting.usable_views import with_usable_views
from orthoscope.geometry.arrays import CalibrationError, Float, ndarray
from orthoscope.machine.blas import with_one_thread
from orthoscope.methods.radial_curve.corrected import calibration_of_corrected
from orthoscope.methods.radial_curve.radial_lines import GridView, grid_views
from orthoscope.targets.detections import Detections

__all__ = ["division_of_grids", "fitzgibbon"]

# In units of half the diagonal: at -1 the frame's corner would lie at infinity.
STRONGEST, WEAKEST = -0.98, 2.0
CENTRE_TAKEN = "the distortion centre is taken at the image's centre"


@with_one_thread
def fitzgibbon(detections: Detections, *, lens: str = "auto", skew: bool = False) -> Calibration:
    """Calibrate the division model's coefficient linearly, then the pin-hole on the corrected corners.

    Args:
        detections: of a flat target, eight corners a view or more.
        lens: the formula that the corrected corners are written as, a name of LENSES or with the
            coefficients to free; `auto` is the division model itself.
        skew: whether K has one.
    Raises:
        CalibrationError: the views cannot tell the coefficient or the pin-hole.
        InputError: a setting is none.
    """
    lens = "division" if lens == "auto" else lens
    used = with_usable_views(detections)
    middle, unit = 0.5 * (np.array(used.image_size) - 1.0), 0.5 * float(np.hypot(*used.image_size))
    value = division_of_grids(grid_views(used), used.image_size)

    def straightened(pixels: Float[ndarray, "n 2"]) -> Float[ndarray, "n 2"]:
        out = pixels - middle
        return middle + out / (1.0 + value * (out * out).sum(1) / unit**2)[:, None]

    return calibration_of_corrected(
        used,
        straightened,
        middle,
        lens=lens,
        method="fitzgibbon",
        settings={"lens": lens, "skew": skew},
        said=(CENTRE_TAKEN,),
    )


def division_of_grids(views: list[GridView], image_size: tuple[int, int]) -> float:
    """The coefficient, in units of half the image's diagonal.

    Raises:
        CalibrationError: no view has a real one.
    """
    found = [value for view in views if (value := _of_view(view, image_size)) is not None]
    if not found:
        raise CalibrationError(
            "no view tells a coefficient of the division model; the corners are too few or out of order."
            " Use fccm."
        )
    return float(np.median(found))


def _of_view(view: GridView, image_size: tuple[int, int]) -> float | None:
    """The coefficient of a view; None where it has no real one."""
    middle, unit = 0.5 * (np.array(image_size) - 1.0), 0.5 * float(np.hypot(*image_size))
    x, y = ((view.pixels - middle) / unit).T[:, :, None]
    X, r2, nothing = view.places, x * x + y * y, np.zeros_like(view.places)
    D1 = np.block([[-X, nothing, x * X], [nothing, -X, y * X]])
    D2 = np.block([[-r2 * X, nothing, nothing], [nothing, -r2 * X, nothing]])
    try:
        values = np.linalg.eigvals(-np.linalg.solve(D1.T @ D1, D1.T @ D2))
    except np.linalg.LinAlgError:
        return 0.0  # met exactly without any distortion
    with np.errstate(divide="ignore", invalid="ignore"):
        coefficients = 1.0 / values[np.abs(values.imag) < 1e-9 * np.abs(values)].real
    likely = [float(v) for v in coefficients if STRONGEST < v < WEAKEST]
    if not likely:
        return None
    left = [np.linalg.svd(D1 + value * D2, compute_uv=False)[-1] for value in likely]
    return likely[int(np.argmin(left))]

"""Hartley and Kang's calibration without a formula for the lens, the nearest relative of the paper's aim.

1. the distortion centre, from radial lines of planar grids (radial_lines.py);
2. the radial curve about it, without a formula, and the corrected corners (curve.py);
3. the pin-hole on these, and a formula from the pairs of both, as in the paper's section 3.2 (corrected.py).

R. Hartley and S. B. Kang, Parameter-free radial distortion correction with center of distortion estimation,
PAMI 29(8), 2007. All is linear but for the last pixels of the centre, and nothing is fitted jointly: lens
first, then pin-hole.
"""

from __future__ import annotations

from orthoscope.fitting.calibration import Calibration
from orthoscope.fitting.usable_views import with_usable_views
from orthoscope.machine.blas import with_one_thread
from orthoscope.methods.radial_curve.corrected import calibration_of_corrected
from orthoscope.methods.radial_curve.curve import curve_of_views
from orthoscope.methods.radial_curve.radial_lines import centre_of_distortion, grid_views
from orthoscope.targets.detections import Detections

__all__ = ["hartley_kang"]

SAID = "the radial curve has no formula while it is estimated; the lens is the formula nearest to it"


@with_one_thread
def hartley_kang(detections: Detections, *, lens: str = "pfet", skew: bool = False) -> Calibration:
    """Calibrate centre and radial curve without a formula, then the pin-hole on the corrected corners.

    Args:
        detections: of a flat target, eight corners a view or more.
        lens: the formula that the curve is written as, a name of LENSES or with the coefficients to free;
            `auto` is pfet.
        skew: whether K has one.
    Raises:
        CalibrationError: the views cannot tell centre, curve or pin-hole.
        InputError: a setting is none.
    """
    lens = "pfet" if lens == "auto" else lens
    used = with_usable_views(detections)
    views = grid_views(used)
    curve = curve_of_views(views, centre_of_distortion(views, used.image_size))
    return calibration_of_corrected(
        used,
        curve.straightened,
        curve.centre,
        lens=lens,
        method="hartley_kang",
        settings={"lens": lens, "skew": skew},
        said=(SAID,),
    )

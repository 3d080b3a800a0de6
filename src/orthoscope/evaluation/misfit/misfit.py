"""Misfit tests: what a low error hides.  Does the target, or does the lens formula, limit this calibration?

Noise of the corners points anywhere, in every view anew. What points the same way in view after view is no
noise: at the same corner *of the target* it says that the corner is not where the target's description has
it; at the same place *of the image*, that the formula cannot follow the lens. Held-out error can see neither,
since the held-out views show the same target through the same lens.

**The F test.**  Near the estimate the residuals of all views are linear in everything that may explain them
(jacobian.py):

    e = V a + S b + C c + T d + noise      V: poses, 6 for each view      C: a shift of each image cell, 2
                                           S: the camera's own            T: a displacement of each corner in
                                           parameters                        the target, 3

With A the columns that are granted and B those in question, R(.) the squared sum that least squares on these
columns leaves, q and p the ranks that B and A have one after the other, N twice the number of corners:

    F = (R(A) - R(A, B)) / q / s^2,      s^2 = R(A, B) / (N - p - q), the variance of one coordinate

For normal noise of one size it has Fisher's distribution, whatever the fit that made e has taken away, since
A holds all that a fit could take (G. Seber and A. Lee, Linear Regression Analysis, 2003, section 4.3); what a
fit took beyond that, as an estimated target shape or a free lens does, only makes F smaller. The target is
tested with the image cells granted, A = (V, S, C), B = T, and the lens with the target granted, A = (V, S,
T), B = C: a bent target makes a lens look bad and the other way round, so each is only blamed for what the
other cannot explain. What a lens does besides its formula is smooth, and cells are steps: what they leave of
a missing decentering would be blamed on the target. So C also holds smooth displacements of the image that
any lens may make: radial ones up to the ninth power of the distance from the axis, decentering, thin prism.
Displacements have three components, since what a dent does in the image turns with the view; what poses do as
well (shift, turn, size of the whole target) has rank 0 by itself.

**The vote of the views.**  In real photographs the errors of one view hang together (blur, light,
refinement), and then F exceeds 1 without any misfit. Between views they still do not. So F is computed again
and again for the residuals that A leaves, with views picked at random whose residuals change their sign as a
whole: without misfit all these F come from one distribution (sign flips as in J. Hemerik, J. Goeman and L.
Finos, JRSS B 82(3), 2020; of residuals as in D. Freedman and D. Lane, JBES 1(4), 1983). Their mean, `chance`,
is what F would be; the share of them that is not below F is a second p-value. It holds to a few per cent
(views share the camera), the first one exactly.

**In pixels.**  What B explains beyond chance, q s^2 (F - chance), is the systematic part, its root over the
corners rms px per point; among the flipped views one in v still votes the true way, hence a factor v / (v -
1). Where it sits, d and c, is estimated as normal numbers of that size seen through the noise (ridge
regression), so that pictures show no noise.

Corners that miss by more than CLIP_RATIO times the noise count as if they missed by that: a few wild ones
neither make a misfit nor hide one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orthoscope.evaluation.misfit.design_matrix import Block, Columns
from orthoscope.evaluation.misfit.f_test import Agreement, MisfitTest, agreement
from orthoscope.evaluation.misfit.jacobian import Slopes, parameters_of, slopes_of, stepped
from orthoscope.evaluation.misfit.whitening import Whitening
from orthoscope.fitting.calibration import Calibration
from orthoscope.geometry.arrays import Float, Int, median, ndarray
from orthoscope.geometry.cells import Cells, cells_for
from orthoscope.models.camera import Camera
from orthoscope.models.difference import image_difference

__all__ = ["LensMisfit", "Misfit", "MisfitTest", "TargetMisfit", "misfit"]

# The image has about so many cells: finer than any lens varies, coarse enough for some corners in each.
MISFIT_CELLS = 48
# The target has about so many patches: each corner is one, but where there are more corners.
PATCH_COUNT = 300
# The block with this number is tested for the target.
TARGET_BLOCK = 0
# The blocks with these numbers are tested for the lens.
LENS_BLOCKS = (2, 3)
# The smooth terms along a radius have these powers of the squared distance.
RADIAL_POWERS = (1, 2, 3, 4)
# A residual counts at most this many times the noise: one corner in 300 000 is beyond it by chance.
CLIP_RATIO = 5.0


@dataclass(frozen=True, eq=False)
class TargetMisfit:
    """The target against its description.

    Attributes:
        displacements: (m,3) metres, target frame, where the corners seem to be minus where they are said to
            be, as far as that is no noise and neither shift, turn nor size of the whole; NaN for a corner
            that was not seen.
        pixels_per_metre: of the typical view.
        moves_camera_px: how far the camera's image would move if the corners were there (after a rotation,
            rms over the detected corners, to first order); rather too small, since noise hides part of the
            displacements.
    """

    test: MisfitTest
    displacements: Float[ndarray, "m 3"]
    pixels_per_metre: float
    moves_camera_px: float


@dataclass(frozen=True, eq=False)
class LensMisfit:
    """The lens against its formula.

    Attributes:
        residuals: (rows, columns, 2) pixels, predicted minus detected, what the views agree on in each cell,
            as far as that is no noise; NaN for a cell without corners.
    """

    test: MisfitTest
    cells: Cells
    residuals: Float[ndarray, "rows columns 2"]


@dataclass(frozen=True, eq=False)
class Misfit:
    """Both."""

    target: TargetMisfit
    lens: LensMisfit


def misfit(calibration: Calibration) -> Misfit:
    """Test the target against its description and the lens against its formula, by the calibration's own
    residuals.
    """
    detections = calibration.detections
    cells, patches = cells_for(detections.image_size, MISFIT_CELLS), _patches(detections.target.points)
    slopes = slopes_of(calibration)
    weight = _weights(slopes.residual)[:, None, None]
    smooth_terms = _smooth_terms(calibration.camera, slopes.pixels + slopes.residual)
    for rows in (slopes.by_camera, slopes.by_pose, smooth_terms):
        rows *= weight  # of many corners these are large, and nothing else wants them without weights
    camera = Block(slopes.by_camera, np.zeros_like(slopes.view), 1)
    image = Block(weight * np.eye(2), cells.of(slopes.pixels), cells.columns * cells.rows)
    target = Block(weight * slopes.by_place, patches[slopes.corner], int(patches.max(initial=-1)) + 1)
    smooth = Block(smooth_terms, np.zeros_like(slopes.view), 1)
    columns = Columns(
        weight[:, 0] * slopes.residual,
        slopes.by_pose,
        slopes.view,
        len(detections.views),
        (target, camera, image, smooth),
    )
    whole = Whitening.of(
        columns.gram
    )  # the target, which is large, stands first: what is granted to the lens is then a block of it
    of_target, of_lens = agreement(columns, whole, (TARGET_BLOCK,)), agreement(columns, whole, LENS_BLOCKS)
    return Misfit(
        TargetMisfit(
            of_target.test,
            _displacements(of_target, slopes, patches),
            _scale(slopes),
            _moved(calibration, columns, of_target),
        ),
        LensMisfit(of_lens.test, cells, _cell_residuals(of_lens, image, smooth, cells)),
    )


def _weights(residual: Float[ndarray, "n 2"]) -> Float[ndarray, " n"]:
    """1, but where a residual is larger than CLIP_RATIO times the noise; there what makes it that large."""
    size = np.hypot(*residual.T)
    # Rayleigh's median
    noise = median(size) / np.sqrt(2.0 * np.log(2.0)) if len(size) else 0.0
    return np.minimum(1.0, CLIP_RATIO * noise / np.maximum(size, 1e-300))


def _patches(points: Float[ndarray, "m 3"]) -> Int[ndarray, " m"]:
    """The patch of each corner: itself, or where there are more than PATCH_COUNT a square of the target that
    holds some.
    """
    if len(points) <= PATCH_COUNT:
        return np.arange(len(points))
    low, span = points[:, :2].min(0), np.ptp(points[:, :2], axis=0)
    side = np.sqrt(span[0] * span[1] / PATCH_COUNT)
    row_column = np.floor((points[:, :2] - low) / side * (1.0 - 1e-9)).astype(np.int64)
    return np.unique(row_column, axis=0, return_inverse=True)[1].reshape(-1)


def _displacements(found: Agreement, slopes: Slopes, patches: Int[ndarray, " m"]) -> Float[ndarray, "m 3"]:
    """Of each corner: the displacement that its patch's residuals ask for; NaN where the corner was
    not seen.
    """
    seen = np.bincount(slopes.corner, minlength=len(patches)) > 0
    return np.where(seen[:, None], -found.unknowns.reshape(-1, 3)[patches], np.nan)


def _moved(calibration: Calibration, columns: Columns, of_target: Agreement) -> float:
    """How far the image moves (rms px at the detected corners) from this camera to the one that the displaced
    corners ask for.
    """
    if not of_target.unknowns.any():
        return 0.0
    T, S, *_ = columns.places
    change = np.linalg.lstsq(
        columns.gram[np.ix_(S, S)], columns.gram[np.ix_(S, T)] @ of_target.unknowns, rcond=None
    )[0]
    camera = calibration.camera
    for name, step in zip(parameters_of(calibration), change, strict=True):
        camera = stepped(camera, name, float(step))
    pixels = np.concatenate([np.empty((0, 2)), *(view.pixels for view in calibration.detections.views)])
    squared = (image_difference(calibration.camera, camera, pixels) ** 2).sum(1)
    return float(np.sqrt(np.nanmean(squared))) if np.isfinite(squared).any() else float("nan")


def _smooth_terms(camera: Camera, pixels: Float[ndarray, "n 2"]) -> Float[ndarray, "n 2 w"]:
    """What lenses do besides a formula, as displacements of the image: radial, decentering, thin prism.

    Args:
        pixels: predicted. At detected ones a term less the same term of the formula would be the error
            itself.
    """
    frame = camera.lens_frame or camera.intrinsics
    x, y = ((pixels - [frame.cx, frame.cy]) / (0.5 * np.hypot(*camera.image_size))).T
    s, zero = x * x + y * y, np.zeros_like(x)
    radial = [(x * s**power, y * s**power) for power in RADIAL_POWERS]
    decentering = [(s + 2.0 * x * x, 2.0 * x * y), (2.0 * x * y, s + 2.0 * y * y)]
    prism = [(s, zero), (zero, s), (s * s, zero), (zero, s * s)]
    return np.moveaxis(np.array([*radial, *decentering, *prism]), 0, -1).transpose(1, 0, 2)


def _cell_residuals(
    found: Agreement, image: Block, smooth: Block, cells: Cells
) -> Float[ndarray, "rows columns 2"]:
    """Of each cell the residual that its corners share, smooth terms included; NaN where there are none."""
    counts = np.bincount(image.group, minlength=image.groups)
    steps, terms = np.split(found.unknowns, [image.width])
    smoothly = [
        np.bincount(image.group, weights=row, minlength=image.groups) / np.maximum(counts, 1)
        for row in smooth.times(terms).T
    ]
    residuals = steps.reshape(-1, 2) + np.stack(smoothly, axis=1)
    return np.where(counts[:, None] > 0, residuals, np.nan).reshape(cells.rows, cells.columns, 2)


def _scale(slopes: Slopes) -> float:
    """Pixels per metre in the target's plane, the middle view's (rms over directions)."""
    return (
        float(np.sqrt(0.5 * median((slopes.by_place[:, :, :2] ** 2).sum((1, 2)))))
        if len(slopes.view)
        else float("nan")
    )

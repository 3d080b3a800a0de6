"""From the centres of discs' outlines to where the discs' own centres are seen.

A tilted disc's image is an ellipse whose centre is not the image of the disc's centre: the near half is seen
larger than the far one. With r the disc's radius, f the focal length, d its distance and t its tilt they are
about f (r/d)^2 sin t cos t apart, pixels, all towards the same side of a view, so that a calibration takes it
for tilt and distortion. A lens that distorts moves the centre once more. Once a camera and the poses are
known the offset is too: points on the rim are projected and an ellipse is fitted to them, each by the length
of rim that it stands for, as the detector did to the outline's pixels.

J. Heikkila, Geometric camera calibration using circular control points, TPAMI 22(10), 2000, has the offset
of a pin-hole in closed form.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from orthoscope.fitting.calibration import points_of
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.geometry.ellipses import fit_ellipses
from orthoscope.geometry.pose import Pose
from orthoscope.models.camera import Camera
from orthoscope.models.target_shape import TargetShape
from orthoscope.targets.detections import Detections, View

__all__ = ["at_disc_centres", "disc_offsets", "has_outlines"]

# A disc's outline has so many points.
RIM_POINTS = 48


def has_outlines(detections: Detections) -> bool:
    """Whether the pixels are centres of discs' outlines that nobody has corrected."""
    return bool(detections.target.disc_radii.any()) and not detections.disc_centres


def disc_offsets(
    camera: Camera,
    camera_from_target: Pose,
    points: Float[ndarray, "n 3"],
    radius: float | Float[ndarray, " n"],
) -> Float[ndarray, "n 2"]:
    """From where each disc's centre is seen to the centre of its outline, pixels; 0 where it has none.

    Args:
        camera: which sees them.
        camera_from_target: where the target stands.
        points: the discs' centres, metres, target frame.
        radius: of the discs, metres; of all or of each.
    """
    angle = 2.0 * np.pi * np.arange(RIM_POINTS) / RIM_POINTS
    rim = np.stack([np.cos(angle), np.sin(angle), np.zeros(RIM_POINTS)], axis=1)
    rims = points[:, None] + np.broadcast_to(radius, len(points))[:, None, None] * rim
    around = camera_from_target.apply(rims.reshape(-1, 3))
    outlines = camera.project(around, beyond=True).reshape(-1, RIM_POINTS, 2)
    centres = camera.project(camera_from_target.apply(points), beyond=True)
    return np.nan_to_num(fit_ellipses(outlines, by_length=True).centres - centres)


def at_disc_centres(
    detections: Detections,
    camera: Camera,
    camera_from_target: Sequence[Pose],
    images: Sequence[str],
    *,
    shape: TargetShape | None = None,
) -> Detections:
    """The same detections with each pixel where its disc's centre is seen.

    Which disc a pixel is of is told by where it is, since a fit may list a view's discs from another end.

    Args:
        detections: as they were found.
        camera: from a first fit.
        camera_from_target: of the views of these images; others stay as they are.
        images: the names of those views.
        shape: of the target, flat by default.
    """
    if not has_outlines(detections):
        return detections
    every, radii = points_of(detections.target, shape), detections.target.disc_radii
    poses = dict(zip(images, camera_from_target, strict=True))
    views = []
    for view in detections.views:
        if view.image in poses and len(view.ids) and radii[view.ids].any():
            pose = poses[view.image]
            mine = detections.target.parts[int(detections.member_of(view.ids)[0])]
            points = every[mine]
            offsets = disc_offsets(camera, pose, points, radii[mine])
            outlines = camera.project(pose.apply(points), beyond=True) + offsets
            apart = np.linalg.norm(view.pixels[:, None] - outlines, axis=-1)
            disc = np.where(np.isfinite(apart), apart, np.inf).argmin(1)
            view = View(view.image, view.ids, view.pixels - offsets[disc])
        views.append(view)
    return replace(detections, views=tuple(views), disc_centres=True)

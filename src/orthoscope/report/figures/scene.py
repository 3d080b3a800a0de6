"""Where the boards were: the camera with its frustum and every board, in three dimensions.

Drawn as a photographer stands: the camera's x to the right, z (forward) into the page, y (down) downwards.
Matplotlib's axes are (right, into the page, up), hence (x, z, -y).
"""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from orthoscope.evaluation.evaluate import Evaluation
from orthoscope.fitting.calibration import Calibration
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.models.camera import Camera
from orthoscope.report.data.boards import board_corners, boards_in, frustum
from orthoscope.report.figures.style import BLUE, COLUMN_WIDTH, INK, ORANGE, RED, styled

__all__ = ["board_poses"]

# With more boards numbers would only hide each other.
NUMBERED_BOARDS = 30


@styled
def board_poses(evaluation: Evaluation) -> Figure:
    """The boards as the camera saw them, metres, numbered as in the table of photographs; suspects
    stand out.
    """
    calibration = evaluation.calibration
    figure = Figure(figsize=(COLUMN_WIDTH, 4.7))
    figure.set_layout_engine("none")  # matplotlib's layouts do not know how far 3-D labels reach
    axes = figure.add_axes((0.02, 0.07, 0.9, 0.91), projection="3d", computed_zorder=False)
    assert isinstance(axes, Axes3D)
    boards = _as_drawn(_boards(calibration))
    suspects = {name for name, _ in evaluation.suspects}
    odd = [view.image in suspects for view in calibration.detections.views]
    pyramid = _as_drawn(_frustum(calibration.camera, _boards(calibration)))
    axes.add_collection3d(Line3DCollection(pyramid, colors=INK, linewidths=1.1))
    faces = [RED if is_odd else BLUE for is_odd in odd]
    if len(boards):
        axes.add_collection3d(
            Poly3DCollection(
                boards,
                facecolors=faces,
                edgecolors=faces,
                alpha=float(np.clip(4 / len(boards), 0.05, 0.28)),
                linewidths=0.9,
            )
        )
        axes.plot(*boards[:, 0].T, "o", ms=2.6, color=ORANGE, label="corner 0")
        axes.legend(loc="upper left", borderaxespad=0.0)
    for i, board in enumerate(boards):
        if odd[i] or len(boards) <= NUMBERED_BOARDS:
            x, y, z = board.mean(0)
            axes.text(x, y, z, str(i + 1), color=RED if odd[i] else INK, fontsize=7, ha="center", va="center")
    _frame_scene(axes, np.concatenate([boards.reshape(-1, 3), pyramid.reshape(-1, 3)]))
    return figure


def _frame_scene(axes: Axes3D, points: Float[ndarray, "n 3"]) -> None:
    """One scale on all three axes, names and units as the camera's."""
    low, high = points.min(0), points.max(0)
    margin = 0.03 * float((high - low).max())
    axes.set(
        xlim=(low[0] - margin, high[0] + margin),
        ylim=(low[1] - margin, high[1] + margin),
        zlim=(low[2] - margin, high[2] + margin),
    )
    axes.set_box_aspect(high - low + 2 * margin)
    axes.set(xlabel="x, right (m)", ylabel="z, forward (m)", zlabel="y, down (m)")
    axes.zaxis.set_major_formatter(lambda value, _: f"{-value + 0.0:.4g}".replace("-", "\N{MINUS SIGN}"))
    axes.view_init(elev=22, azim=-62)
    axes.locator_params(nbins=5)


def _boards(calibration: Calibration) -> Float[ndarray, "views 4 3"]:
    """The corners of each board's outline, camera frame, metres, beginning with that of corner 0."""
    outlines = board_corners(calibration.detections.target)[boards_in(calibration.detections)]
    seen = zip(calibration.camera_from_target, outlines, strict=True)
    return np.array([pose.apply(outline) for pose, outline in seen]).reshape(-1, 4, 3)


def _frustum(camera: Camera, boards: Float[ndarray, "views 4 3"]) -> Float[ndarray, "8 2 3"]:
    """The edges of the pyramid that the frame sees, camera frame; its depth a third of the nearest boards'
    distance.
    """
    depth = 1 / 3 * float(np.quantile(np.linalg.norm(boards.mean(1), axis=-1), 0.1)) if len(boards) else 1.0
    front = frustum(camera, depth)
    return np.concatenate(
        [np.stack([np.zeros((4, 3)), front], axis=1), np.stack([front, np.roll(front, -1, axis=0)], axis=1)]
    )


def _as_drawn(points: Float[ndarray, "*batch 3"]) -> Float[ndarray, "*batch 3"]:
    """Camera frame (x right, y down, z forward) to matplotlib's (right, into the page, up)."""
    return np.stack([points[..., 0], points[..., 2], -points[..., 1]], axis=-1)

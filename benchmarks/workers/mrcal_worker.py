"""mrcal as a peer, in the steps of its own mrcal-calibrate-cameras: stereographic seed, lens, then everything
with the board's warp.

Regularisation and outlier rejection are as they are by default; the seed's random coefficients come from a
fixed seed. `plain` leaves warp, outlier rejection and the last repeated solve out: then it solves the problem
that everybody else solves.
"""

from __future__ import annotations

import subprocess
from functools import partial
from typing import Any

import mrcal  # pyright: ignore[reportMissingImports]  # lives in the system's Python
import numpy as np
from corners import Corners, Fit, tasks_of
from served import serve

SPLINED = "SPLINED_STEREOGRAPHIC_order=3_Nx=16_Ny=12"
MARGIN = 1.15  # of the field of view that the splines cover, over what the image needs


class _Board:
    """The corners as mrcal counts them: row by row, all one spacing apart."""

    def __init__(self, corners: Corners) -> None:
        if corners.grid is None:
            raise ValueError("mrcal takes full chessboards only")
        self.columns, self.rows = corners.grid
        self.origin = corners.points.min(0)
        self.spacing = float(np.ptp(corners.points[:, 0])) / (self.columns - 1)
        column, row = np.rint((corners.points - self.origin)[:, :2] / self.spacing).astype(int).T
        self.place = row * self.columns + column

    def points(self, warp: np.ndarray | None) -> np.ndarray:
        """Where mrcal believes our corners to be."""
        believed = mrcal.ref_calibration_object(self.columns, self.rows, self.spacing, calobject_warp=warp)
        return believed.reshape(-1, 3)[self.place] + self.origin


def _fit(corners: Corners, lens: str, *, plain: bool = False) -> Fit:
    if lens == SPLINED:
        lens = f"{lens}_fov_x_deg={round(np.rad2deg(corners.fov_x) * MARGIN)}"
    lens, board = f"LENSMODEL_{lens}", _Board(corners)
    problem = _seeded(corners, board)
    mrcal.optimize(**problem, **_plainly(core=False))
    mrcal.optimize(**problem, **_plainly(core=True))
    problem.update(
        lensmodel=lens,
        intrinsics=_widened(problem["intrinsics"], lens),
        **_finally(core=not _is_splined(lens)),
    )
    problem.update(do_apply_outlier_rejection=not plain)
    stats = mrcal.optimize(**problem)
    if not plain:
        problem.update(calobject_warp=np.zeros(2), do_optimize_calobject_warp=True)
        stats = mrcal.optimize(**problem)
    project = partial(_project, lens=lens, intrinsics=problem["intrinsics"][0])
    return Fit(
        project,
        board.points(problem.get("calobject_warp")),
        float(np.sqrt(2.0) * stats["rms_reproj_error__pixels"]),
    )


def _project(points: np.ndarray, *, lens: str, intrinsics: np.ndarray) -> np.ndarray:
    return mrcal.project(np.ascontiguousarray(points), lens, intrinsics)


def _seeded(corners: Corners, board: _Board) -> dict[str, Any]:
    """mrcal's problem, seen through its stereographic seed."""
    views = len(corners.ids)
    observations = np.full((views, board.rows * board.columns, 3), -1.0)
    for observed, ids, pixels in zip(observations, corners.ids, corners.pixels, strict=True):
        observed[board.place[ids]] = np.column_stack([pixels, np.ones(len(ids))])
    observations = observations.reshape(views, board.rows, board.columns, 3)
    view_camera = np.stack([np.arange(views), np.zeros(views)], axis=-1).astype(np.int32)
    sizes = np.array([corners.image_size], dtype=np.int32)
    intrinsics, extrinsics, frames = mrcal.seed_stereographic(
        imagersizes=sizes,
        focal_estimate=corners.focal,
        indices_frame_camera=view_camera,
        observations=observations,
        object_spacing=board.spacing,
    )
    return {
        "intrinsics": intrinsics,
        "extrinsics_rt_fromref": extrinsics,
        "frames_rt_toref": frames,
        "points": None,
        "observations_board": observations,
        "indices_frame_camintrinsics_camextrinsics": (
            np.column_stack([view_camera, view_camera[:, 1] - 1]).astype(np.int32)
        ),
        "observations_point": None,
        "indices_point_camintrinsics_camextrinsics": None,
        "lensmodel": "LENSMODEL_STEREOGRAPHIC",
        "imagersizes": sizes,
        "calibration_object_spacing": board.spacing,
    }


def _plainly(*, core: bool) -> dict[str, bool]:
    """The first two solves: poses, then the focal length too."""
    return {
        "do_optimize_intrinsics_core": core,
        "do_optimize_intrinsics_distortions": False,
        "do_optimize_calobject_warp": False,
        "do_apply_outlier_rejection": False,
        "do_apply_regularization": False,
    }


def _finally(*, core: bool) -> dict[str, bool]:
    """The last two: everything, as by default."""
    return {
        "do_optimize_intrinsics_core": core,
        "do_optimize_intrinsics_distortions": True,
        "do_optimize_calobject_warp": False,
        "do_apply_outlier_rejection": True,
        "do_apply_regularization": True,
    }


def _is_splined(lens: str) -> bool:
    return lens.startswith("LENSMODEL_SPLINED")


def _widened(intrinsics: np.ndarray, lens: str) -> np.ndarray:
    """The core, with small random coefficients after it; the denominators of OPENCV8 smaller still."""
    extra = mrcal.lensmodel_num_params(lens) - intrinsics.shape[-1]
    coefficients = np.random.default_rng(0).uniform(-1e-6, 1e-6, (1, extra))
    if not _is_splined(lens):
        coefficients[:, 5:8] *= 1e-3
    return np.hstack([intrinsics, coefficients])


def _version() -> str:
    package = subprocess.run(
        ["dpkg-query", "-W", "-f", "${Version}", "mrcal"], capture_output=True, text=True, check=False
    ).stdout
    return f"mrcal {package or 'of unknown version'}"


KINDS = {
    "OPENCV5": partial(_fit, lens="OPENCV5"),
    "OPENCV8": partial(_fit, lens="OPENCV8"),
    "splined": partial(_fit, lens=SPLINED),
    "OPENCV5 plain": partial(_fit, lens="OPENCV5", plain=True),
    "splined plain": partial(_fit, lens=SPLINED, plain=True),
}

if __name__ == "__main__":
    serve(tasks_of(KINDS, _version))

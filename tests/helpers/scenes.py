"""Scenes that methods are tried on: a known camera, boards where a person would hold them, corners with or
without noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import ConvexHull

from orthoscope.geometry.pose import Pose, rotation_from_vector
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.lens import Lens
from orthoscope.models.lenses.table import Brown, KannalaBrandt
from orthoscope.simulation.scene import Scene, random_views, simulate_detections
from orthoscope.targets.detections import Detections, View
from orthoscope.targets.target import Target, chessboard

__all__ = [
    "BOARD",
    "NARROW",
    "WIDE",
    "K",
    "camera_with",
    "facing",
    "image_difference",
    "photographed",
    "seen",
    "side_by_side",
    "some_corners",
    "turned_boards",
    "worst_image",
]

BOARD = chessboard(9, 6, 0.025)
K = Intrinsics(520.0, 524.0, 325.0, 236.0)
NARROW = Camera((640, 480), K, Brown(k1=-0.28, k2=0.09, p1=1e-3, p2=-6e-4, k3=-0.02))
WIDE = Camera(
    (640, 480), Intrinsics(205.0, 206.0, 318.0, 242.0), KannalaBrandt(k1=-0.02, k2=0.003, k3=-0.002, k4=2e-4)
)


def camera_with(lens: Lens, intrinsics: Intrinsics = K) -> Camera:
    """A 640x480 camera with this lens."""
    return Camera((640, 480), intrinsics, lens)


def seen(camera: Camera, poses: Sequence[Pose], *, noise_px: float = 0.0, seed: int = 0) -> Detections:
    """The corners of BOARD that the camera sees of these poses."""
    return simulate_detections(
        Scene(camera, BOARD, tuple(poses)), noise_px=noise_px, rng=np.random.default_rng(seed)
    )


def photographed(
    camera: Camera, views: int = 10, *, noise_px: float = 0.0, seed: int = 0, **how
) -> Detections:
    """So many views of BOARD as a person would take them; how: as in random_views."""
    return seen(
        camera,
        random_views(camera, BOARD, views, rng=np.random.default_rng(seed), **how),
        noise_px=noise_px,
        seed=seed,
    )


def facing(views: int, rotation: np.ndarray, *, seed: int = 0) -> tuple[Pose, ...]:
    """Boards that are all parallel: turned like this, then moved about, and turned in their own plane."""
    rng = np.random.default_rng(seed)
    poses = []
    for _ in range(views):
        turned = rotation @ rotation_from_vector(np.array([0.0, 0.0, rng.uniform(-0.5, 0.5)]))
        middle = np.array([rng.uniform(-0.05, 0.05), rng.uniform(-0.04, 0.04), rng.uniform(0.35, 0.6)])
        poses.append(Pose(turned, middle - turned @ BOARD.points.mean(0)))
    return tuple(poses)


def some_corners(detections: Detections, share: tuple[float, float], *, seed: int = 0) -> Detections:
    """The same with a random share of each view's corners left, at least 4, in random order."""
    rng = np.random.default_rng(seed)

    def thinned(view: View) -> View:
        keep = rng.permutation(len(view.ids))[: max(4, int(rng.uniform(*share) * len(view.ids)))]
        return View(view.image, view.ids[keep], view.pixels[keep])

    return replace(detections, views=tuple(thinned(view) for view in detections.views))


def image_difference(camera: Camera, other: Camera, pixels: np.ndarray) -> np.ndarray:
    """How far apart (n,), pixels, the two cameras see what the first sees at these pixels."""
    return np.hypot(*(other.project(camera.unproject(pixels)) - pixels).T)


def worst_image(camera: Camera, other: Camera, detections: Detections, samples: int = 20) -> float:
    """The largest image difference over the part of the frame that corners cover: their convex hull.

    Places of it that the first camera does not see (beside a fisheye's image, say) are left out.
    """
    pixels = np.concatenate([view.pixels for view in detections.views])
    low, high = pixels.min(0), pixels.max(0)
    x, y = np.meshgrid(np.linspace(low[0], high[0], samples), np.linspace(low[1], high[1], samples))
    grid = np.stack([x.ravel(), y.ravel()], axis=-1)
    sides = ConvexHull(pixels).equations  # (sides, 3): normal pointing outwards, and offset
    covered = np.concatenate([pixels, grid[(grid @ sides[:, :2].T + sides[:, 2] <= 0.0).all(1)]])
    covered = covered[np.isfinite(camera.unproject(covered)[:, 0])]
    return float(image_difference(camera, other, covered).max())


def turned_boards() -> tuple[np.ndarray, np.ndarray]:
    """Four boards within 20 degrees of the axis."""
    w = np.array([[0.0, 0.0, 0.0], [0.4, 0.1, 0.0], [-0.2, 0.5, 1.0], [0.1, -0.3, 3.0]])
    middle = np.array([[0.0, 0.0, 0.8], [0.05, 0.0, 0.9], [-0.05, 0.05, 0.8], [0.0, -0.05, 1.0]])
    return w, middle - np.einsum("vij,j->vi", rotation_from_vector(w), BOARD.points.mean(0))


def side_by_side(camera: Camera, target: Target, turn: float) -> list[tuple[Target, Pose]]:
    """Where the members of a target stand, next to each other across the picture, each turned its own way."""
    spans = [member.drawing().size for member in target.members]
    (width, height), fx = camera.image_size, camera.intrinsics.fx
    share = max(sum(span[0] for span in spans) / width, max(span[1] for span in spans) / height)
    distance, left, stands = 1.15 * fx * share, -0.5 * sum(span[0] for span in spans), []
    for number, (member, span) in enumerate(zip(target.members, spans, strict=True)):
        drawing = member.drawing()
        rotation = rotation_from_vector(np.array([turn, 0.25 * (-1) ** number, 0.05 * number]))
        middle = np.array([*(0.5 * (drawing.low + drawing.high)), 0.0])
        at = np.array([left + 0.5 * span[0], 0.0, distance])
        stands.append((member, Pose(rotation, at - rotation @ middle)))
        left += span[0]
    return stands

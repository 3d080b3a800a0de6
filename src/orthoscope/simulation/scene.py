"""Scenes whose truth is known, and the corners that a detector would find in them.

A view is made as a person makes one: choose a *place* in the image, how much of the image the board shall
*fill*, how it is
*turned* (roll in its own plane, then tilt about an axis in that plane, against the line of sight, so that the
same words serve a narrow lens and one past 90 degrees); then move the board until the picture agrees. The
last step is a fixed point: the board's box in the image is compared with the wanted one, the aim is moved by
the difference and the distance by the ratio.

The paper's camera is that of its section 4.1, read in normalised coordinates (its mm^-2 would fold the image
over).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from orthoscope.geometry.arrays import Bool, CalibrationError, Float, InputError, ndarray
from orthoscope.geometry.pose import Pose, cross_matrix, rotation_from_vector
from orthoscope.models.camera import Camera, Intrinsics
from orthoscope.models.lenses import Brown
from orthoscope.targets.detections import Detections, SetAside, View
from orthoscope.targets.target import Target, chessboard

__all__ = ["Scene", "paper_scene", "random_views", "simulate_detections"]

BORDER = 0.01  # gap that a whole board leaves to the image's border, as a share of the image's side
# how often a view that cannot be made is drawn again, nearer to the image's middle each time
ATTEMPTS = 80
STEPS = 25  # of the fixed point; it gains a digit every two or three
GRAZING = np.deg2rad(
    75.0
)  # no corner is looked at flatter than this, from the board's normal: no detector would find it
LEAST_SEEN = 0.25  # share of the corners that a partial view shows at least
# the paper's section 4.1: at this tilt the noise is twice what it is face on
DOUBLED_AT = np.deg2rad(70.0)
# its powers make the most even sequence in the plane (M. Roberts, R2, 2018)
PLASTIC = 1.324717957244746

PAPER_FILL = (
    0.8,
    0.98,
    # its Fig. 1 shows boards that fill the frame; what a lens formula cannot follow shows at the
    # frame's border
)

PAPER_LENSES: dict[str, tuple[Brown, tuple[float, float]]] = {
    "low": (Brown(k1=-0.2), (317.0, 244.0)),
    "high": (Brown(k1=-0.3, k2=-0.045, p1=-0.005, p2=-0.00025), (305.0, 257.0)),
}


@dataclass(frozen=True, eq=False)
class Scene:
    """The truth: a camera, a target and where the target stood in each view.

    Raises InputError for a scene without views.
    """

    camera: Camera
    target: Target
    camera_from_target: tuple[Pose, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "camera_from_target", tuple(self.camera_from_target))
        if not self.camera_from_target:
            raise InputError(
                "a scene has 0 views; expected at least 1. Hand in one pose for each photograph."
            )

    @property
    def images(self) -> tuple[str, ...]:
        """A name for each view: view01, view02, and so on."""
        digits = max(2, len(str(len(self.camera_from_target))))
        return tuple(f"view{i:0{digits}d}" for i in range(1, len(self.camera_from_target) + 1))

    def corner_pixels(self) -> Float[ndarray, "v m 2"]:
        """Where the camera sees every corner of every view, pixels; NaN for a corner without image or outside
        the frame.
        """
        pixels = _see(
            self.camera, np.stack([pose.apply(self.target.points) for pose in self.camera_from_target])
        )
        pixels[~_inside(pixels, self.camera.image_size)] = np.nan
        return pixels

    def tilts(self) -> Float[ndarray, " v"]:
        """The angle between the target and the image plane in each view, radians."""
        return np.arccos(np.minimum(1.0, np.abs([pose.rotation[2, 2] for pose in self.camera_from_target])))


def simulate_detections(
    scene: Scene, *, noise_px: float, rng: np.random.Generator, tilt_noise: bool = False
) -> Detections:
    """What a detector with Gaussian noise would find in a scene: corners in the frame, each coordinate off by
    N(0, sigma^2).

    noise_px: sigma, pixels, of the board face on. tilt_noise: sigma grows linearly with the angle between
    board and image plane, to twice its value at 70 degrees (the paper, section 4.1). Views without a corner
    are set aside. Raises InputError where noise_px is negative.
    """
    if not 0 <= noise_px < np.inf:
        raise InputError(f"noise_px is {noise_px}; expected 0 or more pixels.")
    pixels = scene.corner_pixels()
    sigma = noise_px * (1.0 + scene.tilts() / DOUBLED_AT if tilt_noise else np.ones(len(pixels)))
    pixels += sigma[:, None, None] * rng.standard_normal(pixels.shape)
    views, empty = [], []
    for image, corners in zip(scene.images, pixels, strict=True):
        ids = np.flatnonzero(np.isfinite(corners[:, 0]))
        if len(ids):
            views.append(View(image, ids, corners[ids]))
        else:
            empty.append(SetAside(image, "no corner of the target lies in the image"))
    return Detections(scene.target, scene.camera.image_size, tuple(views), tuple(empty))


def paper_scene(distortion: str, *, count: int = 20, rng: np.random.Generator) -> Scene:
    """The paper's simulated camera and target (section 4.1), with its `low` or `high` distortion.

    The sheet is 210 x 297 mm with 14 x 20 inner corners, so 15 x 21 squares: 14 mm is the largest square that
    fits (it uses the full 210 mm and 294 of the 297). The lens has a centre of its own; the paper says
    nothing of it for the pin-hole, which stays at (320, 240). Raises InputError for another word.
    """
    if distortion not in PAPER_LENSES:
        raise InputError(f"distortion is {distortion!r}; expected one of {', '.join(PAPER_LENSES)}.")
    lens, (centre_x, centre_y) = PAPER_LENSES[distortion]
    camera = Camera(
        (640, 480),
        Intrinsics(750.0, 750.0, 320.0, 240.0),
        lens,
        lens_frame=Intrinsics(750.0, 750.0, centre_x, centre_y),
    )
    target = chessboard(14, 20, 0.014)
    return Scene(camera, target, random_views(camera, target, count, rng=rng, fill=PAPER_FILL))


def random_views(
    camera: Camera,
    target: Target,
    count: int,
    *,
    rng: np.random.Generator,
    tilt: tuple[float, float] = (0.0, np.pi / 4),
    roll: tuple[float, float] = (-np.pi, np.pi),
    fill: tuple[float, float] = (0.4, 0.9),
    whole: bool = True,
    margin: float = 0.0,
) -> tuple[Pose, ...]:
    """camera_from_target of `count` views as a person would take them: the middle, the image's four corners,
    then evenly all over.

    The board's middle is in front of the camera; with a lens past 90 degrees its rim may not be. tilt: least
    and greatest angle between the board's normal and the line of sight to its middle, radians, the axis at
    random. roll: turn of the board in its own plane, radians. fill: the board's box in the image over the
    image, in the direction where that is more. whole: all corners are in the image; otherwise the board's
    middle goes to where its box would have gone, and at least a quarter of the corners is seen. margin:
    metres around the corners that count as board too (a square, to see the outer squares). Raises InputError
    for ranges that make no sense, CalibrationError where no such view can be found.
    """
    _check_ranges(count, tilt, roll, fill, margin)
    board = _board(target, margin)
    places = _places(count, rng)
    views: dict[int, Pose] = {}
    for attempt in range(ATTEMPTS):
        missing = np.array([view for view in range(count) if view not in views])
        nearer = 0.5 + (places[missing] - 0.5) * 0.95**attempt
        turned = _turned(*(rng.uniform(*bounds, len(missing)) for bounds in (tilt, roll, (-np.pi, np.pi))))
        aim, distance, agrees = _move(camera, board, turned, nearer, rng.uniform(*fill, len(missing)))
        if not whole:
            aim = nearer * _frame(camera)
        rotation, translation = _stand(camera, board, turned, aim, distance)
        agrees &= _is_good(camera, board, rotation, translation, whole)
        views |= {int(missing[i]): Pose(rotation[i], translation[i]) for i in np.flatnonzero(agrees)}
        if len(views) == count:
            return tuple(views[view] for view in range(count))
    raise CalibrationError(
        f"only {len(views)} of {count} views of {target.name!r} could be made after {ATTEMPTS} attempts at"
        f" each; expected the board {'wholly' if whole else 'partly'} in the image, filling {fill[0]:g} to"
        f" {fill[1]:g} of it. Ask for a smaller fill or tilt, or check that the lens reaches over the image."
    )


def _check_ranges(
    count: int, tilt: tuple[float, float], roll: tuple[float, float], fill: tuple[float, float], margin: float
) -> None:
    if count < 1:
        raise InputError(f"count is {count}; expected at least 1 view.")
    if not 0 <= tilt[0] <= tilt[1] < np.pi / 2:
        raise InputError(
            f"tilt is {tilt}; expected radians with 0 <= least <= greatest < pi/2, such as (0, 0.78)."
        )
    if not -np.inf < roll[0] <= roll[1] < np.inf:
        raise InputError(f"roll is {roll}; expected (least, greatest) in radians, such as (-3.14, 3.14).")
    if not 0 < fill[0] <= fill[1] <= 1 - 2 * BORDER:
        raise InputError(
            f"fill is {fill}; expected shares of the image with 0 < least <= greatest <= {1 - 2 * BORDER:g}."
        )
    if not 0 <= margin < np.inf:
        raise InputError(f"margin is {margin}; expected 0 or more metres.")


class _Board(NamedTuple):
    """The corners (m,3), points (n,3) along the bounding rectangle widened by the margin, and its middle
    (3,); metres, target frame.
    """

    corners: ndarray
    outline: ndarray
    middle: ndarray


def _board(target: Target, margin: float, along: int = 12) -> _Board:
    low, high = target.points.min(0), target.points.max(0)
    middle, half = 0.5 * (low + high), 0.5 * (high - low) + [margin, margin, 0.0]
    t, one, zero = np.linspace(-1.0, 1.0, along), np.ones(along), np.zeros(along)
    sides = np.concatenate(
        [
            np.stack(side, axis=-1)
            for side in ((t, one, zero), (t, -one, zero), (one, t, zero), (-one, t, zero))
        ]
    )
    return _Board(target.points, middle + half * sides, middle)


def _places(count: int, rng: np.random.Generator) -> Float[ndarray, "v 2"]:
    """Where in the free room of the image the boards go, 0 to 1: middle, four corners, the rest evenly; in
    random order.
    """
    first = np.array([[0.5, 0.5], [0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]])
    rest = (rng.random(2) + np.arange(max(0, count - 5))[:, None] / PLASTIC ** np.array([1, 2])) % 1.0
    return rng.permutation(np.concatenate([first, rest])[:count])


def _turned(tilt: ndarray, roll: ndarray, axis: ndarray) -> Float[ndarray, "v 3 3"]:
    """Rotations that roll the board in its plane, then tilt it about the axis at this angle in the plane."""
    zero = np.zeros_like(roll)
    tilted = rotation_from_vector(np.stack([tilt * np.cos(axis), tilt * np.sin(axis), zero], axis=-1))
    return tilted @ rotation_from_vector(np.stack([zero, zero, roll], axis=-1))


def _move(
    camera: Camera, board: _Board, turned: ndarray, place: ndarray, fill: ndarray
) -> tuple[Float[ndarray, "v 2"], Float[ndarray, " v"], Bool[ndarray, " v"]]:
    """The pixel and the distance of the board's middle at which its box lies and fills as wanted; and which
    views came to agree.
    """
    frame = _frame(camera)
    free = (1.0 - 2.0 * BORDER) * frame
    aim = np.repeat(0.5 * frame[None], len(fill), axis=0)
    distance = np.ptp(board.outline, axis=0).max() * camera.intrinsics.fx / (fill * frame.max())
    ratio = np.full(len(fill), np.nan)
    for _ in range(STEPS):
        pixels = _see(camera, _place_in_camera(board.outline, *_stand(camera, board, turned, aim, distance)))
        low, box = pixels.min(1), np.ptp(pixels, axis=1)
        ratio = (box / frame).max(-1) / fill
        lost = np.isnan(ratio)  # part of the board has no image: farther away, and towards the middle
        step = np.where(lost[:, None], 0.3 * (0.5 * frame - aim), BORDER * frame + place * (free - box) - low)
        aim = np.clip(aim + step, 0.0, frame)
        distance = distance * np.where(lost, 1.3, np.clip(ratio, 0.7, 1.4))
    return aim, distance, np.abs(ratio - 1.0) < 0.05


def _stand(
    camera: Camera, board: _Board, turned: ndarray, aim: ndarray, distance: ndarray
) -> tuple[Float[ndarray, "v 3 3"], Float[ndarray, "v 3"]]:
    """camera_from_target of boards whose middle is seen at the aim, turned against the line of sight; NaN
    where the aim shows nothing.
    """
    sight = camera.unproject(aim)
    rotation = _facing(sight) @ turned
    return rotation, distance[:, None] * sight - rotation @ board.middle


def _facing(sight: Float[ndarray, "v 3"]) -> Float[ndarray, "v 3 3"]:
    """The shortest rotation that takes the z axis to each unit vector."""
    axis = cross_matrix(np.stack([-sight[:, 1], sight[:, 0], np.zeros(len(sight))], axis=-1))
    return np.eye(3) + axis + axis @ axis / (1.0 + sight[:, 2])[:, None, None]


def _place_in_camera(points: ndarray, rotation: ndarray, translation: ndarray) -> Float[ndarray, "v n 3"]:
    """The same points of the target in every view, camera frame."""
    return points @ np.swapaxes(rotation, 1, 2) + translation[:, None]


def _see(camera: Camera, points: Float[ndarray, "v n 3"]) -> Float[ndarray, "v n 2"]:
    return camera.project(points.reshape(-1, 3)).reshape(*points.shape[:2], 2)


def _is_good(
    camera: Camera, board: _Board, rotation: ndarray, translation: ndarray, whole: bool
) -> Bool[ndarray, " v"]:
    """Whether the board's middle is in front, enough of it is in the image, and no corner there is looked at
    too flatly.
    """
    points = _place_in_camera(
        np.concatenate([board.corners, board.outline]) if whole else board.corners, rotation, translation
    )
    inside = _inside(_see(camera, points), camera.image_size)
    upright = (points * rotation[:, None, :, 2]).sum(-1) >= np.cos(GRAZING) * np.sqrt(
        (points * points).sum(-1)
    )
    in_front = _place_in_camera(board.middle[None], rotation, translation)[:, 0, 2] > 0
    return in_front & (inside.mean(-1) >= (1.0 if whole else LEAST_SEEN)) & (upright | ~inside).all(-1)


def _frame(camera: Camera) -> Float[ndarray, "2"]:
    """The last pixel, (width - 1, height - 1)."""
    return np.array(camera.image_size) - 1.0


def _inside(pixels: Float[ndarray, "*batch 2"], image_size: tuple[int, int]) -> Bool[ndarray, "*batch"]:
    """Which pixels lie on the image; not those that are NaN."""
    return np.all((pixels >= -0.5) & (pixels <= np.array(image_size) - 0.5), axis=-1)

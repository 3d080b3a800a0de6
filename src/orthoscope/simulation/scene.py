"""Scenes whose truth is known, and the corners that a detector would find in them.

A view is made as a person makes one: choose a *place* in the image, how much of the image the board shall
*fill*, how it is *turned* (roll in its own plane, then tilt about an axis in that plane, against the line of
sight, so that the same words serve a narrow lens and one past 90 degrees); then move the board until the
picture agrees. The last step is a fixed point: the board's box in the image is compared with the wanted one,
the aim is moved by the difference and the distance by the ratio.

The paper's camera is that of its section 4.1, read in normalised coordinates (its mm^-2 would fold the image
over).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from orthoscope.geometry.arrays import Bool, CalibrationError, Float, InputError, ndarray
from orthoscope.geometry.pose import Pose, cross_matrix, rotation_from_vector
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown
from orthoscope.targets.detections import Detections, SetAside, View
from orthoscope.targets.target import Target, chessboard

__all__ = ["PAPER_FILL", "Scene", "paper_scene", "random_views", "simulate_detections"]

# A whole board leaves a gap to the image's border of this share of the image's side.
BORDER_SHARE = 0.01
# A view that cannot be made is drawn again so often at most, nearer to the image's middle each time.
ATTEMPT_LIMIT = 80
# The fixed point is given so many steps; it gains a digit every two or three.
FIXED_POINT_STEPS = 25
# No corner is looked at flatter than this, from the board's normal, radians: no detector would find it.
GRAZING_ANGLE = np.deg2rad(75.0)
# A partial view shows at least this share of the corners.
LEAST_SEEN_SHARE = 0.25
# At this tilt, radians, the noise is twice what it is face on (the paper's section 4.1).
DOUBLE_NOISE_TILT = np.deg2rad(70.0)
# The powers of the plastic number make the most even sequence in the plane (M. Roberts, R2, 2018).
PLASTIC_NUMBER = 1.324717957244746

# The paper's Fig. 1 shows boards that fill the frame; what a lens formula cannot follow shows at its border.
PAPER_FILL = (0.8, 0.98)

# The paper's two lenses and their centres, pixels.
PAPER_LENSES: dict[str, tuple[Brown, tuple[float, float]]] = {
    "low": (Brown(k1=-0.2), (317.0, 244.0)),
    "high": (Brown(k1=-0.3, k2=-0.045, p1=-0.005, p2=-0.00025), (305.0, 257.0)),
}


@dataclass(frozen=True, eq=False)
class Scene:
    """The truth about some photographs.

    Attributes:
        camera: which took them.
        target: what they show.
        camera_from_target: where it stood in each.
    Raises:
        InputError: there is no view.
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
        """Pixels of every corner of every view; NaN for a corner without image or outside the frame."""
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
    """What a detector with Gaussian noise would find in a scene: corners in the frame, off by N(0, sigma^2).

    Views without a corner are set aside.

    Args:
        scene: the truth.
        noise_px: sigma of each coordinate where the board is seen face on, pixels.
        rng: the source of the noise.
        tilt_noise: whether sigma grows linearly with the angle between board and image plane, to twice its
            value at 70 degrees (the paper's section 4.1).
    Raises:
        InputError: noise_px is negative or infinite.
    """
    if not 0 <= noise_px < np.inf:
        raise InputError(f"noise_px is {noise_px}; expected 0 or more pixels.")
    pixels = scene.corner_pixels()
    sigma = noise_px * (1.0 + scene.tilts() / DOUBLE_NOISE_TILT if tilt_noise else np.ones(len(pixels)))
    pixels += sigma[:, None, None] * rng.standard_normal(pixels.shape)
    views, empty = [], []
    for image, corners in zip(scene.images, pixels, strict=True):
        ids = np.flatnonzero(np.isfinite(corners[:, 0]))
        if len(ids):
            views.append(View(image, ids, corners[ids]))
        else:
            empty.append(SetAside(image, "no corner of the target lies in the image"))
    return Detections(
        scene.target,
        scene.camera.image_size,
        tuple(views),
        tuple(empty),
        disc_centres=bool(scene.target.disc_radii.any()),
    )


def paper_scene(
    distortion: str,
    *,
    count: int = 20,
    rng: np.random.Generator,
    tilt: tuple[float, float] = (0.0, np.pi / 4),
    fill: tuple[float, float] = PAPER_FILL,
) -> Scene:
    """The paper's simulated camera and target (section 4.1).

    The sheet is 210 x 297 mm with 14 x 20 inner corners, so 15 x 21 squares: 14 mm is the largest square that
    fits (it uses the full 210 mm and 294 of the 297). The lens has a centre of its own; the paper says
    nothing of it for the pin-hole, which stays at (320, 240).

    Args:
        distortion: `low` or `high`.
        count: how many views.
        rng: the source of the views.
        tilt, fill: as `random_views` takes them.
    Raises:
        InputError: another word for the distortion.
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
    return Scene(camera, target, random_views(camera, target, count, rng=rng, tilt=tilt, fill=fill))


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
    """camera_from_target of views as a person takes them: the middle, the four corners, then evenly all over.

    The board's middle is in front of the camera; with a lens past 90 degrees its rim may not be.

    Args:
        camera: which takes them.
        target: what they show.
        count: how many views.
        rng: the source of all that is at random.
        tilt: least and greatest angle between the board's normal and the line of sight to its middle,
            radians; its axis is at random.
        roll: least and greatest turn of the board in its own plane, radians.
        fill: least and greatest share of the image that the board's box has, in the direction where it is
            more.
        whole: whether all corners are in the image; otherwise the board's middle goes to where its box would
            have gone, and at least a quarter of the corners is seen.
        margin: what counts as board around the corners, metres (a square, to see the outer squares).
    Raises:
        InputError: ranges that make no sense.
        CalibrationError: no such view can be found.
    """
    _check_ranges(count, tilt, roll, fill, margin)
    board = _board(target, margin)
    places = _places(count, rng)
    views: dict[int, Pose] = {}
    for attempt in range(ATTEMPT_LIMIT):
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
        f"only {len(views)} of {count} views of {target.name!r} could be made after {ATTEMPT_LIMIT} attempts"
        f" at each; expected the board {'wholly' if whole else 'partly'} in the image, filling {fill[0]:g} to"
        f" {fill[1]:g} of it. Ask for a smaller fill or tilt, or check that the lens reaches over the image."
    )


def _check_ranges(
    count: int, tilt: tuple[float, float], roll: tuple[float, float], fill: tuple[float, float], margin: float
) -> None:
    """Check that each parameter of `random_views` makes sense.

    Raises:
        InputError: one does not.
    """
    if count < 1:
        raise InputError(f"count is {count}; expected at least 1 view.")
    if not 0 <= tilt[0] <= tilt[1] < np.pi / 2:
        raise InputError(
            f"tilt is {tilt}; expected radians with 0 <= least <= greatest < pi/2, such as (0, 0.78)."
        )
    if not -np.inf < roll[0] <= roll[1] < np.inf:
        raise InputError(f"roll is {roll}; expected (least, greatest) in radians, such as (-3.14, 3.14).")
    if not 0 < fill[0] <= fill[1] <= 1 - 2 * BORDER_SHARE:
        raise InputError(
            f"fill is {fill}; expected shares of the image with 0 < least <= greatest <="
            f" {1 - 2 * BORDER_SHARE:g}."
        )
    if not 0 <= margin < np.inf:
        raise InputError(f"margin is {margin}; expected 0 or more metres.")


class _Board(NamedTuple):
    """A target as a thing that fills part of an image; metres, target frame.

    Attributes:
        corners: its corners, (m,3).
        outline: points along the bounding rectangle, widened by the margin, (n,3).
        middle: of the rectangle, (3,).
    """

    corners: ndarray
    outline: ndarray
    middle: ndarray


def _board(target: Target, margin: float, along: int = 12) -> _Board:
    """The board of a target.

    Args:
        target: the one that is photographed.
        margin: by which the outline is wider than the corners, metres.
        along: how many points each of its sides has.
    """
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
    """Where in the free room boards go, 0 to 1: middle, four corners, the rest evenly; in random order."""
    first = np.array([[0.5, 0.5], [0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]])
    rest = (rng.random(2) + np.arange(max(0, count - 5))[:, None] / PLASTIC_NUMBER ** np.array([1, 2])) % 1.0
    return rng.permutation(np.concatenate([first, rest])[:count])


def _turned(tilt: ndarray, roll: ndarray, axis: ndarray) -> Float[ndarray, "v 3 3"]:
    """Rotations that roll the board in its plane, then tilt it about an axis in the plane.

    Args:
        tilt: of each view, (v,) radians.
        roll: of each view, (v,) radians.
        axis: the angle of the tilt's axis in the plane, (v,) radians.
    """
    zero = np.zeros_like(roll)
    tilted = rotation_from_vector(np.stack([tilt * np.cos(axis), tilt * np.sin(axis), zero], axis=-1))
    return tilted @ rotation_from_vector(np.stack([zero, zero, roll], axis=-1))


def _move(
    camera: Camera, board: _Board, turned: ndarray, place: ndarray, fill: ndarray
) -> tuple[Float[ndarray, "v 2"], Float[ndarray, " v"], Bool[ndarray, " v"]]:
    """The pixel and the distance of the board's middle at which its box lies and fills as wanted.

    Args:
        camera: which takes the views.
        board: what they show.
        turned: the board's rotation against the line of sight, (v,3,3).
        place: where its box goes in the image's free room, (v,2), 0 to 1.
        fill: the share of the image that its box has, (v,).
    Returns:
        Pixels (v,2), distances (v,) in metres, and which views came to agree (v,).
    """
    frame = _frame(camera)
    free = (1.0 - 2.0 * BORDER_SHARE) * frame
    aim = np.repeat(0.5 * frame[None], len(fill), axis=0)
    distance = np.ptp(board.outline, axis=0).max() * camera.intrinsics.fx / (fill * frame.max())
    ratio = np.full(len(fill), np.nan)
    for _ in range(FIXED_POINT_STEPS):
        pixels = _see(camera, _place_in_camera(board.outline, *_stand(camera, board, turned, aim, distance)))
        low, box = pixels.min(1), np.ptp(pixels, axis=1)
        ratio = (box / frame).max(-1) / fill
        lost = np.isnan(ratio)  # part of the board has no image: farther away, and towards the middle
        step = np.where(
            lost[:, None], 0.3 * (0.5 * frame - aim), BORDER_SHARE * frame + place * (free - box) - low
        )
        aim = np.clip(aim + step, 0.0, frame)
        distance = distance * np.where(lost, 1.3, np.clip(ratio, 0.7, 1.4))
    return aim, distance, np.abs(ratio - 1.0) < 0.05


def _stand(
    camera: Camera, board: _Board, turned: ndarray, aim: ndarray, distance: ndarray
) -> tuple[Float[ndarray, "v 3 3"], Float[ndarray, "v 3"]]:
    """camera_from_target of boards, turned against the line of sight, whose middle is seen at a pixel.

    Args:
        camera: which takes the views.
        board: what they show.
        turned: the board's rotation against the line of sight, (v,3,3).
        aim: the pixel of its middle, (v,2).
        distance: of its middle, (v,) metres.
    Returns:
        Rotations (v,3,3) and translations (v,3); NaN where the aim shows nothing.
    """
    sight = camera.unproject(aim)
    rotation = _facing(sight) @ turned
    return rotation, distance[:, None] * sight - rotation @ board.middle


def _facing(sight: Float[ndarray, "v 3"]) -> Float[ndarray, "v 3 3"]:
    """The shortest rotation that takes the z axis to each unit vector."""
    axis = cross_matrix(np.stack([-sight[:, 1], sight[:, 0], np.zeros(len(sight))], axis=-1))
    return np.eye(3) + axis + axis @ axis / (1.0 + sight[:, 2])[:, None, None]


def _place_in_camera(points: ndarray, rotation: ndarray, translation: ndarray) -> Float[ndarray, "v n 3"]:
    """Points of the target in every view, camera frame, metres."""
    return points @ np.swapaxes(rotation, 1, 2) + translation[:, None]


def _see(camera: Camera, points: Float[ndarray, "v n 3"]) -> Float[ndarray, "v n 2"]:
    """Pixels of points, camera frame."""
    return camera.project(points.reshape(-1, 3)).reshape(*points.shape[:2], 2)


def _is_good(
    camera: Camera, board: _Board, rotation: ndarray, translation: ndarray, whole: bool
) -> Bool[ndarray, " v"]:
    """Whether the board's middle is in front, enough of it is in the image, and no corner is seen too flatly.

    Args:
        camera: which takes the views.
        board: what they show.
        rotation: of each view, (v,3,3).
        translation: of each view, (v,3) metres.
        whole: whether enough is all of it.
    """
    points = _place_in_camera(
        np.concatenate([board.corners, board.outline]) if whole else board.corners, rotation, translation
    )
    inside = _inside(_see(camera, points), camera.image_size)
    upright = (points * rotation[:, None, :, 2]).sum(-1) >= np.cos(GRAZING_ANGLE) * np.sqrt(
        (points * points).sum(-1)
    )
    in_front = _place_in_camera(board.middle[None], rotation, translation)[:, 0, 2] > 0
    return in_front & (inside.mean(-1) >= (1.0 if whole else LEAST_SEEN_SHARE)) & (upright | ~inside).all(-1)


def _frame(camera: Camera) -> Float[ndarray, "2"]:
    """The last pixel, (width - 1, height - 1)."""
    return np.array(camera.image_size) - 1.0


def _inside(pixels: Float[ndarray, "*batch 2"], image_size: tuple[int, int]) -> Bool[ndarray, "*batch"]:
    """Which pixels lie on the image; not those that are NaN."""
    return np.all((pixels >= -0.5) & (pixels <= np.array(image_size) - 0.5), axis=-1)

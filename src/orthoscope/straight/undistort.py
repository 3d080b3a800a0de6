"""Straight pictures: photographs as a pin-hole camera, or another that one chooses, would have taken them.

The map says for each straight pixel where to look in the photograph (Camera.view_map); cv2.remap looks. A
picture keeps its depth, its channels and all that stands beside its pixels in the file (picture_files.py).
Where the lens has no image the map is NaN and the picture black. Colour is mapped with a fourth channel
beside its three: the pixels are the same, and OpenCV 5 takes two thirds of the time for them. What lies
between is written to the same memory for each photograph: fresh memory for large pictures costs the system as
much as half the mapping, and threads that ask for it wait for each other.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Executor
from contextlib import contextmanager, nullcontext
from functools import partial
from os import PathLike
from pathlib import Path

import cv2
import numpy as np

from orthoscope.files.images import read_image
from orthoscope.files.whole_files import check_not_onto, write_bytes
from orthoscope.fitting.calibration import Calibration
from orthoscope.geometry.arrays import InputError, ndarray
from orthoscope.models.camera import Camera
from orthoscope.models.image_size import check_image_size
from orthoscope.straight.picture_files import encoded, read_picture
from orthoscope.straight.views import View, map_of, straight_camera

__all__ = ["Straightener", "before_and_after", "undistort", "undistort_photographs"]

# This place is surely outside any photograph: remap paints it black.
OUTSIDE_PLACE = -10.0


class _Spare(threading.local):
    """Pictures that one thread writes to again and again."""

    def __init__(self) -> None:
        self._pictures: dict[str, ndarray] = {}

    def picture(self, name: str, size: tuple[int, int], channels: int) -> ndarray:
        """Of uint8, with whatever was written last; size is (width, height)."""
        if name not in self._pictures:
            self._pictures[name] = np.empty((size[1], size[0], channels), dtype=np.uint8)
        return self._pictures[name]


class Straightener:
    """A camera's straight view, its map made once for many photographs.

    To another process it goes without its map, which is made again there in less time than it takes to send.

    Args:
        keep: `all` photographed pixels, or only `valid` places (no black border).
        view: the camera of the straight pictures, instead of what `keep` says.
    """

    def __init__(self, camera: Camera, *, keep: str = "all", view: View | None = None) -> None:
        self.camera = camera
        self.view: View = view or straight_camera(camera, keep=keep)
        self._spare = _Spare()
        self.maps: list[ndarray] = [
            np.nan_to_num(part, copy=False, nan=OUTSIDE_PLACE) for part in map_of(camera, self.view)
        ]

    def __reduce__(self) -> tuple[Callable[[Camera], Straightener], tuple[Camera]]:
        return partial(Straightener, view=self.view), (self.camera,)

    def __call__(self, image: ndarray, *, reuse: bool = False) -> ndarray:
        """The straight picture of a photograph (h,w) or (h,w,c), any depth, of the view's size.

        Args:
            reuse: where this thread's next picture may overwrite this one, whose memory then serves for all.
        Raises:
            InputError: the photograph is not of the camera's size.
        """
        size = (image.shape[1], image.shape[0])
        check_image_size(self.camera, size)
        if image.dtype != np.uint8 or image.shape[2:] != (3,):
            return self._mapped(image)
        wide = self._spare.picture("wide", size, 4)
        mapped = self._spare.picture("mapped", self.view.image_size, 4)
        cv2.cvtColor(image, cv2.COLOR_BGR2BGRA, dst=wide)
        straight = self._spare.picture("straight", self.view.image_size, 3) if reuse else None
        return cv2.cvtColor(self._mapped(wide, into=mapped), cv2.COLOR_BGRA2BGR, dst=straight)

    def _mapped(self, image: ndarray, *, into: ndarray | None = None) -> ndarray:
        return cv2.remap(
            image, *self.maps, interpolation=cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, dst=into
        )


def undistort(
    image: ndarray, camera: Camera | Calibration, *, keep: str = "all", view: View | None = None
) -> ndarray:
    """One straight picture; for many, a Straightener makes its map only once.

    Args:
        image: (h,w) or (h,w,c) of the camera's size.
        camera: that took it, or its calibration.
        keep: `all` or `valid`.
        view: the straight picture's camera, as `straight_camera` makes it; by default a pin-hole of the same
            size.
    Raises:
        InputError: there is no picture, or its size differs.
    """
    if not isinstance(image, np.ndarray) or image.ndim not in (2, 3):
        raise InputError(
            f"the picture is {type(image).__name__}; expected an array (h,w) or (h,w,c). Read it with"
            " orthoscope.read_image, which says what is wrong with a file."
        )
    camera = camera.camera if isinstance(camera, Calibration) else camera
    return Straightener(camera, keep=keep, view=view)(image)


def undistort_photographs(
    paths: Iterable[str | PathLike[str]],
    camera: Camera,
    folder: str | PathLike[str],
    *,
    keep: str = "all",
    view: View | None = None,
    executor: Executor | None = None,
    progress: Callable[[int, int, str], None] | None = None,
) -> tuple[list[Path], list[tuple[str, str]]]:
    """Straight pictures of photographs, written into a folder under their own names, each as the file it was.

    Args:
        keep, view: as for `undistort`.
        executor: where photographs are read, mapped and written, each by one worker from file to file
            (threads suit; others need to see the same files), while OpenCV itself uses one thread in this
            process; by default here.
        progress: called with (done, total, name).
    Returns:
        The files written, and for each photograph that could not be used its name and the reason.
    Raises:
        InputError: two photographs have one name, or one would be written onto itself or another.
    """
    photographs, folder = [Path(path) for path in paths], Path(folder)
    _check_names(photographs)
    places = [folder / path.name for path in photographs]
    check_not_onto(places, photographs)
    straighten = partial(_straighten, Straightener(camera, keep=keep, view=view))
    run = executor.map if executor else map
    written, failed = [], []
    with _one_thread_each() if executor else nullcontext():
        for done, (path, place, failure) in enumerate(
            zip(photographs, places, run(straighten, photographs, places), strict=True), 1
        ):
            if failure is None:
                written.append(place)
            else:
                failed.append((path.name, failure))
            if progress:
                progress(done, len(photographs), path.name)
    return written, failed


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Keeps OpenCV from dividing each picture among threads where the pictures already are: they would wait
    for each other.
    """
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)


def _straighten(straightener: Straightener, path: Path, place: Path) -> str | None:
    """One photograph from file to file; the reason where that cannot be."""
    try:
        picture = read_picture(path)
        write_bytes(place, encoded(straightener(picture.pixels, reuse=True), picture, place))
    except InputError as error:
        return str(error)
    return None


def _check_names(photographs: list[Path]) -> None:
    """Check that each photograph would be written to a file of its own.

    Raises:
        InputError: two would be written to one.
    """
    first: dict[str, Path] = {}
    for path in photographs:
        if path.name in first:
            raise InputError(
                f"{path} and {first[path.name]} have the same name; straighten them into folders of their"
                " own, one after the other."
            )
        first[path.name] = path


def before_and_after(
    calibration: Calibration, files: Mapping[str, Path], *, keep: str = "all"
) -> tuple[str, ndarray, ndarray] | None:
    """(name, photograph, straight picture) of the view whose corners lie farthest out, where its file is at
    hand and can be read.
    """
    views = [view for view in calibration.detections.views if view.image in files]
    if not views:
        return None
    centre = 0.5 * (np.array(calibration.camera.image_size) - 1.0)
    view = max(views, key=lambda view: float(np.hypot(*(view.pixels - centre).T).mean()))
    try:
        image = read_image(files[view.image], grey=False)
        return view.image, image, undistort(image, calibration.camera, keep=keep)
    except InputError:
        return None

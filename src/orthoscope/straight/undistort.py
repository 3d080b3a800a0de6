"""Straight pictures: photographs as a pin-hole camera would have taken them.

The map says for each straight pixel where to look in the photograph (Camera.undistort_map); cv2.remap looks.
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

from orthoscope.files.images import read_image, write_image
from orthoscope.fitting.calibration import Calibration
from orthoscope.geometry.arrays import InputError, ndarray
from orthoscope.models.camera import Camera, Intrinsics
from orthoscope.models.lenses import Brown

__all__ = ["Straightener", "before_and_after", "straight_camera", "undistort", "undistort_photographs"]

OUTSIDE = -10.0  # a place that is surely outside any photograph: remap paints it black


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

    keep: `all` photographed pixels, or only `valid` places (no black border). intrinsics: the pin-hole of the
    straight pictures. To another process it goes without its map, which is made again there in less time than
    it takes to send.
    """

    def __init__(self, camera: Camera, *, keep: str = "all") -> None:
        self.camera, self.keep = camera, keep
        self.intrinsics: Intrinsics = camera.straight_intrinsics(keep)
        self._spare = _Spare()
        self._maps = [
            np.nan_to_num(part, copy=False, nan=OUTSIDE) for part in camera.undistort_map(self.intrinsics)
        ]

    def __reduce__(self) -> tuple[Callable[[Camera], Straightener], tuple[Camera]]:
        return partial(Straightener, keep=self.keep), (self.camera,)

    def __call__(self, image: ndarray, *, reuse: bool = False) -> ndarray:
        """The straight picture of a photograph (h,w) or (h,w,c), any depth, same size.

        reuse: where this thread's next picture may overwrite this one, whose memory then serves for all.
        Raises InputError where the photograph is not of the camera's size.
        """
        size = (image.shape[1], image.shape[0])
        if size != tuple(self.camera.image_size):
            width, height = self.camera.image_size
            raise InputError(
                f"the photograph is {size[0]}x{size[1]}; this camera was calibrated at {width}x{height}. Hand"
                " in photographs of that size."
            )
        if image.dtype != np.uint8 or image.shape[2:] != (3,):
            return self._mapped(image)
        wide, mapped = (self._spare.picture(name, size, 4) for name in ("wide", "mapped"))
        cv2.cvtColor(image, cv2.COLOR_BGR2BGRA, dst=wide)
        straight = self._spare.picture("straight", size, 3) if reuse else None
        return cv2.cvtColor(self._mapped(wide, into=mapped), cv2.COLOR_BGRA2BGR, dst=straight)

    def _mapped(self, image: ndarray, *, into: ndarray | None = None) -> ndarray:
        return cv2.remap(
            image, *self._maps, interpolation=cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, dst=into
        )


def undistort(image: ndarray, camera: Camera, *, keep: str = "all") -> ndarray:
    """One straight picture; for many, a Straightener makes its map only once.

    image: (h,w) or (h,w,c) of the camera's size.  keep: `all` or `valid`.
    Raises InputError where the size differs.
    """
    return Straightener(camera, keep=keep)(image)


def undistort_photographs(
    paths: Iterable[str | PathLike[str]],
    camera: Camera,
    folder: str | PathLike[str],
    *,
    keep: str = "all",
    executor: Executor | None = None,
    progress: Callable[[int, int, str], None] | None = None,
) -> tuple[list[Path], list[tuple[str, str]]]:
    """Straight pictures of photographs, written into a folder under their own names.

    executor: where photographs are read, mapped and written, each by one worker from file to file (threads
    suit; others need to see the same files), while OpenCV itself uses one thread in this process; by default
    here. progress: called with (done, total, name). Returns the files written, and for each photograph that
    could not be used its name and the reason.
    """
    straighten, folder = partial(_straighten, Straightener(camera, keep=keep)), Path(folder)
    photographs = [Path(path) for path in paths]
    _check_names(photographs)
    places = [folder / path.name for path in photographs]
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
        write_image(place, straightener(read_image(path, grey=False), reuse=True))
    except InputError as error:
        return str(error)
    return None


def _check_names(photographs: list[Path]) -> None:
    """Raises InputError where two photographs would be written to one file."""
    first: dict[str, Path] = {}
    for path in photographs:
        if path.name in first:
            raise InputError(
                f"{path} and {first[path.name]} have the same name; straighten them into folders of their"
                " own, one after the other."
            )
        first[path.name] = path


def straight_camera(camera: Camera, *, keep: str = "all") -> Camera:
    """The camera of the straight pictures: a pin-hole without distortion."""
    return Camera(camera.image_size, camera.straight_intrinsics(keep), Brown())


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

"""Straight films: the frames of a video file as a pin-hole camera would have taken them.

Frames are read and written here, in order, and mapped by an executor meanwhile, a few ahead, so that the
cores are busy and memory does not grow with the film. A mark that has players turn the film turns nothing
here and is kept (files/sensor_frames.py). A film is written beside its place and takes it when it is whole.
Where PyAV is installed it is H.264 with its sound and its time stamps (film_av.py); otherwise OpenCV writes
it, without sound, which OpenCV does not read.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import nullcontext
from os import PathLike
from pathlib import Path

import cv2

from orthoscope.files.sensor_frames import mark_turned, open_film, quarter_turns
from orthoscope.files.whole_files import check_not_onto
from orthoscope.geometry.arrays import InputError, ndarray
from orthoscope.machine.cores import at_once
from orthoscope.models.camera import Camera
from orthoscope.straight.film_av import has_pyav, straighten_film
from orthoscope.straight.undistort import Straightener
from orthoscope.straight.views import View

__all__ = ["CODECS", "is_video", "undistort_video"]

CODECS = {
    ".mp4": "mp4v",
    ".m4v": "mp4v",
    ".mov": "mp4v",
    ".mkv": "mp4v",
    ".avi": "MJPG",
}  # what a film of that name is written with
# So many frames are under way at most.
FRAMES_AHEAD = 6
# A film that does not say has so many frames a second.
USUAL_RATE = 25.0


def is_video(path: str | PathLike[str]) -> bool:
    """Whether a file is a film, by its name."""
    return Path(path).suffix.lower() in CODECS


def undistort_video(
    path: str | PathLike[str],
    camera: Camera,
    place: str | PathLike[str],
    *,
    keep: str = "all",
    view: View | None = None,
    executor: Executor | None = None,
    progress: Callable[[int, int, str], None] | None = None,
) -> int:
    """The straight film of a video file, written to `place`, whose suffix says in which format.

    Args:
        keep, view: as for photographs.
        executor: threads that map frames; by default as many as there are cores.
        progress: called with (frames done, frames that the file speaks of, name).
    Returns:
        The number of frames.
    Raises:
        InputError: the file cannot be read, is of another size than the camera's, or is what would be written
            onto; the place cannot be written.
    """
    path, place = Path(path), Path(place)
    check_not_onto([place], [path])
    straightener = Straightener(camera, keep=keep, view=view)
    if has_pyav():
        return _with_pyav(straightener, path, place, executor=executor, progress=progress)
    with nullcontext(executor) if executor else ThreadPoolExecutor(at_once()) as run, _Source(path) as source:
        rate, total = source.get(cv2.CAP_PROP_FPS), int(source.get(cv2.CAP_PROP_FRAME_COUNT))
        usual = rate if 0 < rate < 1e4 else USUAL_RATE
        with _Film(place, usual, straightener, quarters=quarter_turns(path)) as film:
            done = 0
            for done, frame in enumerate(_in_order(run, straightener, _frames(source)), 1):
                film.write(frame)
                if progress:
                    progress(done, max(done, total), path.name)
            if not done:
                raise InputError(
                    f"{path} has no frame that can be read; expected a film. Copy it again or convert it."
                )
    return done


def _with_pyav(
    straightener: Straightener,
    path: Path,
    place: Path,
    *,
    executor: Executor | None,
    progress: Callable[[int, int, str], None] | None,
) -> int:
    if not path.is_file():
        raise InputError(f"{path} does not exist; expected a video file. Check the name and the folder.")
    part = _part_of(place)
    size = straightener.view.image_size
    try:
        with nullcontext(executor) if executor else ThreadPoolExecutor(at_once()) as run:
            done = straighten_film(path, part, straightener, size=size, executor=run, progress=progress)
        if not done:
            raise InputError(
                f"{path} has no frame that can be read; expected a film. Copy it again or convert it."
            )
        mark_turned(part, quarter_turns(path), size=size)
        os.replace(part, place)
    finally:
        part.unlink(missing_ok=True)
    return done


def _part_of(place: Path) -> Path:
    """Where a film is written until it is whole; makes its folder.

    Raises:
        InputError: the name is no film's or the folder cannot be made.
    """
    suffix = place.suffix.lower()
    if suffix not in CODECS:
        raise InputError(
            f"{place} cannot be written: {suffix or 'no suffix'} is no film; expected one of"
            f" {', '.join(CODECS)}."
        )
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"{place} cannot be written ({reason}); choose another place.") from error
    return place.with_name(f".{place.stem}.{os.getpid()}.part{suffix}")


def _in_order(
    executor: Executor, step: Callable[[ndarray], ndarray], frames: Iterable[ndarray]
) -> Iterator[ndarray]:
    """What `step` makes of each frame, in their order, with no more than FRAMES_AHEAD under way."""
    waiting: deque[Future[ndarray]] = deque()
    try:
        for frame in frames:
            waiting.append(executor.submit(step, frame))
            if len(waiting) == FRAMES_AHEAD:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
    finally:
        for future in waiting:
            future.cancel()


def _frames(source: cv2.VideoCapture) -> Iterator[ndarray]:
    while (read := source.read())[0]:
        yield read[1]


class _Source:
    """A video file that is open for reading within a block."""

    def __init__(self, path: Path) -> None:
        if not path.is_file():
            raise InputError(f"{path} does not exist; expected a video file. Check the name and the folder.")
        self.source = open_film(path)
        if not self.source.isOpened():
            raise InputError(
                f"{path} is no film that can be read; expected one of {', '.join(CODECS)}. Convert it."
            )

    def __enter__(self) -> cv2.VideoCapture:
        return self.source

    def __exit__(self, *_: object) -> None:
        self.source.release()


class _Film:
    """A film that is open for writing within a block, and at its place after it, unless the block failed."""

    def __init__(self, place: Path, rate: float, straightener: Straightener, *, quarters: int) -> None:
        self.place, self.part = place, _part_of(place)
        self.quarters, self.size = quarters, straightener.view.image_size
        code = cv2.VideoWriter_fourcc(*CODECS[place.suffix.lower()])  # pyright: ignore[reportAttributeAccessIssue]  its stubs have lost it
        self.film = cv2.VideoWriter(str(self.part), code, rate, straightener.view.image_size)

    def __enter__(self) -> cv2.VideoWriter:
        if not self.film.isOpened():
            raise InputError(
                f"{self.place} cannot be written; choose another place or another suffix:"
                f" {', '.join(CODECS)}."
            )
        return self.film

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self.film.release()
        if kind is None:
            mark_turned(self.part, self.quarters, size=self.size)
            os.replace(self.part, self.place)
        else:
            self.part.unlink(missing_ok=True)

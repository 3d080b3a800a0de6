"""Straight films by PyAV (`pip install 'orthoscope[video]'`): H.264, every frame at its own time, the sound
as it was.

Sound and subtitles are copied packet by packet, never decoded; frames keep their time stamps, so that a film
of uneven rate stays in step with its sound.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

from orthoscope.geometry.arrays import InputError, ndarray

__all__ = ["has_pyav", "straighten_film"]

# So many frames are under way at most.
FRAMES_AHEAD = 6
# H.264's constant quality; 18 is taken for what no eye tells from the source.
QUALITY = "18"


def has_pyav() -> bool:
    """Whether PyAV is installed."""
    import importlib.util

    return importlib.util.find_spec("av") is not None


def straighten_film(
    path: Path,
    part: Path,
    step: Callable[[ndarray], ndarray],
    *,
    size: tuple[int, int],
    executor: Executor,
    progress: Callable[[int, int, str], None] | None,
) -> int:
    """Writes the straight film of `path` into `part`; returns the number of frames.

    Args:
        step: makes a straight picture of one (h,w,3), blue, green, red.
        size: (width, height) of what it makes.
    Raises:
        InputError: the film cannot be read or written.
    """
    import av
    from av.error import FFmpegError

    try:
        with av.open(str(path)) as source, av.open(str(part), "w") as film:
            return _copy(source, film, path, step, size=size, executor=executor, progress=progress)
    except FFmpegError as error:
        raise InputError(f"{path} is no film that can be read or written ({error}). Convert it.") from error


def _copy(
    source: Any,
    film: Any,
    path: Path,
    step: Callable[[ndarray], ndarray],
    *,
    size: tuple[int, int],
    executor: Executor,
    progress: Callable[[int, int, str], None] | None,
) -> int:
    if not source.streams.video:
        raise InputError(f"{path} has no picture in it; expected a film.")
    seen = source.streams.video[0]
    seen.thread_type = "AUTO"
    shown = film.add_stream("libx264", rate=seen.average_rate or 25, options={"crf": QUALITY})
    shown.width, shown.height = size
    shown.pix_fmt = "yuv420p" if size[0] % 2 == size[1] % 2 == 0 else "yuv444p"
    shown.time_base = shown.codec_context.time_base = seen.time_base
    film.metadata.update(source.metadata)
    others = {
        stream: film.add_stream_from_template(stream) for stream in source.streams if stream.type == "audio"
    }
    waiting: deque[tuple[Any, Future[ndarray]]] = deque()
    done, total = 0, seen.frames or round((source.duration or 0) / av_second() * (seen.average_rate or 0))

    def write_first() -> None:
        nonlocal done
        frame, future = waiting.popleft()
        straight = av_frame(future.result(), shown.pix_fmt)
        straight.pts, straight.time_base = frame.pts, frame.time_base
        film.mux(shown.encode(straight))
        done += 1
        if progress:
            progress(done, max(done, total), path.name)

    try:
        for packet in source.demux([seen, *others]):
            if packet.stream is not seen:
                if packet.dts is not None:
                    packet.stream = others[packet.stream]
                    film.mux(packet)
                continue
            for frame in packet.decode():
                waiting.append((frame, executor.submit(step, frame.to_ndarray(format="bgr24"))))
                if len(waiting) == FRAMES_AHEAD:
                    write_first()
        while waiting:
            write_first()
        film.mux(shown.encode(None))
    finally:
        for _, future in waiting:
            future.cancel()
    return done


def av_second() -> int:
    """A second in the units of a container's duration."""
    import av

    return av.time_base


def av_frame(image: ndarray, pixel_format: str) -> Any:
    """A frame of a picture (h,w,3), blue, green, red."""
    import av

    return av.VideoFrame.from_ndarray(image, format="bgr24").reformat(format=pixel_format)

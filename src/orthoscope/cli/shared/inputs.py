"""Whatever holds corners, to Detections: photographs, our own detections.json, or a table of
corners.

OpenCV is loaded for photographs only.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from pathlib import Path

from orthoscope.cli.shared.printing import tell
from orthoscope.formats.corners_vnl import SUFFIXES, read_vnl
from orthoscope.formats.own.json import load_detections
from orthoscope.geometry.arrays import InputError
from orthoscope.targets.detections import Detections, photograph_of
from orthoscope.targets.table import parse_target
from orthoscope.targets.target import Target

__all__ = ["AUTO", "detections_from"]

# What `--target` says where nobody knows which target it is.
AUTO = "auto"


def detections_from(
    paths: Sequence[str | Path],
    target: str | Target | None,
    *,
    image_size: tuple[int, int] | None = None,
    jobs: int | None = None,
    executor: Executor | None = None,
    progress: Callable[[int, int, str], None] | None = None,
    most_megapixels: float | None = None,
    topic: str | None = None,
) -> tuple[Detections, dict[str, Path]]:
    """Detections, and where the photograph of each name is (empty where corners were found before).

    Args:
        paths: photographs (files, folders, globs), or one .json of ours, or one .vnl or .csv.
        target: needed but for our own file, which knows its own.
        image_size: needed with a table, which does not know it.
        jobs, executor, progress: as in `detect`.
    Raises:
        InputError: something needed is missing, or contradicts the photographs.
    """
    if len(paths) == 1 and Path(paths[0]).suffix == ".json":
        found = load_detections(paths[0])
        _check_same_target(found, target, paths[0])
        _check_same_size(found, image_size)
        return found, {}
    if target is None:
        raise InputError(
            "no target was named; say what was photographed, such as --target chessboard:9x6:25mm (inner"
            " corners, square). `orthoscope detect PHOTOS --target auto` says which it seems to be."
        )
    if target == AUTO:
        from orthoscope.detection.recognition.recognise import recognise

        raise InputError(f"--target {AUTO} only says what is seen: {recognise(paths).sentence}.")
    target = parse_target(target) if isinstance(target, str) else target
    if len(paths) == 1 and Path(paths[0]).suffix.lower() in SUFFIXES:
        if image_size is None:
            raise InputError(
                f"{paths[0]} does not say how large the photographs are; add their size, such as --image-size"
                " 640x480."
            )
        return read_vnl(paths[0], target, image_size), {}
    from orthoscope.detection.detect import detect
    from orthoscope.files.images import MOST_MEGAPIXELS, names_of, passed_over, photographs
    from orthoscope.files.pictures import MOVING

    files = photographs(paths, also=MOVING)
    most = MOST_MEGAPIXELS if most_megapixels is None else most_megapixels
    found = detect(
        files, target, jobs=jobs, executor=executor, progress=progress, most_megapixels=most, topic=topic
    )
    _check_same_size(found, image_size)
    if others := passed_over(paths, also=MOVING):
        tell(f"passed over {', '.join(f'{count} {end}' for end, count in others.items())}", err=True)
    named = dict(zip(names_of(files), files, strict=True))
    return found, named | {
        view.image: named[photograph]
        for view in found.views
        if (photograph := photograph_of(view.image)) in named
    }


def _check_same_size(found: Detections, image_size: tuple[int, int] | None) -> None:
    """What is said of the photographs' size is so.

    Raises:
        InputError: another size is named.
    """
    if image_size not in (None, tuple(found.image_size)):
        (width, height), (w, h) = found.image_size, image_size
        raise InputError(
            f"the photographs are {width}x{height}; --image-size says {w}x{h}. Leave it out: only a table of"
            " corners does not know its size."
        )


def _check_same_target(found: Detections, target: str | Target | None, path: str | Path) -> None:
    """Corners that were found before are of the target that they were found for.

    Raises:
        InputError: another target is named.
    """
    if target in (None, AUTO):
        return
    named = parse_target(target) if isinstance(target, str) else target
    if named.name != found.target.name:
        raise InputError(
            f"{path} holds corners of {found.target.name}; --target says {named.name}. Leave --target out, or"
            " find the corners of that target in the photographs: orthoscope detect."
        )

"""COLMAP's sparse model: cameras.txt or cameras.bin, with images.txt or images.bin for the poses.

COLMAP calls the centre of the first pixel (0.5, 0.5). A pose is camera from world, as a quaternion (w first)
and a translation; the world is the target's frame. Poses go along where the file is named cameras.txt or
cameras.bin, as COLMAP wants it; an empty points3D file then completes the model.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from orthoscope.files.whole_files import read_bytes
from orthoscope.formats.record import Contents, Files, Format, Holding
from orthoscope.formats.syntax import LARGEST_SIDE, Document, numbers, whole_number
from orthoscope.geometry.arrays import InputError
from orthoscope.geometry.pose import Pose, quaternion_from_rotation, rotation_from_quaternion
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics

__all__ = ["COLMAP"]

# COLMAP's models: number in binary files, how many focal lengths, how many coefficients.
MODELS = {
    "SIMPLE_PINHOLE": (0, 1, 0),
    "PINHOLE": (1, 2, 0),
    "SIMPLE_RADIAL": (2, 1, 1),
    "RADIAL": (3, 1, 2),
    "OPENCV": (4, 2, 4),
    "OPENCV_FISHEYE": (5, 2, 4),
    "FULL_OPENCV": (6, 2, 8),
    "FOV": (7, 2, 1),
    "SIMPLE_RADIAL_FISHEYE": (8, 1, 1),
    "RADIAL_FISHEYE": (9, 1, 2),
}
NAMES = {number: name for name, (number, _, _) in MODELS.items()}
OPENCV_8 = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
CAMERA_HEAD, IMAGE_HEAD = struct.Struct("<IiQQ"), struct.Struct("<I7dI")
# No sparse model of one camera has more; a binary file that says so is another's.
MOST_CAMERAS = 100_000


def _recognises(document: Document) -> bool:
    if document.content[:1] in (b"{", b"[", b"<", b"%"):
        return False
    return bool(_rows(document)) or _binary_cameras(document) is not None


def _read(document: Document, image_size: tuple[int, int] | None) -> Mapping[str, Contents]:
    rows = _rows(document)
    entries = (
        [(row[0], row[1], row[2:4], row[4:]) for row in rows] if rows else _binary_cameras(document) or []
    )
    poses = _poses(document)
    cameras = {}
    for key, model, sides, values in entries:
        width, height = (whole_number(side, "size of the image", document) for side in sides)
        camera = _camera(model, (width, height), numbers(list(values), "parameters", document), document)
        cameras[str(key)] = Contents(camera, poses.get(str(key), {}), name=str(key))
    return cameras


def _camera(model: str, size: tuple[int, int], values: list[float], document: Document) -> Camera:
    _, focals, coefficients = MODELS[model]
    if len(values) != focals + 2 + coefficients:
        raise document.refuse(
            f"has {len(values)} parameters of {model}; expected {focals + 2 + coefficients}"
        )
    cx, cy = values[focals : focals + 2]
    lens = COLMAP.lens(model, values[focals + 2 :], document)
    return Camera(size, Intrinsics(values[0], values[focals - 1], cx, cy), lens)


def _rows(document: Document) -> list[list[str]]:
    """The cameras of a text file, as words; none where it is no such file."""
    text = document.text
    if text is None or "\0" in text:
        return []
    rows = [line.split() for line in text.split("\n") if line.strip() and not line.lstrip().startswith("#")]
    return (
        rows if rows and all(len(row) > 4 and row[0].isdigit() and row[1] in MODELS for row in rows) else []
    )


def _binary_cameras(document: Document) -> list[tuple[int, str, tuple[int, int], list[float]]] | None:
    """The cameras of a binary file; None where it is no such file."""
    content = document.content
    if len(content) < 8 or not 1 <= (count := struct.unpack_from("<Q", content)[0]) <= MOST_CAMERAS:
        return None
    place, cameras = 8, []
    for _ in range(count):
        if len(content) < place + CAMERA_HEAD.size:
            return None
        key, number, width, height = CAMERA_HEAD.unpack_from(content, place)
        if number not in NAMES or not (0 < width <= LARGEST_SIDE and 0 < height <= LARGEST_SIDE):
            return None
        place += CAMERA_HEAD.size
        length = MODELS[NAMES[number]][1] + 2 + MODELS[NAMES[number]][2]
        if len(content) < place + 8 * length:
            return None
        cameras.append(
            (key, NAMES[number], (width, height), list(struct.unpack_from(f"<{length}d", content, place)))
        )
        place += 8 * length
    return cameras if place == len(content) else None


def _poses(document: Document) -> dict[str, dict[str, Pose]]:
    """The poses beside a file of cameras, by camera and photograph; none where there are none."""
    beside = document.path.with_name("images" + document.path.suffix)
    if document.path.stem != "cameras" or not beside.is_file():
        return {}
    images = Document(beside, read_bytes(beside))
    rows = _binary_images(images) if beside.suffix == ".bin" else _text_images(images)
    poses: dict[str, dict[str, Pose]] = {}
    for values, camera, image in rows:
        w, x, y, z, *translation = numbers(list(values), f"pose of {image}", images, count=7)
        if not w * w + x * x + y * y + z * z > 0:
            raise images.refuse(f"has a pose of {image} that does not turn; expected a quaternion")
        rotation = rotation_from_quaternion(np.array([w, x, y, z]))
        poses.setdefault(camera, {})[image] = Pose(rotation, np.array(translation))
    return poses


def _text_images(document: Document) -> list[tuple[list[Any], str, str]]:
    lines = [line for line in (document.text or "").split("\n") if not line.startswith("#")]
    rows = []
    for line in lines[::2]:
        words = line.split()
        if not words:
            continue
        if len(words) < 10:
            raise document.refuse("has a photograph of fewer than 10 columns; expected pose, camera and name")
        rows.append((words[1:8], words[8], words[9]))
    return rows


def _binary_images(document: Document) -> list[tuple[list[Any], str, str]]:
    content, place, rows = document.content, 8, []
    try:
        for _ in range(struct.unpack_from("<Q", content)[0]):
            _, *values, camera = IMAGE_HEAD.unpack_from(content, place)
            end = content.index(b"\0", place + IMAGE_HEAD.size)
            name = content[place + IMAGE_HEAD.size : end].decode()
            rows.append((values, str(camera), name))
            place = end + 9 + 24 * struct.unpack_from("<Q", content, end + 1)[0]
    except (struct.error, ValueError) as error:
        raise document.refuse("is cut off; expected COLMAP's images.bin") from error
    return rows


def _write(contents: Contents, place: Path) -> Files:
    camera = contents.camera
    holding = COLMAP.holding(camera.lens)
    assert holding is not None, "export hands in what the tool holds"
    fx, fy, cx, cy, _ = camera.intrinsics.as_tuple()
    values = [fx, fy, cx, cy, *holding.values(camera.lens)]
    binary = place.suffix.lower() == ".bin"
    files: dict[Path, str | bytes] = {
        place: _camera_bytes(camera, holding.word, values)
        if binary
        else _camera_text(camera, holding.word, values)
    }
    if contents.poses and place.stem == "cameras":
        files[place.with_name("images" + place.suffix)] = (
            _image_bytes(contents.poses) if binary else _image_text(contents.poses)
        )
        empty = struct.pack("<Q", 0) if binary else "# 3D points: none, only the target's poses are known\n"
        files[place.with_name("points3D" + place.suffix)] = empty
    return files


def _camera_text(camera: Camera, model: str, values: list[float]) -> str:
    width, height = camera.image_size
    parameters = " ".join(map(repr, values))
    return f"# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n1 {model} {width} {height} {parameters}\n"


def _camera_bytes(camera: Camera, model: str, values: list[float]) -> bytes:
    head = CAMERA_HEAD.pack(1, MODELS[model][0], *camera.image_size)
    return struct.pack("<Q", 1) + head + struct.pack(f"<{len(values)}d", *values)


def _image_text(poses: Mapping[str, Pose]) -> str:
    lines = ["# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME", "# POINTS2D[]: none"]
    for i, (image, pose) in enumerate(poses.items(), 1):
        if image.split() != [image]:
            raise InputError(
                f"image name {image!r} cannot stand in COLMAP's images.txt, which ends at the first blank."
                " Write cameras.bin, or rename the photograph."
            )
        values = [*quaternion_from_rotation(pose.rotation).tolist(), *pose.translation.tolist()]
        lines += [f"{i} {' '.join(map(repr, values))} 1 {image}", ""]
    return "\n".join(lines) + "\n"


def _image_bytes(poses: Mapping[str, Pose]) -> bytes:
    parts = [struct.pack("<Q", len(poses))]
    for i, (image, pose) in enumerate(poses.items(), 1):
        values = [*quaternion_from_rotation(pose.rotation).tolist(), *pose.translation.tolist()]
        parts += [IMAGE_HEAD.pack(i, *values, 1), image.encode(), b"\0", struct.pack("<Q", 0)]
    return b"".join(parts)


COLMAP = Format(
    name="colmap",
    title="COLMAP cameras",
    suffixes=(".txt", ".bin"),
    holdings=(
        Holding("brown", "PINHOLE", ()),
        Holding("brown", "OPENCV", ("k1", "k2", "p1", "p2")),
        Holding("brown", "FULL_OPENCV", OPENCV_8),
        Holding("rational", "FULL_OPENCV", OPENCV_8),
        Holding("kannala_brandt", "OPENCV_FISHEYE", ("k1", "k2", "k3", "k4"), farthest_deg=90.0),
        Holding("fov", "FOV", ("w",)),
        Holding("brown", "SIMPLE_PINHOLE", (), written=False),
        Holding("brown", "SIMPLE_RADIAL", ("k1",), written=False),
        Holding("brown", "RADIAL", ("k1", "k2"), written=False),
        Holding("kannala_brandt", "SIMPLE_RADIAL_FISHEYE", ("k1",), written=False),
        Holding("kannala_brandt", "RADIAL_FISHEYE", ("k1", "k2"), written=False),
    ),
    recognises=_recognises,
    read=_read,
    write=_write,
    pixel_origin=0.5,
    poses=True,
    remarks="Poses go along where the file is named cameras.txt or cameras.bin; of images and points nothing"
    " is read.",
)

"""MATLAB: a .mat file with the fields of cameraParameters, or a .m line that makes cameraIntrinsics.

MATLAB calls the centre of the first pixel (1, 1), knows a skew, and has OpenCV's k1 k2 k3 p1 p2. A .mat is of
version 5: elements of a type, a length and data, padded to 8 bytes; a struct is a matrix whose elements are
matrices, and a compressed element is zlib's. An object that MATLAB itself saved is closed to others:
`toStruct` opens it. Its fish-eye is Scaramuzza's, which no lens here is. MAT-File Format, The MathWorks.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from orthoscope.formats.record import Contents, Files, Format, Holding
from orthoscope.formats.syntax import LARGEST_FILE, Document, numbers, whole_number
from orthoscope.geometry.arrays import ndarray
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics

__all__ = ["MATLAB"]

HEADER = b"MATLAB 5.0 MAT-file"
# Types of elements and classes of arrays that a camera needs.
INT8, UINT8, INT16, UINT16, INT32, UINT32, SINGLE, DOUBLE, INT64, UINT64, MATRIX, COMPRESSED, UTF8 = (
    1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 14, 15, 16,
)  # fmt: skip
DTYPES = {
    INT8: "i1", UINT8: "u1", INT16: "i2", UINT16: "u2", INT32: "i4", UINT32: "u4",
    SINGLE: "f4", DOUBLE: "f8", INT64: "i8", UINT64: "u8", UTF8: "u1",
}  # fmt: skip
STRUCT_CLASS, CHAR_CLASS, DOUBLE_CLASS, OPAQUE_CLASS = 2, 4, 6, 17
NUMERIC_CLASSES = range(DOUBLE_CLASS, 16)
# A field's name has so many bytes.
NAME_LENGTH = 32
# What reading damaged bytes may raise; a generator that ends too soon is a RuntimeError.
DAMAGED = (struct.error, zlib.error, ValueError, LookupError, ArithmeticError, MemoryError, RuntimeError)
# Structs stand within structs at most so deep.
DEEPEST_STRUCTS = 8
# A struct has at most so many fields.
MOST_FIELDS = 4096


def _recognises(document: Document) -> bool:
    return document.content.startswith(b"MATLAB") or "cameraIntrinsics(" in (document.text or "")


def _read(document: Document, image_size: tuple[int, int] | None) -> Mapping[str, Contents]:
    if not document.content.startswith(b"MATLAB"):
        return {"camera": Contents(_of_line(document, image_size))}
    if not document.content.startswith(HEADER):
        raise document.refuse("is not of MAT-file version 5", "In MATLAB: save(name, 'cameraParams', '-v7').")
    little = document.content[126:128] == b"IM"
    try:
        variables = dict(_variables(document.content[128:], "<" if little else ">", 0))
    except DAMAGED as error:
        raise document.refuse(f"is damaged ({error}); expected a MAT-file of version 5") from error
    cameras = {name: fields for name, fields in _structs(variables) if "RadialDistortion" in fields}
    if not cameras:
        raise document.refuse(
            "has no struct with RadialDistortion; an object that MATLAB saved is closed to others",
            "In MATLAB: cameraParams = toStruct(cameraParams); save(name, 'cameraParams').",
        )
    return {
        name: Contents(_of_fields(fields, document, image_size), name=name)
        for name, fields in cameras.items()
    }


def _of_fields(fields: Mapping[str, Any], document: Document, image_size: tuple[int, int] | None) -> Camera:
    if "K" in fields or "IntrinsicMatrix" in fields:
        values = np.array(
            numbers(_plain(fields.get("K", fields.get("IntrinsicMatrix"))), "K", document, count=9)
        )
        matrix = values.reshape(3, 3) if "K" in fields else values.reshape(3, 3).T
        intrinsics = Intrinsics(matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], matrix[0, 1])
    else:
        fx, fy = numbers(_plain(fields.get("FocalLength")), "FocalLength", document, count=2)
        cx, cy = numbers(_plain(fields.get("PrincipalPoint")), "PrincipalPoint", document, count=2)
        (skew,) = numbers(_plain(fields.get("Skew", np.zeros((1, 1)))), "Skew", document, count=1)
        intrinsics = Intrinsics(fx, fy, cx, cy, skew)
    radial = numbers(_plain(fields["RadialDistortion"]), "RadialDistortion", document)
    tangential = numbers(
        _plain(fields.get("TangentialDistortion", np.zeros((1, 2)))),
        "TangentialDistortion",
        document,
        count=2,
    )
    return _camera(intrinsics, radial, tangential, _plain(fields.get("ImageSize")), document, image_size)


def _camera(
    intrinsics: Intrinsics,
    radial: list[float],
    tangential: list[float],
    sides: Any,
    document: Document,
    image_size: tuple[int, int] | None,
) -> Camera:
    if len(radial) not in (2, 3):
        raise document.refuse(f"has {len(radial)} coefficients in RadialDistortion; expected 2 or 3")
    values = [*radial, 0.0][:3] + tangential
    if image_size is None:
        if not isinstance(sides, list) or not sides:
            raise document.refuse(
                "does not say how large its images are (ImageSize)",
                "Hand in image_size (--image-size 640x480).",
            )
        rows, columns = numbers(sides, "ImageSize", document, count=2)
        image_size = whole_number(columns, "ImageSize", document), whole_number(rows, "ImageSize", document)
    return Camera(image_size, intrinsics, MATLAB.lens("cameraParameters", values, document))


def _of_line(document: Document, image_size: tuple[int, int] | None) -> Camera:
    """The camera of a line `cameraIntrinsics([fx fy], [cx cy], [rows columns], 'RadialDistortion', [..],
    ...)`.
    """
    text = document.text or ""
    whole = re.search(r"cameraIntrinsics\(([^()]*)\)", text)
    call = whole and re.match(r"\s*(\[[^\]]*\]|[\w.+-]+)\s*,\s*\[([^\]]*)\]\s*,\s*\[([^\]]*)\]", whole[1])
    if not whole or not call:
        raise document.refuse("has no whole cameraIntrinsics([fx fy], [cx cy], [rows columns], ...)")
    focal = numbers(call[1].strip("[]"), "focal length", document)
    named = {
        name: numbers(values.strip("[]"), name, document)
        for name, values in re.findall(
            r"['\"](\w+)['\"]\s*,\s*(\[[^\]]*\]|[\d.eE+-]+)", whole[1][call.end() :]
        )
    }
    skew = [*named.get("Skew", []), 0.0][0]
    cx, cy = numbers(call[2], "principal point", document, count=2)
    sides = numbers(call[3], "image size", document, count=2)
    tangential = [*named.get("TangentialDistortion", []), 0.0, 0.0][:2]
    if not 1 <= len(focal) <= 2:
        raise document.refuse(f"has {len(focal)} focal lengths; expected fx and fy")
    return _camera(
        Intrinsics(focal[0], focal[-1], cx, cy, skew),
        named.get("RadialDistortion", [0.0, 0.0]),
        tangential,
        sides,
        document,
        image_size,
    )


def _plain(value: Any) -> Any:
    """An array row by row as a list."""
    return value.ravel().tolist() if isinstance(value, ndarray) else value


def _structs(variables: Mapping[str, Any], within: str = "") -> Iterator[tuple[str, Mapping[str, Any]]]:
    """All structs by name, those in structs too."""
    for name, value in variables.items():
        if isinstance(value, dict):
            yield within + name, value
            yield from _structs(value, f"{within}{name}.")


def _variables(content: bytes, order: str, depth: int) -> Iterator[tuple[str, Any]]:
    """Name and value of each matrix in the bytes."""
    if depth > DEEPEST_STRUCTS:
        raise ValueError("structs within structs without end")
    for kind, data in _elements(content, order):
        if kind == COMPRESSED:
            unpacker = zlib.decompressobj()
            unpacked = unpacker.decompress(data, LARGEST_FILE)
            if unpacker.unconsumed_tail:
                raise ValueError("unpacked it is too large")
            yield from _variables(unpacked, order, depth + 1)
        elif kind == MATRIX and data:
            yield _matrix(data, order, depth)


def _elements(content: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """Type and data of each element."""
    place = 0
    while place + 8 <= len(content):
        kind, length = struct.unpack_from(order + "II", content, place)
        if kind >> 16:  # a small element: its data stand in the place of its length
            yield kind & 0xFFFF, content[place + 4 : place + 4 + min(kind >> 16, 4)]
            place += 8
            continue
        if place + 8 + length > len(content):
            raise ValueError("cut off")
        yield kind, content[place + 8 : place + 8 + length]
        place += 8 + (length if kind == COMPRESSED else -(-length // 8) * 8)


def _matrix(data: bytes, order: str, depth: int) -> tuple[str, Any]:
    parts = _elements(data, order)
    flags = struct.unpack_from(order + "I", next(parts)[1])[0]
    kind = flags & 0xFF
    if kind == OPAQUE_CLASS:
        return "object", None
    shape = _array(*next(parts), order).astype(np.int64)
    name = next(parts)[1].decode("ascii", "replace")
    if kind == STRUCT_CLASS:
        length = int(_array(*next(parts), order)[0])
        names = next(parts)[1]
        if not 1 <= length <= len(names) or len(names) // length > MOST_FIELDS or int(shape.prod()) != 1:
            raise ValueError("a struct without fields")
        fields = [
            names[i : i + length].split(b"\0")[0].decode("ascii", "replace")
            for i in range(0, len(names), length)
        ]
        values = [
            _matrix(part, order, depth + 1)[1]
            if kind == MATRIX and part and depth < DEEPEST_STRUCTS
            else None
            for kind, part in parts
        ]
        return name, dict(zip(fields, values, strict=True))
    if kind in NUMERIC_CLASSES:
        values = _array(*next(parts), order)
        return name, values.reshape(tuple(shape[:2]), order="F").astype(float)
    return name, None


def _array(kind: int, data: bytes, order: str) -> ndarray:
    return np.frombuffer(data, dtype=np.dtype(order + DTYPES[kind]))


def _write(contents: Contents, place: Path) -> Files:
    camera = contents.camera
    holding = MATLAB.holding(camera.lens)
    assert holding is not None, "export hands in what the tool holds"
    k1, k2, k3, p1, p2 = holding.values(camera.lens)
    fx, fy, cx, cy, skew = camera.intrinsics.as_tuple()
    width, height = camera.image_size
    if place.suffix.lower() == ".m":
        return {
            place: f"{contents.name} = cameraIntrinsics([{fx!r} {fy!r}], [{cx!r} {cy!r}], [{height}"
            f" {width}], ..."
            f"\n    'RadialDistortion', [{k1!r} {k2!r} {k3!r}], 'TangentialDistortion', [{p1!r} {p2!r}], ..."
            f"\n    'Skew', {skew!r});\n"
        }
    fields: dict[str, ndarray | str] = {
        "K": camera.intrinsics.matrix,
        "IntrinsicMatrix": camera.intrinsics.matrix.T,
        "ImageSize": np.array([[height, width]]),
        "RadialDistortion": np.array([[k1, k2, k3]]),
        "TangentialDistortion": np.array([[p1, p2]]),
        "FocalLength": np.array([[fx, fy]]),
        "PrincipalPoint": np.array([[cx, cy]]),
        "Skew": np.array([[skew]]),
        "EstimateSkew": np.array([[float(skew != 0.0)]]),
        "NumRadialDistortionCoefficients": np.array([[3.0]]),
        "EstimateTangentialDistortion": np.array([[float(p1 != 0.0 or p2 != 0.0)]]),
        "WorldUnits": "m",
    }
    head = (HEADER + b", written by orthoscope").ljust(124) + struct.pack("<H", 0x0100) + b"IM"
    return {place: head + _struct("cameraParams", fields)}


def _element(kind: int, data: bytes) -> bytes:
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def _head(kind: int, shape: tuple[int, int], name: str) -> bytes:
    flags = _element(UINT32, struct.pack("<II", kind, 0))
    return flags + _element(INT32, struct.pack("<ii", *shape)) + _element(INT8, name.encode())


def _struct(name: str, fields: Mapping[str, ndarray | str]) -> bytes:
    names = b"".join(field.encode().ljust(NAME_LENGTH, b"\0") for field in fields)
    length = struct.pack("<HHi", INT32, 4, NAME_LENGTH)  # a small element, as MATLAB wants it here
    values = b"".join(_value(value) for value in fields.values())
    return _element(MATRIX, _head(STRUCT_CLASS, (1, 1), name) + length + _element(INT8, names) + values)


def _value(value: ndarray | str) -> bytes:
    if isinstance(value, str):
        data = _element(UINT16, value.encode("utf-16-le"))
        return _element(MATRIX, _head(CHAR_CLASS, (1, len(value)), "") + data)
    data = _element(DOUBLE, np.asarray(value, dtype="<f8").tobytes(order="F"))
    rows, columns = value.shape
    return _element(MATRIX, _head(DOUBLE_CLASS, (rows, columns), "") + data)


MATLAB = Format(
    name="matlab",
    title="MATLAB cameraParameters",
    suffixes=(".mat", ".m"),
    holdings=(Holding("brown", "cameraParameters", ("k1", "k2", "k3", "p1", "p2")),),
    recognises=_recognises,
    read=_read,
    write=_write,
    skew=True,
    pixel_origin=1.0,
    remarks="The .mat is a struct of the fields, the .m a call of cameraIntrinsics; an object that MATLAB"
    " saved must go"
    " through toStruct.",
)

"""Damaged files: every reader ends in a value or an `InputError`, soon, and with no more memory than a file
needs.

Files of every format are made, and mutated by a seeded generator: bytes changed, cut, repeated, doubled;
numbers put in the place of numbers (huge, negative, no number), lines and brackets moved.
`ORTHOSCOPE_MUTANTS` asks for more:

    ORTHOSCOPE_MUTANTS=100000 pytest tests/formats/test_fuzz.py -n 0
"""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from helpers.cameras import SIZE, camera_held, poses
from orthoscope.fitting.calibration import Calibration, Uncertainty
from orthoscope.formats.corners_vnl import read_vnl, write_vnl
from orthoscope.formats.export import export
from orthoscope.formats.load import load_camera
from orthoscope.formats.own.json import load, save
from orthoscope.formats.record import Contents
from orthoscope.formats.table import FORMATS
from orthoscope.geometry.arrays import InputError
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown
from orthoscope.simulation.scene import Scene, random_views, simulate_detections
from orthoscope.targets.target import chessboard

MUTANTS = int(os.environ.get("ORTHOSCOPE_MUTANTS", "2000"))
# Seconds that one damaged file may take; a whole one takes milliseconds.
SLOWEST = 5.0
NUMBERS = (
    *(b"1e308", b"-1e308", b"1e999", b"NaN", b".nan", b"Infinity", b"-1", b"0", b"9223372036854775808"),
    *(b"99999999999999999999999", b"1_0", b'"x"', b"null", b"[]", b"{}", b"1e-320", b"true", b"640.5"),
)
NUMBER = re.compile(rb"-?\d+\.?\d*(?:[eE][+-]?\d+)?")


def own_files(folder: Path) -> dict[str, bytes]:
    """Our own files and a table of corners, of a small scene."""
    rng = np.random.default_rng(0)
    camera, target = (
        Camera(SIZE, Intrinsics(500.0, 501.0, 320.0, 240.0), Brown(k1=-0.1)),
        chessboard(4, 3, 0.02),
    )
    views = random_views(camera, target, 3, rng=rng)
    scene = Scene(camera, target, views)
    detections = simulate_detections(scene, noise_px=0.1, rng=rng)
    calibration = Calibration(
        camera=camera,
        camera_from_target=views,
        detections=detections,
        method="fccm",
        settings={"lens": "brown"},
        uncertainty=Uncertainty(("fx", "fy"), np.eye(2)),
        status="converged",
        steps=3,
        version="0",
    )
    for name, thing in {"scene": scene, "detections": detections, "calibration": calibration}.items():
        save(thing, folder / f"{name}.json")
    write_vnl(detections, folder / "corners.vnl")
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.fixture(scope="module")
def seeds(tmp_path_factory) -> dict[str, tuple[bytes, Callable[[Path], object]]]:
    """By name: the bytes of a whole file, and what reads it."""
    folder = tmp_path_factory.mktemp("seeds")
    found = {}
    for name, content in own_files(folder).items():
        if name == "corners.vnl":
            found[name] = (content, lambda path: read_vnl(path, chessboard(4, 3, 0.02), SIZE))
        else:
            found[name] = (content, load)
            if name != "detections.json":
                found[f"{name} for its camera"] = (content, load_camera)
    for tool, record in FORMATS.items():
        for suffix in dict.fromkeys(record.suffixes):
            holding = next(
                holding for holding in record.holdings if holding.coefficients or tool == "orthoscope"
            )
            place = folder / tool / f"cameras{suffix}"
            export(Contents(camera_held(record, holding), poses()), place, tool)
            found[f"{tool}{suffix}"] = (place.read_bytes(), lambda path: load_camera(path, image_size=None))
            if not record.knows_size:
                found[f"{tool}{suffix}"] = (
                    place.read_bytes(),
                    lambda path: load_camera(path, image_size=SIZE),
                )
    return found


def mutated(content: bytes, rng: np.random.Generator) -> bytes:
    """The bytes, damaged in one to three places."""
    for _ in range(rng.integers(1, 4)):
        content = MUTATIONS[rng.integers(len(MUTATIONS))](content, rng)
    return content


def place_in(content: bytes, rng: np.random.Generator) -> int:
    return int(rng.integers(len(content) + 1))


def other_byte(content: bytes, rng: np.random.Generator) -> bytes:
    at = place_in(content, rng)
    return content[:at] + bytes([rng.integers(256)]) + content[at + 1 :]


def cut(content: bytes, rng: np.random.Generator) -> bytes:
    return content[: place_in(content, rng)]


def without_part(content: bytes, rng: np.random.Generator) -> bytes:
    at = place_in(content, rng)
    return content[:at] + content[at + int(rng.integers(1, 40)) :]


def repeated(content: bytes, rng: np.random.Generator) -> bytes:
    at, end = sorted((place_in(content, rng), place_in(content, rng)))
    return content[:end] + content[at:end] + content[end:]


def another_number(content: bytes, rng: np.random.Generator) -> bytes:
    found = list(NUMBER.finditer(content[:20_000]))
    if not found:
        return content
    number = found[rng.integers(len(found))]
    return content[: number.start()] + NUMBERS[rng.integers(len(NUMBERS))] + content[number.end() :]


def nested(content: bytes, rng: np.random.Generator) -> bytes:
    at = place_in(content, rng)
    return (
        content[:at]
        + [b"[", b"{", b"(", b"- ", b"<a>"][rng.integers(5)] * int(rng.integers(1, 3000))
        + content[at:]
    )


def without_line(content: bytes, rng: np.random.Generator) -> bytes:
    lines = content.split(b"\n")
    del lines[rng.integers(len(lines))]
    return b"\n".join(lines)


def bad_text(content: bytes, rng: np.random.Generator) -> bytes:
    at = place_in(content, rng)
    return (
        content[:at]
        + [b"\xff\xfe", b"\x00", b"\xed\xa0\x80", b"\x1b[31m", b"&a", b"*a", b"!!x "][rng.integers(7)]
        + content[at:]
    )


MUTATIONS = (
    other_byte,
    cut,
    without_part,
    repeated,
    another_number,
    another_number,
    nested,
    without_line,
    bad_text,
)


def test_every_seed_is_read(seeds, tmp_path):
    for name, (content, read) in seeds.items():
        (tmp_path / "whole").write_bytes(content)
        assert read(tmp_path / "whole") is not None, name


def test_a_damaged_file_is_a_value_or_an_input_error(seeds, tmp_path):
    rng, names = np.random.default_rng(20260101), list(seeds)
    place, failures, slow = tmp_path / "damaged", [], []
    for i in range(MUTANTS):
        name = names[i % len(names)]
        content, read = seeds[name]
        damaged = mutated(content, rng)
        place.write_bytes(damaged)
        started = time.process_time()
        try:
            read(place)
        except InputError as error:
            if "\x1b" in str(error):
                failures.append((i, name, "an escape in the message"))
        except Exception as error:  # the point of this test
            failures.append((i, name, f"{type(error).__name__}: {error}"[:200]))
        if time.process_time() - started > SLOWEST:
            slow.append((i, name))
    kinds = {(name, message.split(":")[0]): message for _, name, message in failures}
    assert not failures, f"{len(failures)} of {MUTANTS}: {list(kinds.items())[:20]}"
    assert not slow, slow[:10]

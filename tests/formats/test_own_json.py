"""Our own files: exact, the same each time, pleasant to read, and clear about what is wrong with them."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from helpers.laws import FREE_LENSES_TO_TRY, for_every_lens
from orthoscope.fitting.calibration import Calibration, Candidate, Uncertainty, Variances
from orthoscope.formats.own.json import load, load_calibration, load_detections, load_own_camera, save
from orthoscope.formats.own.json_layout import lay_out
from orthoscope.geometry.arrays import InputError
from orthoscope.geometry.pose import Pose, rotation_from_vector
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.free import FreeLens
from orthoscope.models.lenses.lens import Lens
from orthoscope.models.lenses.table import Brown, KannalaBrandt
from orthoscope.models.target_shape import TargetShape
from orthoscope.targets.detections import Detections, Outlier, SetAside, View
from orthoscope.targets.target import Target, chessboard

BOARD = chessboard(4, 3, 0.025)
CAMERA = Camera((640, 480), Intrinsics(500.1, 501.3, 1 / 3, 240.0, 0.1), Brown(k1=-0.2, p1=1e-17))


def some_detections(views: int = 3) -> Detections:
    generator = np.random.default_rng(0)
    seen = [
        View(
            f"left {i}.jpg",
            ids := generator.permutation(12)[: 12 - i],
            generator.uniform(0, 400, (len(ids), 2)),
        )
        for i in range(views)
    ]
    aside = (SetAside("blurred “ä”.jpg", 'no chessboard "4x3" found'),)
    return Detections(
        BOARD,
        (640, 480),
        tuple(seen),
        aside,
        (Outlier("left 1.jpg", 11, (1 / 3, 1e-17), "14.2 px from the rest"),),
    )


def some_calibration() -> Calibration:
    generator = np.random.default_rng(1)
    poses = [Pose(rotation_from_vector(generator.normal(size=3)), generator.normal(size=3)) for _ in range(3)]
    return Calibration(
        camera=CAMERA,
        camera_from_target=tuple(poses),
        detections=some_detections(),
        method="fccm",
        settings={"lens": "brown", "loss": "cauchy", "loss_scale": 0.1, "max_steps": 200, "skew": True},
        uncertainty=Uncertainty(("fx=fy", "k1"), np.array([[0.3, 1e-9], [1e-9, 1 / 7]])),
        status="converged: the step no longer changes the parameters",
        steps=9,
        version="0.1.0",
        assumptions=("the pixels are square",),
    )


def a_decoupled_calibration() -> Calibration:
    """With all that the default method tells beside a camera."""
    generator = np.random.default_rng(2)
    return replace(
        some_calibration(),
        camera=Camera((640, 480), CAMERA.intrinsics, FREE_LENSES_TO_TRY["free over brown"]),
        method="decoupled",
        settings={
            "lens": "free",
            "shape": "free",
            "base": "brown",
            "first_lens": "free",
            "fit": "joint",
            "skew": False,
        },
        target_shape=TargetShape("free", 1e-3 * generator.standard_normal((12, 3))),
        parameters=41.0 + 1 / 3,
        uncertainty=Uncertainty(("fx", "k1"), np.array([[0.3, 0.0], [0.0, 1 / 7]]), np.eye(2) / 9),
        variances=Variances(0.01, (1e-9, 2e-9), (1e-10, 2e-10, 1 / 3), 1e-8, 0.2, 1.5),
        candidates=(
            Candidate("flat", "brown", 0.3, 0.01, 0.2),
            Candidate("smooth", "brown", 1 / 3, float("nan"), 1 / 7, "brown", "joint", 3),
            Candidate("free", "rational", *[float("nan")] * 3, "brown", "pairs", 0),
        ),
        free_camera=Camera((640, 480), CAMERA.intrinsics, FREE_LENSES_TO_TRY["free over kannala_brandt"]),
    )


def assert_same_detections(a: Detections, b: Detections) -> None:
    assert (a.image_size, a.set_aside, a.outliers) == (b.image_size, b.set_aside, b.outliers)
    assert (a.target.name, a.target.grid) == (b.target.name, b.target.grid)
    assert_array_equal(a.target.points, b.target.points)
    for line_a, line_b in zip(a.target.lines, b.target.lines, strict=True):
        assert_array_equal(line_a, line_b)
    for view_a, view_b in zip(a.views, b.views, strict=True):
        assert view_a.image == view_b.image
        assert_array_equal(view_a.ids, view_b.ids)
        assert_array_equal(view_a.pixels, view_b.pixels)


def assert_same_camera(a: Camera, b: Camera) -> None:
    assert (a.image_size, a.intrinsics.as_tuple()) == (b.image_size, b.intrinsics.as_tuple())
    assert_same_lens(a.lens, b.lens)
    assert (a.lens_frame is None) == (b.lens_frame is None)
    assert a.lens_frame is None or b.lens_frame is None or a.lens_frame.as_tuple() == b.lens_frame.as_tuple()


def assert_same_lens(a: Lens, b: Lens) -> None:
    assert type(a) is type(b)
    assert_array_equal(a.coefficients, b.coefficients)
    if isinstance(a, FreeLens) and isinstance(b, FreeLens):
        assert_same_lens(a.base, b.base)
        assert_array_equal(a.over.coefficients, b.over.coefficients)
        assert_array_equal(a.over.lattice.origin, b.over.lattice.origin)
        assert_array_equal(a.over.lattice.step, b.over.lattice.step)
        assert a.over.lattice.shape == b.over.lattice.shape


def test_detections_come_back_to_the_last_bit(tmp_path):
    save(some_detections(), tmp_path / "detections.json")
    assert_same_detections(load_detections(tmp_path / "detections.json"), some_detections())


def test_detections_without_outliers_say_nothing_of_them(tmp_path):
    save(replace(some_detections(), outliers=()), tmp_path / "detections.json")
    assert "outliers" not in (tmp_path / "detections.json").read_text()
    assert load_detections(tmp_path / "detections.json").outliers == ()


@given(st.lists(st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 2), max_size=12))
def test_any_pixels_come_back_to_the_last_bit(tmp_path_factory, corners):
    path = tmp_path_factory.mktemp("pixels") / "detections.json"
    pixels = np.array(corners, dtype=float).reshape(-1, 2)
    save(Detections(BOARD, (640, 480), (View("a.jpg", np.arange(len(corners)), pixels),)), path)
    again = load_detections(path).views[0].pixels
    assert again.tobytes() == pixels.tobytes()  # bytes: -0.0 too


def test_a_target_without_grid_and_lines_comes_back(tmp_path):
    free = Target("three dots", np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.2, 0.0]]))
    detections = Detections(free, (640, 480), ())
    save(detections, tmp_path / "detections.json")
    assert_same_detections(load_detections(tmp_path / "detections.json"), detections)


@pytest.mark.parametrize("made", [some_calibration(), a_decoupled_calibration()], ids=["fccm", "decoupled"])
def test_a_calibration_comes_back_to_the_last_bit(tmp_path, made):
    save(made, tmp_path / "calibration.json")
    again = load_calibration(tmp_path / "calibration.json")
    assert_same_camera(again.camera, made.camera)
    assert_same_detections(again.detections, made.detections)
    for pose_a, pose_b in zip(again.camera_from_target, made.camera_from_target, strict=True):
        assert_array_equal(pose_a.rotation, pose_b.rotation)
        assert_array_equal(pose_a.translation, pose_b.translation)
    assert again.uncertainty.names == made.uncertainty.names
    assert_array_equal(again.uncertainty.covariance, made.uncertainty.covariance)
    assert_array_equal(again.uncertainty.model, made.uncertainty.model)
    assert again.variances == made.variances
    for name in ("method", "settings", "status", "steps", "version", "assumptions", "parameters"):
        assert getattr(again, name) == getattr(made, name), name
    assert again.target_shape.kind == made.target_shape.kind
    assert_array_equal(again.target_shape.displacements, made.target_shape.displacements)
    assert [candidate[:2] for candidate in again.candidates] == [
        candidate[:2] for candidate in made.candidates
    ]
    assert_array_equal(
        [candidate[2:] for candidate in again.candidates], [candidate[2:] for candidate in made.candidates]
    )  # NaN is NaN


def test_the_free_camera_beside_a_formula_comes_back(tmp_path):
    made = a_decoupled_calibration()
    save(made, tmp_path / "calibration.json")
    again = load_calibration(tmp_path / "calibration.json").free_camera
    assert again is not None
    assert made.free_camera is not None
    assert_same_camera(again, made.free_camera)
    save(replace(made, free_camera=None), tmp_path / "calibration.json")
    assert load_calibration(tmp_path / "calibration.json").free_camera is None


def test_what_no_view_could_judge_is_null_in_the_file(tmp_path):
    save(a_decoupled_calibration(), tmp_path / "calibration.json")
    content = json.loads(
        (tmp_path / "calibration.json").read_text(),
        parse_constant=lambda name: pytest.fail(f"{name} is no JSON"),
    )
    assert content["candidates"][1:] == [
        {
            "target": "smooth",
            "lens": "brown",
            "base": "brown",
            "fit": "joint",
            "views": 3,
            "held_out_px": 1 / 3,
            "standard_error_px": None,
            "loses_px": 1 / 7,
        },
        {
            "target": "free",
            "lens": "rational",
            "base": "brown",
            "fit": "pairs",
            "views": 0,
            "held_out_px": None,
            "standard_error_px": None,
            "loses_px": None,
        },
    ]


def test_a_flat_target_and_a_formula_are_written_without_saying_so(tmp_path):
    save(some_calibration(), tmp_path / "calibration.json")
    content = json.loads((tmp_path / "calibration.json").read_text())
    assert not {"target_shape", "candidates", "free_camera"} & set(content)
    assert set(content["camera"]["lens"]) == {"name", "coefficients"}


@for_every_lens
def test_a_camera_with_any_lens_comes_back(tmp_path, lens):
    for frame in (None, Intrinsics(480.0, 490.0, 300.0, 220.0)):
        camera = Camera((640, 480), CAMERA.intrinsics, lens, frame)
        save(camera, tmp_path / "camera.json")
        assert_same_camera(load_own_camera(tmp_path / "camera.json"), camera)


def test_the_camera_and_the_detections_of_a_calibration_can_be_had_alone(tmp_path):
    save(some_calibration(), tmp_path / "calibration.json")
    assert_same_camera(load_own_camera(tmp_path / "calibration.json"), CAMERA)
    assert_same_detections(load_detections(tmp_path / "calibration.json"), some_detections())


def test_load_gives_whatever_the_file_holds(tmp_path):
    for thing in (some_detections(), some_calibration(), CAMERA):
        save(thing, tmp_path / "thing.json")
        assert type(load(tmp_path / "thing.json")) is type(thing)


@pytest.mark.parametrize(
    "thing",
    [some_detections(), some_calibration(), a_decoupled_calibration(), CAMERA],
    ids=["detections", "fccm", "decoupled", "camera"],
)
def test_what_is_saved_twice_is_the_same_to_the_byte(tmp_path, thing):
    save(thing, tmp_path / "one.json")
    save(load(tmp_path / "one.json"), tmp_path / "two.json")
    assert (tmp_path / "one.json").read_bytes() == (tmp_path / "two.json").read_bytes()


def test_a_file_has_a_corner_a_line(tmp_path):
    save(some_detections(), tmp_path / "detections.json")
    text = (tmp_path / "detections.json").read_text()
    assert text.startswith('{\n  "orthoscope": "detections",\n  "format": 1,\n  "image_size": [640, 480],\n')
    assert text.endswith("}\n")
    assert (
        len(re.findall(r"^ {8}\[\d+, [\d.]+, [\d.]+\],?$", text, flags=re.MULTILINE))
        == some_detections().corners
    )
    assert max(map(len, text.splitlines())) < 120


def test_a_file_is_json_to_other_programs(tmp_path):
    save(some_calibration(), tmp_path / "calibration.json")
    content = json.loads((tmp_path / "calibration.json").read_text())
    assert content["camera"]["lens"]["coefficients"]["k1"] == -0.2
    assert content["camera"]["intrinsics"]["cx"] == 1 / 3


@pytest.mark.parametrize(
    "value",
    [
        {},
        [],
        [[]],
        {"a": []},
        "x",
        1,
        None,
        [1, [2]],
        [["a", "]], ["], [1]],
        [[[1, 2], [3]]],
        {"a": {"b": [{"c": 1}]}},
        [{}, []],
    ],
)
def test_any_plain_value_is_laid_out_as_json(value):
    assert json.loads(lay_out(value)) == value


def written(tmp_path, thing, *changes: tuple[str, str]) -> str:
    """A file of ours with its text changed; each change must hit."""
    path = tmp_path / "file.json"
    save(thing, path)
    text = path.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path.write_text(text)
    return str(path)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"calibration\.json does not exist"):
        load(tmp_path / "calibration.json")


@pytest.mark.parametrize("share", [0.1, 0.5, 0.99])
def test_a_file_that_is_cut_off_is_refused(tmp_path, share):
    save(some_detections(), tmp_path / "file.json")
    content = (tmp_path / "file.json").read_bytes()
    (tmp_path / "file.json").write_bytes(content[: int(share * len(content))])
    with pytest.raises(InputError, match=r"file\.json is cut off; expected whole JSON"):
        load(tmp_path / "file.json")


@pytest.mark.parametrize("content", ["", " \n"])
def test_an_empty_file_is_refused(tmp_path, content):
    (tmp_path / "file.json").write_text(content)
    with pytest.raises(InputError, match=r"file\.json is empty"):
        load(tmp_path / "file.json")


@pytest.mark.parametrize(
    "content", [b"hello", b"{'a': 1}", b"\xff\xd8\xff\xe0", b'{"orthoscope": "camera" "format": 1}']
)
def test_a_file_that_is_no_json_is_refused(tmp_path, content):
    (tmp_path / "file.json").write_bytes(content)
    with pytest.raises(InputError, match=r"file\.json is not (JSON|text)"):
        load(tmp_path / "file.json")


@pytest.mark.parametrize(
    "content",
    ["[1, 2]", "{}", '{"camera_matrix": []}', '{"orthoscope": 3}', '{"orthoscope": "map", "format": 1}', "7"],
)
def test_json_of_another_program_is_refused(tmp_path, content):
    (tmp_path / "file.json").write_text(content)
    with pytest.raises(
        InputError, match=r"file\.json is JSON, but not of orthoscope; expected an object that opens with"
    ):
        load(tmp_path / "file.json")


def test_a_file_of_a_newer_version_is_refused_whatever_it_holds(tmp_path):
    (tmp_path / "file.json").write_text('{"orthoscope": "hologram", "format": 2, "light": [1, 2]}')
    with pytest.raises(
        InputError, match=r"written by a newer orthoscope \(format 2; this one reads up to 1\). Upgrade"
    ):
        load(tmp_path / "file.json")


@pytest.mark.parametrize("word", ["NaN", "Infinity", "-Infinity"])
def test_a_number_that_is_none_is_named_with_its_line(tmp_path, word):
    path = written(tmp_path, some_detections(), ("[640, 480]", f"[{word}, 480]"))
    with pytest.raises(InputError, match=rf"line 4, has {word}; expected finite numbers"):
        load(path)


def test_a_photograph_called_nan_is_none_the_worse(tmp_path):
    path = written(tmp_path, some_detections(), ('"left 0.jpg"', '"NaN"'))
    assert load_detections(path).views[0].image == "NaN"


FAULTS = {
    "a word for a number": ([('"format": 1', '"format": "1"')], r"but not of orthoscope"),
    "a null": ([("[640, 480]", "[640, null]")], r"Expected `int`, got `null` - at `\$.image_size\[1\]`"),
    "a field missing": ([('"views"', '"view"')], r"unknown field `view`|missing required field `views`"),
    "a corner twice": ([("[2, ", "[5, "), ("[11, ", "[5, ")], r"has corner 5 more than once"),
    "a corner too many": (
        [("[11, ", "[12, ")],
        r"has corner 12; target 'chessboard:4x3:25mm' has corners 0 to 11",
    ),
    "a photograph twice": ([("left 1.jpg", "left 0.jpg")], r"view 'left 0.jpg' is there twice"),
    "a number too large": ([("[640, 480]", "[1e999, 480]")], r"not JSON|Expected `int`|out of range"),
}


@pytest.mark.parametrize(("changes", "message"), FAULTS.values(), ids=FAULTS.keys())
def test_faulty_detections_are_refused_with_the_file_and_the_fault(tmp_path, changes, message):
    path = written(tmp_path, some_detections(), *changes)
    with pytest.raises(InputError, match=message) as raised:
        load(path)
    assert path in str(raised.value)


CALIBRATION_FAULTS = {
    "an unknown lens": (
        [('"name": "brown"', '"name": "soap"')],
        r"lens 'soap' is not known; expected one of brown, rational, pfet",
    ),
    "an unknown coefficient": ([('"k1": -0.2', '"k9": -0.2')], r"Brown has no coefficient 'k9'"),
    "a focal length of zero": ([('"fx": 500.1', '"fx": 0.0')], r"focal lengths are 0 and"),
    "a pose missing": (
        [('"left 2.jpg"', '"left 2.jpg"'), ('"views": [', '"views": [{"image": "x", "corners": []},')],
        r"3 poses for 4 views",
    ),
    "a covariance of another size": ([('"fx=fy", "k1"', '"fx", "fy", "k1"')], r"covariance is not 3 by 3"),
    "a text for a number": ([('"steps": 9', '"steps": "9"')], r"Expected `int`, got `str` - at `\$.steps`"),
}


@pytest.mark.parametrize(("changes", "message"), CALIBRATION_FAULTS.values(), ids=CALIBRATION_FAULTS.keys())
def test_a_faulty_calibration_is_refused_with_the_file_and_the_fault(tmp_path, changes, message):
    path = written(tmp_path, some_calibration(), *changes)
    with pytest.raises(InputError, match=message) as raised:
        load(path)
    assert path in str(raised.value)


DECOUPLED_FAULTS = {
    "a shape of too few corners": (
        lambda content: content["target_shape"]["displacements"].pop(),
        "a shape of 11 corners for a target of 12",
    ),
    "a shape of no kind": (
        lambda content: content["target_shape"].update(kind="wavy"),
        "target shape 'wavy' is not known",
    ),
    "a lattice without cells": (
        lambda content: content["camera"]["lens"]["over"].update(shape=[3, 9]),
        "expected at least 4 each way",
    ),
    "a coefficient missing": (
        lambda content: content["camera"]["lens"]["over"]["coefficients"].pop(),
        r"coefficients has shape \(98, 2\)",
    ),
    "a candidate without error": (
        lambda content: content["candidates"][0].pop("standard_error_px"),
        r"missing required field `standard_error_px` - at `\$.candidates\[0\]`",
    ),
}


@pytest.mark.parametrize(("spoil", "message"), DECOUPLED_FAULTS.values(), ids=DECOUPLED_FAULTS.keys())
def test_a_faulty_shape_lens_or_candidate_is_refused(tmp_path, spoil, message):
    save(a_decoupled_calibration(), tmp_path / "file.json")
    content = json.loads((tmp_path / "file.json").read_text())
    spoil(content)
    (tmp_path / "file.json").write_text(json.dumps(content))
    with pytest.raises(InputError, match=message):
        load(tmp_path / "file.json")


def test_a_rotation_that_is_none_is_refused(tmp_path):
    save(some_calibration(), tmp_path / "file.json")
    content = json.loads((tmp_path / "file.json").read_text())
    content["camera_from_target"][1]["rotation"][0] = [1.0, 1.0, 0.0]
    (tmp_path / "file.json").write_text(json.dumps(content))
    with pytest.raises(InputError, match="rotation is not orthonormal"):
        load(tmp_path / "file.json")


def test_a_coefficient_left_out_has_its_usual_value(tmp_path):
    path = written(tmp_path, CAMERA, ('"s1": 0.0,', ""))
    assert_same_camera(load_own_camera(path), CAMERA)


def test_a_file_of_another_kind_is_refused(tmp_path):
    save(CAMERA, tmp_path / "camera.json")
    save(some_detections(), tmp_path / "detections.json")
    with pytest.raises(InputError, match=r"camera\.json holds a camera; expected calibration"):
        load_calibration(tmp_path / "camera.json")
    with pytest.raises(InputError, match=r"detections\.json holds detections; expected camera"):
        load_own_camera(tmp_path / "detections.json")
    with pytest.raises(InputError, match=r"camera\.json holds a camera; expected detections"):
        load_detections(tmp_path / "camera.json")


@pytest.mark.parametrize("value", [float("nan"), object(), np.arange(3)], ids=["nan", "object", "array"])
def test_a_setting_without_a_plain_value_is_refused_and_nothing_written(tmp_path, value):
    calibration = replace(some_calibration(), settings={"sigma": value})
    with pytest.raises(InputError, match="cannot be written as JSON"):
        save(calibration, tmp_path / "calibration.json")
    assert not (tmp_path / "calibration.json").exists()


def test_a_lens_outside_the_table_is_refused(tmp_path):
    class Homemade(KannalaBrandt):
        pass

    with pytest.raises(InputError, match="Homemade cannot be saved; expected one of LENSES: brown"):
        save(Camera((640, 480), CAMERA.intrinsics, Homemade()), tmp_path / "camera.json")


def as_written_before(made: Calibration, path, **settings: str) -> None:
    """The file of a decoupled calibration as version 0.1.0 wrote it: candidates in rows, no setting `fit`."""
    save(made, path)
    written = json.loads(path.read_text())
    del written["settings"]["fit"]
    written["settings"] |= settings
    written["candidates"] = [
        ["flat", "brown", 0.35, 0.006, 0.3],
        ["free", "free", 0.05, None, 0.0],
        ["free", "rational from pairs", None, None, 0.1],
    ]
    path.write_text(json.dumps(written))


def test_a_calibration_of_the_version_before_is_read(tmp_path):
    made = a_decoupled_calibration()
    as_written_before(made, tmp_path / "calibration.json")
    again = load_calibration(tmp_path / "calibration.json")
    assert again.settings == made.settings
    assert [(one.lens, one.base, one.fit) for one in again.candidates] == [
        ("brown", "brown", "joint"),
        ("free", "brown", "joint"),
        ("rational", "rational", "pairs"),
    ]
    save(again, tmp_path / "again.json")
    assert load_calibration(tmp_path / "again.json").settings == again.settings


def test_a_formula_of_the_version_before_is_fitted_again_as_it_was(tmp_path):
    as_written_before(a_decoupled_calibration(), tmp_path / "calibration.json", lens="rational")
    assert load_calibration(tmp_path / "calibration.json").settings["fit"] == "pairs"


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"method": "zhang"}, "'zhang' is not known; expected one of decoupled"),
        ({"settings": {"lense": "brown"}}, "no setting 'lense'; it has lens"),
        ({"settings": {"lens": 5}}, "'lens' of method 'fccm' is 5; expected a word"),
        ({"settings": {"skew": "yes"}}, "is 'yes'; expected true or false"),
        ({"settings": {"loss_scale": True}}, "is True; expected a number"),
    ],
)
def test_a_method_or_setting_that_is_none_is_named_when_its_file_is_read(tmp_path, changes, told):
    path = tmp_path / "calibration.json"
    save(some_calibration(), path)
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))
    with pytest.raises(InputError, match=re.escape(told)):
        load_calibration(path)

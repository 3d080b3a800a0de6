"""A camera from elsewhere beside the one that photographs give by themselves."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest
from numpy.testing import assert_allclose

from helpers.boards import BOARD, NARROW, photographs_of
from orthoscope.evaluation.camera_check import check_camera
from orthoscope.evaluation.evaluate import examine
from orthoscope.evaluation.verdict.grades import Grade
from orthoscope.methods.decoupled.decoupled import decoupled
from orthoscope.models.camera import Camera
from orthoscope.models.lenses.table import Brown
from orthoscope.targets.detections import Detections


@pytest.fixture(scope="module")
def photographs() -> Iterator[Detections]:
    """Whose own camera is calibrated and judged once for all tests."""
    taken = photographs_of(BOARD.points, 10, 5, noise_px=0.1)
    own = decoupled(taken)
    judged = examine(own)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("orthoscope.evaluation.camera_check.decoupled", lambda _: own)
        patch.setattr("orthoscope.evaluation.camera_check.examine", lambda _: judged)
        yield taken


def with_k(**changes: float) -> Camera:
    return replace(NARROW, intrinsics=replace(NARROW.intrinsics, **changes))


def test_the_camera_that_took_the_photographs_is_still_good(photographs: Detections):
    found = check_camera(NARROW, photographs)
    assert found is not None
    assert found.changed == ""
    assert found.grade == Grade.GOOD
    assert found.apart_px < 2.0 * found.known_px
    assert "by themselves" in str(found)


@pytest.mark.parametrize("share", [-0.03, 0.05])
def test_a_zoom_is_named_with_its_share(photographs: Detections, share: float):
    """The camera was calibrated before the zoom, the photographs were taken after it."""
    before = with_k(fx=NARROW.intrinsics.fx / (1.0 + share), fy=NARROW.intrinsics.fy / (1.0 + share))
    found = check_camera(before, photographs)
    assert found is not None
    assert found.changed == "focal length"
    assert_allclose(found.focal_shares, share, rtol=0.1)  # one linear step
    assert found.unexplained_px < 0.3 * found.apart_px
    assert ("longer" if share > 0 else "shorter") in str(found)


def test_a_shifted_principal_point_is_named_with_its_pixels(photographs: Detections):
    """Some of a shift is a turn of the camera: the same image moves with distortion and perspective only."""
    found = check_camera(with_k(cx=NARROW.intrinsics.cx - 60.0, cy=NARROW.intrinsics.cy + 40.0), photographs)
    assert found is not None
    assert found.changed == "principal point"
    assert_allclose(found.centre_px, (60.0, -40.0), atol=6.0)


def test_pictures_resized_in_one_direction_are_named(photographs: Detections):
    found = check_camera(with_k(fx=NARROW.intrinsics.fx / 1.05), photographs)
    assert found is not None
    assert "unequally" in found.changed
    assert_allclose(found.focal_shares, (0.05, 0.0), atol=0.01)
    assert "resized" in str(found)


def test_another_lens_is_no_change_of_k(photographs: Detections):
    found = check_camera(replace(NARROW, lens=Brown(k1=-0.1)), photographs)
    assert found is not None
    assert found.changed == "lens"
    assert "lens" in str(found)


def test_too_few_photographs_tell_no_camera_of_their_own():
    assert check_camera(NARROW, photographs_of(BOARD.points, 3, 5)) is None

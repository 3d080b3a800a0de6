"""What straight pictures show: squares as squares, nothing black where it was promised, all where all was
asked for.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from helpers.laws import LENSES_TO_TRY
from orthoscope.geometry.arrays import InputError
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown, Division, KannalaBrandt, Stereographic
from orthoscope.straight.undistort import Straightener, undistort
from orthoscope.straight.views import PROJECTIONS, map_of, share_kept, straight_camera

SIZE = (160, 120)
WIDE = Camera(SIZE, Intrinsics(50.0, 50.5, 78.0, 61.0), KannalaBrandt(k1=-0.02))
CAMERAS = {
    f"{name}, {focal:g} px": Camera(SIZE, Intrinsics(focal, 1.1 * focal, 83.0, 57.0), lens)
    for name, lens in LENSES_TO_TRY.items()
    for focal in ((90.0, 220.0) if name == "kannala_brandt mild" else (110.0,))
    if not name.startswith(("pfet with", "fet", "rational with a pole", "brown tilted", "rational tilted"))
}
for_every_camera = pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS.keys())


@for_every_camera
def test_valid_has_not_one_black_pixel(camera):
    white = np.full((SIZE[1], SIZE[0]), 255, dtype=np.uint8)
    assert (undistort(white, camera, keep="valid") == 255).all()


@for_every_camera
@pytest.mark.parametrize("keep", ["all", "valid"])
def test_squares_stay_squares(camera, keep):
    straight = camera.straight_intrinsics(keep)
    assert straight.fy / straight.fx == pytest.approx(camera.intrinsics.fy / camera.intrinsics.fx)
    assert straight.skew == 0.0


@pytest.mark.parametrize("lens", [Brown(k1=-0.3, k2=0.1), Brown(k1=0.1), Division(l=-0.2)])
def test_all_shows_all(lens):
    camera = Camera(SIZE, Intrinsics(150.0, 150.0, 83.0, 57.0), lens)
    assert share_kept(camera, straight_camera(camera)) == 1.0


def test_of_a_wide_lens_a_plane_shows_a_share_and_other_projections_all():
    assert 0.3 < share_kept(WIDE, straight_camera(WIDE)) < 0.9
    assert share_kept(WIDE, straight_camera(WIDE, projection="equidistant")) > 0.999


def test_valid_is_larger_than_a_rectangle_about_the_middle_alone():
    """The principal point off the middle: the view goes where there is more to see."""
    camera = Camera(SIZE, Intrinsics(120.0, 120.0, 120.0, 60.0), Brown(k1=-0.2))
    straight = camera.straight_intrinsics("valid")
    assert straight.fx < 120.0


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_a_field_of_view_is_what_the_picture_shows_across(projection):
    view = straight_camera(WIDE, fov=100.0, size=(201, 101), projection=projection)
    left, right = view.unproject(np.array([[-0.5, 50.0], [200.5, 50.0]]))
    assert np.degrees(np.arccos(left @ right)) == pytest.approx(100.0)


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_a_view_looks_where_its_rays_come_from(projection):
    view = straight_camera(WIDE, projection=projection)
    x, y = map_of(WIDE, view)
    pixels = np.array([[80.0, 60.0], [40.0, 30.0], [120.0, 90.0]])
    expected = WIDE.project(view.unproject(pixels))
    inside = (np.abs(expected - np.array([79.5, 59.5])) < np.array([80.0, 60.0])).all(1)
    rows, columns = pixels.astype(int).T[::-1]
    assert_allclose(
        np.stack([x[rows, columns], y[rows, columns]], axis=-1)[inside], expected[inside], atol=2e-3
    )
    assert inside[0]


def test_a_scale_of_one_is_one_pixel_for_one_at_the_principal_point():
    view = straight_camera(WIDE, scale=1.0, size=(100, 80))
    rays = WIDE.unproject(np.array([[78.0, 61.0], [78.1, 61.0]]))
    assert np.ptp(view.project(rays)[:, 0]) == pytest.approx(0.1, rel=1e-4)
    assert view.image_size == (100, 80)


def test_the_picture_has_the_views_size():
    view = straight_camera(WIDE, size=(50, 40))
    colour = np.full((120, 160, 3), 200, dtype=np.uint8)
    straightener = Straightener(WIDE, view=view)
    assert straightener(colour).shape == (40, 50, 3)
    assert straightener(colour, reuse=True).shape == (40, 50, 3)
    assert straightener(colour[..., 0]).shape == (40, 50)


def test_stereographic_and_equidistant_views_are_cameras_that_files_hold(tmp_path):
    from orthoscope.formats.load import load_camera
    from orthoscope.formats.own.json import save

    view = straight_camera(WIDE, projection="stereographic")
    save(view, tmp_path / "camera.json")
    assert isinstance(load_camera(tmp_path / "camera.json").lens, Stereographic)
    assert isinstance(straight_camera(WIDE, projection="equidistant").lens, KannalaBrandt)


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"projection": "round"}, r"projection 'round' is not known; expected one of rectilinear"),
        ({"fov": 190.0}, r"190 degrees cannot be rectilinear"),
        ({"fov": -5.0}, r"-5 degrees cannot be"),
        ({"fov": float("nan")}, r"nan degrees cannot be"),
        ({"scale": 0.0}, r"a scale of 0 shows nothing"),
        ({"scale": 1.0, "fov": 90.0}, r"both fov and scale"),
        ({"keep": "some"}, r"keep is 'some'"),
        ({"keep": "valid", "projection": "cylindrical"}, r"keep='valid' is for rectilinear"),
    ],
)
def test_what_cannot_be_shown_is_refused(asked, message):
    with pytest.raises(InputError, match=message):
        straight_camera(WIDE, **asked)

"""Laws of every lens: inverse, Jacobians, domain."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_less

from helpers.laws import LENSES_TO_TRY, directions, for_every_formula, for_every_lens, places_over, rays_over
from orthoscope.geometry.arrays import InputError
from orthoscope.models.lenses.lens import Lens
from orthoscope.models.lenses.table import LENSES, Brown, Division, Fet, Fov, KannalaBrandt, Pfet, Rational

ROUNDING = 1e-15


def is_seen(lens: Lens, rays: np.ndarray) -> np.ndarray:
    """Rays that have an image: all but the axis of a lens that tears its centre."""
    return rays[np.isfinite(lens.distort(rays)).all(axis=1)]


def test_every_lens_of_the_table_is_put_through_the_laws():
    assert {type(lens) for lens in LENSES_TO_TRY.values()} == set(LENSES.values())


@for_every_lens
def test_every_ray_of_the_domain_has_an_image(lens):
    plane = lens.distort(rays_over(lens))
    torn = isinstance(lens, Pfet) and lens.a0 > 0  # the axis itself is spread over a ring
    assert np.isnan(plane).any(axis=1).sum() == (len(directions(lens)[0]) if torn else 0)


@for_every_lens
def test_undistort_inverts_distort(lens):
    rays = is_seen(lens, rays_over(lens))
    # up to 1e-4 before a fold the inverse's slope is below 1e4: rounding of the image, 1e-16 times its size,
    # grows by that
    assert_allclose(lens.undistort(lens.distort(rays)), rays, atol=1e-11)


@for_every_lens
def test_the_last_rays_before_the_end_come_back(lens):
    rays = is_seen(lens, rays_over(lens, last=1.0 - 1e-9))
    plane = lens.distort(rays)
    back = lens.undistort(plane)
    assert_allclose(
        back, rays, atol=1e-6
    )  # at a fold the inverse is a square root: 1e-16 becomes 1e-8, times the curve's scale
    near = np.abs(plane).max(axis=1) < 50.0  # beside a pole a rounding of the ray is a mile in the image
    assert_allclose(lens.distort(back[near], beyond=True), plane[near], rtol=1e-9, atol=1e-12)


@for_every_lens
def test_distort_inverts_undistort_all_over_the_image(lens):
    x, y = np.meshgrid(np.linspace(-1.2, 1.2, 61), np.linspace(-0.9, 0.9, 47))
    plane = np.stack([x.ravel(), y.ravel()], axis=1)
    rays = lens.undistort(plane)
    seen = np.isfinite(rays).all(axis=1)
    assert seen.sum() > 200
    assert_allclose(lens.distort(rays[seen]), plane[seen], atol=1e-12)


@for_every_lens
def test_the_determinant_is_positive_all_over_the_domain(lens):
    x, y = places_over(lens, last=1.0 - 1e-6)
    with np.errstate(invalid="ignore", divide="ignore"):
        at = lens.linearise(x, y)
        seen = lens.sees(x, y) & np.isfinite(at.x)
    assert_array_less(0.0, (at.j_xx * at.j_yy - at.j_xy * at.j_yx)[seen])


@for_every_lens
def test_beyond_the_domain_there_is_no_image(lens):
    angles, ends = directions(lens)
    limit = lens.chart.radius(lens.chart.reach - 1e-3)
    s = np.outer([1.02, 1.1, 1.5, 3.0, 10.0], ends[ends < limit / 1.02])
    s[s > limit] = np.nan
    rays = lens.chart.lift(
        s * np.cos(angles[ends < limit / 1.02]), s * np.sin(angles[ends < limit / 1.02])
    ).reshape(-1, 3)
    assert np.isnan(lens.distort(rays)).all()


@for_every_lens
def test_a_ray_of_no_length_and_a_ray_straight_back_have_no_image(lens):
    assert np.isnan(lens.distort(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -1.0]]))).all()


@for_every_lens
def test_the_length_of_a_ray_does_not_matter(lens):
    rays = is_seen(lens, rays_over(lens, last=0.9))
    plane = lens.distort(rays)
    near = np.abs(plane).max(axis=1) < 50.0  # beside the horizon of a tilted sensor roundings grow
    assert_allclose(lens.distort(1e3 * rays)[near], plane[near], rtol=1e-12, atol=1e-14)  # one more rounding


@for_every_lens
def test_nan_in_is_nan_out(lens):
    assert np.isnan(lens.distort(np.full((1, 3), np.nan))).all()
    assert np.isnan(lens.undistort(np.full((1, 2), np.nan))).all()


@for_every_lens
def test_no_places_give_no_rays(lens):
    assert lens.undistort(np.empty((0, 2))).shape == (0, 3)
    assert lens.distort(np.empty((0, 3))).shape == (0, 2)


@pytest.mark.parametrize(
    "name",
    ["brown mild", "brown strong", "pfet with a ring", "division pincushion", "kannala_brandt folding"],
)
def test_past_the_image_of_a_fold_nothing_is_seen(name):
    lens = LENSES_TO_TRY[name]
    end = np.hypot(*lens.distort(is_seen(lens, rays_over(lens, last=1.0 - 1e-9))).T).max()
    beyond = np.array([[1.0, 0.0], [0.0, 1.0], [-0.6, 0.8]]) * 1.01 * end
    assert np.isnan(lens.undistort(beyond)).all()


@for_every_lens
def test_the_formula_and_its_linearisation_agree(lens):
    x, y = places_over(lens, last=0.95, widest=3.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        at = lens.linearise(x, y)
        assert_allclose(
            np.stack([at.x, at.y]), np.stack(lens.warp(x, y)), rtol=1e-13, atol=1e-14
        )  # the order of sums differs


@for_every_lens
def test_jacobians_by_place_are_those_of_differences(lens):
    x, y = places_over(lens, last=0.95, widest=3.0)
    apart = (
        np.hypot(x, y) > 1e-2 + 1.2 * lens.domain.hole
    )  # at the centre a curve may have a corner: next test
    x, y = x[apart], y[apart]
    at, step = lens.linearise(x, y), 1e-5
    for (dx, dy), (by_x, by_y) in {(1, 0): (at.j_xx, at.j_yx), (0, 1): (at.j_xy, at.j_yy)}.items():
        after, before = lens.warp(x + step * dx, y + step * dy), lens.warp(x - step * dx, y - step * dy)
        for exact, plus, minus in zip((by_x, by_y), after, before, strict=True):
            # error of a central difference: step^2 times the third derivative, here up to some 10, and
            # rounding over step
            assert_allclose(exact, (plus - minus) / (2 * step), rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("name", [name for name in LENSES_TO_TRY if not name.startswith("pfet with")])
def test_at_the_centre_the_jacobian_is_the_gain(name):
    lens = LENSES_TO_TRY[name]
    at, (g, _) = lens.linearise(np.zeros(1), np.zeros(1)), lens.gain(np.zeros(1))
    jacobian = np.array([[at.j_xx[0], at.j_xy[0]], [at.j_yx[0], at.j_yy[0]]])
    # OpenCV's tilt turns the sensor about the axis' foot: cos(tau) squashes what it turns away, at most by
    # 0.08^2
    assert_allclose(jacobian, g[0] * np.eye(2), atol=0.01 if "tilted" in name else ROUNDING)


@for_every_lens
def test_jacobians_by_each_coefficient_are_those_of_differences(lens):
    x, y = places_over(lens, last=0.9, widest=1.5)
    s = np.hypot(x, y)
    tried = (s > 1e-2 + 1.2 * lens.domain.hole) & (
        s < 1.8
    )  # farther out a coefficient's powers carry a displacement over its knots
    x, y = x[tried], y[tried]
    names = lens.names()
    at = lens.linearise(x, y, names)
    for name, value, exact in zip(names, lens.coefficients, at.by, strict=True):
        step = 1e-6
        after = lens.with_coefficients(**{name: value + step}).warp(x, y)
        before = lens.with_coefficients(**{name: value - step}).warp(x, y)
        for part, plus, minus in zip(exact, after, before, strict=True):
            # rounding over step, times what the image is large (up to some 10)
            assert_allclose(part, (plus - minus) / (2 * step), rtol=1e-6, atol=1e-7, err_msg=name)


@for_every_formula
def test_coefficients_come_in_the_order_of_their_names(lens):
    again = type(lens)(*lens.coefficients)
    assert dict(zip(lens.names(), again.coefficients, strict=True)) == {
        name: getattr(lens, name) for name in lens.names()
    }


@for_every_lens
def test_coefficients_that_are_freed_are_coefficients(lens):
    assert set(lens.free) <= set(lens.names())


def test_an_unknown_coefficient_is_refused():
    with pytest.raises(InputError, match=r"Brown has no coefficient 'k9'; it has k1"):
        Brown().with_coefficients(k9=1.0)


def test_a_coefficient_that_is_no_number_is_refused():
    with pytest.raises(InputError, match="expected finite numbers"):
        Brown(k1=float("nan"))


# Angles from the axis to almost straight back, radians.
THETA = np.linspace(0.0, 3.0, 40)
# As they come these are stereographic.
STEREOGRAPHIC = ("stereographic", "double_sphere", "eucm")


def test_a_stereographic_lens_is_that_by_three_formulas():
    rays = np.stack([np.sin(THETA), 0.0 * THETA, np.cos(THETA)], axis=-1)
    for name in STEREOGRAPHIC:
        assert_allclose(LENSES[name]().distort(rays)[:, 0], 2.0 * np.tan(0.5 * THETA), rtol=1e-14)


@pytest.mark.parametrize(
    "lens", [kind() for name, kind in LENSES.items() if name not in ("fet", *STEREOGRAPHIC)]
)
def test_a_lens_without_coefficients_does_nothing(lens):
    x, y = np.array([0.0, 0.3, -0.7]), np.array([0.0, -0.2, 0.5])
    assert_allclose(lens.warp(x, y), (x, y), atol=ROUNDING)


def test_brown_folds_where_its_slope_is_zero():
    # 1 + 3 k1 s^2 = 0 at s = sqrt(1 / 0.6), and the derivative of the angle by s is below 1
    assert_allclose(Brown(k1=-0.2).field_angle, np.arctan(np.sqrt(1.0 / 0.6)), atol=1e-12)


def test_division_ends_where_its_root_does():
    assert_allclose(np.tan(Division(l=0.1).field_angle), np.sqrt(1.0 / 0.4), rtol=1e-12)  # 1 - 4 l s^2 = 0


def test_rational_ends_at_its_pole():
    assert_allclose(np.tan(Rational(k4=-0.5).field_angle), np.sqrt(2.0), rtol=1e-12)


def test_fov_of_a_small_angle_is_no_distortion():
    rays = rays_over(Fov(w=1e-6), last=0.5)
    assert_allclose(Fov(w=1e-6).distort(rays), Fov().distort(rays), atol=1e-9)  # w^2 s^3 / 3 with s up to 10


def test_kannala_brandt_sees_behind_itself():
    ray = np.array([[np.sin(2.0), 0.0, np.cos(2.0)]])  # 115 degrees from the axis
    assert_allclose(KannalaBrandt().distort(ray), [[2.0, 0.0]], atol=1e-15)
    assert_allclose(KannalaBrandt().undistort(np.array([[2.0, 0.0]])), ray, atol=1e-15)


@pytest.mark.parametrize(
    "lens", [Pfet(a1=-1.0), Fet(scale=-1.0, l=0.5), Fov(w=3.5)], ids=["pfet", "fet", "fov"]
)
def test_a_lens_turned_inside_out_sees_nothing(lens):
    assert np.isnan(lens.distort(np.array([[0.1, 0.2, 1.0], [0.0, 0.0, 1.0]]))).all()
    assert np.isnan(lens.undistort(np.array([[0.1, 0.2], [0.0, 0.0]]))).all()


def test_a_decentred_lens_does_not_cover_its_image_twice():
    # far out, decentering makes the map quadratic: the determinant is positive again behind the fold
    lens = Brown(p1=0.02, p2=-0.03)
    generator = np.random.default_rng(0)
    angle, s = generator.uniform(-np.pi, np.pi, 5000), np.tan(generator.uniform(0.0, 1.55, 5000))
    x, y = s * np.cos(angle), s * np.sin(angle)
    seen = lens.sees(x, y)
    assert 1000 < seen.sum() < 5000
    assert_allclose(lens.unwarp(*lens.warp(x[seen], y[seen])), (x[seen], y[seen]), rtol=1e-9, atol=1e-12)


small, tiny = st.floats(-0.4, 0.4), st.floats(-0.01, 0.01)


@given(k1=small, k2=small, k3=small, p1=tiny, p2=tiny, s1=tiny, s3=tiny)
def test_any_brown_lens_can_be_inverted(k1, k2, k3, p1, p2, s1, s3):
    lens = Brown(k1=k1, k2=k2, k3=k3, p1=p1, p2=p2, s1=s1, s3=s3)
    rays = rays_over(lens)
    assert_allclose(lens.undistort(lens.distort(rays)), rays, atol=1e-9)


@given(k1=small, k2=small, k4=small, k5=small, k6=small, p1=tiny, p2=tiny)
def test_any_rational_lens_can_be_inverted(k1, k2, k4, k5, k6, p1, p2):
    lens = Rational(k1=k1, k2=k2, k4=k4, k5=k5, k6=k6, p1=p1, p2=p2)
    rays = rays_over(lens)
    assert_allclose(lens.undistort(lens.distort(rays)), rays, atol=1e-9)


@given(k1=small, k2=tiny, k3=tiny, k4=tiny)
def test_any_kannala_brandt_lens_can_be_inverted(k1, k2, k3, k4):
    lens = KannalaBrandt(k1, k2, k3, k4)
    rays = rays_over(lens)
    assert_allclose(lens.undistort(lens.distort(rays)), rays, atol=1e-9)

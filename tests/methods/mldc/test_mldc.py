"""MLDC: eq. (7) is minimised, it does not determine the camera, and what that costs; FCCM's figures in the
same simulation beside it.
"""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from helpers.quick import first_quick
from helpers.scenes import NARROW, K, camera_with, photographed, some_corners
from orthoscope.evaluation.evaluate import evaluate_on
from orthoscope.fitting.calibration import residuals_of, rms
from orthoscope.fitting.observations import Observations, Poses
from orthoscope.fitting.reprojection import Estimate, Reprojection
from orthoscope.fitting.starts.initial_camera import Assumptions, StartingCameras
from orthoscope.fitting.starts.pinhole import pinhole_start
from orthoscope.fitting.unseen.held_out import held_out
from orthoscope.geometry.arrays import InputError
from orthoscope.geometry.pose import rotation_from_vector
from orthoscope.methods import METHODS
from orthoscope.methods.fccm import fccm
from orthoscope.methods.mldc.eq7 import CorrectedPoints, Eq7
from orthoscope.methods.mldc.lens_about_centre import fit_centred_lens
from orthoscope.methods.mldc.mldc import mldc
from orthoscope.methods.mldc.nmldc import nmldc
from orthoscope.methods.mldc.pairs import pairs_of
from orthoscope.models.difference import image_difference
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown
from orthoscope.paper.subgrids import on_subgrid
from orthoscope.simulation.scene import paper_scene, simulate_detections
from orthoscope.solve.least_squares import solve
from orthoscope.solve.losses import Linear

DAMPINGS = (("identity", 1e-4), ("identity", 1e2), ("diagonal", 1e-4), ("diagonal", 1.0))
EXPERIMENT = {  # the rows of the table in docs/paper.md
    **{
        f"literal, {damp} {damping:g}": partial(mldc, correct="literal", damp=damp, damping=damping)
        for damp, damping in DAMPINGS
    },
    "nearest": partial(mldc, correct="nearest"),
    "repeated": mldc,
    "NMLDC": nmldc,
    "FCCM, k1 k2": partial(fccm, lens="brown:k1,k2"),
    "FCCM, pfet, own centre": partial(fccm, lens="pfet", own_centre=True),
    "FCCM, 5 parameters": partial(fccm, lens="brown"),
}
MEMBERS = {  # rows of the same table: pin-holes that no search found, with corrected points of their own
    "any member, fx 600": Intrinsics(600.0, 600.0, 320.0, 240.0),
    "any member, the true K": Intrinsics(750.0, 750.0, 320.0, 240.0),
}


def papers_simulation(distortion, *, noise_px=0.1, seed=0):
    """The paper's section 4.1: 15 photographs with noise to calibrate from, 5 without to test with."""
    rng = np.random.default_rng(seed)
    scene = paper_scene(distortion, rng=rng)
    training, test = (
        replace(scene, camera_from_target=scene.camera_from_target[part])
        for part in (slice(15), slice(15, 20))
    )
    return simulate_detections(training, noise_px=noise_px, rng=rng, tilt_noise=True), simulate_detections(
        test, noise_px=0.0, rng=rng
    )


def eq7(detections, **settings):
    """The problem of eq. (7) and the paper's start."""
    observations, narrowing = Observations.of(detections), Assumptions.of(len(detections.views), skew=False)
    problem = Eq7(observations, detections.target, narrowing.free, **settings)
    bases = StartingCameras(observations, detections.target.points, detections.image_size, narrowing)
    return problem, problem.start(pinhole_start(bases), observations)


def perfect(pinhole, detections):
    """Any pin-hole with the points where it sees the target."""
    observations = Observations.of(detections)
    offset = Reprojection(observations, detections.target.points, pinhole.camera).residuals(pinhole)
    return CorrectedPoints(pinhole, (observations.pixels() + offset) * observations.present[..., None])


def member_of(intrinsics, detections):
    """J of eq. (7) for a pin-hole with the poses nearest to the detections, and the camera of step 2 then."""
    problem, start = eq7(detections)
    observations = Observations.of(detections)
    pinhole = replace(start.pinhole.camera, intrinsics=intrinsics)
    points = detections.target.points
    poses = solve(Reprojection(observations, points, pinhole, ()), Estimate(pinhole, start.pinhole.poses))
    chosen = perfect(poses.unknowns, detections)
    bases = StartingCameras(observations, points, detections.image_size, Assumptions.of(15, skew=False))
    fit = fit_centred_lens(*pairs_of(bases, poses.unknowns.poses), pinhole=pinhole, lens="pfet")
    return problem.linearise(chosen, Linear()).cost, fit.unknowns


def some_other(pinhole, *, seed):
    """A pin-hole with poses that are tens of pixels away."""
    rng = np.random.default_rng(seed)
    K = Intrinsics(*(np.array(pinhole.camera.intrinsics.as_tuple()[:4]) + rng.normal(0.0, 30.0, 4)))
    turn = rotation_from_vector(rng.normal(0.0, 0.05, pinhole.poses.translation.shape))
    return Estimate(
        replace(pinhole.camera, intrinsics=K),
        Poses(turn @ pinhole.poses.rotation, 1.1 * pinhole.poses.translation),
    )


@pytest.mark.parametrize("partly", [False, True])
def test_the_derivatives_of_eq_7_are_exact(partly):
    detections = photographed(NARROW, 3, noise_px=0.5)
    problem, here = eq7(
        some_corners(detections, (0.4, 0.9)) if partly else detections, weights=(1.0, 300.0, 2.0)
    )
    sums = problem.linearise(here, Linear())
    rng = np.random.default_rng(0)
    shared, views = rng.standard_normal(len(sums.a)), 0.1 * rng.standard_normal(sums.c.shape)
    views[:, :6] *= 0.01
    h = 1e-4
    ahead, back = (
        problem.linearise(problem.move(here, s * h * shared, s * h * views), Linear()).cost for s in (1, -1)
    )
    assert_allclose(
        sums.a @ shared + (sums.c * views).sum(), (ahead - back) / (4 * h), rtol=1e-6
    )  # h^2 of the third derivative


def test_every_pin_hole_makes_eq_7_zero():
    detections = some_corners(photographed(NARROW, 4), (0.5, 1.0))
    problem, start = eq7(detections)
    assert max(problem.terms(start)) > 1.0
    for seed in range(3):
        anywhere = perfect(some_other(start.pinhole, seed=seed), detections)
        assert np.abs(anywhere.q - start.q).max() > 10.0
        assert max(problem.terms(anywhere)) < 1e-20  # rounding of some hundred pixels, squared


def test_thinned_boards_keep_their_cross_ratios():
    """Any four corners of a line have a cross-ratio that the target tells: a sub-grid of unequal steps has as
    many terms as a board of its size.
    """
    for grid in ((4, 5), (6, 9)):
        thinned = on_subgrid(papers_simulation("low")[0].only(range(3)), grid)
        problem, start = eq7(thinned)
        columns, rows = grid
        runs = rows * (columns - 3) + columns * (rows - 3)
        assert problem.counts == (3 * 2 * rows * columns, 3 * runs, 3 * 2 * rows * columns)
        assert problem.terms(start)[1] > 1e-9  # what the lens does to cross-ratios is seen
        assert problem.terms(perfect(start.pinhole, thinned))[1] < 1e-20


def test_at_a_minimum_eq_7_leaves_open_as_many_directions_as_the_pin_hole_and_its_poses_have():
    """4 of K (no skew) and 6 of each view: the count of residuals in the paper's eq. (8) does not see that
    they repeat one another.
    """
    detections = photographed(NARROW, 3)
    problem, start = eq7(detections)
    sums = problem.linearise(perfect(start.pinhole, detections), Linear())
    m, k, p = sums.B.shape
    whole = np.zeros((k + m * p, k + m * p))
    whole[:k, :k] = sums.A
    for view in range(m):
        place = slice(k + view * p, k + (view + 1) * p)
        whole[:k, place], whole[place, :k], whole[place, place] = sums.B[view], sums.B[view].T, sums.C[view]
    scale = np.sqrt(np.diag(whole))
    values = np.linalg.eigvalsh(whole / np.outer(scale, scale))
    assert (np.abs(values) < 1e-12).sum() == k + 6 * m
    assert values[k + 6 * m] > 1e-6


@pytest.mark.parametrize(("damp", "damping"), DAMPINGS)
def test_eq_7_is_minimised_from_every_damping(damp, damping):
    calibration = mldc(photographed(NARROW, 5, noise_px=0.1), correct="literal", damp=damp, damping=damping)
    assert calibration.status == "converged"
    assert j_of(calibration) < 1e-10  # what is promised; the points then fit the pin-hole to 1e-5 px


def j_of(calibration):
    """The J that a literal calibration says it ended with."""
    return float(re.search(r"J = ([0-9.e+-]+)", " ".join(calibration.assumptions))[1])


def test_another_damping_is_another_camera():
    detections = photographed(NARROW, 5, noise_px=0.1)
    cameras = [
        mldc(detections, correct="literal", damp=damp, damping=damping).camera.intrinsics
        for damp, damping in DAMPINGS
    ]
    apart = np.ptp([camera.as_tuple()[:4] for camera in cameras], axis=0)
    assert apart.max() > 3.0  # px, of what the paper takes to be one camera


def test_cross_ratios_and_straight_lines_add_nothing_to_eq_7():
    """The paper saw that its weights do not matter; they do not matter even where they are zero."""
    detections = photographed(NARROW, 5, noise_px=0.1)
    whole, bare = (
        mldc(detections, correct="literal", damping=1e2, weights=weights)
        for weights in ((1.0, 1.0, 1.0), (1.0, 0.0, 0.0))
    )
    assert_allclose(
        bare.camera.intrinsics.as_tuple(), whole.camera.intrinsics.as_tuple(), atol=0.5
    )  # px; dampings differ by ten times that


def test_partial_boards_are_corrected_as_well():
    detections = some_corners(photographed(NARROW, 6, noise_px=0.1), (0.5, 0.9))
    assert j_of(mldc(detections, correct="literal")) < 1e-10


def test_the_nearest_member_is_nearer_to_the_detections_than_another():
    detections = photographed(NARROW, 6, noise_px=0.1)
    distances = []
    for correct in ("nearest", "literal"):
        calibration = mldc(detections, correct=correct)
        straight = replace(calibration.camera, lens=Brown(), lens_frame=None)
        distances.append(
            rms(np.concatenate(residuals_of(straight, calibration.camera_from_target, detections)))
        )
    assert distances[0] < distances[1]


def test_all_say_which_member_they_are():
    detections = photographed(NARROW, 4, noise_px=0.1)
    assert "meets the detected corners best" in mldc(detections).assumptions[0]
    assert "nearest to the detected corners" in mldc(detections, correct="nearest").assumptions[0]
    assert "identity damping 100" in mldc(detections, correct="literal", damping=1e2).assumptions[0]


@pytest.mark.parametrize("correct", ["repeated", "nearest", "literal"])
def test_without_distortion_the_detections_are_the_corrected_points(correct):
    camera = camera_with(Brown())
    calibration = mldc(photographed(camera, 6), correct=correct)
    pixels = np.concatenate([view.pixels for view in calibration.detections.views])
    assert np.abs(image_difference(camera, calibration.camera, pixels)).max() < 1e-6
    assert_allclose(calibration.camera.intrinsics.as_tuple(), K.as_tuple(), atol=1e-5)


def test_with_distortion_no_member_is_the_camera_even_without_noise():
    """What the method cannot do, and why: the pin-hole of step 1 has taken up part of the lens."""
    training, test = papers_simulation("low", noise_px=0.0)
    assert evaluate_on(mldc(training, correct="nearest").camera, test).nce > 1.0
    assert evaluate_on(nmldc(training, lens="brown:k1").camera, test).nce < 1e-6


@pytest.mark.parametrize(("distortion", "known"), first_quick([("low", 0.119), ("high", 0.786)]))
def test_the_nce_of_fccm_in_the_papers_simulation_is_as_known(distortion, known):
    """A prototype's figure for k1 k2 about the principal point, from one set of views, lies within the spread
    over sets of views.
    """
    errors = []
    for seed in range(6):
        training, test = papers_simulation(distortion, seed=seed)
        errors.append(evaluate_on(fccm(training, lens="brown:k1,k2").camera, test).nce)
        assert (
            evaluate_on(fccm(training, lens="brown").camera, test).nce < 0.05
        )  # with 5 parameters the lens is met: only noise is left
    assert abs(np.mean(errors) - known) < 2.0 * np.std(errors, ddof=1)


@pytest.mark.slow
def test_the_table_of_docs_paper_md_is_what_this_code_finds():
    text = (Path(__file__).parents[3] / "docs" / "paper.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (low|high) \| (.+?) \| (.*?)\| (.+?) \| (.+?) \|$", text, re.MULTILINE)
    assert {name for distortion, name, *_ in rows if distortion == "low"} == {*EXPERIMENT, *MEMBERS}
    data = {distortion: papers_simulation(distortion) for distortion in ("low", "high")}
    for distortion, name, J, camera, nce in rows:
        training, test = data[distortion]
        if name in MEMBERS:
            cost, found = member_of(MEMBERS[name], training)
            assert (J.strip(), cost < 1e-10) == ("< 1e-10", True)
            assert [float(value) for value in camera.split(",")] == list(MEMBERS[name].as_tuple()[:4])
            assert_allclose(float(nce), evaluate_on(found, test).nce, atol=0.006)
            continue
        calibration = EXPERIMENT[name](training)
        assert_allclose(
            [float(value) for value in camera.split(",")],
            calibration.camera.intrinsics.as_tuple()[:4],
            atol=0.6,
        )  # as printed
        assert_allclose(float(nce), evaluate_on(calibration.camera, test).nce, atol=0.006)
        assert "literal" not in name or (j_of(calibration) < 1e-10 and J.strip() == "< 1e-10")


def test_the_settings_make_the_same_camera_again():
    calibration = mldc(
        photographed(NARROW, 5, noise_px=0.1),
        correct="literal",
        damp="diagonal",
        lens="brown",
        weights=(1.0, 10.0, 2.0),
    )
    again = METHODS[calibration.method](calibration.detections, **calibration.settings)
    assert again.camera.intrinsics.as_tuple() == calibration.camera.intrinsics.as_tuple()
    assert again.assumptions == calibration.assumptions


@pytest.mark.slow
def test_held_out_error_works_on_it():
    once = held_out(photographed(NARROW, 8, noise_px=0.1), partial(mldc, correct="nearest"))
    repeated = held_out(photographed(NARROW, 8, noise_px=0.1), mldc)
    assert 0.12 < repeated.rms_px < once.rms_px < 10.0  # noise .14 px; once: 8.7


def test_a_setting_that_is_none_is_refused():
    detections = photographed(NARROW, 3)
    with pytest.raises(InputError, match="expected one of repeated, repeated-plain, nearest, literal"):
        mldc(detections, correct="closest")
    with pytest.raises(InputError, match="J_PH"):
        mldc(detections, correct="literal", weights=(0.0, 1.0, 1.0))
    with pytest.raises(InputError, match="damp is 'trace'"):
        mldc(detections, correct="literal", damp="trace")
    with pytest.raises(InputError, match="expected one of linear"):
        mldc(detections, loss="squares")

"""What can be wrong, worst first: one table.  A verdict names the first that holds, and no other.

The order is that of what hides what: a formula that cannot follow the lens before the target, both before
photographs that are merely too few; two cameras in one folder before everything that a single camera could
have.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isnan
from typing import NamedTuple

from orthoscope.evaluation.misfit.f_test import MisfitTest
from orthoscope.evaluation.verdict.grades import WIDE_SHARE, Grade, good_somewhere
from orthoscope.evaluation.verdict.situation import FINE_PX, Situation
from orthoscope.geometry.numbers import rough_pixels

__all__ = ["CAUSES", "FEW_VIEWS", "Cause", "is_misfit", "listed"]

# With fewer photographs no error can be told.
FEWEST_PHOTOGRAPHS = 4
# Fewer photographs than this are few.
FEW_VIEWS = 8
# Photographs with less tilt, degrees, are all frontal.
LEVEL_DEGREES = 12.0
# Cameras whose images differ by less than the corners' noise times this are as good as one.
NOTICED_SHARE = 1.0
# What cannot be named limits a camera where it makes so much of its error.
LARGE_SHARE = 0.5
# Cameras that differ by less, pixels, are one camera for everyone.
NEGLIGIBLE_DIFFERENCE_PX = 0.05
# With this p-value of a misfit one perfect set in a hundred is blamed for its target, and one for its lens.
SURE_P_VALUE = 0.01
# The p-value over views is at most this or, with too few views to get there, the least that they can give.
SURE_P_VALUE_OVER_VIEWS = 0.05
# A misfit that is smaller than this share of the noise adds less than a thirtieth to the error.
TELLING_SHARE = 0.25
# No misfit that is smaller, pixels, matters to anyone.
NEGLIGIBLE_MISFIT_PX = 0.01
# A free lens may miss up to this share of the corners' noise.
STIFF_SHARE = 0.5
# What a formula misses, where it is a smaller share of the camera's error, limits nothing.
PART_SHARE = 0.15
# Chance makes hardly so large a share of the corners wild.
WILD_SHARE = 0.005
# Where a camera holds over a smaller part than this of what lies between corners, it is not corners that are
# missing.
SMALL_PART = 0.5
# A sentence lists so many images.
NAMED_IMAGES = 3
# A principal point that is known no better than this share of the image's width is open.
ADRIFT_SHARE = 0.1


class Cause(NamedTuple):
    """Something that may limit a camera.

    Attributes:
        name: in a file and in tests.
        holds: whether it does.
        allows: the best grade with it.
        says: the sentence, with figures; a clause that can follow "Usable: ...".
    """

    name: str
    holds: Callable[[Situation], bool]
    allows: Callable[[Situation], Grade]
    says: Callable[[Situation], str]


def is_misfit(test: MisfitTest, views: int) -> bool:
    """Whether a misfit is certain, by the F test and by the vote of the views, and large enough to matter."""
    certain = test.p_value < SURE_P_VALUE and test.p_over_views <= max(
        SURE_P_VALUE_OVER_VIEWS, 2.0 ** (1 - views)
    )
    return certain and test.systematic_px > max(TELLING_SHARE * test.noise_px, NEGLIGIBLE_MISFIT_PX)


def listed(images: Sequence[str]) -> str:
    """`a, b and c`, or `a, b, c and 5 more`."""
    shown = list(images[:NAMED_IMAGES])
    if len(images) > NAMED_IMAGES:
        return f"{', '.join(shown)} and {len(images) - NAMED_IMAGES} more"
    return " and ".join([", ".join(shown[:-1]), shown[-1]]) if len(shown) > 1 else "".join(shown)


def _matters(s: Situation) -> bool:
    """Whether it limits the camera that the photographs differ: a small spread that is certain is in its
    predicted error anyway.
    """
    if s.disagree in ("shutter", "mixed") and not s.groups:
        part = s.error_px if s.disagree == "shutter" else s.differ_px
        return s.error_px > FINE_PX and part > LARGE_SHARE * s.error_px
    return bool(s.disagree) and s.differ_px > max(NOTICED_SHARE * s.noise_px, NEGLIGIBLE_DIFFERENCE_PX)


def _lens_is_missed(s: Situation) -> bool:
    """A free lens is as stiff as its data made it, and misses a little of every lens by intent; what a
    formula misses is named where it shows beside the noise or is a good part of the camera's error.
    """
    if s.lens == "free":
        return s.lens_px > STIFF_SHARE * s.noise_px
    return s.lens_px > min(STIFF_SHARE * s.noise_px, PART_SHARE * s.error_px)


def _of_photographs(s: Situation) -> Grade:
    apart = 2.0 * s.differ_px if s.groups else s.differ_px
    return Grade.NO if apart > s.coarse_px else Grade.USABLE


APART = "the photographs do not agree on one camera"
KINDS = {
    "zoom": lambda s: (
        f"{APART}: the focal length changes between them by about {100 * s.differ_focal:.2g} % (zoom or"
        " focus)"
    ),
    "centre": lambda s: (
        f"{APART}: the image moves on the sensor by about {rough_pixels(s.differ_centre_px)} px"
        " (a stabiliser or cropping)"
    ),
    "lens": lambda s: f"{APART}: the lens's distortion changes between them (another lens, or straightened)",
    "mixed": lambda s: "the photographs do not quite agree on one camera",
    # It is one camera all the same.
    "shutter": lambda s: (
        "the photographs were read row by row while camera or target moved (a rolling shutter)"
    ),
}


def _photographs(s: Situation) -> str:
    if s.groups:
        return f"{APART}: {listed(s.groups[1])} are of another than {listed(s.groups[0])}"
    return KINDS[s.disagree](s)


def _open(s: Situation) -> bool:
    """Whether the camera is not known well enough, and not for lack of corners in some part of the frame."""
    corners_there = s.covered >= WIDE_SHARE or s.share < SMALL_PART * s.covered
    return s.error_px > FINE_PX or (s.share < WIDE_SHARE and corners_there)


def _as_far_as_known(s: Situation) -> Grade:
    return Grade.REGION if good_somewhere(s) else Grade.USABLE


def _as_far_as_it_goes(s: Situation) -> Grade:
    """What is wrong is in the predicted error, so it counts by that."""
    return Grade.USABLE if s.error_px > FINE_PX else Grade.GOOD


CAUSES: tuple[Cause, ...] = (
    Cause(
        "few",
        lambda s: s.views < FEWEST_PHOTOGRAPHS or (isnan(s.error_px) and s.distinct < FEW_VIEWS),
        lambda s: Grade.NO if s.views < 2 or isnan(s.error_px) else Grade.USABLE,
        lambda s: (
            f"{_photograph(s.views)} cannot tell how far off it is"
            if isnan(s.error_px)
            else f"{_photograph(s.views)} are too few to rely on that"
        ),
    ),
    Cause(
        "unknown",
        lambda s: isnan(s.error_px),
        lambda s: Grade.NO,
        lambda s: "no richer camera that it could be compared with can be fitted to these photographs",
    ),
    Cause(
        "lens",
        lambda s: s.beyond > 0,
        lambda s: Grade.NO if s.beyond > WILD_SHARE * s.corners else Grade.USABLE,
        lambda s: (
            f"the lens formula ends {s.fold:.0f} degrees from the axis, before {s.beyond} of the corners"
        ),
    ),
    Cause(
        "corners",
        lambda s: s.wild > WILD_SHARE * s.corners,
        lambda s: _as_far_as_it_goes(s) if s.method == "decoupled" else Grade.USABLE,
        lambda s: (
            f"{s.wild} of {s.corners} corners are far from where the others put them{_where(s.wild_in)}"
        ),
    ),
    Cause("photographs", _matters, _of_photographs, _photographs),
    Cause(
        "lens",
        _lens_is_missed,
        _as_far_as_it_goes,
        lambda s: (
            f"{_formula(s)} cannot follow this lens: at the same places of every photograph"
            f" corners are off by {rough_pixels(s.lens_px)} px"
        ),
    ),
    Cause(
        "target",
        lambda s: s.target_px > 0.0,  # where it is a misfit
        _as_far_as_it_goes,
        lambda s: f"{_target(s)}: in every photograph its corners are off by the same {s.target_mm:.2g} mm",
    ),
    Cause(
        "views",
        lambda s: bool(s.suspects),
        lambda s: Grade.GOOD,
        lambda s: "; ".join(f"in {image} {what}" for image, what in s.suspects[:1]),
    ),
    Cause(
        "tilt",
        lambda s: _open(s) and s.tilt < LEVEL_DEGREES,
        _as_far_as_known,
        lambda s: "the target faced the camera in all photographs, so its focal length is open",
    ),
    Cause(
        "few",
        lambda s: _open(s) and s.distinct < FEW_VIEWS,
        _as_far_as_known,
        lambda s: (
            f"{_photograph(s.distinct)} are few"
            if s.distinct == s.views
            else f"of {s.views} photographs only {s.distinct} differ from one another"
        ),
    ),
    Cause(
        "open",
        _open,
        _as_far_as_known,
        lambda s: (
            "where the lens's axis meets the image is open, as it is with a lens this long"
            if s.centre_sd > ADRIFT_SHARE
            else "these photographs do not tell it better"
        ),
    ),
    Cause(
        "solver",
        lambda s: not s.converged and s.error_px > FINE_PX,
        lambda s: Grade.USABLE,
        lambda s: "the search for the camera did not come to an end",
    ),
    Cause(
        "region",
        lambda s: s.share < WIDE_SHARE,
        lambda s: Grade.REGION,
        lambda s: f"too few corners were seen {s.place}",
    ),
)


def _where(images: Sequence[str]) -> str:
    return f", in {listed(images)}" if images else ""


def _photograph(count: int) -> str:
    return "one photograph" if count == 1 else f"{count} photographs"


def _formula(s: Situation) -> str:
    return (
        "the free lens, as stiff as these photographs made it,"
        if s.lens == "free"
        else f"the formula {s.lens}"
    )


def _target(s: Situation) -> str:
    return (
        "the target is not flat, or not as described"
        if s.shape in ("", "flat")
        else "the target is not of the shape that was found"
    )

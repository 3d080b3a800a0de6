"""What a verdict is made from: plain facts about a calibration, whatever they were found by.

A verdict is a function of these facts and of nothing else, so a test can go through all that may occur.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["COARSE_PX", "FINE_PX", "NEAR_PX", "NOTHING_KNOWN", "USUAL_WIDTH", "Situation", "coarse_px"]

# A camera that is off by no more, pixels, serves everyone: corners are found to about that.
FINE_PX = 0.5
# A camera that is off by more, pixels in an image of 1000, serves nobody.
COARSE_PX = 3.0
# One that is off by more than this even at the distances where the target was serves nobody there either.
NEAR_PX = 1.0
# Limits in pixels are meant for an image of this width, and grow with a larger one.
USUAL_WIDTH = 1000.0


@dataclass(frozen=True)
class Situation:
    """The facts.

    Attributes:
        method, lens, base, first_lens: what the calibration was made by, as it is called again; empty
            where it has no such setting.
        shape: of the target, that it came to.
        views: photographs that were used.
        distinct: of these, those that are not near-copies of another.
        converged: whether the search for the camera came to an end.
        error_px: how far off the camera is, rms over the seen part, of what is far away; NaN where nothing
            says.
        near_px: the same of things where the target was; NaN where nothing says.
        centre_sd: standard deviation of the principal point, as a share of the image's width.
        coarse_px: error above which it is of no use.
        share: of the frame that lies in the region where it is off by FINE_PX at most, corners around it.
        covered: share of the frame that lies between corners, however far off the camera is there.
        place: of the frame where corners are missing, in words.
        noise_px: of a found corner, per point.
        tilt: of the target against the line of sight, degrees, in the photograph that has most but one.
        corners: that were used.
        wild: of these, far from where the others put them.
        wild_in: images that they are in, that with most of them first.
        loss: how errors count, where the method has such a setting.
        beyond: corners that lie where the lens formula has ended.
        fold: degrees from the axis at which it ends.
        disagree: how photographs differ (disagreement.py); empty where they agree.
        differ_px: how far their cameras' images are apart.
        differ_focal: standard deviation of their focal lengths, a share.
        differ_centre_px: of their principal points.
        groups: images of each of two cameras; empty where there are none.
        lens_px: what the lens does at the same places in every photograph and its formula does not; 0 where
            there is no such thing.
        target_px, target_mm: how far the target's corners are from where they are said to be; 0 where there
            is no such thing.
        suspects: images whose own corners fit badly, with what is wrong.
        precious: images that nothing else could replace, with the place that they alone show.
    """

    method: str = "decoupled"
    lens: str = "free"
    shape: str = "flat"
    base: str = "brown"
    first_lens: str = "free"
    views: int = 15
    distinct: int = 15
    converged: bool = True
    error_px: float = 0.1
    near_px: float = float("nan")
    centre_sd: float = 0.0
    coarse_px: float = COARSE_PX
    share: float = 1.0
    covered: float = 1.0
    place: str = "in the middle"
    noise_px: float = 0.1
    tilt: float = 40.0
    corners: int = 800
    wild: int = 0
    wild_in: tuple[str, ...] = ()
    loss: str = ""
    beyond: int = 0
    fold: float = float("nan")
    disagree: str = ""
    differ_px: float = 0.0
    differ_focal: float = 0.0
    differ_centre_px: float = 0.0
    groups: tuple[tuple[str, ...], ...] = ()
    lens_px: float = 0.0
    target_px: float = 0.0
    target_mm: float = 0.0
    suspects: tuple[tuple[str, str], ...] = ()
    precious: tuple[tuple[str, str], ...] = ()


NOTHING_KNOWN = Situation(error_px=float("nan"), share=0.0)


def coarse_px(image_size: tuple[int, int]) -> float:
    """The error above which a camera of this image size is of no use, pixels."""
    return COARSE_PX * max(1.0, max(image_size) / USUAL_WIDTH)

"""The paper's sentences that are judged, word for word but for symbols, each with its section.

The page counts these, each once, however many figures show it.
"""

from __future__ import annotations

from typing import NamedTuple

__all__ = [
    "ACCURATE_FROM_THREE",
    "ALIKE_ON_TEST",
    "ALWAYS_PERFECT",
    "BETTER",
    "BETTER_STRAIGHTENED",
    "BETTER_TRAINED",
    "DEGREE",
    "EXACT_WITHOUT_NOISE",
    "FAR_FROM_FEW",
    "GREATER_ERRORS",
    "MORE_SENSITIVE",
    "NO_LONGER_SATISFIED",
    "ONE_IMAGE",
    "OVER_CONSTRAINED",
    "STABLE",
    "WEIGHTS",
    "Sentence",
]


class Sentence(NamedTuple):
    """What the paper says, and in which section."""

    section: str
    text: str


OVER_CONSTRAINED = Sentence(
    "3.1",
    "Using all residuals, expression (8) is always true and the optimization problem is over constrained.",
)
WEIGHTS = Sentence(
    "3.1", "It is also seen that computed pin-hole model does not depend on the weight of J_PH."
)
ALWAYS_PERFECT = Sentence(
    "3.1",
    "In our experiments, the non-linear searching has always converged to a place where points in images"
    " satisfy all template restrictions perfectly, but the computing time has lasted from 1 min to 1 h.",
)
ACCURATE_FROM_THREE = Sentence(
    "3.1",
    "If the number of images increase the searching time increase also, but the result is always a set of"
    " control points of all images satisfying template restrictions and an accurate camera model.",
)
FAR_FROM_FEW = Sentence(
    "3.1",
    "Therefore, when m < 3 the result of the non-linear searching can compute a pin-hole model which"
    " diverges to a place far away of the right one.",
)
ONE_IMAGE = Sentence(
    "3.2",
    "For the proposed method, the number of images to resolve the model is only one, although several"
    " images are necessary for the previous step and they can be used now.",
)
DEGREE = Sentence(
    "3.2",
    "The degree of the polynomial fish-eye distortion model is not significant to the computation process.",
)
MORE_SENSITIVE = Sentence("4.1", "NMLDC is more sensitive to pixel noise.")
NO_LONGER_SATISFIED = Sentence("4.1", "When data change, the computed model no longer satisfies them.")
ALIKE_ON_TEST = Sentence(
    "4.1",
    "Finally with MLDC, lens distortion is represented by the computed model and when the data change the"
    " normalized error is similar.",
)
EXACT_WITHOUT_NOISE = Sentence(
    "4.1", "In the absence of noise, a small number of training points can yield 100% accuracy."
)
GREATER_ERRORS = Sentence("4.1", "Again NMLDC gives greater errors.")
BETTER_STRAIGHTENED = Sentence(
    "4.2",
    "Distortion correction with MLDC method seems to be more accurate than undistorted images with the"
    " NMLDC or FCCM methods.",
)
BETTER_TRAINED = Sentence("4.2", "The FCCM method obtains better results in the training step.")
BETTER = Sentence(
    "5", "A new calibration method is proposed with better performance than existing calibration methods."
)
STABLE = Sentence(
    "5",
    "This method guaranties stability when non-linear searching is solved and also when the distortion"
    " center is computed.",
)

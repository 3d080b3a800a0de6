"""Finding a grid of discs: spots, the lattice that they make, the board's discs, then their outlines.

Discs are black on white, or white on black; both are tried. What is returned is the centre of the ellipse
that a disc's outline makes, which is not where the disc's centre is seen (`fitting/disc_centres.py`).
"""

from __future__ import annotations

import numpy as np

from orthoscope.detection.discs.disc_foresight import is_among
from orthoscope.detection.discs.disc_growth import FEWEST_DISCS, with_next
from orthoscope.detection.discs.disc_lattice import laid_on
from orthoscope.detection.discs.disc_links import diameter_in_steps, numbered
from orthoscope.detection.discs.disc_outlines import fitted_whole, outlines_near, smoothed
from orthoscope.detection.discs.disc_spots import spots
from orthoscope.detection.discs.whole_discs import are_whole
from orthoscope.detection.sight import Sight, Unseen
from orthoscope.detection.small_copies import resized, to_photograph
from orthoscope.geometry.arrays import Float, Int, ndarray
from orthoscope.geometry.ellipses import Ellipses
from orthoscope.targets.circles import Circles

__all__ = ["see_circles"]

# Copies have these longer sides, pixels.
COPY_SIDES = (640, 1280, 2560)
# A sight of the board has at least this share of its discs.
LEAST_DISCS_SHARE = 0.15
# Where this share of the board's discs hangs together, others are sought that were no spots.
GROWING_DISCS_SHARE = 0.4
# Where this share of the board's discs is found no other copy is looked at.
ENOUGH_DISCS_SHARE = 0.97
# No picture with a shorter side, pixels, is looked at.
SMALLEST_SIDE = 16
# A spot so many of its radii from where a disc was looked for may be another.
NEW_RADII = 0.5


def see_circles(grey: ndarray, board: Circles) -> Sight | Unseen:
    """The centres of the outlines of a grid's discs, or of the part of it that can be seen.

    Args:
        grey: (h,w) uint8.
        board: what to look for.
    """
    search = _Search(board)
    shapes = set()
    for side in COPY_SIDES:
        copy = resized(grey, side)
        if copy.shape in shapes or min(copy.shape) < SMALLEST_SIDE:
            continue
        shapes.add(copy.shape)
        for white in (False, True):
            search.look(copy, grey, white=white)
            if search.is_done:
                return search.best
    return search.outcome


class _Search:
    """What was found of a board so far.

    best: with most discs. asked: where discs were looked for in the photograph. most: that hang together.
    """

    def __init__(self, board: Circles) -> None:
        self.board, self.count = board, board.columns * board.rows
        self.best = Sight(np.zeros(0, dtype=int), np.zeros((0, 2)))
        self.asked = np.zeros((0, 2))
        self.most, self.laid, self.several = 0, False, False

    @property
    def is_done(self) -> bool:
        """Whether hardly anything is left to be found."""
        return len(self.best.ids) >= ENOUGH_DISCS_SHARE * self.count

    @property
    def outcome(self) -> Sight | Unseen:
        """The best sight, or why there is none."""
        if len(self.best.ids) >= FEWEST_DISCS:
            return self.best
        if self.laid:
            return Unseen("is in it, but too blurred, dim or small to say where its discs are")
        if self.several:
            return Unseen("is in it in part only, and which part cannot be told")
        return Unseen(f"was not found in it: {self.most} discs hang together, the board has {self.count}")

    def look(self, copy: ndarray, grey: ndarray, *, white: bool) -> None:
        """At black or white discs in a copy of a photograph: spots first, then where most that hang together
        foresee others.
        """
        largest, laid = (Ellipses(np.zeros((0, 2)), np.zeros((0, 2, 2))), np.zeros((0, 2), dtype=int)), False
        for found in spots(255 - copy if white else copy):
            which, places = numbered(found)
            self.most = max(self.most, len(which))
            if len(which) < max(FEWEST_DISCS, LEAST_DISCS_SHARE * self.count, len(self.best.ids)):
                continue
            laid |= self._lay(found.of(which), places, copy, grey, white=white)
            if self.is_done:
                return
            if len(which) > len(largest[1]):
                largest = found.of(which), places
        if not laid and len(largest[1]) >= GROWING_DISCS_SHARE * self.count:
            smooth = smoothed(copy, white=white)
            rays, places, _ = with_next(smooth, outlines_near(smooth, largest[0]), largest[1])
            if len(places) >= FEWEST_DISCS:
                self._lay(rays.ellipses, places, copy, grey, white=white)

    def _lay(
        self, discs: Ellipses, places: Int[ndarray, "n 2"], copy: ndarray, grey: ndarray, *, white: bool
    ) -> bool:
        """Whether these discs are the board's, in one way; then its discs are fitted where some are new."""
        ids, unsure = laid_on(self.board, discs, places, copy.shape)
        self.several |= unsure
        mine = ids >= 0
        if mine.sum() < FEWEST_DISCS:
            return False
        centres = to_photograph(discs.centres[mine], copy, grey)
        rough = Ellipses(centres, discs.axes[mine] * grey.shape[1] / copy.shape[1])
        if _are_new(rough, self.asked):
            self.laid = True
            sight, asked = _outlined(grey, self.board, rough, ids[mine], white=white)
            self.asked = np.concatenate([self.asked, asked])
            self.best = max(self.best, sight, key=lambda one: len(one.ids))
        return True


def _are_new(discs: Ellipses, asked: Float[ndarray, "k 2"]) -> bool:
    """Whether a disc is where none was looked for yet."""
    apart = np.linalg.norm(discs.centres[:, None] - asked, axis=2).min(1, initial=np.inf)
    return bool((apart > NEW_RADII * np.sqrt(np.abs(np.linalg.det(discs.axes)))).any())


def _outlined(
    grey: ndarray, board: Circles, rough: Ellipses, ids: Int[ndarray, " n"], *, white: bool
) -> tuple[Sight, Float[ndarray, "k 2"]]:
    """Ids and centres from outlines in the photograph, those of discs that were no spots included, and where
    discs were looked for. What is given out was seen whole in the last fit; where it was foreseen, or rays
    met an outline, only said where to look.

    Args:
        grey: (h,w) uint8.
        board: what to look for.
        rough: spots.
        ids: of these.
        white: whether discs are white.
    """
    smooth, on_board = smoothed(grey, white=white), board.neighbour_places()
    rays, places, may_be, seen = outlines_near(smooth, rough), on_board[ids], on_board, 0
    fine, asked = rays, rough.centres
    while True:
        rays, places, more = with_next(smooth, rays, places, among=may_be)
        asked = np.concatenate([asked, more])
        if len(places) in (0, seen):
            break
        fine = fitted_whole(grey, rays)
        good = are_whole(fine, places)
        may_be = may_be[~is_among(may_be, places[~good])]
        rays, fine, places, seen = rays.of(good), fine.of(good), places[good], int(good.sum())
    if len(places) < FEWEST_DISCS:
        return Sight(ids[:0], np.zeros((0, 2))), asked
    ids = (on_board == places[:, None]).all(2).argmax(1)
    order = np.argsort(ids)
    diameter = diameter_in_steps(fine.ellipses, places) * board.nearest
    return Sight(ids[order], fine.ellipses.centres[order], diameter=diameter), asked

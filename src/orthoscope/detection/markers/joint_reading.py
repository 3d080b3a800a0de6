"""All markers of a board read together: which way a lattice of squares lies on the board.

One marker that is small, blurred or noisy cannot be read; but a lattice of squares can lie on its board in
some hundred ways only (four turns, each shift, each layout), and each of these says which marker is in which
square. With d_s what is seen in square s, mean taken out and light evened, and t_n the drawing of marker n,
the mean of all markers taken out,

    a_sn = d_s . t_n,    z_sn = (a_sn - mean_n a_sn) / deviation_n a_sn,    Z(way) = sum_s z_sn(s) / sqrt(k)

over the k squares that hold markers in this way. Mean and deviation go over all markers of the dictionary,
and so over what square s would say of any marker that is not there: of a wrong way, whatever the picture
shows, Z has mean 0 and variance 1, and is normal, being a sum over many squares. Of the right way each z_s is
about m, and the logarithm of the ratio of the likelihoods of both is m sum z_s - k m^2 / 2. The way for which
that is greatest is believed where no chance makes its Z in as many ways as there are, and where the next best
is less likely by far. (Over Z alone a shift by a column might pass that agrees in all other columns.)
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import cv2
import numpy as np

from orthoscope.geometry.arrays import Bool, Float, Int, ndarray
from orthoscope.targets.markers import dictionary, marker_modules

__all__ = ["Drawings", "Squares", "Way", "drawings_of", "likeliest_way", "seen_squares"]

# The likeliest way has at least this Z: chance makes it once in 10^10 ways.
LEAST_Z = 6.4
# And is more likely than any other by at least this, the logarithm of a ratio of 10^6.
LEAST_LIKELIER = 14.0
# Markers are compared blurred by so many of their own squares.
DRAWING_BLUR = 0.4
# A drawing has so many pixels along a marker's square.
DRAWN_PX = 8
# The grey of a marker's square is looked at in its middle and so far to each side, as a share of it.
AWAY_IN_SQUARE = 1.0 / 3.0
# What is seen in a square counts as if it were mixed with this share of what is usual in all.
EVENING_SHARE = 0.5
# So many markers of a dictionary, beside the board's own, say what a square has to do with any marker.
MOST_OTHERS = 100
# A lattice may reach over the board by so many squares, which are none of it.
MOST_OVERHANG = 1
# No way is believed whose logarithm of likelihood is less than this share of that of the likeliest one, be it
# over the rim; some markers at the rim may be seen badly, half of all not.
LEAST_SHARE_OF_LIKELIEST = 0.5
# Squares so far around one tell whether the way is right there, too.
LOCAL_REACH = 2
# They agree with it, in the mean, by at least this share of what all do.
LEAST_LOCAL_SHARE = 0.35


class Squares(NamedTuple):
    """What is seen in the squares of a lattice.

    Attributes:
        values: (rows, columns, bits, bits) inside of the marker that may be there, mean 0.
        inside: (rows, columns) whether the square is in the picture.
    """

    values: Float[ndarray, "r c b b"]
    inside: Bool[ndarray, "r c"]


class Drawings(NamedTuple):
    """How markers are drawn.

    Attributes:
        drawn: (n, bits^2) inside of each marker, the board's first; the mean of all taken out.
        board_count: of the board's.
    """

    drawn: Float[ndarray, "n p"]
    board_count: int


class Way(NamedTuple):
    """How a lattice lies on a board.

    Attributes:
        turns: quarters by which the lattice is turned, as `numpy.rot90` does, to lie as the board does.
        row, column: of the board's square on which the turned lattice's first one lies; may be below 0.
        layout: which of the layouts it is.
        z: how unlikely chance makes it so, in standard deviations.
        agrees: (rows, columns) of the lattice, unturned: whether markers around each square agree.
    """

    turns: int
    row: int
    column: int
    layout: int
    z: float
    agrees: Bool[ndarray, "r c"]


@cache
def drawings_of(name: str, numbers: range, border: int = 1) -> Drawings:
    """How a board's markers are drawn, and others of their dictionary.

    Args:
        name: of the dictionary.
        numbers: of the board's markers.
        border: of a marker, in its squares.
    """
    others = [number for number in range(len(dictionary(name).bytesList)) if number not in numbers]
    bits = int(dictionary(name).markerSize)
    middles = (np.arange(bits) + border + 1) * DRAWN_PX + DRAWN_PX // 2
    drawn = []
    for number in (*numbers, *others[:MOST_OTHERS]):
        white = 1.0 - np.pad(marker_modules(name, number, border=border), 1).astype(np.float32)
        large = np.kron(white, np.ones((DRAWN_PX, DRAWN_PX), np.float32))
        drawn.append(
            cv2.GaussianBlur(large, (0, 0), DRAWING_BLUR * DRAWN_PX)[np.ix_(middles, middles)].ravel()
        )
    return Drawings(np.stack(drawn) - np.mean(drawn, axis=0), len(numbers))


def seen_squares(grey: ndarray, quads: Float[ndarray, "r c 4 2"], bits: int, rim: float) -> Squares:
    """What is seen in squares of a lattice, where a marker would have its bits.

    Args:
        grey: (h,w) uint8.
        quads: pixels of each one's corners: its top left, then clockwise; NaN where it is not known.
        bits: of a marker along its side.
        rim: from a square's side to the bits, as a share of it.
    """
    middles = (np.arange(bits)[:, None] + 0.5 + AWAY_IN_SQUARE * np.array([-1.0, 0.0, 1.0])).ravel() / bits
    u = rim + (1.0 - 2.0 * rim) * middles
    across, down = u[None, :, None, None, None], u[:, None, None, None, None]
    top = (1.0 - across) * quads[:, :, 0] + across * quads[:, :, 1]
    bottom = (1.0 - across) * quads[:, :, 3] + across * quads[:, :, 2]
    at = (1.0 - down) * top + down * bottom  # (down, across, rows, columns, 2)
    rows, columns = quads.shape[:2]
    inside = np.asarray(((at >= 0) & (at <= np.array(grey.shape[::-1]) - 1)).all((0, 1, 4)))
    x, y = (
        np.where(inside[..., None], at, 0.0).astype(np.float32).reshape(len(u) ** 2, -1, 2).transpose(2, 0, 1)
    )
    values = cv2.remap(grey, x.copy(), y.copy(), cv2.INTER_LINEAR).reshape(bits, 3, bits, 3, rows, columns)
    values = values.mean((1, 3), dtype=np.float64).transpose(2, 3, 0, 1)
    values -= values.mean((2, 3), keepdims=True)
    power = (values**2).mean((2, 3), keepdims=True)
    usual = np.median(power[inside]) if inside.any() else 0.0
    return Squares(values / np.sqrt(power + EVENING_SHARE**2 * usual + 1e-6), inside)


def likeliest_way(
    squares: Squares,
    may_hold: Sequence[tuple[int, Bool[ndarray, "r c"]]],
    layouts: Sequence[Int[ndarray, "a b"]],
    markers: Drawings,
) -> Way | None:
    """How a lattice of squares lies on a board, by all its markers; None where they do not say.

    Args:
        squares: what is seen.
        may_hold: the squares in which markers may be, black on white (1) or white on black (-1).
        layouts: which of the board's markers is in each of its squares, -1 where there is none.
        markers: how they are drawn.
    """
    told = [_told(squares, turns, markers) for turns in range(4)]
    may_hold = [(sign, may & squares.inside) for sign, may in may_hold]
    asked = [
        (sign * told[turns], np.rot90(may, turns), numbers, turns, layout)
        for layout, numbers in enumerate(layouts)
        for sign, may in may_hold
        for turns in range(4)
    ]
    shifts = [_all_shifts(z, may, numbers) for z, may, numbers, *_ in asked]
    of = np.concatenate([np.full(one.sums.size, number) for number, one in enumerate(shifts)])
    layout_of = np.array([layout for *_, layout in asked])[of]
    sums, counts, over = (
        np.concatenate([part.ravel() for part in parts]) for parts in zip(*shifts, strict=True)
    )
    likely = _likelihoods(np.where(counts > 0, sums, 0.0), np.where(counts > 0, counts, 1))
    for most_over in (0, MOST_OVERHANG):
        may_lie = (over <= most_over) & (counts > 0)
        best = _likeliest(
            np.where(may_lie, sums, 0.0), np.where(may_lie, counts, 1), layout_of, bool(most_over)
        )
        # lines too many make a wrong way the only one that is not over the rim
        if best is not None and likely[best] < LEAST_SHARE_OF_LIKELIEST * likely.max():
            continue
        if best is not None:
            of_marker, may, numbers, turns, layout = asked[of[best]]
            shift = np.unravel_index(best - int(np.argmax(of == of[best])), shifts[of[best]].sums.shape)
            first = int(shift[0]) + 1 - may.shape[0], int(shift[1]) + 1 - may.shape[1]
            agrees = np.rot90(_locally(of_marker, may, numbers, first), -turns)
            return Way(turns, *first, layout, float(sums[best] / np.sqrt(counts[best])), agrees)
    return None


def _likeliest(
    sums: Float[ndarray, " w"], counts: Int[ndarray, " w"], layouts: Int[ndarray, " w"], doubtful: bool
) -> int | None:
    """Which of all ways is the likeliest; None where it is not by far.

    Where the board is seen so that two layouts have the same markers in the same squares they are as likely;
    then it is the first, which was said. A lattice that reaches over the board is doubtful, and says nothing.
    """
    z, likely = sums / np.sqrt(counts), _likelihoods(sums, counts)
    best = [np.where(layouts == layout, likely, -np.inf).argmax() for layout in np.unique(layouts)]
    chosen = best[0]
    for other in best[1:]:
        if likely[other] > likely[chosen] + (0.0 if doubtful else LEAST_LIKELIER):
            chosen = other
    compared = np.where((layouts == layouts[chosen]) | doubtful, likely, -np.inf)
    compared[chosen] = 0.0
    sure = z[chosen] >= LEAST_Z and likely[chosen] - max(float(compared.max()), 0.0) >= LEAST_LIKELIER
    return int(chosen) if sure else None


def _likelihoods(sums: Float[ndarray, " w"], counts: Int[ndarray, " w"]) -> Float[ndarray, " w"]:
    """Logarithms of how much likelier than chance each way makes what is seen, if all have markers that are
    seen as well as those of the one that chance makes least.
    """
    z = sums / np.sqrt(counts)
    usual = z.max() / np.sqrt(counts[z.argmax()])
    return usual * sums - 0.5 * counts * usual**2


def _told(squares: Squares, turns: int, markers: Drawings) -> Float[ndarray, "r c k"]:
    """What the squares of a turned lattice say of each of the board's markers: how much more than of any
    marker, in standard deviations.
    """
    turned = np.rot90(np.rot90(squares.values, turns, axes=(2, 3)), turns)
    rows, columns = turned.shape[:2]
    alike = turned.reshape(rows, columns, -1) @ markers.drawn.T
    more = alike[..., : markers.board_count] - alike.mean(-1, keepdims=True)
    return more / (alike.std(-1, keepdims=True) + 1e-6)


class _Shifts(NamedTuple):
    """Of each shift of a lattice over a board, from where they touch, the sum of z over the squares that hold
    markers, how many these are, and by how many lines more the lattice reaches over the board than it must.
    """

    sums: Float[ndarray, "s t"]
    counts: Int[ndarray, "s t"]
    over: Int[ndarray, "s t"]


def _all_shifts(
    z: Float[ndarray, "r c k"], may: Bool[ndarray, "r c"], numbers: Int[ndarray, "a b"]
) -> _Shifts:
    squares, places = np.argwhere(may), np.argwhere(numbers >= 0)
    reach = np.array(may.shape) - 1
    size = reach + numbers.shape
    shift = places - squares[:, None] + reach
    flat, count = (shift[..., 0] * size[1] + shift[..., 1]).ravel(), int(size.prod())
    row, column = squares.T
    sums = np.bincount(flat, z[row, column][:, numbers[numbers >= 0]].ravel(), count)
    counts = np.bincount(flat, minlength=count)
    over = np.maximum.outer(*(_over(*both) for both in zip(may.shape, numbers.shape, strict=True)))
    return _Shifts(sums.reshape(size), counts.reshape(size), over)


def _over(length: int, board: int) -> Int[ndarray, " s"]:
    """By how many lines more a lattice reaches over a board than it must, for each shift."""
    first = np.arange(1 - length, board)
    return np.maximum(-first, first + length - board) - max(0, length - board)


def _locally(
    z: Float[ndarray, "r c k"],
    may: Bool[ndarray, "r c"],
    numbers: Int[ndarray, "a b"],
    first: tuple[int, int],
) -> Bool[ndarray, "r c"]:
    """Around which squares of a turned lattice the markers are those of this way."""
    row, column = (at + np.arange(length) for at, length in zip(first, may.shape, strict=True))
    on = np.logical_and.outer(
        *((at >= 0) & (at < most) for at, most in zip((row, column), numbers.shape, strict=True))
    )
    there = numbers[np.ix_(np.clip(row, 0, numbers.shape[0] - 1), np.clip(column, 0, numbers.shape[1] - 1))]
    counts = on & may & (there >= 0)
    here = np.where(counts, np.take_along_axis(z, np.maximum(there, 0)[..., None], axis=2)[..., 0], 0.0)
    window = (2 * LOCAL_REACH + 1,) * 2
    around, number = (
        cv2.boxFilter(part.astype(float), -1, window, normalize=False, borderType=cv2.BORDER_CONSTANT)
        for part in (here, counts)
    )
    return (number > 0.5) & (around >= LEAST_LOCAL_SHARE * number * here.sum() / max(int(counts.sum()), 1))

"""Straight-looking edges of a photograph, to a part of a pixel.

OpenCV's line segment detector says where edges run (R. Grompone von Gioi and others, LSD, PAMI 32(4), 2010);
a bent one comes as several pieces. Along each piece the brightness across it is sampled, and the edge is
where that changes fastest: the vertex of the parabola through the slope's peak and its neighbours. Pieces
that go on in each other are joined to one edge, across gaps and whichever side is the darker: so a row of a
chessboard, whose edges stop at every corner, is one line.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from orthoscope.geometry.arrays import Float, Int, ndarray

__all__ = ["Edge", "edges_of"]

# Pieces shorter than this share of the image's diagonal say nothing of a lens.
SHORTEST_PIECE = 0.015
# So many pieces of a photograph are looked at, the longest: each pair of them may go on in each other.
MOST_PIECES = 800
# The brightness is looked at so far to both sides of a piece, pixels, in such steps.
REACH, PROFILE_STEP = 3.0, 0.5
# So many looks across a piece, one for each pixel along it, are averaged: noise has peaks of its own.
AVERAGED_LOOKS = 7
# A peak of the slope below this, grey values a pixel, is no edge.
LEAST_SLOPE = 6.0
# Ends of a piece are left out, pixels: there other edges begin.
END_MARGIN = 2.0
# Two pieces go on in each other over a gap of at most this share of the diagonal.
LARGEST_GAP_SHARE = 0.03
# Pieces that go on in each other differ in direction by no more than this, radians.
LARGEST_TURN = np.deg2rad(4.0)
# Each of them, drawn on straight, passes the other's near end within this, pixels.
LARGEST_MISS_PX = 1.5
# So many points of an edge are kept, evenly along it.
POINTS_KEPT = 24


class Edge(NamedTuple):
    """Points along an edge, in order.

    Attributes:
        photograph: its number.
        pixels: (n,2).
    """

    photograph: int
    pixels: Float[ndarray, "n 2"]

    @property
    def length(self) -> float:
        """From end to end, pixels."""
        return float(np.hypot(*(self.pixels[-1] - self.pixels[0])))


def edges_of(image: ndarray, photograph: int = 0) -> list[Edge]:
    """The edges of a photograph, longest first.

    Args:
        image: grey, (h,w) uint8.
        photograph: the number that they bear.
    """
    diagonal = float(np.hypot(*image.shape))
    found = cv2.createLineSegmentDetector().detect(image)[0]
    if found is None:
        return []
    ends = np.asarray(found, dtype=np.float64).reshape(-1, 2, 2)
    length = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
    longest = np.argsort(-length, kind="stable")[:MOST_PIECES]
    ends = ends[longest[length[longest] > max(SHORTEST_PIECE * diagonal, 3 * END_MARGIN)]]
    smooth = cv2.GaussianBlur(image, (0, 0), 0.8).astype(np.float32)
    pieces = [points for piece in ends if len(points := _refined(smooth, piece)) >= 4]
    edges = [Edge(photograph, _thinned(points)) for points in _joined(pieces, LARGEST_GAP_SHARE * diagonal)]
    return sorted(edges, key=lambda edge: -edge.length)


def _refined(image: ndarray, piece: Float[ndarray, "2 2"]) -> Float[ndarray, "n 2"]:
    """Points of the edge along a piece, one for each pixel of its length, where the slope has a clear
    peak.
    """
    along = piece[1] - piece[0]
    length = float(np.hypot(*along))
    along = along / length
    across = np.array([-along[1], along[0]])
    t = np.arange(END_MARGIN, length - END_MARGIN, 1.0)
    offsets = np.arange(-REACH, REACH + 0.5 * PROFILE_STEP, PROFILE_STEP)
    places = (piece[0] + t[:, None] * along)[:, None] + offsets[None, :, None] * across
    grey = cv2.remap(
        image,
        places[..., 0].astype(np.float32),
        places[..., 1].astype(np.float32),
        cv2.INTER_CUBIC,
        borderMode=cv2.BORDER_REPLICATE,
    )
    grey = cv2.blur(grey, (1, AVERAGED_LOOKS))
    slope = (grey[:, 2:] - grey[:, :-2]) / (2 * PROFILE_STEP)
    slope = slope * np.sign(slope[:, slope.shape[1] // 2].sum() or 1.0)
    peak = slope[:, 1:-1].argmax(1) + 1
    row = np.arange(len(slope))
    before, at, after = slope[row, peak - 1], slope[row, peak], slope[row, peak + 1]
    bend = before - 2 * at + after
    clear = (at > LEAST_SLOPE) & (bend < 0) & (peak > 1) & (peak < slope.shape[1] - 2)
    shift = 0.5 * (before - after) / np.where(clear, bend, -1.0)
    place = offsets[1:-1][peak] + PROFILE_STEP * np.clip(shift, -1, 1)
    return (places[:, len(offsets) // 2] + place[:, None] * across)[clear]


def _joined(pieces: list[ndarray], gap: float) -> list[ndarray]:
    """Pieces that go on in each other made one, each end with the nearest that fits.

    A piece is two ends, 2i and 2i+1, with the direction in which it leaves there.
    """
    if not pieces:
        return []
    places = np.array([end for points in pieces for end in (points[0], points[-1])])
    leaving = np.array(
        [way / np.hypot(*way) for points in pieces for way in (_way(points[::-1]), _way(points))]
    )
    apart = places[None] - places[:, None]
    distance = np.hypot(apart[..., 0], apart[..., 1])
    ahead = (apart * leaving[:, None]).sum(-1)
    miss = np.abs(apart[..., 0] * leaving[:, None, 1] - apart[..., 1] * leaving[:, None, 0])
    turn = (leaving[:, None] * -leaving[None]).sum(-1)
    fits = (
        (distance < gap)
        & (turn > np.cos(LARGEST_TURN))
        & (miss < LARGEST_MISS_PX)
        & (miss.T < LARGEST_MISS_PX)
    )
    fits &= (ahead > -LARGEST_MISS_PX) & (ahead.T > -LARGEST_MISS_PX)
    mate = np.arange(len(places)) ^ 1
    fits[np.arange(len(places)), mate] = False
    partner = np.full(len(places), -1)
    one, other = np.nonzero(np.triu(fits))
    for i in np.argsort(distance[one, other], kind="stable"):
        if partner[one[i]] < 0 and partner[other[i]] < 0:
            partner[one[i]], partner[other[i]] = other[i], one[i]
    return _chains(pieces, partner)


def _way(points: Float[ndarray, "n 2"]) -> Float[ndarray, "2"]:
    """The direction in which a piece ends: of the line through its last half."""
    last = points[len(points) // 2 :]
    centred = last - last.mean(0)
    way = np.linalg.svd(centred, full_matrices=False)[2][0]
    return way * np.sign(way @ (last[-1] - last[0]) or 1.0)


def _chains(pieces: list[ndarray], partner: Int[ndarray, " e"]) -> list[ndarray]:
    """Pieces strung together along their partners; a ring is cut where it was entered."""
    chains, done = [], np.zeros(len(pieces), dtype=bool)
    for start in [*np.flatnonzero(partner < 0), *range(len(partner))]:
        end, chain = int(start), []
        while end >= 0 and not done[end // 2]:
            done[end // 2] = True
            points = pieces[end // 2]
            chain.append(points if end % 2 == 0 else points[::-1])
            end = int(partner[end ^ 1])
        if chain:
            chains.append(np.concatenate(chain))
    return chains


def _thinned(points: Float[ndarray, "n 2"]) -> Float[ndarray, "m 2"]:
    """At most so many of the points, each the mean of its neighbours' places along a short stretch."""
    if len(points) <= POINTS_KEPT:
        return points
    return np.array([part.mean(0) for part in np.array_split(points, POINTS_KEPT)])

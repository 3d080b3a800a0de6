"""OpenCV's finder for each kind of target, as its tutorials call it: the pixels of what it finds."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.targets.target import Target

__all__ = ["FINDERS", "apart"]

NOTHING = np.zeros((0, 2))


def _chessboard(picture: ndarray, target: Target) -> Float[ndarray, "n 2"]:
    seen, corners = cv2.findChessboardCorners(picture, target.grid)
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 40, 1e-3)
    return cv2.cornerSubPix(picture, corners, (5, 5), (-1, -1), criteria) if seen else NOTHING


def _marked(picture: ndarray, target: Target) -> Float[ndarray, "n 2"]:
    seen, corners = cv2.findChessboardCornersSB(picture, target.grid, flags=cv2.CALIB_CB_MARKER)
    return corners if seen else NOTHING


def _charuco(picture: ndarray, target: Target) -> Float[ndarray, "n 2"]:
    board = target.board
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.dictionary))
    theirs = cv2.aruco.CharucoBoard((board.columns, board.rows), board.square, board.marker, dictionary)
    theirs.setLegacyPattern(board.legacy)
    corners = cv2.aruco.CharucoDetector(theirs).detectBoard(picture)[0]
    return NOTHING if corners is None else corners


def _markers(picture: ndarray, target: Target) -> Float[ndarray, "n 2"]:
    name, numbers = target.board.markers
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    parameters.markerBorderBits = 2 if target.kind == "aprilgrid" else 1
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
    corners, ids, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(picture)
    read = () if ids is None else ids.ravel()
    mine = [one for one, number in zip(corners, read, strict=True) if number in numbers]
    return np.concatenate(mine) if mine else NOTHING


def _circles(picture: ndarray, target: Target) -> Float[ndarray, "n 2"]:
    layout = (
        cv2.CALIB_CB_ASYMMETRIC_GRID if target.board.layout == "asymmetric" else cv2.CALIB_CB_SYMMETRIC_GRID
    )
    seen, centres = cv2.findCirclesGrid(picture, target.grid, flags=layout)
    return centres if seen else NOTHING


FINDERS: dict[str, Callable[[ndarray, Target], ndarray]] = {
    "chessboard": _chessboard,
    "marked": _marked,
    "charuco": _charuco,
    "aprilgrid": _markers,
    "aruco": _markers,
    "circles": _circles,
}


def apart(found: ndarray, truth: Float[ndarray, "m 2"]) -> Float[ndarray, " n"]:
    """How far each of the corners found is from the nearest that is there, px, whichever id it has."""
    pixels = np.asarray(found, dtype=float).reshape(-1, 2)
    there = truth[np.isfinite(truth).all(1)]
    return np.linalg.norm(pixels[:, None] - there, axis=-1).min(1)

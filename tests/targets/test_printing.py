"""What is printed: the board in true size, in every format, found again in its own page."""

from __future__ import annotations

import re
import zlib

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from helpers.target_laws import BOARDS, every_board
from orthoscope.detection.sight import Sight
from orthoscope.detection.table import see
from orthoscope.geometry.arrays import InputError
from orthoscope.targets.printing import MARGIN_MM, PAPERS, PRINT_FORMATS, STRIP_MM, page_of, pdf, png, svg
from orthoscope.targets.table import parse_target
from orthoscope.targets.target import target_of


def rectangles_in_pdf(content: bytes) -> np.ndarray:
    """(n,4) x, y, width, height in mm, y downwards, by the page's own matrix."""
    stream = zlib.decompress(content.split(b"stream\n")[1].split(b"\nendstream")[0]).decode()
    scale = float(stream.split()[0]) * 25.4 / 72
    return np.array(re.findall(r"([-\d.]+) ([-\d.]+) ([-\d.]+) ([-\d.]+) re", stream), dtype=float) * scale


def test_the_squares_of_a_pdf_measure_what_the_board_says():
    boxes = rectangles_in_pdf(pdf(page_of(parse_target("chessboard:9x6:25mm"))))
    squares = boxes[np.isclose(boxes[:, 2], boxes[:, 3])]
    assert len(squares) == 35
    assert_allclose(squares[:, 2:], 25.0, atol=1e-4)
    ruler = boxes[boxes[:, 2].argmax()]
    assert_allclose(ruler[2], 100.0, atol=1e-4)


@every_board
def test_a_board_is_found_in_its_own_page_where_it_is_drawn(board):
    target = target_of(board)
    page = page_of(target)
    picture = cv2.imdecode(np.frombuffer(png(page), np.uint8), cv2.IMREAD_GRAYSCALE)
    shrink = max(picture.shape) / 1000
    small = cv2.resize(picture, None, fx=1 / shrink, fy=1 / shrink, interpolation=cv2.INTER_AREA)
    sight = see(small, target)
    assert isinstance(sight, Sight)
    assert len(sight.ids) == len(target.points)
    a_pixel = np.array([page.width, page.height]) / small.shape[::-1]
    places = (sight.pixels + 0.5) * a_pixel * 1e-3  # metres on the paper
    points = target.points[sight.ids, :2]
    ways = [np.arange(len(points)), *board.symmetries()]
    # a quarter of a pixel: the picture is dots of 0.04 mm, averaged
    assert min(np.abs(places - points[way] - (places - points[way]).mean(0)).max() for way in ways) < 1e-4


@every_board
@pytest.mark.parametrize("suffix", PRINT_FORMATS)
def test_every_board_is_written_in_every_format_within_the_printers_margins(board, suffix):
    page = page_of(target_of(board))
    assert len(PRINT_FORMATS[suffix](page)) > 500
    black = page.rectangles.reshape(-1, 2)
    assert (black > MARGIN_MM - 1e-9).all()
    assert (black < np.array([page.width, page.height]) - MARGIN_MM + 0.5).all()


def test_the_smallest_paper_that_fits_is_taken_and_one_that_is_too_small_is_refused():
    page = page_of(parse_target("chessboard:9x6:25mm"))
    assert (page.width, page.height) == PAPERS["A4"][::-1]
    with pytest.raises(InputError, match="does not fit on A4"):
        page_of(parse_target("chessboard:9x6:40mm"), paper="A4")
    assert (
        page_of(parse_target("chessboard:9x6:40mm"), paper=f"{410}x{280 + 2 * MARGIN_MM + STRIP_MM}mm").width
        == 410
    )
    with pytest.raises(InputError, match="paper 'napkin'"):
        page_of(parse_target("chessboard:9x6:25mm"), paper="napkin")


def test_the_description_stands_on_the_page():
    for board in BOARDS:
        page = page_of(target_of(board))
        assert board.description in svg(page).decode()

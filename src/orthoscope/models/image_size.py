"""A camera answers for photographs of its own size; what to do with one of another."""

from __future__ import annotations

from orthoscope.geometry.arrays import InputError
from orthoscope.models.camera import Camera

__all__ = ["check_image_size", "of_another_size"]


def check_image_size(camera: Camera, size: tuple[int, int]) -> None:
    """Photographs are of the camera's size.

    Args:
        camera: that they are taken to be of.
        size: (width, height) of the photographs.
    Raises:
        InputError: they are not.
    """
    if told := of_another_size(camera, size):
        raise InputError(told)


def of_another_size(camera: Camera, size: tuple[int, int]) -> str:
    """What is wrong with photographs of this size, and what to do; empty where nothing is.

    Args:
        camera: that they are taken to be of.
        size: (width, height) of the photographs.
    """
    (width, height), (w, h) = size, camera.image_size
    if (width, height) == (w, h):
        return ""
    told = f"the photographs are {width}x{height}; this camera was calibrated at {w}x{h}. "
    if abs(width * h - height * w) <= max(width, height, w, h):  # the same shape, to a pixel
        return told + (
            "Where photographs were scaled, scale the camera: orthoscope convert CAMERA scaled.json --to"
            f" orthoscope --resize {width}x{height}; Camera.resized in Python."
        )
    return told + (
        "Hand in photographs of that size; where they are a crop or binned, change the camera likewise:"
        " orthoscope convert CAMERA changed.json --to orthoscope --crop or --binning."
    )

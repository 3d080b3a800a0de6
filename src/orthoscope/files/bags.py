"""Pictures of ROS bags: `.bag` of ROS 1, `.mcap` and `.db3` of ROS 2, read by `rosbags`.

A bag holds messages of many topics; one that has pictures is taken, raw or compressed. Of several it must be
said which.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from orthoscope.geometry.arrays import InputError, ndarray
from orthoscope.machine.missing import how_to_install

__all__ = ["BAGS", "pictures_in_bag"]

BAGS = (".bag", ".mcap", ".db3")
RAW, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
# Of each encoding of a raw picture the kind of its numbers, its channels, and how OpenCV makes it grey.
ENCODINGS: dict[str, tuple[type, int, int | None]] = {
    "mono8": (np.uint8, 1, None),
    "8UC1": (np.uint8, 1, None),
    "mono16": (np.uint16, 1, None),
    "16UC1": (np.uint16, 1, None),
    "rgb8": (np.uint8, 3, cv2.COLOR_RGB2GRAY),
    "bgr8": (np.uint8, 3, cv2.COLOR_BGR2GRAY),
    "8UC3": (np.uint8, 3, cv2.COLOR_BGR2GRAY),
    "rgba8": (np.uint8, 4, cv2.COLOR_RGBA2GRAY),
    "bgra8": (np.uint8, 4, cv2.COLOR_BGRA2GRAY),
    "bayer_rggb8": (np.uint8, 1, cv2.COLOR_BayerBG2GRAY),
    "bayer_bggr8": (np.uint8, 1, cv2.COLOR_BayerRG2GRAY),
    "bayer_gbrg8": (np.uint8, 1, cv2.COLOR_BayerGR2GRAY),
    "bayer_grbg8": (np.uint8, 1, cv2.COLOR_BayerGB2GRAY),
}


def pictures_in_bag(path: Path, topic: str | None = None) -> Iterator[tuple[float, ndarray]]:
    """Seconds from the first picture, and the pictures of a topic, (h,w), as they were recorded.

    Args:
        path: of the bag.
        topic: such as /camera/image_raw; may be left out where only one has pictures.
    Raises:
        InputError: `rosbags` is not installed, the file is no bag, or the topic is none of its own.
    """
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError
        from rosbags.typesys import Stores, get_typestore
    except ModuleNotFoundError as error:
        raise InputError(how_to_install(error) or str(error)) from error
    try:
        reader = AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
        reader.open()
    except (AnyReaderError, OSError, ValueError) as error:
        raise InputError(
            f"{path} cannot be read as a bag ({error}); expected one of ROS. Name another."
        ) from error
    try:
        chosen = _connections(reader.connections, path, topic)
        first = None
        for connection, nanoseconds, content in reader.messages(connections=chosen):
            message = reader.deserialize(content, connection.msgtype)
            first = nanoseconds if first is None else first
            yield (nanoseconds - first) * 1e-9, _picture(message, connection.msgtype, path)
    finally:
        reader.close()


def _connections(connections: list[Any], path: Path, topic: str | None) -> list[Any]:
    """Those of the topic, or of the only one that has pictures."""
    shown = [one for one in connections if one.msgtype in (RAW, COMPRESSED)]
    topics = sorted({one.topic for one in shown})
    if topic is None and len(topics) == 1:
        return shown
    chosen = [one for one in shown if one.topic == topic]
    if not chosen:
        told = ", ".join(topics) or "none"
        raise InputError(
            f"{path} has pictures in these topics: {told}; got {topic or 'no topic'}. Say which one, such as"
            " --topic /camera/image_raw."
        )
    return chosen


def _picture(message: Any, kind: str, path: Path) -> ndarray:
    if kind == COMPRESSED:
        picture = cv2.imdecode(
            np.asarray(message.data, dtype=np.uint8), cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH
        )
        if picture is None:
            raise InputError(f"{path} has a picture of format {message.format!r} that cannot be read.")
        return picture
    if message.encoding not in ENCODINGS:
        raise InputError(
            f"{path} has pictures with the encoding {message.encoding!r}; expected one of"
            f" {', '.join(ENCODINGS)}. Convert the topic."
        )
    number, channels, to_grey = ENCODINGS[message.encoding]
    words = np.dtype(number).newbyteorder(">" if message.is_bigendian else "<")
    rows = np.asarray(message.data, dtype=np.uint8).reshape(message.height, message.step)
    rows = rows[:, : message.width * channels * words.itemsize].copy().view(words).astype(number)
    shape = (message.height, message.width) if channels == 1 else (message.height, message.width, channels)
    picture = rows.reshape(shape)
    return picture if to_grey is None else cv2.cvtColor(picture, to_grey)

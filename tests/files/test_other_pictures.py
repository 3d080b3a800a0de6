"""HEIC and raw photographs, ROS bags: read by packages of their own, and named where these are missing."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from orthoscope.files.bags import pictures_in_bag
from orthoscope.files.films import worth_looking_at
from orthoscope.files.images import photographs, read_image
from orthoscope.files.pictures import pictures
from orthoscope.geometry.arrays import InputError

SLOPE = np.tile(np.arange(0, 240, dtype=np.uint8)[:, None], (1, 320))


def test_a_heic_photograph_is_read_and_its_turn_undone(tmp_path):
    heif = pytest.importorskip("pillow_heif")
    image = pytest.importorskip("PIL.Image")
    heif.register_heif_opener()
    turned = image.Exif()
    turned[274] = 6  # held upright
    picture = image.fromarray(SLOPE).convert("RGB")
    picture.save(tmp_path / "level.heic", quality=100)
    picture.save(tmp_path / "upright.heic", quality=100, exif=turned.tobytes())
    for name in ("level.heic", "upright.heic"):
        assert_allclose(read_image(tmp_path / name, grey=True).astype(float), SLOPE, atol=3)


@pytest.mark.parametrize(
    ("package", "name", "extra"),
    [("pillow_heif", "a.heic", "heic"), ("rawpy", "a.dng", "raw"), ("rosbags", "a.mcap", "ros")],
)
def test_where_a_package_is_missing_its_name_is_told(package, name, extra, tmp_path, monkeypatch):
    for module in [one for one in sys.modules if one.partition(".")[0] == package]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, package, None)
    (tmp_path / name).write_bytes(b"something")
    with pytest.raises(InputError, match=rf"pip install 'orthoscope\[{extra}\]'"):
        pictures(tmp_path / name)[0].grey(most_megapixels=10.0)


def test_a_broken_photograph_of_such_a_kind_is_an_input_error(tmp_path):
    pytest.importorskip("pillow_heif")
    (tmp_path / "a.heic").write_bytes(b"no photograph")
    with pytest.raises(InputError, match=r"a\.heic: it cannot be read"):
        read_image(tmp_path / "a.heic")


def test_raw_photographs_of_a_folder_are_taken_where_there_are_no_others(tmp_path):
    (tmp_path / "a.cr2").write_bytes(b"raw")
    assert [file.name for file in photographs([tmp_path])] == ["a.cr2"]
    (tmp_path / "a.jpg").write_bytes(b"the same")
    assert [file.name for file in photographs([tmp_path])] == ["a.jpg"]


@pytest.fixture
def bag(tmp_path):
    """A recording of ROS 2 with two topics: a picture that moves, and one of another camera."""
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    image, header, time = (
        store.types[name]
        for name in ("sensor_msgs/msg/Image", "std_msgs/msg/Header", "builtin_interfaces/msg/Time")
    )
    folder = tmp_path / "run"
    with rosbag2.Writer(folder, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP) as writer:
        for topic, encoding in (("/left/image_raw", "mono8"), ("/right/image_raw", "rgb8")):
            connection = writer.add_connection(topic, image.__msgtype__, typestore=store)
            for second in range(12):
                picture = np.roll(SLOPE, 20 * second, axis=0)
                channels = 1 if encoding == "mono8" else 3
                told = image(
                    header(time(second, 0), "camera"), 240, 320, encoding, 0, 320 * channels,
                    np.repeat(picture.ravel(), channels),
                )  # fmt: skip
                content = store.serialize_cdr(told, image.__msgtype__)
                writer.write(connection, 1_000_000_000 * (second + 5), content)
    return next(folder.glob("*.mcap"))


@pytest.mark.parametrize("topic", ["/left/image_raw", "/right/image_raw"])
def test_a_bags_pictures_are_those_of_the_topic(bag, topic):
    found = list(pictures_in_bag(bag, topic))
    assert [seconds for seconds, _ in found] == list(range(12))
    assert_array_equal(found[0][1], SLOPE)
    named = pictures(bag, topic=topic)
    assert named[0].name.startswith("run.mcap@")
    assert 2 <= len(named) <= 12


def test_of_several_topics_one_must_be_said(bag):
    for topic in (None, "/nothing"):
        with pytest.raises(InputError, match="/left/image_raw, /right/image_raw"):
            list(pictures_in_bag(bag, topic))


def test_kept_frames_lie_in_files_not_in_memory():
    rng = np.random.default_rng(0)
    frames = worth_looking_at(
        ((float(i), rng.integers(0, 256, (60, 80), dtype=np.uint8)) for i in range(40)), most=6
    )
    assert 3 <= len(frames) <= 6
    assert all(isinstance(frame.picture, np.memmap) for frame in frames)

"""Straight films: as many frames as there were, in their order, and whole or not there."""

from __future__ import annotations

from fractions import Fraction

import cv2
import numpy as np
import pytest

from orthoscope.files.films import frames_of as frames_worth_a_look
from orthoscope.files.sensor_frames import mark_turned, quarter_turns
from orthoscope.geometry.arrays import InputError
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown
from orthoscope.straight.film import CODECS, is_video, undistort_video
from orthoscope.straight.film_av import has_pyav
from orthoscope.straight.undistort import Straightener

SIZE, FRAMES, RATE = (160, 120), 40, 12.5
CAMERA = Camera(SIZE, Intrinsics(120.0, 120.0, 80.0, 60.0), Brown(k1=-0.2))


def filmed(i: int) -> np.ndarray:
    """A picture that brightens from left to right, and with i."""
    return np.repeat(
        (np.linspace(0, 120, 160)[None, :, None] + 3.0 * i).astype(np.uint8), 120, axis=0
    ).repeat(3, axis=2)


FILMED = [filmed(i) for i in range(FRAMES)]


@pytest.fixture(params=sorted(CODECS))
def film(request, tmp_path):
    path = tmp_path / f"film{request.param}"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*CODECS[request.param]), RATE, SIZE)
    for picture in FILMED:
        writer.write(picture)
    writer.release()
    return path


def frames_of(path) -> list[np.ndarray]:
    source, frames = cv2.VideoCapture(str(path)), []
    while (read := source.read())[0]:
        frames.append(read[1])
    return frames


def test_each_frame_comes_out_straight_and_in_its_place(film, tmp_path):
    told = []
    place = tmp_path / "straight" / film.name
    assert undistort_video(film, CAMERA, place, keep="valid", progress=lambda *at: told.append(at)) == FRAMES
    straightener = Straightener(CAMERA, keep="valid")
    straight, expected = (
        [picture.astype(float) for picture in pictures]
        for pictures in (frames_of(place), map(straightener, FILMED))
    )
    assert len(straight) == FRAMES
    assert cv2.VideoCapture(str(place)).get(cv2.CAP_PROP_FPS) == pytest.approx(RATE, rel=1e-3)
    for i, (picture, wanted) in enumerate(zip(straight, expected, strict=True)):
        # codecs shift all colours by up to 5 and lose some; the frame before would be 3 away
        assert np.median(np.abs((picture - straight[0]) - (wanted - expected[0]))) < 1.5, i
    assert told == [(i + 1, FRAMES, film.name) for i in range(FRAMES)]
    assert list(place.parent.iterdir()) == [place]


def test_what_is_a_film_is_told_by_its_name():
    assert is_video("clip.MP4")
    assert not is_video("clip.png")


@pytest.mark.parametrize("name", ["film.png", "film"])
def test_a_place_that_is_no_film_is_refused(tmp_path, name):
    (tmp_path / "a.avi").write_bytes(b"")
    with pytest.raises(InputError, match=r"expected one of \.mp4"):
        undistort_video(tmp_path / "a.avi", CAMERA, tmp_path / name)


def test_a_film_that_is_not_there_or_cannot_be_read_is_named(tmp_path):
    with pytest.raises(InputError, match=r"missing\.mp4 does not exist"):
        undistort_video(tmp_path / "missing.mp4", CAMERA, tmp_path / "out/a.mp4")
    (tmp_path / "text.mp4").write_text("no film")
    with pytest.raises(InputError, match=r"text\.mp4 is no film"):
        undistort_video(tmp_path / "text.mp4", CAMERA, tmp_path / "out/a.mp4")


@pytest.mark.parametrize("failure", [KeyboardInterrupt, InputError])
def test_a_film_that_is_stopped_leaves_nothing_behind(film, tmp_path, failure):
    place = tmp_path / "straight" / film.name

    def stop(done, total, name):
        if done == 10:
            raise failure

    with pytest.raises(failure):
        undistort_video(film, CAMERA, place, progress=stop)
    assert list(place.parent.iterdir()) == []


def test_a_film_of_another_size_is_refused_and_nothing_is_left_behind(film, tmp_path):
    camera = Camera((640, 480), CAMERA.intrinsics, CAMERA.lens)
    with pytest.raises(InputError, match=r"160x120; this camera was calibrated at 640x480"):
        undistort_video(film, camera, tmp_path / "straight/film.mp4")
    assert list((tmp_path / "straight").iterdir()) == []


@pytest.fixture
def film_with_sound(tmp_path):
    """Frames at uneven times, and a tone."""
    av = pytest.importorskip("av", reason="PyAV writes films with sound; pip install 'orthoscope[video]'")
    path = tmp_path / "sound.mp4"
    with av.open(str(path), "w") as film:
        seen, heard = film.add_stream("libx264", rate=25), film.add_stream("aac", rate=16000)
        seen.width, seen.height = SIZE
        seen.pix_fmt, seen.time_base = "yuv420p", Fraction(1, 1000)
        seen.codec_context.time_base = Fraction(1, 1000)
        for at, picture in zip(UNEVEN, FILMED, strict=False):
            frame = av.VideoFrame.from_ndarray(picture, format="bgr24")
            frame.pts, frame.time_base = at, Fraction(1, 1000)
            film.mux(seen.encode(frame))
        film.mux(seen.encode(None))
        tone = np.sin(np.arange(16000) * 0.1).astype(np.float32)[None]
        sound = av.AudioFrame.from_ndarray(tone, format="fltp", layout="mono")
        sound.sample_rate, sound.pts = 16000, 0
        film.mux(heard.encode(sound))
        film.mux(heard.encode(None))
    return path


UNEVEN = (0, 40, 100, 110, 300, 340, 900)


def times_and_sound(path) -> tuple[list[float], list[bytes], str]:
    import av

    with av.open(str(path)) as film:
        codec = film.streams.video[0].codec_context.name
        times = [float(frame.time) for frame in film.decode(video=0)]
    with av.open(str(path)) as film:
        sound = [bytes(packet) for packet in film.demux(audio=0) if packet.size]
    return times, sound, codec


def test_a_film_keeps_its_sound_and_the_times_of_its_frames(film_with_sound, tmp_path):
    place = tmp_path / "straight/sound.mp4"
    assert undistort_video(film_with_sound, CAMERA, place) == len(UNEVEN)
    times, sound, codec = times_and_sound(place)
    given_times, given_sound, _ = times_and_sound(film_with_sound)
    assert times == pytest.approx(given_times, abs=2e-3)
    assert times == pytest.approx([at / 1000 for at in UNEVEN], abs=2e-3)
    assert sound == given_sound
    assert codec == "h264"


def test_without_pyav_opencv_writes_the_film(film_with_sound, tmp_path, monkeypatch):
    monkeypatch.setattr("orthoscope.straight.film.has_pyav", lambda: False)
    assert undistort_video(film_with_sound, CAMERA, tmp_path / "straight/sound.mp4") >= len(UNEVEN) - 1


def test_a_film_is_not_written_onto_itself(film_with_sound, tmp_path):
    before = film_with_sound.read_bytes()
    (tmp_path / "link.mp4").symlink_to(film_with_sound)
    for place in (film_with_sound, tmp_path / "link.mp4"):
        with pytest.raises(InputError, match="what is read is never written onto"):
            undistort_video(film_with_sound, CAMERA, place)
    assert film_with_sound.read_bytes() == before


@pytest.mark.parametrize("quarters", [1, 2, 3])
@pytest.mark.parametrize("pyav", [True, False])
def test_a_film_that_players_turn_is_straightened_as_the_sensor_saw_it(tmp_path, monkeypatch, quarters, pyav):
    """A telephone held upright: players turn the film, OpenCV too unless it is told not to."""
    monkeypatch.setattr("orthoscope.straight.film.has_pyav", lambda: pyav and has_pyav())
    path, place = tmp_path / "turned.mp4", tmp_path / "straight" / "turned.mp4"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"mp4v"), RATE, SIZE)
    for picture in FILMED[:8]:
        writer.write(picture)
    writer.release()
    mark_turned(path, quarters, size=SIZE)
    shown = SIZE if quarters == 2 else SIZE[::-1]
    assert frames_of(path)[0].shape[1::-1] == shown
    assert frames_worth_a_look(path)[0].picture.shape[::-1] == SIZE
    assert undistort_video(path, CAMERA, place) == 8
    assert quarter_turns(path) == quarter_turns(place) == quarters
    assert frames_of(place)[0].shape[1::-1] == shown

"""Films, the camera, synthetic recordings, and films in files."""

import sys
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from filmed_markers import steady

from cellmap.basins import StoreError
from systems import lab

CLEAN = lab.Look(shade=0.0, read_noise=0.0, full_well=float("inf"), rod_width=0.0, blur=0.0)


CAMERA = lab.Camera(scale=500.0, origin=(32.25, 20.5), shape=(64, 80))


def test_the_camera_looks_from_the_front() -> None:
    """Right is right, up is a smaller row, and back again."""
    assert CAMERA.pixels([0.0, 0.0]).tolist() == [32.25, 20.5]
    assert CAMERA.pixels([[0.01, 0.0], [0.0, 0.01]]).tolist() == [[37.25, 20.5], [32.25, 15.5]]
    places = np.random.default_rng(0).normal(size=(5, 3, 2))
    assert np.abs(CAMERA.places(CAMERA.pixels(places)) - places).max() < 1e-14


@pytest.mark.parametrize(
    ("frames", "times", "error"),
    [
        (np.zeros((2, 3, 4), np.int32), [0.0, 1.0], "frames are int32"),
        ([[1]], [0.0], "frames are list"),
        (np.zeros((2, 3, 4, 3), np.uint8), [0.0, 1.0], "give grey frames"),
        (np.zeros((0, 3, 4), np.uint8), [], "give grey frames"),
        (np.zeros((2, 3, 4), np.uint8), [0.0], "give one for each of the 2 frames"),
        (np.zeros((2, 3, 4), np.uint8), [0.0, np.nan], r"times\[1\]=nan: give finite times"),
        (np.zeros((2, 3, 4), np.uint8), [0.0, 0.0], r"times\[1\]=0 follows 0"),
    ],
)
def test_what_is_no_film(frames: Any, times: Any, error: str) -> None:
    with pytest.raises((TypeError, ValueError), match=error):
        lab.Film(frames, np.array(times))


def test_missing_frames() -> None:
    """Flagged ones, and those with numbers that are not finite."""
    frames = np.ones((4, 3, 5), np.float32)
    frames[1], frames[3, 0, 0] = np.nan, np.inf
    film = lab.film_at_rate(frames, 50.0, dropped=[True, False, False, False])
    assert film.missing.tolist() == [True, True, False, True]
    assert repr(film) == "Film(4 frames of 5 x 3 pixels, float32, 0 to 0.06 s, 1 dropped)"
    assert film.shape == (3, 5)
    assert len(film) == 4
    part = lab.select_frames(film, [0, 2])
    assert part.times.tolist() == [0.0, 0.04]
    assert part.missing.tolist() == [True, False]
    with pytest.raises(ValueError, match="dropped is int64 of shape"):
        lab.film_at_rate(frames, 50.0, dropped=[0, 1, 0, 0])
    with pytest.raises(ValueError, match="strictly increase"):
        lab.select_frames(film, [2, 0])


def test_a_marker_is_where_the_truth_is() -> None:
    """Its light, on a black ground, has the disc's area and centre: to what 4 x 4 points a pixel leave open."""
    look = lab.Look(marker_radius=5.0, marker=200.0, background=0.0, shade=0.0, blur=0.0, rod_width=0.0, read_noise=0.0)
    for k in range(5):
        camera = lab.Camera(500.0, (32.25 + 0.2 * k, 20.5 + 0.13 * k), (64, 80))
        recording = lab.render_film(steady(), camera, [0.5], look, rng=k)
        light = recording.film.frames[0].astype(float)
        rows, columns = np.mgrid[:64, :80]
        centre = np.array([(columns * light).sum(), (rows * light).sum()]) / light.sum()
        assert np.abs(centre - recording.truth[0, 0]).max() < 0.01
        assert light.sum() / 200.0 == pytest.approx(25.0 * pi, rel=0.01)
        assert recording.truth[0, 0] == pytest.approx(camera.pixels([0.05 * np.sin(1.0), -0.05 * np.cos(1.0)]))


def test_exposure_smears() -> None:
    """The second moment along the way grows by travel^2 / 12, and the middle stays."""
    look = lab.Look(marker_radius=4.0, marker=250.0, background=0.0, shade=0.0, blur=0.0, rod_width=0.0, read_noise=0.0)
    motion = steady(speed=1.0, length=0.2)
    camera = lab.Camera(500.0, (-40.0, 80.0), (96, 140))
    moments = []
    for exposure in (0.0, 0.1):
        recording = lab.render_film(motion, camera, [0.5], look, exposure)
        light = recording.film.frames[0].astype(float)
        rows, columns = np.mgrid[:96, :140]
        along = np.array([np.cos(1.5), -np.sin(1.5)])
        way = (columns - recording.truth[0, 0, 0]) * along[0] + (rows - recording.truth[0, 0, 1]) * along[1]
        assert (way * light).sum() / light.sum() == pytest.approx(0.0, abs=0.02)
        moments.append((way**2 * light).sum() / light.sum())
        assert recording.film.exposure == exposure
    assert moments[1] - moments[0] == pytest.approx(10.0**2 / 12.0, rel=0.02)


def test_noise_is_that_of_electrons() -> None:
    """Variance g 255 / full well + read noise^2 + 1/12 of rounding, on an even ground of grey g."""
    look = lab.Look(background=100.0, shade=0.0, full_well=5000.0, read_noise=2.0, rod_width=0.0, marker_radius=1.0)
    frames = lab.render_film(steady(), CAMERA, np.linspace(0.1, 0.2, 20), look, rng=3).film.frames[:, :20].astype(float)
    expected = 100.0 * 255.0 / 5000.0 + 4.0 + 1.0 / 12.0
    assert frames.var() == pytest.approx(expected, rel=5.0 * np.sqrt(2.0 / frames.size))
    assert frames.mean() == pytest.approx(100.0, abs=5.0 * np.sqrt(expected / frames.size))


def test_bars_spots_and_dropped_frames() -> None:
    place = CAMERA.pixels([0.05 * np.sin(1.0), -0.05 * np.cos(1.0)])
    bar = lab.Bar(left=place[0], right=79.0, top=0.0, bottom=63.0, grey=10.0, start=0.4)
    spot = lab.Spot(column=10.0, row=50.0, radius=4.0)
    recording = lab.render_film(steady(), CAMERA, [0.1, 0.3, 0.5], CLEAN, bars=[bar], spots=[spot], dropped=[1], rng=1)
    film = recording.film
    assert film.dropped.tolist() == [False, True, False]
    assert film.frames[:, 50, 10].tolist() == [220, 0, 220]
    column, row = place.round().astype(int)
    assert film.frames[0, row, column + 2] == 220
    assert film.frames[2, row, column + 2] == 10
    assert recording.visible[:, 0] == pytest.approx([1.0, 1.0, 0.5], abs=0.02)
    outside = lab.render_film(steady(), lab.Camera(500.0, (-20.0, 20.0), (64, 80)), [0.1], CLEAN)
    assert outside.visible[0, 0] < 0.999


FRAMES = np.random.default_rng(5).integers(0, 256, (6, 12, 16)).astype(np.uint8)


@pytest.mark.parametrize("name", ["film.gif", "film.tif", "film.tiff", "film"])
def test_there_and_back(tmp_path: Path, name: str) -> None:
    pytest.importorskip("imageio")
    film = lab.film_at_rate(FRAMES, 25.0)
    lab.write_film(film, tmp_path / name)
    assert [p.name for p in tmp_path.iterdir()] == [name]
    back = lab.read_film(tmp_path / name, None if name.endswith("gif") else 25.0)
    assert (back.frames == film.frames).all()
    assert back.times == pytest.approx(film.times)
    if not name.endswith("gif"):
        with pytest.raises(ValueError, match="does not say when its frames were taken; give frame_rate="):
            lab.read_film(tmp_path / name)


def test_images_are_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    """Many cameras number without leading zeros; the grey value of each image is its number."""
    imageio = pytest.importorskip("imageio.v3")
    (tmp_path / "film").mkdir()
    for k in range(12):
        imageio.imwrite(tmp_path / "film" / f"img{k}.png", np.full((4, 5), k, np.uint8))
    assert lab.read_film(tmp_path / "film", 10.0).frames[:, 0, 0].tolist() == list(range(12))


def test_equal_frames_of_a_gif_keep_their_times(tmp_path: Path) -> None:
    """Four dropped frames are black and become one; those after them keep their times, exact multiples of 5 ms."""
    pytest.importorskip("imageio")
    film = lab.film_at_rate(np.where(np.isin(np.arange(6), [2, 3])[:, None, None], np.uint8(0), FRAMES), 200.0)
    lab.write_film(film, tmp_path / "film.gif")
    back = lab.read_film(tmp_path / "film.gif", 200.0)
    assert back.times == pytest.approx(film.times[[0, 1, 2, 4, 5]], abs=1e-12)
    assert (back.frames == film.frames[[0, 1, 2, 4, 5]]).all()


def test_deep_images(tmp_path: Path) -> None:
    pytest.importorskip("imageio")
    film = lab.film_at_rate((FRAMES.astype(np.uint16) * 257), 100.0)
    for name in ("deep.tiff", "folder"):
        lab.write_film(film, tmp_path / name)
        back = lab.read_film(tmp_path / name, 100.0)
        assert back.frames.dtype == np.uint16
        assert (back.frames == film.frames).all()
    with pytest.raises(ValueError, match="film has grey values of uint16: convert them to uint8"):
        lab.write_film(film, tmp_path / "deep.gif")


def test_colours_become_grey(tmp_path: Path) -> None:
    """ITU-R BT.601: 0.299 R + 0.587 G + 0.114 B."""
    imageio = pytest.importorskip("imageio.v3")
    (tmp_path / "film").mkdir()
    for k, colour in enumerate([(255, 0, 0), (0, 255, 0), (0, 0, 255), (7, 7, 7)]):
        imageio.imwrite(tmp_path / "film" / f"{k}.png", np.full((4, 5, 3), colour, np.uint8))
    assert lab.read_film(tmp_path / "film", 10.0).frames[:, 2, 2].tolist() == [76, 150, 29, 7]


def test_files_that_are_no_films(tmp_path: Path) -> None:
    imageio = pytest.importorskip("imageio.v3")
    film = lab.film_at_rate(FRAMES, 25.0)
    lab.write_film(film, tmp_path / "film.gif")
    whole = (tmp_path / "film.gif").read_bytes()
    for name, content in (("cut.gif", whole[: len(whole) // 3]), ("text.tif", b"no picture"), ("none.gif", b"")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(StoreError, match="truncated or of another kind"):
            lab.read_film(tmp_path / name, 25.0)
    with pytest.raises(FileNotFoundError, match="there is no such file"):
        lab.read_film(tmp_path / "missing.gif")
    with pytest.raises(ValueError, match=r"choose a .gif"):
        (tmp_path / "film.txt").write_text("x", encoding="utf-8")
        lab.read_film(tmp_path / "film.txt")
    (tmp_path / "empty").mkdir()
    with pytest.raises(StoreError, match="holds no images"):
        lab.read_film(tmp_path / "empty", 25.0)
    imageio.imwrite(tmp_path / "empty" / "a.png", FRAMES[0])
    imageio.imwrite(tmp_path / "empty" / "b.png", FRAMES[0, :8])
    with pytest.raises(StoreError, match="different sizes"):
        lab.read_film(tmp_path / "empty", 25.0)
    (tmp_path / "empty" / "b.png").write_bytes(b"\x89PNG\r\n")
    with pytest.raises(StoreError, match=r"b\.png' is truncated or no image"):
        lab.read_film(tmp_path / "empty", 25.0)


def test_what_is_not_installed_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    film = lab.film_at_rate(FRAMES, 25.0)
    with monkeypatch.context() as without:
        without.setattr("importlib.util.find_spec", lambda name: None)
        with pytest.raises(ModuleNotFoundError, match=r"pip install 'cellmap-dynamics\[video\]'"):
            lab.write_film(film, tmp_path / "film.mp4")
    monkeypatch.setitem(sys.modules, "imageio", None)
    monkeypatch.setitem(sys.modules, "imageio.v3", None)
    with pytest.raises(ModuleNotFoundError, match=r"pip install 'cellmap-dynamics\[video\]'"):
        lab.write_film(film, tmp_path / "film.gif")
    assert not list(tmp_path.iterdir())


def test_a_short_video(tmp_path: Path) -> None:
    """Coding alters grey values a little, and neither times nor what is bright and what is dark."""
    film = lab.film_at_rate(np.tile(np.repeat(np.array([0, 200], np.uint8), 8), (3, 16, 1)), 50.0)
    lab.write_film(film, tmp_path / "film.mp4")
    again = lab.read_film(tmp_path / "film.mp4")
    np.testing.assert_allclose(again.times, film.times, atol=1e-9)
    assert np.array_equal(again.frames > 100, film.frames > 100)
    whole = (tmp_path / "film.mp4").read_bytes()
    (tmp_path / "torn.mp4").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(StoreError, match="truncated or of another kind"):
        lab.read_film(tmp_path / "torn.mp4")

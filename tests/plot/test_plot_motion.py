"""Figures of motions: which curves are drawn, where they are cut, and films that are whole files."""

from math import cos, pi, sin

import matplotlib.pyplot as plt
import numpy as np
import pytest
from PIL import Image

from cellmap import Coordinate, ForcedSystem, angle, plot, trajectory
from cellmap.plot import _animation as animation
from cellmap.plot._axes import cut_at_branch_cuts
from systems.lab import read_film

ANGLE = angle("theta")
AXES = Coordinate("t"), ANGLE


def rhs(t, x, p):
    return x[1], -sin(x[0]) + 0.1 * cos(t)


PENDULUM = ForcedSystem(
    rhs,
    {},
    2 * pi,
    (ANGLE, Coordinate("v", "rad/s")),
    "pendulum",
    outputs={
        "positions": lambda t, x, p: (0.0, 0.0, sin(x[0]), -cos(x[0])),
        "energy": lambda t, x, p: (0.5 * x[1] ** 2 - cos(x[0]),),
        "tip": lambda t, x, p: (sin(x[0]), -cos(x[0]), 0.0),
    },
)


@pytest.fixture(scope="module")
def motion():
    """One orbit swings, the other rotates."""
    return trajectory(PENDULUM, [[0.5, 0.0], [0.5, 3.0]], 3, samples_per_period=16)


def curves(ax):
    return [line for line in ax.get_lines() if line.get_marker() == "None"]


def marks(ax):
    return [line for line in ax.get_lines() if line.get_marker() == "o"]


def test_a_curve_is_cut_where_it_crosses_the_branch_cut():
    curve = np.array([[0.0, 5.0], [1.0, -7.0], [2.0, 30.0]])
    assert np.array_equal(cut_at_branch_cuts(curve, (Coordinate("t"), Coordinate("x"))), curve)
    curve = np.array([[0.0, pi - 1.0], [4.0, pi + 3.0]])
    exact = [[0, pi - 1], [1, pi], [np.nan, np.nan], [1, -pi], [4, 3 - pi]]
    assert cut_at_branch_cuts(curve, AXES) == pytest.approx(np.array(exact), abs=1e-12, nan_ok=True)
    through = np.array([[0.0, 0.0], [1.0, pi], [2.0, 2 * pi]])  # a sample lies there
    exact = [[0, 0], [1, pi], [np.nan, np.nan], [1, -pi], [2, 0]]
    assert cut_at_branch_cuts(through, AXES) == pytest.approx(np.array(exact), abs=1e-12, nan_ok=True)
    there_and_back = np.array([[0.0, 0.0], [1.0, pi], [2.0, 0.0]])
    assert not np.isnan(cut_at_branch_cuts(there_and_back, AXES)).any()
    for direction in (1, -1):
        cut = cut_at_branch_cuts(np.array([[0.0, 0.0], [1.0, direction * 6 * pi]]), AXES)
        assert np.count_nonzero(np.isnan(cut[:, 0])) == 3
        assert cut[-1] == pytest.approx([1.0, 0.0], abs=1e-12)
    curve = np.array([[0.0, 0.0], [1.0, 1.0], [2.0, np.nan], [3.0, np.nan]])  # gaps stay gaps
    cut = cut_at_branch_cuts(curve, AXES)
    assert cut[np.isfinite(cut).all(axis=1)] == pytest.approx(curve[:2])


def test_cuts_on_a_torus_keep_every_piece_inside():
    """Two angles of different turns; along the pieces both grow as before, and nothing is lost."""
    pair = (angle("a"), angle("b", "deg", 360.0, 0.0))
    t = np.linspace(0.0, 10.0, 41)
    curve = np.stack([7.0 * t + np.sin(t), -500.0 * t], axis=-1)
    cut = cut_at_branch_cuts(curve, pair)
    low, high = np.array([-pi, 0.0]), np.array([pi, 360.0])
    kept = cut[np.isfinite(cut[:, 0])]
    assert (kept >= low - 1e-9).all() and (kept <= high + 1e-9).all()
    steps = np.diff(cut, axis=0)
    steps = steps[np.isfinite(steps[:, 0])]
    assert steps.sum(axis=0) == pytest.approx(curve[-1] - curve[0])


def test_no_line_runs_across_the_branch_cut(motion):
    (panel,) = plot.time_series(motion, names="theta")
    swing, rotation = (line.get_ydata() for line in curves(panel))
    assert not np.isnan(swing).any()
    crossings = np.count_nonzero(np.diff(np.floor((motion.states[:, 1, 0] + pi) / (2 * pi))))
    assert crossings > 0
    assert np.count_nonzero(np.isnan(rotation)) == crossings
    assert np.nanmax(np.abs(np.diff(rotation))) < pi
    assert np.nanmax(np.abs(rotation)) == pytest.approx(pi)


@pytest.mark.parametrize(
    ("figure", "arguments", "message"),
    [
        ("time_series", {"names": "w"}, r"names has 'w': the coordinates of pendulum are \['theta', 'v'\] and its"),
        ("time_series", {"labels": ["one"]}, r"labels=\['one'\]: give 2 names"),
        ("phase_portrait", {"coordinates": (2, 1)}, "coordinates=2: give a whole number of at most 1"),
        ("phase_portrait", {"coordinates": ("v", "w")}, r"coordinates='w': the coordinates are \['theta', 'v'\]"),
        ("animate", {"path": "film.avi"}, r"path='film.avi': give the name of a file that ends in \.gif or \.mp4"),
        ("animate", {"path": "no such folder/film.gif"}, "there is no folder 'no such folder'"),
        ("animate", {"output": "places"}, r"output='places': the outputs of pendulum are .* give the ForcedSystem"),
        ("animate", {"output": "energy"}, "output='energy' has 1 components: give x and y"),
        ("animate", {"output": "tip"}, "output='tip' has 3 components: give x and y"),
    ],
)
def test_figures_of_motions_check_their_arguments(motion, figure, arguments, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises((ValueError, TypeError, FileNotFoundError), match=message):
        getattr(plot, figure)(motion, **arguments)
    assert plt.get_fignums() == []


def test_a_gif_has_a_frame_for_every_so_many_samples(motion, tmp_path):
    assert plot.animate(motion, tmp_path / "pendulum.GIF", every=12, frames_per_second=20.0) is None
    with Image.open(tmp_path / "pendulum.GIF") as film:
        assert film.format == "GIF"
        assert film.n_frames == 5  # 49 samples
        assert (film.info["duration"], film.width) == (50, 600)
    assert [p.name for p in tmp_path.iterdir()] == ["pendulum.GIF"]
    assert plt.get_fignums() == []


def test_frames_show_rods_bobs_and_a_fading_trace(motion):
    film = plot.animate(motion, trace=5)
    assert film._interval == pytest.approx(1000.0 / 30.0)
    film._draw_frame(20)
    (ax,) = plt.gcf().axes
    lines = [line.get_xydata() for line in ax.get_lines()]
    positions = motion.output("positions")[20].reshape(2, 2, 2)
    for i in range(2):
        assert any(np.array_equal(line, positions[i]) for line in lines)
        assert any(np.array_equal(line, positions[i, 1:]) for line in lines)
        trail = ax.collections[i]
        assert np.array_equal([piece[0] for piece in trail.get_segments()], motion.output("positions")[15:20, i, 2:])
        assert (np.diff(trail.get_colors()[:, 3]) > 0).all()
    assert ax.get_title() == f"pendulum, t = {motion.times[20]:.4g}"
    assert ax.get_aspect() == 1.0
    low, high = ax.get_xlim()
    assert low < positions[..., 0].min() and positions[..., 0].max() < high
    film._draw_was_started = True  # it is shown to nobody


def test_a_motion_that_ends_is_shown_to_its_end(tmp_path):
    rod = {"place": lambda t, x, p: (0.0, 0.0, x[0], 0.0)}
    system = ForcedSystem(lambda t, x, p: (x[0] ** 2,), {}, 1.0, ("x",), outputs=rod)
    ending = trajectory(system, [0.45], 4, samples_per_period=2)
    assert np.isfinite(ending.states[:, 0]).sum() == 5  # 1/(2.22 - t) until t = 2.22
    (panel,) = plot.time_series(ending)
    panel.figure.canvas.draw()
    assert np.isnan(curves(panel)[0].get_ydata()[-1])
    with pytest.raises(ValueError, match="coordinates=1: give a whole number of at most 0"):
        plot.phase_portrait(ending)
    for trace in (8, 0):
        plot.animate(ending, tmp_path / "end.gif", output="place", trace=trace)
        with Image.open(tmp_path / "end.gif") as film:
            assert film.n_frames == len(ending.times) == 9


def test_a_film_that_fails_leaves_what_was_there(motion, tmp_path, monkeypatch):
    path = tmp_path / "pendulum.gif"
    path.write_text("older")
    monkeypatch.setattr(animation.PillowWriter, "finish", lambda self: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        plot.animate(motion, path, every=24)
    assert path.read_text() == "older"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("there", [True, False])
def test_mp4_needs_ffmpeg(motion, tmp_path, monkeypatch, there):
    if there and not animation.FFMpegWriter.isAvailable():
        pytest.skip("ffmpeg is not there")
    monkeypatch.setattr(animation.FFMpegWriter, "isAvailable", classmethod(lambda cls: there))
    if there:
        plot.animate(motion, tmp_path / "pendulum.mp4", every=12)
        assert len(read_film(tmp_path / "pendulum.mp4").frames) == len(range(0, len(motion.times), 12))
    else:
        with pytest.raises(RuntimeError, match=r"needs the program ffmpeg.*install it, or give .* ends in \.gif"):
            plot.animate(motion, tmp_path / "pendulum.mp4")
        assert list(tmp_path.iterdir()) == []


def test_a_gif_claims_its_memory(motion, tmp_path, monkeypatch):
    monkeypatch.setattr("cellmap._lib.checks._ALWAYS_FREE", 0)
    monkeypatch.setattr("cellmap._lib.checks.memory_available", lambda: 10_000_000)
    with pytest.raises(MemoryError, match=r"a GIF of 49 frames needs .* take a larger every=, or write an MP4"):
        plot.animate(motion, tmp_path / "pendulum.gif")

"""The explorer's server, over real connections: its images are the library's, and it serves nobody but its page."""

import io
import sys
import threading
import time
from typing import Any

import av
import numpy as np
import pytest
from PIL import Image
from served_pages import DUFFING, WELLS, WINDOW, Page, assert_same_image, connected, push, upright

from cellmap import CellGrid, discrete_map, find_basins, interpolated_map, load_basins, stroboscopic_map
from cellmap.analysis.fractal import basin_entropy, boundary_dimension
from cellmap.explorer import Explorer, explore
from cellmap.explorer.protocol import LOWEST


def test_images_are_those_of_the_library(page: Page) -> None:
    assert page.hello["system"]["view"]["params"] == {"keep": 0.6}
    frame, numbers = page.image()
    assert_same_image(frame, numbers, find_basins(WELLS, WINDOW), upright)
    frame, numbers = page.image(params={"keep": 0.7}, lower=[-1, -1], upper=[0.5, 1], cells=[40, 30])
    grid = CellGrid((-1.0, -1.0), (0.5, 1.0), (40, 30))
    assert_same_image(frame, numbers, find_basins(WELLS.with_params(keep=0.7), grid), upright)
    frame, numbers = page.image(axes=[1, 0], lower=[-1.5, -2], upper=[1.5, 2], cells=[48, 64])
    assert_same_image(frame, numbers, find_basins(WELLS, WINDOW), lambda labels: labels[::-1])
    # A map of one coordinate is a strip.
    page.ask("system", name="line")
    _, numbers = page.image(cells=[80])
    assert numbers.shape == (1, 80)
    places = np.abs(np.linspace(-2 + 2 / 80, 2 - 2 / 80, 80))
    assert np.array_equal(numbers[0] >= 0, places < 1)


def test_parameters_phases_and_kinds_of_maps_of_a_forced_system(page: Page) -> None:
    assert page.ask("system", name="duffing")["system"]["forced"]
    grid = CellGrid((-2.2, -2.2), (2.2, 2.2), (60, 50))
    for nodes, phase in ((0, 0.0), (128, 0.25)):
        frame, numbers = page.image(params={"gamma": 0.12}, phase=phase, nodes=nodes)
        exact = stroboscopic_map(DUFFING.with_params(gamma=0.12), phase, rtol=1e-6, atol=1e-6)
        table = CellGrid((-2.42, -2.42), (2.42, 2.42), (128, 128))
        point_map = interpolated_map(exact, table) if nodes else exact
        assert_same_image(frame, numbers, find_basins(point_map, grid), upright)
        told = page.ask("quality")
        assert told["map"] == ("interpolated" if nodes else "stroboscopic")
        assert not nodes or 0 < told["error"]["median"] < told["error"]["largest"]
    verified = page.ask("verify", n_samples=200)
    assert verified["compared"] == 200
    assert verified["low"] <= verified["wrong"] / 200 <= verified["high"]


def test_a_scene_has_the_parts_that_are_switched_on(page: Page) -> None:
    assert page.hello["systems"][-1] == {"name": "parts", "title": "From parts", "about": "", "thumbnail": None}
    found = page.ask("system", name="parts")["system"]
    assert found["scene"] == {"bodies": ["light", "heavy"], "effects": ["push"], "parts": ["light"]}
    assert found["view"]["params"] == {"keep": 0.6}
    frame, numbers = page.image()
    assert_same_image(frame, numbers, find_basins(WELLS, WINDOW), upright)
    found = page.ask("system", name="parts", parts=["heavy", "push"])["system"]
    assert found["view"]["params"] == {"keep": 0.7, "push": 0.5}
    frame, numbers = page.image()
    pushed = discrete_map(push, {"keep": 0.7, "push": 0.5}, ("x", "v"))
    assert_same_image(frame, numbers, find_basins(pushed, WINDOW), upright)
    page.refused("system", "'push' is no body: begin with one of light, heavy", name="parts", parts=["push"])
    page.refused("system", "no effect 'fog': take some of push", name="parts", parts=["light", "fog"])
    for parts in ([], "light"):
        page.refused("system", "give the name of a body", name="parts", parts=parts)


def test_an_orbit_ends_where_its_pixel_says(page: Page) -> None:
    page.ask("system", name="duffing")
    frame, numbers = page.image(nodes=0)
    for column, row in ((3, 7), (30, 20), (55, 44)):
        place = [-2.2 + 4.4 * (column + 0.5) / 60, 2.2 - 4.4 * (row + 0.5) / 50]
        orbit = page.ask("orbit", point=place)
        assert orbit["identity"] == numbers[row, column]
        (end,) = (a for a in frame["attractors"] if a["identity"] == orbit["identity"])
        assert np.abs(np.array(orbit["strobe"][-1]) - end["points"][0]).max() < 0.1
        states, samples = np.array(orbit["motion"]["states"]), orbit["motion"]["samples"]
        assert np.abs(states[::samples] - np.array(orbit["strobe"])).max() < 1e-4


def test_the_script_computes_the_image_again_to_the_bit(page: Page, capsys: pytest.CaptureFixture[str]) -> None:
    text = "\n".join(["q' = v", "v' = q - q**3 - c*v + f*cos(w*t)", "c = 0.2", "f = 0.1", "w = 1.1", "period = 2*pi/w"])
    assert page.ask("system", text=text)["system"]["view"]["params"] == {"c": 0.2, "f": 0.1, "w": 1.1}
    page.image(params={"f": 0.11}, phase=0.1, cells=[50, 40])
    frame, _ = page.image(params={"f": 0.12}, phase=0.1, cells=[50, 40], nodes=128)
    names: dict[str, Any] = {"__name__": "script"}
    exec(page.ask("script")["text"], names)
    assert "bit by bit" in capsys.readouterr().out
    assert names["basins"].labels.shape == (50, 40) and names["point_map"].table is not None
    assert sum(a["fraction"] for a in frame["attractors"]) == pytest.approx(1.0)


def test_files_are_of_basins_and_have_the_labels(page: Page, tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    frame, numbers = page.image()
    image, file = page.ask("hdf5"), page.ask("netcdf")
    for one in (image, file):
        (tmp_path / one["name"]).write_bytes(one["data"])
    basins = load_basins(tmp_path / image["name"])
    assert_same_image(frame, numbers, basins, upright)
    import xarray

    with xarray.open_datatree(tmp_path / file["name"], engine="h5netcdf") as tree:
        np.testing.assert_array_equal(tree["labels"], basins.labels)
    monkeypatch.setitem(sys.modules, "xarray", None)
    page.refused("netcdf", "pip install 'cellmap-dynamics[xarray]'")


def test_at_most_two_frames_are_under_way_and_the_last_view_comes_to_its_end(page: Page) -> None:
    for k in range(40):
        last = page.send("view", view={"params": {"keep": 0.5 + 0.005 * k}, "cells": [300, 300]})
    frames = [page.receive(), page.receive()]
    with pytest.raises(TimeoutError):
        page.receive(1.0)
    for frame in frames:
        page.send("drawn", frame=frame["frame"])
    frames += page.frames(lambda facts: facts["request"] == last and facts["complete"])
    assert len(frames) < 40, "views in between are left out"
    requests = [frame["request"] for frame in frames]
    assert requests == sorted(requests)


def test_a_newer_view_ends_the_image_before(page: Page) -> None:
    """Four million initial conditions, for which nobody waits."""
    page.image()
    page.send("view", view={"params": {"keep": 0.65}, "cells": [2000, 2000]})
    frame = page.receive()
    page.send("drawn", frame=frame["frame"])
    wanted = page.send("view", view={"params": {"keep": 0.7}})
    frames = [frame, *page.frames(lambda facts: facts["request"] == wanted and facts["complete"])]
    assert not any(f["complete"] for f in frames if f["request"] != wanted)


def test_work_ends_with_the_connection(explorer: Explorer) -> None:
    def workers() -> int:
        return sum(t.name.startswith(("image", "question")) for t in threading.enumerate())

    before = workers()
    for _ in range(3):
        with connected(explorer) as page:
            page.send("view", view={"cells": [2000, 2000]})
            assert not page.receive()["complete"]
    deadline = time.monotonic() + 10.0
    while workers() > before and time.monotonic() < deadline:
        time.sleep(0.02)
    assert workers() <= before


def test_a_server_with_a_page_that_rests_costs_nothing(page: Page) -> None:
    page.image()
    time.sleep(0.3)
    began = time.process_time()
    time.sleep(1.0)
    assert time.process_time() - began < 0.02


def test_a_system_that_is_given() -> None:
    with explore(WELLS, WINDOW, open_page=False, wait=False) as running, connected(running) as page:
        assert page.hello["system"]["name"] == "given"
        frame, numbers = page.image()
        assert_same_image(frame, numbers, find_basins(WELLS, WINDOW), upright)
        assert f'src="{running.address}"' in running._repr_html_()
    assert repr(running) == "Explorer(closed)"
    with pytest.raises(ValueError, match="give the ForcedSystem of the map"):
        explore(stroboscopic_map(DUFFING), open_page=False)
    with pytest.raises(TypeError, match="system=3: give"):
        explore(3)  # type: ignore[arg-type]


def test_a_diagram_follows_the_attractors(page: Page) -> None:
    """Pitchfork: the fixed points of x + 0.2 (x - x^3) are 0 and +-1 at any value of `keep`."""
    frame, _ = page.image()
    found = page.ask("diagram", parameter="keep", lower=0.4, upper=0.7)
    points = np.frombuffer(found["data"], "<f4").reshape(found["shape"])
    assert points.shape[0] == 2
    assert points.shape[1] == len(found["values"])
    assert (np.diff(found["values"]) >= 0).all()
    for identity, branch in zip(found["identities"], points, strict=True):
        (attractor,) = (a for a in frame["attractors"] if a["identity"] == identity)
        assert np.abs(branch - attractor["points"][0]).max() < 1e-5
    assert "give a range around the present value" not in str(found)
    page.refused("diagram", "parameter='mass'", parameter="mass", lower=0.4, upper=0.7)


def test_stability_over_two_parameters(page: Page) -> None:
    """Of x^2 + c the lower fixed point is stable for -3/4 < c < 1/4, whatever a parameter without effect is."""
    page.ask("system", text="x -> x**2 + c + 0*a\nc = 0.0\na = 1.0")
    page.image(cells=[80])
    axes = {"x": {"parameter": "c", "lower": -1.0, "upper": 0.2}, "y": {"parameter": "a", "lower": 0.0, "upper": 2.0}}
    found = page.ask("stability", **axes)
    unstable = np.frombuffer(found["data"], np.int8).reshape(len(found["identities"]), len(found["y"]), len(found["x"]))
    assert (unstable[0] == (np.array(found["x"]) < -0.75)).all()
    (curve,) = found["curves"]
    assert (curve["crossing"], curve["identity"]) == ("MINUS_ONE", found["identities"][0])
    assert np.abs(np.array(curve["x"]) + 0.75).max() < 1e-9
    for wrong, message in (
        ({"x": 3}, "x=3: give an object"),
        ({"y": {"parameter": "b"}}, "y.parameter='b'"),
        ({"y": {"parameter": "a", "lower": 2, "upper": 1}}, "y: lower=2, upper=1"),
        ({"y": axes["x"]}, "y has the parameter 'c' of x"),
    ):
        page.refused("stability", message, **{**axes, **wrong})


def test_the_boundary_is_the_stable_manifold_of_the_saddle(page: Page) -> None:
    """The origin: its multipliers are the roots of z^2 - 1.8 z + 0.6.  Pixels around each point of the curve differ.

    Both manifolds leave it along eigenvectors of its Jacobian; the unstable one leads to the attractors.
    """
    _, numbers = page.image(cells=[300, 300])
    found = page.ask("saddles", longest_period=1)
    (saddle,) = found["saddles"]
    assert np.abs(saddle["points"]).max() < 1e-9
    assert saddle["multipliers"] == pytest.approx([0.9 + np.sqrt(0.21), 0.9 - np.sqrt(0.21)])
    points = np.frombuffer(found["data"], "<f4").reshape(-1, 2)
    (stable,), (unstable,) = found["lengths"]["stable"], found["lengths"]["unstable"]
    assert len(points) == stable + unstable
    values, vectors = np.linalg.eig([[1.2, 0.6], [0.2, 0.6]])
    for part, k in ((points[:stable], values.argmin()), (points[stable:], values.argmax())):
        near = part[(np.abs(part) < 0.02).all(axis=1) & (np.abs(part) > 1e-4).any(axis=1)].astype(float)
        assert len(near) > 4
        assert np.abs(near @ np.array([-vectors[1, k], vectors[0, k]])).max() < 1e-3
    ends = points[stable:][~np.isnan(points[stable:, 0])]
    for x in (-1.0, 1.0):
        assert np.hypot(ends[:, 0] - x, ends[:, 1]).min() < 0.02
    points = points[:stable]
    columns, rows = ((points - [-2, -1.5]) / [4, 3] * 300 // 1).T
    inside = (columns > 0) & (columns < 299) & (rows > 0) & (rows < 299)  # none where a curve is interrupted
    assert inside.sum() > 300
    for i, j in zip(columns[inside].astype(int), 299 - rows[inside].astype(int), strict=True):
        assert len(np.unique(numbers[j - 1 : j + 2, i - 1 : i + 2])) == 2
    page.refused("saddles", "longest_period=9", longest_period=9)
    page.ask("system", name="line")
    page.image(cells=[80])
    page.refused("saddles", "two coordinates only")
    page.refused("certify", "certificates are for maps of two coordinates")


FILM = {"view": {}, "parameter": "keep", "lower": 0.5, "upper": 0.7, "stills": 3}


def test_a_film_has_the_images_of_its_values(page: Page) -> None:
    palette = np.random.default_rng(0).integers(0, 256, (32, 3)).tolist()
    answer = page.ask("film", **FILM, palette=palette)
    assert (answer["type"], answer["name"]) == ("film", "basins.gif")
    with Image.open(io.BytesIO(answer["data"])) as film:
        assert film.n_frames == 3
        film.seek(2)
        last = np.array(film.convert("RGB"))
    _, numbers = page.image(params={"keep": 0.7})
    assert np.array_equal(last[:48], np.array(palette)[numbers - LOWEST])
    assert set(np.unique(last[48:])) == {0, 255}, "black on white: the value"
    page.refused("film", "palette", **FILM, palette=[[300]])
    page.refused("film", "format='mov'", **FILM, palette=palette, format="mov")
    page.refused("film", "films go along one parameter", **FILM, across={"parameter": "keep"})
    html = page.ask("film", **{**FILM, "view": {"params": {"keep": 0.6}}}, palette=palette, format="html")
    assert html["media"] == "text/html"
    assert b'id="family"' in html["data"]


def test_a_video_has_the_images_of_its_values(page: Page, monkeypatch: pytest.MonkeyPatch) -> None:
    """H.264 keeps colours to some parts in 255, away from edges; the image is enlarged to 512 pixels."""
    palette = [[40 + 6 * k, 200 - 5 * k, 3 * k] for k in range(32)]
    answer = page.ask("film", **FILM, palette=palette, format="mp4")
    assert (answer["name"], answer["media"]) == ("basins.mp4", "video/mp4")
    with av.open(io.BytesIO(answer["data"])) as film:
        frames = [frame.to_ndarray(format="rgb24").astype(int) for frame in film.decode(video=0)]
        assert film.streams.video[0].average_rate == 12.5
    assert len(frames) == 3
    _, numbers = page.image(params={"keep": 0.7})
    shown = frames[-1][: 48 * 8].reshape(48, 8, 64, 8, 3)[:, 2:6, :, 2:6].mean(axis=(1, 3))
    assert np.quantile(np.abs(shown - np.array(palette)[numbers - LOWEST]).max(axis=-1), 0.97) < 6
    monkeypatch.setattr("cellmap.explorer.films.find_spec", lambda _: None)
    page.refused("film", "pip install 'cellmap-dynamics[video]'", **FILM, palette=palette, format="mp4")


def test_measures_and_certificates_are_the_librarys(page: Page) -> None:
    cells = [200, 200]
    page.image(cells=cells)
    basins = find_basins(WELLS, CellGrid((-2.0, -1.5), (2.0, 1.5), (200, 200)))
    found = {m["name"]: m for m in page.ask("measures")["measures"]}
    entropy, dimension = basin_entropy(basins), boundary_dimension(basins)
    assert found["basin entropy"]["value"] == pytest.approx(entropy.entropy)
    assert found["boundary basin entropy"]["error"] == pytest.approx(entropy.boundary_error)
    assert found["boundary dimension"]["value"] == pytest.approx(dimension.fit.slope)
    assert len(found["uncertainty exponent"]["fit"]["x"]) > 3
    page.ask("system", name="duffing")
    page.image(cells=[40, 30])
    told = page.ask("certify")
    assert told["open"] == np.frombuffer(told["data"], np.uint8).sum() < 120  # on the boundary alone
    assert (told["height"], told["width"]) == (30, 40)
    assert 0 <= told["changed"] <= told["redone"] <= 1200

"""Live images: those of find_basins at each parameter, with attractors that keep their identity; the newest wins."""

import threading
import time
from collections.abc import Mapping

import numpy as np
import pytest
from known_basins import CONSERVATIVE, duffing

import systems
from cellmap import CellGrid, Label, PointMap, discrete_map, find_basins, interpolated_map, set_threads
from cellmap.basins import LiveBasins, LiveFrame

LINE = CellGrid((-2.0,), (2.0,), (101,))
WINDOW = CellGrid((-2.2, -2.2), (2.2, 2.2), (60, 50))


def tilted(x, p):
    """Steps downhill in x^4/4 - x^2/2 - t x: two wells where abs(t) < 2/sqrt(27) = 0.385."""
    return (x[0] + 0.2 * (x[0] - x[0] ** 3 + p.t),)


TILTED = discrete_map(tilted, {"t": 0.0}, ("x",))


def identities_of(frame: LiveFrame) -> Mapping[int, float]:
    """The first coordinate of each attractor, by identity."""
    return {k: float(a.points[0, 0]) for k, a in frame.attractors.items()}


def image(live: LiveBasins, *request: object, **options: object) -> LiveFrame:
    frame = live.image(*request, **options)
    assert frame is not None
    return frame


def same_basins(frame: LiveFrame, point_map: PointMap, grid: CellGrid) -> None:
    """The same sets as those of a call that knows nothing, attractor by attractor."""
    alone = find_basins(point_map, grid)
    assert frame.complete
    assert len(alone.attractors) == len(frame.basins.attractors)
    for one, other in zip(frame.basins.attractors, alone.attractors, strict=True):
        assert np.abs(one.points - other.points).max() < 1e-9
    assert np.array_equal(frame.basins.labels, alone.labels)


@pytest.mark.parametrize("interpolated", [False, True])
def test_images_are_those_of_basins_found_alone(interpolated: bool) -> None:
    def make(phase: float = 0.0, **params: float) -> PointMap:
        nodes = CellGrid((-2.5, -2.5), (2.5, 2.5), (96, 96))
        exact = duffing(phase, **params)
        return interpolated_map(exact, nodes, tolerance=1e-2) if interpolated else exact

    live = LiveBasins(make(), WINDOW)
    same_basins(image(live), make(), WINDOW)
    same_basins(image(live, {"gamma": 0.11}), make(gamma=0.11), WINDOW)
    same_basins(image(live, {"gamma": 0.11}, phase=0.4), make(0.4, gamma=0.11), WINDOW)
    closer = CellGrid((-0.5, -0.5), (0.5, 0.5), (30, 40))
    same_basins(image(live, {"delta": 0.3}, initial_conditions=closer), make(delta=0.3), closer)


def test_an_attractor_keeps_its_identity_while_it_moves() -> None:
    """Wells at -1 and 1; one vanishes at t = 0.385 and comes back; attractors that go and come are told once."""
    live = LiveBasins(TILTED, LINE)
    first = image(live)
    left, right = sorted(first.attractors, key=identities_of(first).__getitem__)
    assert set(first.born) == {left, right}
    for t in np.linspace(0.05, 0.35, 7):
        frame = image(live, {"t": float(t)})
        assert identities_of(frame)[right] > 1.0
        assert identities_of(frame)[left] < -0.5
        assert (frame.born, frame.gone) == ((), ())
    assert (image(live, {"t": 0.45}).gone, image(live, {"t": 0.5}).gone) == ((left,), ())
    back = image(live, {"t": 0.36})
    assert (back.born, back.gone) == ((left,), ())
    assert set(np.unique(back.identity_image)) == {left, right}
    assert (back.identity_image[:20] == left).all()


def test_a_preview_comes_before_anything_is_verified(monkeypatch: pytest.MonkeyPatch) -> None:
    """Orbits by Newton's method, with the regions of those before; the frames after it rest on verified ones."""
    set_threads(1)
    live = LiveBasins(duffing(), WINDOW)
    assert not any(frame.preview for frame in live.frames())
    frames = live.frames({"gamma": 0.101})
    with monkeypatch.context() as patch:
        patch.setattr("cellmap.basins.family.with_regions", lambda *_: pytest.fail("verified too early"))
        early = [next(frames), next(frames)]
    assert [(f.stride, f.preview) for f in early] == [(8, True), (4, True)]
    late = list(frames)
    assert [(f.stride, f.preview) for f in late] == [(4, False), (2, False), (1, False), (1, False)]
    whole = find_basins(duffing(gamma=0.101), WINDOW)
    for frame in early:
        labels = frame.basins.labels[:: frame.stride, :: frame.stride]
        assert np.array_equal(labels, whole.labels[:: frame.stride, :: frame.stride])
        assert np.array_equal(frame.identity_samples, frame.identity_image[:: frame.stride, :: frame.stride])
    assert np.array_equal(late[-1].basins.labels, whole.labels)


def test_identities_do_not_change_on_the_way_through_phases() -> None:
    """The flow takes each attractor from one phase to the next, however far they are apart."""
    live, seen = LiveBasins(duffing(), WINDOW), []
    for phase in (None, 0.5, 0.05, 0.75, 0.0):
        frame = image(live, phase=phase)
        seen.append(identities_of(frame))
        assert frame.born == (() if seen[1:] else tuple(seen[0]))
        assert frame.gone == ()
    assert all(now.keys() == seen[0].keys() for now in seen)
    assert seen[-1] == pytest.approx(seen[0])
    assert all(np.sign(now[k]) == np.sign(seen[0][k]) for now in seen for k in now), "each stays in its well"


def test_a_chaotic_attractor_keeps_its_identity_and_one_that_doubles_its_period() -> None:
    live = LiveBasins(systems.logistic_map(3.2), CellGrid((0.0,), (1.0,), (40,)), max_periods=300)
    seen = [set(image(live, {"mu": r}).attractors) for r in (3.2, 3.4, 3.47, 3.9, 3.91, 3.4)]
    assert seen == [seen[0]] * len(seen)
    assert len(seen[0]) == 1


def test_many_threads_at_once_leave_the_image_of_the_last_request() -> None:
    live, done = LiveBasins(duffing(), WINDOW), []

    def storm(number: int) -> None:
        for k in range(6):
            frame = live.image({"gamma": 0.1 + 1e-3 * (5 * number + k)}, near=(0.0, 0.0))
            done.append(frame is None or not frame.complete or (frame.basins.labels >= 0).all())

    threads = [threading.Thread(target=storm, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60.0)
    assert len(done) == 24
    assert all(done)
    same_basins(image(live, {"gamma": 0.1}), duffing(), WINDOW)
    assert len(image(live, {"gamma": 0.1}).attractors) == 2


def test_a_parameter_that_is_dragged_has_previews_of_every_place_and_images_of_its_own() -> None:
    """Once tables over the parameter are made, previews reach stride 1; the last image is that of the map alone."""

    def wells(x, p):
        y = 0.8 * x[1] + p.h * (x[0] - x[0] ** 3)
        return x[0] + y, y

    exact, nodes = discrete_map(wells, {"h": 0.08, "other": 0.0}, ("x", "y")), CellGrid((-2, -2), (2, 2), (48, 48))
    point_map, grid = interpolated_map(exact, nodes), CellGrid((-1.5, -1.5), (1.5, 1.5), (40, 40))
    live = LiveBasins(point_map, grid)
    live.image()
    finest = []
    for k in range(1, 15):
        previews = []
        for frame in live.frames({"h": 0.08 + 1e-4 * k}):
            if not frame.preview:
                break
            previews.append(frame)
        finest.append(previews[-1].stride)
    assert finest[:2] == [4, 4]
    assert finest[-2:] == [1, 1]
    *_, last = live.frames({"h": 0.0815})
    alone = point_map.with_params(h=0.0815)
    same_basins(last, alone, grid)
    assert last.basins.point_map.table.coefficients.tobytes() == alone.table.coefficients.tobytes()
    *_, preview, _ = [frame for frame in live.frames({"h": 0.0816}) if frame.preview or frame.complete]
    assert (preview.preview, preview.stride) == (True, 1)
    assert np.array_equal(preview.basins.labels, find_basins(point_map.with_params(h=0.0816), grid).labels)
    # Another parameter has tables of its own, and the first change of it none.
    first = next(live.frames({"h": 0.0816, "other": 1.0}))
    assert first.preview
    assert first.basins.point_map.params["other"] == 1.0


def test_an_image_within_some_time_and_those_that_are_cancelled_or_followed_by_another() -> None:
    live = LiveBasins(CONSERVATIVE, CellGrid((-0.4, -0.4), (0.4, 0.4), (100, 100)), 10**6)
    nothing = image(live, max_seconds=1e-9)
    assert (nothing.complete, nothing.attractors) == (False, {})
    assert (nothing.image == Label.UNLABELLED).all()
    began = time.perf_counter()
    frame = image(live, max_seconds=0.2)
    assert time.perf_counter() - began < 10.0
    assert not frame.complete
    assert (frame.image <= Label.UNDECIDED).all()
    threading.Timer(0.1, live.cancel).start()
    again = live.image({"b": 0.9})
    assert again is None or not again.complete
    # Nothing settles for a million periods: only an end from outside leaves the newest request its time.
    frames = []
    slow = threading.Thread(target=lambda: frames.extend(live.frames()))
    slow.start()
    time.sleep(0.3)
    *_, last = live.frames({"b": 1.1}, max_seconds=0.3)
    slow.join(10.0)
    assert not slow.is_alive()
    assert not any(frame.complete for frame in [*frames, last])


def test_what_is_asked_for_again_is_not_computed_again(monkeypatch: pytest.MonkeyPatch) -> None:
    live = LiveBasins(TILTED, LINE)
    image(live, {"t": 0.1})
    image(live)
    monkeypatch.setattr("cellmap.basins.family.orbits_followed", lambda *_: pytest.fail("followed again"))
    assert image(live, {"t": 0.1}).complete


def test_requests_that_do_not_fit() -> None:
    with pytest.raises(ValueError, match=r"params has no \['u'\]: this map has \['t'\]"):
        LiveBasins(TILTED, LINE).image({"u": 1.0})
    with pytest.raises(ValueError, match=r"phase=0\.3: a discrete map has none"):
        LiveBasins(TILTED, LINE).image(phase=0.3)

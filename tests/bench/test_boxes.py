"""Images of a million boxes, against the exact map of a million points."""

from __future__ import annotations

from math import pi

import pytest
from peers import best_times, pendulum

from cellmap import CellGrid, stroboscopic_map
from cellmap.sets import BoxSet, box_image, box_transitions, relative_attractor
from systems import henon_map


@pytest.mark.usefixtures("one_thread")
def test_image_of_a_million_boxes(say):
    exact = stroboscopic_map(pendulum())
    boxes = BoxSet.full(CellGrid((-pi, -4), (pi, 4), (1000, 1000)).on(exact.coordinates))
    points = boxes.centres()
    map_, image, graph = best_times(
        [lambda: exact(points), lambda: box_image(boxes, exact, 1), lambda: box_transitions(boxes, exact, 1)], rounds=3
    )
    say(
        f"driven pendulum, a million boxes of one point: map {map_:.2f} s, image {image:.2f} s ({image / map_:.2f}), "
        f"graph {graph:.2f} s ({graph / map_:.2f})"
    )


@pytest.mark.usefixtures("one_thread")
def test_cover_of_henon(say):
    window = CellGrid((-3, -3), (3, 3), (1, 1))
    (cover,) = best_times([lambda: relative_attractor(henon_map(), window, 10)], rounds=2)
    say(f"relative attractor of Henon's map, 1024 boxes a side: {cover:.2f} s")

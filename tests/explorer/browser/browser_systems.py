"""Systems that pages in a browser show."""

from math import pi, sin

from served_pages import WELLS, push

from cellmap import CellGrid, ForcedSystem, angle, discrete_map
from cellmap.explorer import Explored, ExploredScene


def swing(t, x, p):
    """A pendulum whose pivot is driven; 0 and pi are stable."""
    theta, v = x
    return v, -p.damping * v - (p.weight + p.drive * sin(t)) * sin(theta)


SWING = ForcedSystem(swing, {"damping": 0.3, "weight": 0.01, "drive": 0.5}, 2 * pi, (angle("theta"), "v"), "swing")
PUSHED = discrete_map(push, {"keep": 0.6, "push": 0.1}, ("x", "v"))
WINDOW = CellGrid((-2.0, -1.5), (2.0, 1.5), (100, 100))
TURN = CellGrid((-pi, -2.0), (pi, 2.0), (100, 100))


def parts(body: str, effects: tuple[str, ...]) -> Explored:
    return Explored("", lambda: PUSHED if effects else WELLS, WINDOW)


GALLERY = (
    Explored("wells", lambda: WELLS, WINDOW, source="from browser_systems import WELLS as system\n"),
    Explored("swing", lambda: SWING, TURN, about="A pendulum on a pivot that is driven.", units={"damping": "1/s"}),
    ExploredScene("parts", "From parts", ("ball",), ("push",), ("ball",), parts),
)

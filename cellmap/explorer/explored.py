"""Systems that the explorer offers, with the window that it shows first."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from .._lib.checks import is_sequence, shown, text, whole_number
from .._lib.computed import computed_once
from ..maps.coordinates import Coordinate
from ..maps.grid import CellGrid
from ..maps.interpolation.interpolated import interpolated_map
from ..maps.point_map import PointMap
from ..maps.stroboscopic import stroboscopic_map
from ..maps.system import ForcedSystem

USUAL_CELLS = 500
"""Initial conditions along each axis, in whose place a page takes the pixels of its screen."""

MOST_STEPS = 4096
"""Steps of a period: orbits that blow up are given up after a quarter of those of the library."""

_HALF = 2.0  # half the width of the window along a coordinate that is no angle, where none is given
_MARGIN = 0.05  # fraction of the window by which an interpolation grid is larger on each side


@dataclass(frozen=True, eq=False)
class Explored:
    """A system as the explorer offers it.

    Parameters
    ----------
    name : str
        Name by which addresses and scripts know it.
    make : callable
        Function without arguments that returns the :class:`ForcedSystem`, or the discrete :class:`PointMap`.
    region : CellGrid or None, optional
        First window and number of initial conditions.  With more than two coordinates the image is a slice through the
        window's centre.  By default angles have one period, and other coordinates reach from -2 to 2.
    nodes : int, optional
        Cells of the interpolation grid along each axis; 0 for the exact map.  The grid covers `region`, and a
        twentieth of it more on each side along axes that are no angles.
    source : str, optional
        Python statements after which ``system`` is the system, for scripts.
    about : str, optional
        A sentence about the system.
    units : mapping of str to str, optional
        Units of parameters that have some.
    scene : ExploredScene or None, optional
        The scene that has put the system together.
    parts : tuple of str, optional
        Body and effects that were chosen for it.
    drawn_as : str, optional
        How orbits are shown beside the plane: "chain" (pendulums, one below the other), "rotors", "mass" (on a spring)
        or "above" (a pendulum of two coordinates); "none".  By default one angle is a pendulum, several are rotors, and
        a coordinate with its velocity is a mass.
    pivot : callable or None, optional
        Function of time and parameters that returns where the pivot is, in lengths of the first pendulum.
    thumbnail : path or None, optional
        A small image, PNG, for the list of systems.
    """

    name: str
    make: Callable[[], ForcedSystem | PointMap]
    region: CellGrid | None = None
    nodes: int = 0
    source: str = ""
    about: str = ""
    units: Mapping[str, str] = field(default_factory=dict)
    scene: ExploredScene | None = None
    parts: tuple[str, ...] = ()
    drawn_as: str = ""
    pivot: Callable[[float, Mapping[str, float]], tuple[float, float]] | None = None
    thumbnail: Path | None = None

    @computed_once
    def system(self) -> ForcedSystem | PointMap:
        """The system or discrete map."""
        return self.make()

    @property
    def title(self) -> str:
        """Name in the list of systems."""
        return self.system.name

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """State variables."""
        system = self.system
        return system.axes if isinstance(system, ForcedSystem) else system.coordinates

    @computed_once
    def window(self) -> CellGrid:
        """First window, over all coordinates."""
        if self.region is not None:
            return self.region.on(self.coordinates, "region")
        lower = tuple(-_HALF if c.lower is None else c.lower for c in self.coordinates)
        upper = tuple(_HALF if c.period is None else a + c.period for a, c in zip(lower, self.coordinates, strict=True))
        return CellGrid(lower, upper, (USUAL_CELLS,) * len(lower)).on(self.coordinates)

    def point_map(self, nodes: int, tolerance: float) -> PointMap:
        """Return the map at the system's own parameters, interpolated if there are nodes."""
        system = self.system
        if isinstance(system, ForcedSystem):
            exact = stroboscopic_map(system, rtol=tolerance, atol=tolerance, max_steps=MOST_STEPS)
        else:
            exact = system
        return exact if not nodes else interpolated_map(exact, self.table_grid(nodes))

    def table_grid(self, nodes: int) -> CellGrid:
        """Return the interpolation grid."""
        lower, upper = list(self.window.lower), list(self.window.upper)
        for j, c in enumerate(self.coordinates):
            if c.period is None:
                margin = _MARGIN * (upper[j] - lower[j])
                lower[j], upper[j] = lower[j] - margin, upper[j] + margin
            else:
                lower[j], upper[j] = c.lower or 0.0, (c.lower or 0.0) + c.period
        return CellGrid(tuple(lower), tuple(upper), (nodes,) * len(lower))


@dataclass(frozen=True, eq=False)
class ExploredScene:
    """A system that the explorer puts together from a body and effects, which are switched on and off in the page.

    Parameters
    ----------
    name : str
        Name by which addresses and scripts know it.
    title : str
        Name in the list of systems.
    bodies, effects : tuple of str
        Names of the bodies, of which a scene has one, and of the effects, of which it has any.
    first : tuple of str
        Body and effects that are shown first.
    make : callable
        Function that returns the system of a body and a tuple of effects, in the order of `effects`.
    about : str, optional
        A sentence about the scene.
    thumbnail : path or None, optional
        A small image, PNG, for the list of systems.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> def make(body, effects):
    ...     weight = 0.5 if "weight" in effects else 0.0
    ...     return Explored("", lambda: discrete_map(lambda x, p: (weight - x[0] / 2,), {}, ("x",), body))
    >>> scene = ExploredScene("points", "Points", ("point",), ("weight", "drag"), ("point",), make)
    >>> scene.explored(["point", "weight"]).system([0.0])
    array([0.5])
    """

    name: str
    title: str
    bodies: tuple[str, ...]
    effects: tuple[str, ...]
    first: tuple[str, ...]
    make: Callable[[str, tuple[str, ...]], Explored]
    about: str = ""
    thumbnail: Path | None = None

    def explored(self, parts: Any = None) -> Explored:
        """Return the system of some parts, the body first; by default of those that are shown first.

        Raises
        ------
        TypeError, ValueError
            For parts that the scene does not have, or that have no system together.
        """
        chosen = self.first if parts is None else parts
        if not is_sequence(chosen) or not all(isinstance(part, str) for part in chosen) or not chosen:
            raise TypeError(f"parts={shown(chosen)}: give the name of a body, then those of effects")
        body, effects = chosen[0], chosen[1:]
        if body not in self.bodies:
            raise ValueError(f"parts: {shown(body)} is no body: begin with one of {', '.join(self.bodies)}")
        if unknown := sorted(set(effects) - set(self.effects)):
            raise ValueError(f"parts: there is no effect {shown(unknown[0])}: take some of {', '.join(self.effects)}")
        present = tuple(effect for effect in self.effects if effect in effects)
        return replace(self.make(body, present), name=self.name, scene=self, parts=(body, *present))


def explored_of(entry: Explored | ExploredScene, parts: Any = None) -> Explored:
    """Return the system of an entry of a gallery, a scene with some of its parts."""
    return entry.explored(parts) if isinstance(entry, ExploredScene) else entry


def explored_from(system: ForcedSystem | PointMap, region: CellGrid | None, nodes: int) -> Explored:
    """Return a system that was given to the explorer."""
    if isinstance(system, PointMap) and system.recipe["kind"] != "discrete":
        raise ValueError(f"system={shown(system)}: give the ForcedSystem of the map, or a discrete map")
    return Explored("given", lambda: system, region, whole_number("nodes", nodes))


def load_gallery(module: str) -> tuple[Explored | ExploredScene, ...]:
    """Return the systems of a module's list ``GALLERY``.

    Raises
    ------
    ValueError
        If there is no such module or list, or if two systems have one name.
    """
    try:
        found = importlib.import_module(module).GALLERY
    except (ImportError, AttributeError) as error:
        raise ValueError(f"gallery={module!r}: give a module with a list GALLERY of systems ({error})") from error
    return checked_gallery(found)


def checked_gallery(given: Sequence[Explored | ExploredScene]) -> tuple[Explored | ExploredScene, ...]:
    """Return systems that all have names of their own, at least one."""
    gallery = tuple(given)
    if not gallery or not all(isinstance(e, Explored | ExploredScene) for e in gallery):
        raise TypeError(f"gallery={shown(given)}: give at least one system, each of it an Explored or ExploredScene")
    for explored in gallery:
        for key in ("name", "about", "source" if isinstance(explored, Explored) else "title"):
            text(key, getattr(explored, key))
    names = [e.name for e in gallery]
    if len(set(names)) < len(names):
        raise ValueError(f"gallery={names}: give each system a name of its own")
    return gallery

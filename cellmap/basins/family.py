"""Maps of a family with their attractors, followed from one to the next, each with an identity that it keeps."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from .._lib.arrays import Floats, thinned
from .._lib.stopping import Stop
from ..attractors.continued import circles_followed, is_followed, orbits_followed, with_regions
from ..attractors.matching import persistent_labels
from ..attractors.search import find_attractors
from ..attractors.settling.residence import is_same
from ..maps.coordinates import difference
from ..maps.interpolation.drafts import draft_of, examined
from ..maps.interpolation.dragged import Dragged
from ..maps.interpolation.interpolated import Interpolated
from ..maps.point_map import PointMap
from ..maps.specification import MapSpec
from ..maps.stroboscopic import carried
from ..orbits.attractor import Attractor, Kind

_KEPT = 16  # maps that are kept with their attractors
_REMEMBERED = 1024  # points that are kept of an attractor that may come back
_TRIED = 8  # attractors that were lost, the latest ones, that are followed in drafts once more
_SAME = 1e-6  # distance of points of one orbit, in sizes of the region
_SEEDS = 4  # points of an attractor that was lost from which it is sought


@dataclass(eq=False)
class Member:
    """A map of the family, and its attractors with their identities as far as they are known.

    ``before``: attractors of the map before, by identity, at the phase of this one; ``draft``: whether nothing is
    verified yet, see `LiveFrame`; ``unexamined``: whether its table is a draft; ``combined``: or one that is combined
    from tables over a parameter, with errors that are measured; ``key``: what it is known by.
    """

    point_map: PointMap
    phase: float | None
    before: Mapping[int, Attractor]
    attractors: list[Attractor] = field(default_factory=list)
    identities: list[int] = field(default_factory=list)
    draft: bool = False
    unexamined: bool = False
    combined: bool = False
    key: Any = None

    def known(self) -> dict[int, Attractor]:
        """Return the attractors by identity."""
        return dict(zip(self.identities, self.attractors, strict=True))

    def identity_of(self, attractor: Attractor) -> int | None:
        """Return the identity of an attractor, None if it has none."""
        return next((k for k, a in zip(self.identities, self.attractors, strict=True) if is_same(a, attractor)), None)


class Family:
    """A family of maps of which members are asked for, from any thread.

    ``limits``: largest numbers of periods of a search; ``extent``: size of the region of interest; ``threshold``:
    largest distance of attractors that are the same.
    """

    def __init__(self, base: PointMap, limits: tuple[int, int], extent: Floats, threshold: float) -> None:
        self._base, self._limits, self._extent, self._threshold = base, limits, extent, threshold
        self._making, self._guard = threading.Lock(), threading.RLock()
        self._known: OrderedDict[Any, Member] = OrderedDict()
        self._memory: dict[int, Attractor] = {}
        self._last: Member | None = None  # made last
        self._dragged = Dragged()
        self._phased: tuple[float | None, MapSpec[PointMap] | None] = (None, None)  # at the phase asked for last

    def member(self, changed: Mapping[str, float], phase: float | None, stop: Stop) -> Member:
        """Return a map with the attractors that can be followed to it from the map before, or a draft of it."""
        key = (tuple(sorted({**self._base.params, **changed}.items())), phase)
        with self._making:
            stop.check()
            place = self._known.pop(key, None)
            if place is None:
                place = self._drafted(self._specification(changed, phase), phase, key)
            self._known[key] = self._last = place
            while len(self._known) > _KEPT:
                self._known.popitem(last=False)
            return place

    def _specification(self, changed: Mapping[str, float], phase: float | None) -> MapSpec[PointMap] | None:
        """Return the specification of a map, None for the family's own."""
        if phase is not None and phase != self._phased[0]:
            self._phased = phase, self._base.specified.with_phase(phase)
        spec = None if phase is None else self._phased[1]
        return (spec or self._base.specified).with_params({**self._base.params, **changed}) if changed else spec

    def _drafted(self, spec: MapSpec[PointMap] | None, phase: float | None, key: Any) -> Member:
        """Return a map, and the orbits to which attractors can be followed from where they were."""
        last = self._last
        before: dict[int, Attractor] = {}
        if last is not None:
            # What a draft did not find may be found, or what has taken its place, when it is verified.
            before = {**(last.before if last.draft else {}), **last.known()}
            if phase != last.phase:
                before = {k: _carried(last.point_map, a, phase or 0.0) for k, a in before.items()}
                with self._guard:
                    self._memory = {k: _carried(last.point_map, a, phase or 0.0) for k, a in self._memory.items()}
        regular = {k: a for k, a in before.items() if is_followed(a)}
        if not regular:
            return Member(self._base if spec is None else spec.build(), phase, before, key=key)
        drafted = isinstance(spec, Interpolated)
        combined = self._dragged.map_of(spec, phase) if isinstance(spec, Interpolated) else None
        if combined is not None:
            point_map = combined
        else:
            point_map = (
                self._base if spec is None else draft_of(spec) if isinstance(spec, Interpolated) else spec.build()
            )
        gone = {k: a for k, a in self._memory.items() if k not in regular and is_followed(a)}
        followed = {**regular, **dict(list(gone.items())[-_TRIED:])}
        names = list(followed)
        found = orbits_followed(point_map, list(followed.values()), self._extent)
        kept: dict[int, Attractor] = {}
        for k, orbit in found.items():
            if orbit.neighbourhood is not None and (names[k] in regular or self._is_new(orbit, kept)):
                kept[names[k]] = orbit
        place = Member(point_map, phase, before, list(kept.values()), list(kept), key=key)
        return replace(place, draft=True, unexamined=drafted, combined=combined is not None)

    def _is_new(self, orbit: Attractor, known: Mapping[int, Attractor]) -> bool:
        """Tell whether an orbit, to which one leads that was lost, has no point of another one."""
        axes = orbit.coordinates
        return all(
            (np.abs(difference(a.points, orbit.points[:1], axes)) > _SAME * self._extent).any(axis=-1).all()
            for a in known.values()
        )

    def verified(self, draft: Member, stop: Stop) -> Member:
        """Return a map with its table examined, and its attractors with verified regions."""
        with self._making:
            stop.check()
            spec = draft.point_map.spec
            if draft.combined and isinstance(spec, Interpolated):
                point_map = replace(spec, table=None).build()
            else:
                point_map = examined(draft.point_map) if draft.unexamined else draft.point_map
            stop.check()
            # Chaos, tori and continua that a search found on the draft are found again on the map itself.
            orbits = {k: a for k, a in draft.known().items() if is_followed(a)}
            found = with_regions(point_map, orbits, self._extent)
            circles = {k: a for k, a in draft.before.items() if a.kind is Kind.QUASIPERIODIC}
            names = list(circles)
            curves = circles_followed(point_map, list(circles.values()), self._extent, list(found.values()))
            found |= {names[k]: a for k, a in curves.items()}
            place = Member(point_map, draft.phase, draft.before, list(found.values()), list(found), key=draft.key)
            with self._guard:
                self._memory |= found
            lost = [a for k, a in draft.before.items() if (is_followed(a) or k in circles) and k not in found]
            if lost:
                seeds = np.concatenate([thinned(a.points, _SEEDS) for a in lost])
                self.identify(place, find_attractors(point_map, seeds, *self._limits, attractors=place.attractors))
            self._known[draft.key] = place
            if self._last is draft:
                self._last = place
            return place

    def identify(self, place: Member, found: Sequence[Attractor]) -> None:
        """Give the attractors of a map that have none their identities."""
        with self._guard:
            fresh = [a for a in found if place.identity_of(a) is None]
            if not fresh:
                return
            taken = place.identities
            labels = persistent_labels(fresh, place.before, self._memory, self._extent, self._threshold, taken)
            for attractor, label in zip(fresh, labels, strict=True):
                place.attractors.append(attractor)
                place.identities.append(label)
                self._memory[label] = replace(attractor, points=thinned(attractor.points, _REMEMBERED), cover=None)


def _carried(point_map: PointMap, attractor: Attractor, phase: float) -> Attractor:
    """Return an attractor where the flow takes it until another phase of the forcing."""
    return replace(attractor, points=carried(point_map, attractor.points, phase), cover=None)

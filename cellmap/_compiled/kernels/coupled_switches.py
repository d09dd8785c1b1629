"""Switches whose surfaces depend on the sides of others, as those of a branch within a branch."""

from __future__ import annotations

from ..loops import inlined, loop
from .lane import COUNTS, SIGN, blame, look
from .switching import choose_mode, follow

_DOUBTFUL = 1e-4
"""How far a switch has to be on the wrong side, and the error of a state that slides then, in units of its size."""

_AWAY = 1e-9  # jump of a surface that takes it away from what slides along it


@inlined
def settle(system, t, lane, surfaces, event):
    """Let switches follow whose surfaces depend on the sides of others, until each is on its own side.

    What slides is looked at once more where they have changed the rates on its two sides, and is free where its
    surface jumps away, or is no surface any more.  So is a switch that was hit where another has carried its surface
    away, as the wrap of an angle does with whole parts of that angle; and one that a jump has put on its surface, or
    whose rates have changed there, goes to the side to which it moves now.  Return whether no mode was found in which
    all agree.
    """
    kinds, slides, fresh, hits = system.kinds, lane.slides, lane.fresh, event.hits
    free, after, values = event.on_surface, event.after, surfaces.values
    count, changed, moved = slides.size, 0, 0
    for _ in range(count):
        changed = 0
        for _ in range(count):
            look(system, t, lane, surfaces)
            moved = 0
            for e in range(count):
                away = surfaces.gains[e, e] == 0.0 or abs(values[e] - event.values[e]) > _AWAY
                if slides[e] and kinds[e] <= COUNTS and away:
                    slides[e] = fresh[e] = 0.0
                    if kinds[e] != COUNTS:
                        lane.signs[e] = 1.0 if values[e] > 0.0 else -1.0
                    moved += 1
                elif hits[e] > 0.0 and not slides[e] and kinds[e] <= COUNTS and not _is_met(e, kinds[e], surfaces):
                    hits[e] = fresh[e] = 0.0
                free[e] = 0.0 if hits[e] > 0.0 or slides[e] else 1.0
            moved += follow(values, free, kinds, lane.signs)
            for e in range(count):
                hits[e] = -1.0 if free[e] > 1.0 else hits[e]
            changed += moved
            if not moved:
                break
        sliding, returns = 0.0, 0
        for e in range(count):
            after[e] = lane.signs[e] if free[e] else after[e]
            sliding += slides[e]
        for e in range(count):
            free[e] = 1.0 if hits[e] and kinds[e] <= COUNTS and _is_met(e, kinds[e], surfaces) else slides[e]
            returns += 1 if free[e] and not slides[e] and _returns(e, kinds[e], lane, surfaces, after) else 0
        again = returns > 0 or (changed > 0 and sliding > 0.0)
        changed = moved
        if not again:
            break
        for e in range(count):
            if not returns:
                free[e] = slides[e]
            elif free[e] and not slides[e]:
                hits[e] = 1.0
                lane.signs[e] -= 1.0 if kinds[e] == COUNTS and values[e] < 0.0 else 0.0
        choose_mode(system, lane, surfaces, free, after)
        for e in range(count):
            changed += free[e] != slides[e]
            fresh[e] = 1.0 if free[e] and not slides[e] else fresh[e]
    for e in range(count):
        if kinds[e] == SIGN and not slides[e] and values[e] == 0.0 and _is_still(e, surfaces):
            changed += 1  # it is zero for a time, and has no side
    return changed > 0


@inlined
def _is_met(e, kind, surfaces):
    """Tell whether a switch is on its surface, which moves or which states pass."""
    return _distance(kind, surfaces.values[e]) <= _AWAY and not _is_still(e, surfaces)


@inlined
def _is_still(e, surfaces):
    """Tell whether the function of a switch depends on neither state nor time here."""
    still = surfaces.rates[e] == 0.0
    for j in range(surfaces.normals.shape[1]):
        still = still and surfaces.normals[e, j] == 0.0
    return still


@inlined
def _distance(kind, value):
    """Return how far a switch is from the surface where its side changes."""
    return abs(abs(value) - 0.5) if kind == COUNTS else abs(value)


@inlined
def _returns(e, kind, lane, surfaces, held):
    """Tell whether a switch that is on its surface goes back through it, with the rates that others have now."""
    speed, size = surfaces.rates[e], abs(surfaces.rates[e])
    for j in range(held.size):
        speed += surfaces.gains[e, j] * held[j]
        size += abs(surfaces.gains[e, j] * held[j])
    inwards = (-speed if surfaces.values[e] > 0.0 else speed) if kind == COUNTS else speed * lane.signs[e]
    return inwards < -_AWAY * size


@inlined
def wake(system, t, lane, surfaces, event):
    """Put switches that only matter behind surfaces which are hit where they are then, before a mode is chosen."""
    kinds, signs, slides, asleep = system.kinds, lane.signs, lane.slides, event.after
    count = signs.size
    for e in range(count):
        asleep[e] = 1.0 if surfaces.values[e] == (0.0 if kinds[e] == COUNTS else signs[e]) and not slides[e] else 0.0
        for j in range(surfaces.normals.shape[1]):
            asleep[e] = 0.0 if surfaces.normals[e, j] != 0.0 else asleep[e]
    for e in range(count):
        if event.hits[e] and kinds[e] == SIGN and not slides[e]:
            side = signs[e]
            signs[e] = -side
            for _ in range(count):
                look(system, t, lane, surfaces)
                if not follow(surfaces.values, asleep, kinds, signs):
                    break
            signs[e] = side


@loop
def doubt_of_one_surface(system, lane, surfaces, held):
    """Give a sliding state an error that no tolerance allows, where another switch jumps at the same surface.

    Filippov's solution has one weight for both; the equivalent control would have two.  Surfaces that only meet have
    other normals, or one of them moves.
    """
    values, rates, gains, normals = surfaces.values, surfaces.rates, surfaces.gains, surfaces.normals
    count, wrong = lane.slides.size, False
    for e in range(count):
        for k in range(count):
            if k != e and lane.slides[e] and _distance(system.kinds[k], values[k]) < _AWAY:
                both, first, second, jump = 0.0, 0.0, 0.0, 0.0
                for j in range(normals.shape[1]):
                    jump += abs(surfaces.jumps[k, j])
                    both += normals[e, j] * normals[k, j]
                    first += normals[e, j] * normals[e, j]
                    second += normals[k, j] * normals[k, j]
                speed, size = rates[k], abs(rates[k])
                for j in range(count):
                    speed += gains[k, j] * held[j]
                    size += abs(gains[k, j] * held[j])
                alike = both * both >= (1.0 - 1e-12) * first * second > 0.0 and abs(speed) <= 1e-9 * size
                wrong = wrong or (jump > 0.0 and alike)
    if wrong:
        blame(lane, _DOUBTFUL)


@loop
def doubt(system, t, lane, surfaces, wrong):
    """Give a sliding state an error that no tolerance allows, where a switch belongs on another side than it is on.

    A mode has one side for each switch.  Where the condition of one depends on the side of a surface along which the
    state slides, the two sides of that surface may ask for different ones, for which there is no mode.  So with what is
    `wrong` already.
    """
    values, kinds, signs, slides = surfaces.values, system.kinds, lane.signs, lane.slides
    for e in range(signs.size):
        if slides[e]:
            kept = signs[e]
            for way in range(2):
                signs[e] = kept + way if kinds[e] == COUNTS else 1.0 - 2.0 * way
                look(system, t, lane, surfaces)
                for k in range(signs.size):
                    if kinds[k] == COUNTS and not slides[k]:
                        wrong = wrong or abs(values[k]) > 0.5 + _DOUBTFUL
                    elif not (slides[k] or kinds[k]):
                        wrong = wrong or values[k] * signs[k] < -_DOUBTFUL
            signs[e] = kept
    if wrong:
        blame(lane, _DOUBTFUL)

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
    surface jumps away, or is no surface any more.  Return whether no mode was found in which all agree.
    """
    kinds, slides, fresh, free, after = system.kinds, lane.slides, lane.fresh, event.on_surface, event.after
    count, changed, moved = slides.size, 0, 0
    for _ in range(count):
        changed = 0
        for _ in range(count):
            look(system, t, lane, surfaces)
            for e in range(count):
                away = surfaces.gains[e, e] == 0.0 or abs(surfaces.values[e] - event.values[e]) > _AWAY
                if slides[e] and kinds[e] <= COUNTS and away:
                    slides[e] = fresh[e] = 0.0
                    if kinds[e] != COUNTS:
                        lane.signs[e] = 1.0 if surfaces.values[e] > 0.0 else -1.0
                    changed += 1
                free[e] = 0.0 if event.hits[e] or slides[e] else 1.0
            moved = follow(surfaces.values, free, kinds, lane.signs)
            changed += moved
            if not moved:
                break
        sliding = 0.0
        for e in range(count):
            after[e] = lane.signs[e] if free[e] else after[e]
            free[e] = slides[e]
            sliding += slides[e]
        again = changed > 0 and sliding > 0.0
        changed = moved
        if not again:
            break
        choose_mode(system, lane, surfaces, free, after)
        for e in range(count):
            changed += free[e] != slides[e]
            fresh[e] = 1.0 if free[e] and not slides[e] else fresh[e]
    return changed > 0


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
            away = abs(abs(values[k]) - 0.5) if system.kinds[k] == COUNTS else abs(values[k])
            if k != e and lane.slides[e] and away < _AWAY:
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

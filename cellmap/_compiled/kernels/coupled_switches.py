"""Switches whose surfaces depend on the sides of others, as those of a branch within a branch."""

from __future__ import annotations

from ..loops import inlined, loop
from .calls import call_surfaces
from .collisions import COUNTS
from .switching import choose_mode, follow

_DOUBTFUL = 1e-4
"""How far a switch has to be on the wrong side, and the error of a state that slides then, in units of its size."""

_AWAY = 1e-9  # jump of a surface that takes it away from what slides along it


@inlined
def settle(
    surfaces, t, state, p, signs, values, rates, gains, jumps, normals, slides, fresh, hits, counts, free, were, after
):  # fmt: skip
    """Let switches follow whose surfaces depend on the sides of others, until each is on its own side.

    What slides is looked at once more where they have changed the rates on its two sides, and is free where its
    surface jumps away, or is no surface any more.  Return whether no mode was found in which all agree.
    """
    count, changed, moved = signs.size, 0, 0
    for _ in range(count):
        changed = 0
        for _ in range(count):
            call_surfaces(surfaces, t, state, p, signs, values, rates, gains, jumps, normals)
            for e in range(count):
                away = gains[e, e] == 0.0 or abs(values[e] - were[e]) > _AWAY
                if slides[e] and counts[e] <= COUNTS and away:
                    slides[e] = fresh[e] = 0.0
                    if counts[e] != COUNTS:
                        signs[e] = 1.0 if values[e] > 0.0 else -1.0
                    changed += 1
                free[e] = 0.0 if hits[e] or slides[e] else 1.0
            moved = follow(values, free, counts, signs)
            changed += moved
            if not moved:
                break
        sliding = 0.0
        for e in range(count):
            after[e] = signs[e] if free[e] else after[e]
            free[e] = slides[e]
            sliding += slides[e]
        again = changed > 0 and sliding > 0.0
        changed = moved
        if not again:
            break
        choose_mode(rates, gains, free, counts, signs, slides, after)
        for e in range(count):
            changed += free[e] != slides[e]
            fresh[e] = 1.0 if free[e] and not slides[e] else fresh[e]
    return changed > 0


@inlined
def wake(
    surfaces, t, state, p, signs, values, rates, gains, jumps, normals, slides, hits, counts, asleep
):  # fmt: skip
    """Put switches that only matter behind surfaces which are hit where they are then, before a mode is chosen."""
    count = signs.size
    for e in range(count):
        asleep[e] = 1.0 if values[e] == (0.0 if counts[e] == 1 else signs[e]) and not slides[e] else 0.0
        for j in range(normals.shape[1]):
            asleep[e] = 0.0 if normals[e, j] != 0.0 else asleep[e]
    for e in range(count):
        if hits[e] and not counts[e] and not slides[e]:
            side = signs[e]
            signs[e] = -side
            for _ in range(count):
                call_surfaces(surfaces, t, state, p, signs, values, rates, gains, jumps, normals)
                if not follow(values, asleep, counts, signs):
                    break
            signs[e] = side


@loop
def doubt_of_one_surface(values, rates, gains, jumps, normals, slides, counts, held, state, errors):
    """Give a sliding state an error that no tolerance allows, where another switch jumps at the same surface.

    Filippov's solution has one weight for both; the equivalent control would have two.  Surfaces that only meet have
    other normals, or one of them moves.
    """
    wrong = False
    for e in range(slides.size):
        for k in range(slides.size):
            away = abs(abs(values[k]) - 0.5) if counts[k] == COUNTS else abs(values[k])
            if k != e and slides[e] and away < _AWAY:
                both, first, second, jump = 0.0, 0.0, 0.0, 0.0
                for j in range(normals.shape[1]):
                    jump += abs(jumps[k, j])
                    both += normals[e, j] * normals[k, j]
                    first += normals[e, j] * normals[e, j]
                    second += normals[k, j] * normals[k, j]
                speed, size = rates[k], abs(rates[k])
                for j in range(slides.size):
                    speed += gains[k, j] * held[j]
                    size += abs(gains[k, j] * held[j])
                alike = both * both >= (1.0 - 1e-12) * first * second > 0.0 and abs(speed) <= 1e-9 * size
                wrong = wrong or (jump > 0.0 and alike)
    if wrong:
        for j in range(state.size):
            errors[j] += _DOUBTFUL * (1.0 + abs(state[j]))


@loop
def doubt(surfaces, t, state, p, signs, values, rates, gains, jumps, normals, slides, counts, errors, wrong):
    """Give a sliding state an error that no tolerance allows, where a switch belongs on another side than it is on.

    A mode has one side for each switch.  Where the condition of one depends on the side of a surface along which the
    state slides, the two sides of that surface may ask for different ones, for which there is no mode.  So with what is
    `wrong` already.
    """
    for e in range(signs.size):
        if slides[e]:
            kept = signs[e]
            for way in range(2):
                signs[e] = kept + way if counts[e] == COUNTS else 1.0 - 2.0 * way
                call_surfaces(surfaces, t, state, p, signs, values, rates, gains, jumps, normals)
                for k in range(signs.size):
                    if counts[k] == COUNTS and not slides[k]:
                        wrong = wrong or abs(values[k]) > 0.5 + _DOUBTFUL
                    elif not (slides[k] or counts[k]):
                        wrong = wrong or values[k] * signs[k] < -_DOUBTFUL
            signs[e] = kept
    if wrong:
        for j in range(state.size):
            errors[j] += _DOUBTFUL * (1.0 + abs(state[j]))

"""Calls of generated functions by their addresses, from loops that are compiled once for all of them."""

from __future__ import annotations

from ..loops import by_address
from ..translation.marks import ArrayAt

PERIOD = "int64* float64* int64* float64 float64 float64* float64* int64"
"""Arguments of a period: ``advance(context, x, steps, start, period, p, error, orbits)``."""

array_at = ArrayAt()
"""``array_at(address, shape)`` is the array of a shape whose elements are at an address; floats at a whole number."""


@by_address
def call_step(address, lanes, series, p, end, rate, used):
    """Take a step with the lanes of a block that are in use: ``step(lanes, series, p, end, rate, used)``."""


@by_address
def call_begin(address, lanes, series, p, start):
    """Choose the modes in which all lanes of a block begin: ``begin(lanes, series, p, start)``."""


@by_address
def call_surfaces(address, t, state, p, signs, surfaces):
    """Evaluate what decides modes: ``surfaces(t, state, p, signs, values, rates, gains, jumps, normals, flow)``."""


@by_address
def call_impacts(address, t, state, deviation, p, signs, jumps):
    """Evaluate states and deviations after impacts: ``impacts(t, x, v, p, signs, landed, turned, stuck, held)``."""


@by_address
def call_rows(address, rows, count, p):
    """Move states in rows on by a step, in place: ``step(rows, count, p)``."""


@by_address
def call_period(address, context, x, steps, time, p, error, orbits):
    """Move blocks of lanes on by a period: ``advance(context, x, steps, start, period, p, error, orbits)``."""


@by_address
def call_look_up(address, points, rotations, left, arrays, number, levels, made):
    """Move rows on by look-ups, as :mod:`cellmap._compiled.codegen.lookup` describes it; its arrays by address."""

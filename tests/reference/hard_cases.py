"""Make hard_cases.json again: ``python tests/reference/hard_cases.py``.  It needs heyoka with quadruple precision.

Every image is the state after a number of periods, angles unwrapped, by heyoka's adaptive Taylor method in quadruple
precision (33 digits), from the right-hand side of the reference system in plain Python.  Images of linear oscillators
come from the closed form in 80 digits, by mpmath.
"""

import json
from itertools import product
from math import pi
from typing import Any

import numpy as np

from cellmap._compiled.codegen.rebind import rebind
from studies.hard_cases.frozen import OSCILLATOR_SIZES, OSCILLATOR_START, PROBLEMS, TABLE, Problem


def precise_image(problem: Problem) -> list[float]:
    """Return the unwrapped image, rounded to doubles."""
    import heyoka as hy

    system, number = problem.system, hy.real128
    rhs: Any = rebind(system.rhs, {"sin": hy.sin, "cos": hy.cos})
    state = hy.make_vars(*[f"x{j}" for j in range(system.dimension)])
    derivative = rhs(hy.time, tuple(state), system.parameters)
    integrator = hy.taylor_adaptive(
        list(zip(state, derivative, strict=True)),
        np.array([number(v) for v in problem.start]),
        fp_type=number,
        compact_mode=True,
        high_accuracy=True,
    )
    integrator.propagate_until(number(system.length) * number(problem.periods))
    return [float(v) for v in integrator.state]


def oscillator_image(stiffness: float, damping: float, drive: float) -> list[float]:
    """Return the state after 2 pi by the closed form of x'' + damping x' + stiffness x = drive cos t, in 80 digits."""
    import mpmath

    with mpmath.workdps(80):
        k, d, t = mpmath.mpf(stiffness), mpmath.mpf(damping), mpmath.mpf(2.0 * pi)
        response = drive / mpmath.mpc(k - 1, d)
        ic, end = ((mpmath.re(z), mpmath.re(1j * z)) for z in (response, response * mpmath.expj(t)))
        x, v = (mpmath.mpf(a) - b for a, b in zip(OSCILLATOR_START, ic, strict=True))
        root = mpmath.sqrt(d * d / 4 - k)
        fast, slow = -d / 2 - root, -d / 2 + root
        a, b = (v - fast * x) / (slow - fast), (slow * x - v) / (slow - fast)
        a, b = a * mpmath.exp(slow * t), b * mpmath.exp(fast * t)
        return [float(mpmath.re(end[0] + a + b)), float(mpmath.re(end[1] + slow * a + fast * b))]


def main() -> None:
    images = {}
    for name, problem in PROBLEMS.items():
        images[name] = {**problem.record, "image": precise_image(problem)}
        print(name, images[name]["image"], flush=True)
    made_by = "heyoka 7, quadruple precision; tests/reference/hard_cases.py"
    oscillators = [[*sizes, *oscillator_image(*sizes)] for sizes in product(*[OSCILLATOR_SIZES] * 3)]
    contents = {"made by": made_by, "images": images, "oscillators": oscillators}
    TABLE.write_text(json.dumps(contents, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

"""Make references.json again: ``python -m studies.work_precision.references``.  It needs heyoka on x86.

Every image is the state after one period, angles unwrapped, by heyoka's adaptive Taylor method in 80-bit numbers (19
digits, tolerance 1e-19), from the right-hand side of the reference system in plain Python, rounded to doubles.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cellmap._compiled.codegen.rebind import rebind

from .problems import PROBLEMS, TABLE, Problem


def precise_images(problem: Problem) -> NDArray[np.float64]:
    """Return the unwrapped images of all initial conditions of a problem."""
    import heyoka as hy

    system, number = problem.system, np.longdouble
    rhs: Any = rebind(system.rhs, {"sin": hy.sin, "cos": hy.cos})
    state = hy.make_vars(*[f"x{j}" for j in range(system.dimension)])
    derivative = rhs(hy.time, tuple(state), system.parameters)
    integrator = hy.taylor_adaptive(
        list(zip(state, derivative, strict=True)),
        np.zeros(system.dimension, number),
        fp_type=number,
        tol=number(1e-19),
        high_accuracy=True,
        compact_mode=True,
    )
    images = np.empty((len(problem.initial_conditions), system.dimension))
    for image, start in zip(images, problem.initial_conditions, strict=True):
        integrator.time = number(0)
        integrator.state[:] = start
        integrator.propagate_until(number(system.length))
        image[:] = integrator.state
    return images


def main() -> None:
    """Compute the images of all problems."""
    table = {}
    for problem in PROBLEMS:
        table[problem.name] = {
            "params": dict(problem.system.params),
            "period": problem.system.length,
            "images": precise_images(problem).tolist(),
        }
        print(problem.name, flush=True)
    TABLE.write_text(json.dumps(table, indent=0) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

"""Plans: what they foretold, next to what it took."""

from __future__ import annotations

from cellmap import plan

from .chart import Chart, Run
from .problems import PROBLEMS


def outcomes(quick: bool) -> list[Chart]:
    """Return the outcomes of plans, with the time and the error that were expected."""
    side = 120 if quick else 500
    runs = []
    for problem in PROBLEMS[: 2 if quick else 4]:
        planned = plan(problem.system, problem.grid(side))
        for accuracy in (1e-3, 1e-6, 1e-9):
            again = planned.at(accuracy)
            outcome = again.outcome(again.basins())
            more = (
                f"{again.chosen}; expected {outcome.predicted_seconds:.3g} s ({outcome.time_ratio:.2f} of what it "
                f"took) and an error of {outcome.predicted_error:.1e}"
            )
            runs.append(Run(problem.name, f"accuracy {accuracy:.0e}", outcome.seconds, outcome.error, more))
    return [Chart(f"planned maps, {side} x {side}", "s", "error of a period, 99 %", tuple(runs))]

"""Hard cases: motions, initial conditions and grids that may lead to plausible but wrong basins, with known answers.

Every case states why it is hard and what must come out; it computes what does.  Tests assert it, and the page of the
documentation prints it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from . import damping, friction, grids, initial_conditions, multipliers, scales
from .case import HardCase, Outcome
from .frozen import TABLE as TABLE


def _cases() -> dict[str, tuple[HardCase, ...]]:
    """Cases by the titles of their sections, in the order of the modules."""
    modules = (damping, scales, initial_conditions, multipliers, friction, grids)
    return {
        (module.__doc__ or "").strip().rstrip("."): tuple(v for v in vars(module).values() if isinstance(v, HardCase))
        for module in modules
    }


SECTIONS: Mapping[str, tuple[HardCase, ...]] = _cases()
"""All cases, by section."""


def page(outcomes: Mapping[str, Sequence[Outcome]]) -> str:
    """Return what came out as Markdown."""
    everything = [outcome for some in outcomes.values() for outcome in some]
    findings = [finding for outcome in everything for finding in outcome.findings]
    lines = [
        f"{sum(o.met for o in everything)} of {len(everything)} cases came out as they must, with "
        f"{sum(f.met for f in findings)} of {len(findings)} findings.",
    ]
    for title, some in outcomes.items():
        lines += ["", f"### {title}"]
        for outcome in some:
            case = outcome.case
            lines += ["", f"#### {case.title}", "", f"*Why it is hard.* {case.why}", ""]
            lines += [f"*What must come out.* {case.expected}", "", "*What came out.*", ""]
            lines += [f"- {'' if finding.met else '**Not met:** '}{finding.text}" for finding in outcome.findings]
    return "\n".join(lines) + "\n"


def compute(tell: Callable[[Outcome], None] = lambda outcome: None) -> dict[str, list[Outcome]]:
    """Run all cases, and tell of each when it is done."""
    outcomes: dict[str, list[Outcome]] = {}
    for title, cases in SECTIONS.items():
        outcomes[title] = []
        for case in cases:
            outcomes[title].append(case.run())
            tell(outcomes[title][-1])
    return outcomes


def report(outcome: Outcome) -> None:
    """Print what came out of a case."""
    print(f"\n{'met    ' if outcome.met else 'NOT MET'}  {outcome.seconds:6.1f} s  {outcome.case.title}", flush=True)
    for finding in outcome.findings:
        print(f"    {'' if finding.met else 'not met: '}{finding.text}")


def main(quick: bool, output: Path) -> None:
    """Compute all cases, which are quick, and write the page."""
    (output / "hard_cases.md").write_text(page(compute(report)), encoding="utf-8")

"""Every hard case comes out as it must; the study and the documentation show the same cases."""

import importlib.util
from typing import Any

import numpy as np
import pytest

from studies.hard_cases import SECTIONS, page
from studies.hard_cases.case import Finding, HardCase, Outcome
from studies.hard_cases.frozen import PROBLEMS, TABLE, frozen_image, table

CASES = [case for some in SECTIONS.values() for case in some]


def table_program() -> Any:
    """Return the program that makes the table."""
    spec = importlib.util.spec_from_file_location("hard_cases_table", TABLE.with_suffix(".py"))
    assert spec is not None
    assert spec.loader is not None
    program = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(program)
    return program


LONG = set(
    "nothing_attracts heavy_outer_mass periods large_drive next_to_one next_to_minus_one volumes chaos "
    "permanent_sticking long_transients free_swings boundary tiny_damping at_the_limit whip light_outer_mass "
    "double_pendulum_in_line beyond_bounds saddle".split()
)
"""Cases of the second tier, a third of a second and more each."""


def marked(case: HardCase) -> Any:
    mark = pytest.mark.slow if case.name == "parameters" else pytest.mark.thorough if case.name in LONG else ()
    return pytest.param(case, id=case.name, marks=mark)


@pytest.mark.parametrize("case", [marked(case) for case in CASES])
def test_it_comes_out_as_it_must(case: HardCase) -> None:
    outcome = case.run()
    assert [finding.text for finding in outcome.findings if not finding.met] == []
    assert outcome.met


def test_names_and_titles_are_their_own() -> None:
    assert len({case.name for case in CASES}) == len({case.title for case in CASES}) == len(CASES)


def test_the_table_has_every_problem_as_it_is_stated() -> None:
    for name, problem in PROBLEMS.items():
        assert frozen_image(name).shape == (problem.system.dimension,)
    assert table()["images"].keys() == PROBLEMS.keys()


def test_a_changed_problem_has_no_frozen_image(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(PROBLEMS, "5000 Hz", PROBLEMS["50000 Hz"])
    with pytest.raises(ValueError, match="has another problem under the name '5000 Hz': make it again"):
        frozen_image("5000 Hz")


def test_the_page_says_what_is_not_met() -> None:
    case = HardCase("A title", "A reason.", "An answer.", lambda: iter(()))
    bad = Outcome(case, (Finding("one thing", True), Finding("another", False)), 0.0)
    assert not bad.met
    assert not case.run().met, "a case that finds nothing out is not met"
    text = page({"Section": [bad]})
    assert "0 of 1 cases came out as they must, with 1 of 2 findings." in text
    assert "- one thing\n- **Not met:** another" in text


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in PROBLEMS if "rad/s" not in name and "1e+07" not in name])
def test_the_table_is_reproduced(name: str) -> None:
    """Without the two images that take a minute."""
    pytest.importorskip("heyoka")
    program = table_program()
    np.testing.assert_array_equal(program.precise_image(PROBLEMS[name]), frozen_image(name))


@pytest.mark.thorough
def test_closed_forms_are_reproduced() -> None:
    program = table_program()
    for *sizes, x, v in table()["oscillators"]:
        assert program.oscillator_image(*sizes) == [x, v]

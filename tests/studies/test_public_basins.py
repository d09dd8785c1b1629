"""Systems of a public collection: attractors known by number, and fractions of basins computed otherwise."""

import pytest

from cellmap import Label
from studies.public_basins import CASES, TELLING, measured


@pytest.mark.parametrize("name", TELLING)
def test_known_attractors_are_found_with_their_fractions_and_nothing_is_undecided(name: str) -> None:
    """Numbers by symmetry, closed form or the paper; fractions by SciPy or NumPy, as the table of the study says."""
    row = measured(CASES[name], 40)
    assert row.kinds.total() == CASES[name].attractors
    assert row.deviation < 4.0 or not CASES[name].counts
    assert row.percent(Label.UNDECIDED, Label.OUT_OF_STEPS) == 0.0

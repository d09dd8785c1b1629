"""The study that sets cell mappings side by side."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
import pytest

from cellmap import find_basins, stroboscopic_map
from cellmap.sets import simple_cell_mapping
from studies import cell_mappings
from systems import duffing_oscillator

mpl.use("Agg")


def test_labels_are_cut_out_and_translated():
    exact = stroboscopic_map(duffing_oscillator(damping=0.08, linear=0.0, cubic=1.0, forcing=0.2, frequency=1.0))
    window, wide, _ = cell_mappings.windows(0.02)
    reference = find_basins(exact, window)
    whole = simple_cell_mapping(exact, wide, 8).basins()
    part = cell_mappings.within(whole, reference)
    places = wide.locate(window.centres())
    np.testing.assert_array_equal(part.labels, whole.labels.ravel()[places])
    translated = cell_mappings.translated(part, reference)
    for label in np.unique(part.labels[part.labels >= 0]):
        (number,) = np.unique(translated.labels[part.labels == label])
        theirs, ours = reference.attractors[number].points, whole.attractors[label].points
        assert np.abs(theirs[:, None] - ours).max(axis=-1).min() < 1e-9


@pytest.mark.slow
def test_what_must_come_out(tmp_path, capsys):
    cell_mappings.main(quick=True, output=tmp_path)
    assert (tmp_path / "cell_mappings.png").exists()
    table = [line.split("|")[1:-1] for line in (tmp_path / "cell_mappings.md").read_text().splitlines()[4:]]
    wrong = {row[0].strip(): float(row[3]) for row in table}
    found = {row[0].strip(): int(row[1]) for row in table}
    # 14 % and, with several periods, 3 % on 401 x 401 cells; here there are 200 x 150.
    assert wrong["simple, 1 period"] == pytest.approx(14.0, rel=0.1)
    assert wrong["simple, 1 period"] > wrong["simple, 4 periods"] > 3.0 > wrong["simple, 8 periods"]
    assert wrong["ICM 3"] < 0.5
    assert found["generalized, 1 period"] < 5 == found["generalized, 8 periods"]
    assert "method" in capsys.readouterr().out

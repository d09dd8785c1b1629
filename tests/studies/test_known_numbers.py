"""Studies that must give numbers known otherwise: cell mappings, fractals, proofs and a published basin."""

import re
from math import pi
from pathlib import Path

import numpy as np
import pytest

from cellmap import find_basins, stroboscopic_map
from cellmap.sets import simple_cell_mapping
from studies import basin_stability, cell_mappings, known_fractals, proved_basins
from systems import duffing_oscillator


@pytest.mark.thorough
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


def test_snowflake_has_its_area():
    """The triangle's times (8 - 3 (4/9)**level) / 5, on an image of 1.3 sides."""
    fraction = known_fractals.snowflake_labels(800, 6).mean()
    assert fraction * 1.3**2 == pytest.approx(0.25 * np.sqrt(3.0) * (8.0 - 3.0 * (4.0 / 9.0) ** 6) / 5.0, rel=1e-3)


@pytest.mark.slow
def test_all_within_a_hundredth(tmp_path, capsys):
    known_fractals.main(quick=False, output=tmp_path)
    assert (tmp_path / "known_fractals.png").exists()
    table = (tmp_path / "known_fractals.md").read_text()
    errors = [abs(float(line.split("|")[5])) for line in table.splitlines()[2:]]
    assert len(errors) > 25
    assert max(errors) < 0.01
    assert "largest error" in capsys.readouterr().out


@pytest.mark.thorough
def test_proved_basins(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    compute = proved_basins.compute
    monkeypatch.setattr(proved_basins, "compute", lambda amplitudes, cells, table: compute(amplitudes, 100, 128))
    proved_basins.main(quick=True, output=tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["proved_basins.png"]
    said = capsys.readouterr().out
    assert float(re.findall(r"([\d.]+) % of the window proved", said)[0]) > 70.0
    areas = [float(a) for a in re.findall(r"at least ([\d.]+) rad", said)]
    assert len(areas) == 2 and 0.7 * 400 * pi < sum(areas) <= 400 * pi
    assert "0 proved labels differ" in said
    assert float(re.findall(r"from 3 to 3.1 mm: stable, within (\S+) of", said)[0]) < 1e-5


def test_it_reproduces_what_is_published(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """0.152 (Stender, Hoffmann 2022); a running solution from 4/pi damping on (Levi, Hoppensteadt, Miranker 1978)."""
    basin_stability.main(True, tmp_path)
    assert (tmp_path / "basin_stability.png").exists()
    told = capsys.readouterr().out.splitlines()
    rows = {line.split()[0]: line.split() for line in told[1:6]}
    assert float(rows["0.50"][1]) == pytest.approx(0.152, abs=3 * float(rows["0.50"][3]))
    assert rows["0.10"][1] == "1.0000"
    assert {row[4] for row in rows.values()} == {"-0.0500"}


def test_the_running_solution_appears_at_the_published_power() -> None:
    low, high = basin_stability.onset_of_running(6, periods=500)
    assert low < high
    assert 0.5 * (low + high) == pytest.approx(4.0 * 0.1 / pi, rel=0.02)

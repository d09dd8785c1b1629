"""The study of sets of boxes."""

from __future__ import annotations

import matplotlib as mpl
import pytest

from studies import set_oriented

mpl.use("Agg")


@pytest.mark.slow
def test_quick_run_gives_what_must_come_out(tmp_path, capsys):
    set_oriented.main(quick=True, output=tmp_path)
    assert (tmp_path / "set_oriented.png").exists()
    said = capsys.readouterr().out
    assert "missed: 0 " in said and "fixed points in the sets" in said
    off = float(said.split("within ")[1].split()[0])
    assert off < 1e-4

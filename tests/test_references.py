"""Tests cite documents that are there, and tests/REFERENCES.md has the numbers of its independent programs."""

import importlib
import re
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "tests" / "REFERENCES.md"
CITED = r"(?<![\w\"'/{}(.-])([\w/-]+\.md)\b(?![\"'])"
"""Names of documents, but not those in quotes, which are files that a test writes."""


@pytest.fixture
def report(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The independent program, which belongs to no package that is installed."""
    monkeypatch.syspath_prepend(ROOT)
    return importlib.import_module("tests.reference.report_numbers")


def test_every_document_that_is_cited_is_there():
    places = (ROOT, ROOT / "docs", ROOT / "tests")
    found = [
        f"{path.relative_to(ROOT)}: {name}"
        for folder in ("tests", "studies", "cellmap", "systems")
        for path in sorted((ROOT / folder).rglob("*.py"))
        for name in re.findall(CITED, path.read_text(encoding="utf-8"))
        if not any((place / name).exists() for place in places)
    ]
    assert not found, "\n".join(found)


def test_what_the_paper_cites_is_in_its_bibliography_and_programs_that_are_named_are_there():
    cited = re.findall(r"@([A-Za-z]+\d{4})", (ROOT / "docs" / "paper.md").read_text(encoding="utf-8"))
    entries = re.findall(r"^@\w+\{(\w+),", (ROOT / "docs" / "paper.bib").read_text(encoding="utf-8"), re.MULTILINE)
    assert sorted(set(cited)) == sorted(entries)
    for name in re.findall(r"`(tests/[\w/]+\.(?:py|md))`", PAGE.read_text(encoding="utf-8")):
        assert (ROOT / name).exists(), name


def test_numbers_of_the_report_are_those_of_an_independent_program(report):
    """To all digits on the page but the last, in which integrators at 1e-13 may differ."""
    text = PAGE.read_text(encoding="utf-8")
    given = list(re.findall(r"\d+\.\d{8,}", text))
    for name, value in report.numbers().items():
        same = [v for v in given if abs(float(v) - value) < 2.0 * max(1e-12, 10.0 ** -len(v.partition(".")[2]))]
        assert same, f"{name} = {value:.15g} is not on the page"


@pytest.mark.slow
def test_counts_of_cells_are_those_of_an_independent_program(report):
    assert report.basin_counts("pendulum_3mm") == [32896, 7104]
    assert report.basin_counts("pendulum_3mm_wide") == [25484, 6152, 4182, 4182]

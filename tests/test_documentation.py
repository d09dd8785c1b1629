"""The programs on the pages run as they are printed, and links lead somewhere."""

import functools
import re
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest

import cellmap
import systems
from cellmap import Basins, CellGrid, find_basins, interpolated_map, stroboscopic_map

mpl.use("Agg")
import matplotlib.pyplot as plt

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]


def programs(page: Path) -> list[str]:
    return re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)


def numbered() -> list[Any]:
    return [
        pytest.param(page, number, id=f"{page.name}-{number}")
        for page in PAGES
        for number in range(1, len(programs(page)) + 1)
    ]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Run a page from top to bottom as one program, in an empty folder, up to a block; earlier blocks run once."""
    reached: dict[Path, tuple[int, Path, dict[str, object]]] = {}

    def up_to(page: Path, last: int) -> None:
        done, folder, names = reached.get(page) or (0, tmp_path_factory.mktemp("page"), {"__name__": "__main__"})
        texts = alternative_texts(page)
        with pytest.MonkeyPatch.context() as patch:
            patch.chdir(folder)
            for number in range(done + 1, last + 1):
                text = programs(page)[number - 1]
                if text == SHOWN:
                    names |= shown()[0]
                else:
                    executed(text, f"{page.name}, program {number}", names)
                    assert len(plt.get_fignums()) == texts[number - 1], f"texts for figures, program {number}"
                    plt.close("all")
                reached[page] = number, folder, names

    return up_to


def executed(text: str, name: str, names: dict[str, object]) -> None:
    """Run a program, and compare what it prints with the numbers of its comments."""
    printed: dict[int, str] = {}

    def kept(*values: object) -> None:
        line = sys._getframe(1).f_lineno
        printed[line] = f"{printed.get(line, '')} {' '.join(map(str, values))}"

    names["print"] = kept
    exec(compile(text, name, "exec"), names)
    for line, numbers in promised(text).items():
        found = [float(v) for v in re.findall(NUMBER, printed[line])]
        for given in numbers:
            last = 10.0 ** -len(given.partition(".")[2])
            assert any(abs(v - float(given)) < 0.51 * last for v in found), (given, printed[line])


@pytest.mark.parametrize(("page", "number"), numbered())
def test_programs_run(page, number, run):
    run(page, number)


def alternative_texts(page: Path) -> list[int]:
    """Return how many figures with alternative texts the site shows after each program of a page."""
    _, *after = re.split(r"^```python\n.*?^```", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    return [len(re.findall(r"^<!-- figure: .{20,} -->$", text, re.MULTILINE)) for text in after]


NUMBER = r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?"


def promised(text: str) -> dict[int, list[str]]:
    """Return the numbers that a program says it prints: those of comments that begin with a number, up to a colon."""
    found = {}
    for number, line in enumerate(text.splitlines(), 1):
        if comment := re.fullmatch(r" *print\(.*\) +# (-?\d[^:]*)(?::.*)?", line):
            found[number] = re.findall(NUMBER, comment[1])
    return found


SHOWN, *_ = programs(ROOT / "README.md")
"""What the README begins with, and other pages repeat."""


@functools.cache
def shown() -> tuple[dict[str, object], list[Basins], int]:
    """Run that program once; return its names, the basins that it finds, and how many figures it draws."""
    found: list[Basins] = []

    def kept(*arguments: Any, **options: Any) -> Basins:
        found.append(find_basins(*arguments, **options))
        return found[-1]

    names: dict[str, object] = {"__name__": "__main__"}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cellmap, "find_basins", kept)
        exec(compile(SHOWN, "README.md, program 1", "exec"), names)
    return names, found, len(plt.get_fignums())


def test_program_of_the_readme_is_ten_lines_and_draws_an_image():
    text = SHOWN
    _, (basins,), figures = shown()
    assert figures == 1
    assert isinstance(basins, Basins)
    assert [round(float(f.fraction), 2) for f in basins.fractions.values()] == [0.5, 0.5]
    assert len([line for line in text.splitlines() if line.strip()]) <= 10


def test_what_is_said_of_a_fractal_boundary():
    """own-system.md: one label in ten, one in 22, and fractions that agree to 0.003."""
    table, grid = (CellGrid((-2.2, -2.2), (2.2, 2.2), (n, n)) for n in (300, 200))
    exact = stroboscopic_map(systems.two_well_duffing())
    precise = stroboscopic_map(systems.two_well_duffing(), rtol=1e-13, atol=1e-13)
    by_table, direct, best = (find_basins(m, grid) for m in (interpolated_map(exact, table), exact, precise))
    assert (by_table.labels != direct.labels).mean() == pytest.approx(1 / 10, abs=0.01)
    assert (direct.labels != best.labels).mean() == pytest.approx(1 / 22, abs=0.005)
    check = by_table.verify(2000)
    assert check.low < (by_table.labels != direct.labels).mean() < check.high
    for other in (by_table, direct):
        assert other.fractions[0].fraction == pytest.approx(best.fractions[0].fraction, abs=0.003)


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_links_lead_to_files_and_headings(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if "://" in target or target.startswith("mailto:"):
            continue
        name, _, heading = target.partition("#")
        other = page.parent / name if name else page
        assert other.exists(), target
        if heading:
            titles = re.findall(r"^#+ (.*)$", other.read_text(encoding="utf-8"), re.MULTILINE)
            assert heading in [re.sub(r"[^\w -]", "", t.lower()).replace(" ", "-") for t in titles], target


def test_files_that_the_architecture_names_are_there():
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    there = [path.as_posix() for room in ("cellmap", "systems") for path in (ROOT / room).rglob("*.*")]
    named = re.findall(r"`([\w/]+\.(?:pyi?|js))`", text)
    assert len(named) > 60 and not [name for name in named if not any(path.endswith(f"/{name}") for path in there)]


def test_every_verb_of_make_is_described():
    rules = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    described = re.findall(r"^\t@echo \"make ([a-z-]+) ", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert set(rules) - {"help"} == set(described)

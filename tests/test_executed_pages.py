"""The build of the site compares what its executed pages print; here that comparison is tested, and what it needs."""

import code
import importlib
import importlib.util
import operator
import re
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"
PROGRAMS = sorted(p for folder in ("tutorials", "examples") for p in (DOCS / folder).glob("*.py"))


def extension(name):
    place = DOCS / "_extensions" / f"{name}.py"
    module = importlib.util.module_from_spec(spec := importlib.util.spec_from_file_location(name, place))
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def comparison():
    return extension("printed_output")


def test_notebooks_have_no_roles():
    plain = extension("plain_notebooks").plain
    text = "see :func:`~cellmap.basins.certify`, :doc:`/own-system` and :doc:`the report </the-report>`, ``a.b``"
    assert plain(text) == "see `certify`, `own-system` and the report, `a.b`"
    assert plain("a: `b` and ```text```") == "a: `b` and ```text```"


@pytest.mark.parametrize(
    ("expected", "found", "equal"),
    [
        ("fraction 0.502 +- 0.001", "fraction 0.503 +- 0.001", True),
        ("fraction 0.502 +- 0.001", "fraction 0.504 +- 0.001", False),
        ("error 1e-09", "error 2e-09", True),
        ("error 1e-09", "error 1e-08", False),
        ("90,000 initial conditions", "90,002 initial conditions", False),
        ("[0.99428583 1.12092841]", "[0.99428583 1.12092841 0.1]", False),
        ("saddle, period 1", "node, period 1", False),
    ],
)
def test_numbers_may_differ_by_one_in_their_last_digit(comparison, expected, found, equal):
    assert comparison.same(expected, found) is equal


def test_output_is_read_from_an_executed_page(comparison, tmp_path):
    page = tmp_path / "page.rst"
    page.write_text(".. rst-class:: sphx-glr-script-out\n\n .. code-block:: none\n\n    a 1\n      b 2\n\n\nText.\n")
    assert comparison.printed(page) == "a 1\n  b 2\n"


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda p: p.stem)
def test_each_program_has_figures_with_alternative_text_and_expected_output(program):
    text = program.read_text(encoding="utf-8")
    alternatives = re.findall(r'^# sphinx_gallery_alt = "(.*)"$', text, re.MULTILINE)
    assert alternatives and all(20 <= len(a) <= 160 for a in alternatives)
    assert "print(" not in text or (DOCS / "_printed" / program.parent.name / f"{program.stem}.txt").exists()


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda p: p.stem)
def test_blocks_can_be_pasted_at_the_prompt(program):
    """Python's own prompt before 3.13 needs an empty line after each loop and function, and none inside."""
    prompt = code.InteractiveInterpreter()
    prompt.runcode = lambda compiled: None
    failed = []
    prompt.showsyntaxerror = lambda *_, **__: failed.append(line)
    for block in re.split(r"^# %%$", program.read_text(encoding="utf-8"), flags=re.MULTILINE):
        typed = ""
        for line in [*block.splitlines(), ""]:
            if line.startswith("# sphinx_gallery"):
                continue  # not on the page
            typed += line + "\n"
            if not prompt.runsource(typed[:-1], "<prompt>", "single"):
                typed = ""
    assert failed == []


def test_examples_are_short():
    """20 to 40 lines, so that a reader takes in a whole program at once."""
    for program in PROGRAMS:
        if program.parent.name == "examples":
            assert len(program.read_text(encoding="utf-8").splitlines()) <= 45, program.name


def test_each_public_name_has_a_page_of_the_reference():
    """In one of its groups, by the shortest of its names, and once."""
    pages = [*sorted(DOCS.glob("reference-*.md")), DOCS / "systems-reference.md"]
    text = "".join(page.read_text(encoding="utf-8") for page in pages)
    listed = re.findall(r"^\| \[`((?:cellmap|systems)\.[\w.]+)`", text, re.MULTILINE)
    rooms = [importlib.import_module(room) for room in sorted({name.rpartition(".")[0] for name in listed})]
    public = {id(getattr(room, name)): name for room in rooms for name in getattr(room, "__all__", ())}
    unlisted = {id(thing) for thing in public_constants(rooms)} | {id(module) for module in sys.modules.values()}
    found = [id(operator.attrgetter(name.partition(".")[2])(sys.modules[name.partition(".")[0]])) for name in listed]
    assert len(found) == len(set(found))
    assert not {name for key, name in public.items() if key not in unlisted and key not in found}


def public_constants(rooms):
    """Return dimensions, lengths and versions, which are explained where they are used."""
    things = [getattr(room, name) for room in rooms for name in getattr(room, "__all__", ())]
    return [thing for thing in things if isinstance(thing, float | str | tuple)]


def test_tables_of_names_and_files_are_those_of_the_code(monkeypatch):
    monkeypatch.syspath_prepend(DOCS / "_extensions")
    texts = importlib.import_module("reference_tables").written()
    old = [path.name for path, text in texts.items() if not path.exists() or path.read_text(encoding="utf-8") != text]
    assert not old, "make docs-tables"
    assert len(texts) > 25 and not [
        text for text in texts.values() if "eval-rst" in text or "| |\n|" in text.replace("name | |", "")
    ]


def test_each_plotting_function_has_a_figure_on_its_page(monkeypatch):
    """From the gallery, or from the first program on a page of the guide that calls it."""
    monkeypatch.syspath_prepend(DOCS / "_extensions")
    figures = extension("page_figures").known_figures()
    programs = "".join(program.read_text(encoding="utf-8") for program in PROGRAMS)
    listed = re.findall(
        r"^\| \[`cellmap\.plot\.(\w+)`", (DOCS / "reference-plot.md").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert len(listed) > 40
    without = {name for name in listed if f"plot.{name}" not in figures and f"plot.{name}(" not in programs}
    assert without == {"animate", "draw"}  # a film; and what calls the others
    text = "```python\nplot.a(f(1))\nplot.b(2)\n```\n<!-- figure: first -->\n<!-- figure: second -->\n"
    found = {name: figure.alternative for name, figure in extension("page_figures").figures_of(text, "p").items()}
    assert found == {"plot.a": "first", "f": "first", "plot.b": "second"}

"""Versions of packages are pinned; hosted checks, the recipe and releases say what the project says elsewhere."""

import re
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import cellmap

ROOT = Path(__file__).parent.parent
PINS = [
    Requirement(line)
    for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    if not line.startswith("#")
]
WHOLE = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PROJECT = WHOLE["project"]
DEPENDENCIES = [
    *WHOLE["build-system"]["requires"],
    *PROJECT["dependencies"],
    *(name for extra in PROJECT["optional-dependencies"].values() for name in extra),
]


def made(*arguments: str) -> str:
    command = ["make", "--no-print-directory", *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout


def pins_of(python: str) -> dict[str, str]:
    """The versions that a Python takes, by names of packages; more than one for a package is an error."""
    release = python if python.count(".") == 2 else f"{python}.0"
    environment = {"python_full_version": release, "python_version": release.rpartition(".")[0]}
    taken = [pin for pin in PINS if pin.marker is None or pin.marker.evaluate(environment)]
    names = [canonicalize_name(pin.name) for pin in taken]
    assert len(set(names)) == len(names)
    return {name: next(iter(pin.specifier)).version for name, pin in zip(names, taken, strict=True)}


def test_pins_are_exact_versions_and_no_addresses():
    assert all([s.operator for s in pin.specifier] == ["=="] and pin.url is None for pin in PINS)
    assert "://" not in (ROOT / "constraints.txt").read_text(encoding="utf-8")


def test_what_the_project_needs_is_pinned_to_a_version_that_it_takes():
    for python in ("3.11.0", "3.11.2", "3.11.5", "3.12", "3.13", "3.14"):
        pins = pins_of(python)
        for wanted in map(Requirement, DEPENDENCIES):
            if wanted.marker is None or wanted.marker.evaluate():
                assert wanted.specifier.contains(pins[canonicalize_name(wanted.name)]), (python, wanted)


def test_the_oldest_and_the_newest_python_are_checked():
    """Debian 12 has Python 3.11.2, which one of the packages of the site no longer knew."""
    show = "--eval=show:;@echo $(OLDEST_PYTHON) $(NEWEST_PYTHON) $(UNKNOWN_PYTHON)"
    oldest, newest, unknown = made(show, "show").split()
    assert PROJECT["requires-python"] == ">=" + oldest.removesuffix(".0")
    assert [int(v.removeprefix("3.")) for v in (newest, unknown)] == [14, 15]
    assert pins_of(newest) and not pins_of(unknown)
    checks = made("--dry-run", "check")
    assert f"for python in {oldest} {newest}; do" in checks and "--constraints constraints.txt" in checks


def test_tests_need_no_tools_of_the_site_and_the_first_result_none_of_tests():
    installed = [line for line in made("--dry-run", "--always-make", "test").splitlines() if "--editable" in line]
    assert [line.split("--editable ")[1] for line in installed] == ["'.[test]'"]
    tools = {canonicalize_name(Requirement(name).name) for name in PROJECT["optional-dependencies"]["test"]}
    assert not any("sphinx" in name or "myst" in name for name in tools)
    commands = made("--dry-run", "--always-make", "basins")
    assert "pip install" in commands
    assert "--editable .\n" in commands
    assert "[" not in commands[commands.index("pip install") :].splitlines()[0]


def test_verbs_install_the_pins():
    show = "--eval=show:;@echo $$PIP_CONSTRAINT,$$PIP_BUILD_CONSTRAINT"
    assert made(show, "show").strip() == "constraints.txt,constraints.txt"
    assert made(show, "PINS=", "show").strip() == ","


WORKFLOWS = {p.stem: yaml.safe_load(p.read_text(encoding="utf-8")) for p in (ROOT / ".github/workflows").glob("*.yml")}
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")
VERBS = set(re.findall(r"^\t@echo \"make ([a-z-]+) ", MAKEFILE, re.MULTILINE))


def steps(workflow: dict[str, Any]) -> list[str]:
    return [step["run"] for job in workflow["jobs"].values() for step in job["steps"] if "run" in step]


def test_workflows_call_verbs_of_the_makefile():
    called = {verb for w in WORKFLOWS.values() for run in steps(w) for verb in re.findall(r"\bmake ([a-z-]+)", run)}
    offered = WORKFLOWS["on-demand"][True]["workflow_dispatch"]["inputs"]["verb"]["options"]  # YAML 1.1 reads `on` so
    assert {"test", "check", "dist"} <= called
    assert called | set(offered) <= VERBS


def test_the_pythons_are_those_for_which_versions_are_pinned():
    oldest, newest = re.findall(r"^(?:OLDEST|NEWEST)_PYTHON := (3\.\d+)", MAKEFILE, re.MULTILINE)
    pythons = WORKFLOWS["checks"]["jobs"]["tests"]["strategy"]["matrix"]["python"]
    assert (pythons[0], pythons[-1]) == (oldest, newest)
    assert pythons == [f"3.{n}" for n in range(int(oldest[2:]), int(newest[2:]) + 1)]


def test_the_recipe_of_conda_needs_what_the_project_needs():
    recipe = yaml.safe_load((ROOT / "conda/recipe.yaml").read_text(encoding="utf-8"))
    listed = {name.replace("matplotlib-base", "matplotlib") for name in recipe["requirements"]["run"]}
    assert {re.sub(r"\s", "", name) for name in listed} == {
        *(f"{one.name}{one.specifier}" for one in map(Requirement, PROJECT["dependencies"])),
        f"python{PROJECT['requires-python']}",
    }


def test_the_version_is_the_same_everywhere():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    recipe = yaml.safe_load((ROOT / "conda/recipe.yaml").read_text(encoding="utf-8"))
    assert citation["version"] == recipe["context"]["version"] == cellmap.__version__
    assert f"## {cellmap.__version__}\n" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")

"""Files for hosted checks and releases: verbs of the Makefile, and what the project says elsewhere."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import yaml
from packaging.requirements import Requirement

import cellmap

ROOT = Path(__file__).parent.parent
WORKFLOWS = {p.stem: yaml.safe_load(p.read_text(encoding="utf-8")) for p in (ROOT / ".github/workflows").glob("*.yml")}
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
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

"""Versions of packages: all are pinned, and the verbs of the Makefile install them so."""

from __future__ import annotations

import subprocess
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parent.parent
PINS = [
    Requirement(line)
    for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    if not line.startswith("#")
]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
DEPENDENCIES = [
    *PROJECT["build-system"]["requires"],
    *PROJECT["project"]["dependencies"],
    *(name for extra in PROJECT["project"]["optional-dependencies"].values() for name in extra),
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


@pytest.mark.parametrize("python", ["3.11.0", "3.11.2", "3.11.5", "3.12", "3.13", "3.14"])
def test_what_the_project_needs_is_pinned_to_a_version_that_it_takes(python):
    pins = pins_of(python)
    for wanted in map(Requirement, DEPENDENCIES):
        if wanted.marker is None or wanted.marker.evaluate():
            assert wanted.specifier.contains(pins[canonicalize_name(wanted.name)]), wanted


def test_the_oldest_and_the_newest_python_are_checked():
    """Debian 12 has Python 3.11.2, which one of the packages of the site no longer knew."""
    show = "--eval=show:;@echo $(OLDEST_PYTHON) $(NEWEST_PYTHON) $(UNKNOWN_PYTHON)"
    oldest, newest, unknown = made(show, "show").split()
    assert PROJECT["project"]["requires-python"] == ">=" + oldest.removesuffix(".0")
    assert [int(v.removeprefix("3.")) for v in (newest, unknown)] == [14, 15]
    assert pins_of(newest) and not pins_of(unknown)
    checks = made("--dry-run", "check")
    assert f"for python in {oldest} {newest}; do" in checks and "--constraints constraints.txt" in checks


def test_tests_need_no_tools_of_the_site():
    installed = [line for line in made("--dry-run", "--always-make", "test").splitlines() if "--editable" in line]
    assert [line.split("--editable ")[1] for line in installed] == ["'.[test]'"]
    tools = {canonicalize_name(Requirement(name).name) for name in PROJECT["project"]["optional-dependencies"]["test"]}
    assert not any("sphinx" in name or "myst" in name for name in tools)


def test_verbs_install_the_pins():
    show = "--eval=show:;@echo $$PIP_CONSTRAINT,$$PIP_BUILD_CONSTRAINT"
    assert made(show, "show").strip() == "constraints.txt,constraints.txt"
    assert made(show, "PINS=", "show").strip() == ","


def test_the_first_result_needs_no_tools_of_tests():
    commands = made("--dry-run", "--always-make", "basins")
    assert "pip install" in commands
    assert "--editable .\n" in commands
    assert "[" not in commands[commands.index("pip install") :].splitlines()[0]

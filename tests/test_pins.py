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


def test_pins_are_exact_versions_and_no_addresses():
    names = [canonicalize_name(pin.name) for pin in PINS]
    assert len(set(names)) == len(names)
    assert all([s.operator for s in pin.specifier] == ["=="] and pin.url is None for pin in PINS)
    assert "://" not in (ROOT / "constraints.txt").read_text(encoding="utf-8")


@pytest.mark.parametrize("dependency", DEPENDENCIES)
def test_what_the_project_needs_is_pinned_to_a_version_that_it_takes(dependency):
    wanted = Requirement(dependency)
    (pin,) = (pin for pin in PINS if canonicalize_name(pin.name) == canonicalize_name(wanted.name))
    (exact,) = pin.specifier
    assert wanted.specifier.contains(exact.version)


def test_verbs_install_the_pins():
    show = "--eval=show:;@echo $$PIP_CONSTRAINT,$$PIP_BUILD_CONSTRAINT"
    assert made(show, "show").strip() == "constraints.txt,constraints.txt"
    assert made(show, "PINS=", "show").strip() == ","


def test_the_first_result_needs_no_tools_of_tests():
    commands = made("--dry-run", "--always-make", "basins")
    assert "pip install" in commands
    assert "--editable .\n" in commands
    assert "[" not in commands[commands.index("pip install") :].splitlines()[0]

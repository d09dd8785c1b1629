"""Pages that are computed: what the studies draw and print, and references by module."""

from __future__ import annotations

import hashlib
import importlib
import inspect
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from enum import Enum
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from reference_tables import EXPORTS

import systems.lab
from studies import hard_cases
from studies.__main__ import study_names

if TYPE_CHECKING:
    from sphinx.application import Sphinx

HARD_CASES = "<!-- what came out of the hard cases -->"
WORK_PRECISION = "<!-- what accuracy costs -->"
GALLERY = "<!-- what the studies draw and print -->"

ROOT = Path(__file__).parents[2]
GENERATED = ROOT / "docs" / "generated"
_beside: list[subprocess.Popen[bytes]] = []  # the process of the studies


def exports(package: ModuleType) -> str:
    """Return the reference as text: a section for each module, an entry for each name that the package exports."""
    by_module: dict[str, list[str]] = {}
    for name, module in defined_in(package).items():
        by_module.setdefault(module, []).append(name)
    parts = []
    for module, names in by_module.items():
        parts += headed((inspect.getdoc(sys.modules[module]) or module).split("\n\n")[0].replace("\n", " "))
        parts += [f"```{{eval-rst}}\n{directive(package, name)}\n```" for name in names]
    return "\n\n".join(parts)


def defined_in(package: ModuleType) -> dict[str, str]:
    """Return the modules that define the public names of a package, in the order of its stub."""
    stub = Path(package.__file__ or "").with_suffix(".pyi").read_text(encoding="utf-8")
    found = re.findall(r"^from \.([\w.]+) import (\w+)", stub, re.MULTILINE)
    return {name: importlib.import_module(f"{package.__name__}.{module}").__name__ for module, name in found}


def directive(package: ModuleType, name: str) -> str:
    """Return the directive that documents one name."""
    thing, place = getattr(package, name), f"{package.__name__}.{name}"
    if not inspect.isclass(thing):
        return f".. {'autofunction' if inspect.isfunction(thing) else 'autodata'}:: {place}"
    members = [":members:", *([":undoc-members:"] if issubclass(thing, Enum) else [])]
    return "\n".join([f".. autoclass:: {place}", *(f"   {line}" for line in members)])


def headed(text: str) -> list[str]:
    """Return a heading, which is the beginning of a text, and the text where it says more."""
    title = re.split("[.:,]", text)[0]
    return [f"## {title}", *([text] if len(text) > len(title) + 1 else [])]


def results(study: str) -> Path:
    """Return the folder with what a study writes and prints when it is quick.

    It runs again only where its code, or that of the library, or reference values have changed.
    """
    sources = sorted((ROOT / "studies" / study).rglob("*.py"))
    sources += sorted(p for name in (f"{study}[._]*", "_*.py") for p in (ROOT / "studies").glob(name))

    def run(folder: Path) -> None:
        with (folder / "printed.txt").open("w", encoding="utf-8") as printed, redirect_stdout(printed):
            importlib.import_module(f"studies.{study}").main(quick=True, output=folder)

    return kept(study, [*sources, hard_cases.TABLE], run)


def begin_studies(app: Sphinx, *_: object) -> None:
    """Run the studies in a process of their own, beside the programs of the gallery and of pages."""
    if computes():
        program = "import study_pages as pages\nfor study in pages.study_names(): pages.results(study)"
        paths = os.pathsep.join([str(Path(__file__).parent), str(ROOT)])
        _beside.append(subprocess.Popen([sys.executable, "-c", program], env={**os.environ, "PYTHONPATH": paths}))


def end_studies(*_: object) -> None:
    """Wait for the studies; those that have failed run again where their results are asked for, and say why."""
    while _beside:
        _beside.pop().wait()


def kept(name: str, sources: Sequence[Path], make: Callable[[Path], None]) -> Path:
    """Return the folder with what a function makes, again only where files or the library have changed."""
    library = [p for room in ("cellmap", "systems") for p in sorted((ROOT / room).rglob("*.py"))]
    code = hashlib.sha256(b"".join(p.read_bytes() for p in [*library, *sources])).hexdigest()
    folder = GENERATED / f"{name}_{code[:16]}"
    if not folder.exists():
        for old in GENERATED.glob(f"{name}_{'[0-9a-f]' * 16}*"):
            shutil.rmtree(old)
        unfinished = folder.with_suffix(".unfinished")
        unfinished.mkdir(parents=True)
        make(unfinished)
        unfinished.rename(folder)
    return folder


def hard_case_results() -> str:
    """Return what came out of the hard cases."""
    return (results("hard_cases") / "hard_cases.md").read_text(encoding="utf-8")


def work_precision_results() -> str:
    """Return the tables and figures of time against error."""
    folder = results("work_precision")
    text = (folder / "work_precision.md").read_text(encoding="utf-8")
    return text.replace("](", f"]({folder.relative_to(GENERATED.parent).as_posix()}/")


def gallery() -> str:
    """Return all studies that draw: what each is about, its figures, and what it prints."""
    parts = []
    for study in study_names():
        folder = results(study)
        images = sorted(folder.glob("*.png"))
        if not images:
            continue
        about = inspect.getdoc(importlib.import_module(f"studies.{study}")) or study
        first, *others = (as_markdown(paragraph) for paragraph in about.split("\n\n"))
        parts += [*headed(first), *others]
        parts += [
            f"```{{figure}} {image.relative_to(GENERATED.parent).as_posix()}\n:alt: {first}\n:width: 100%\n```"
            for image in images
        ]
        printed = (folder / "printed.txt").read_text(encoding="utf-8").strip()
        if printed:
            shown = "<details>\n<summary>What it prints</summary>\n\n```text\n{}\n```\n\n</details>"
            parts.append(shown.format(printed))
        parts.append(f"In full: `python -m studies {study}`")
    return "\n\n".join(parts)


def as_markdown(paragraph: str) -> str:
    """Return a paragraph of plain text as Markdown that shows it as it is; an indented one is a block of code."""
    if paragraph.startswith("    "):
        return paragraph
    return re.sub(r"([\\`*_{}\[\]<>#$|~^])", r"\\\1", " ".join(paragraph.split()))


def computed(text: Callable[[], str]) -> Callable[[], str]:
    """Return what makes a text from studies; a note in its place where the build only checks the pages."""
    return text if computes() else lambda: "*This build leaves the studies out.*"


def computes() -> bool:
    """Whether this build runs studies and the programs of pages."""
    return os.environ.get("CELLMAP_STUDIES") != "skip"


def fill_page(app: Sphinx, docname: str, source: list[str]) -> None:
    """Put what is computed into the pages that ask for it."""
    if EXPORTS in source[0]:
        source[0] = source[0].split(EXPORTS)[0] + exports(systems.lab)
    pages = {
        HARD_CASES: computed(hard_case_results),
        WORK_PRECISION: computed(work_precision_results),
        GALLERY: computed(gallery),
    }
    for marker, text in pages.items():
        if marker in source[0]:
            source[0] = source[0].replace(marker, text())


def pages_that_are_computed(app: Sphinx, *_: object) -> list[str]:
    """Name the pages that change with the code, whether or not their own text has."""
    return ["accuracy-and-cost", "gallery", "hard-cases", "laboratory-reference"]


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the hooks: studies begin first, and are waited for when all figures are drawn."""
    app.connect("config-inited", begin_studies)
    app.connect("builder-inited", end_studies, priority=970)
    app.connect("build-finished", end_studies)
    app.connect("source-read", fill_page)
    app.connect("env-get-outdated", pages_that_are_computed)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

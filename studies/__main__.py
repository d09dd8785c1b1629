"""Run studies by name, or all of them: ``python -m studies [NAME ...] [--quick] [--output DIR]``."""

from __future__ import annotations

import argparse
import importlib
import pkgutil
import time
from collections.abc import Sequence
from pathlib import Path

import studies

OUTPUT = Path(__file__).parent / "output"


def study_names() -> list[str]:
    """Return the names of all studies: the modules of this package without a leading underscore."""
    return sorted(m.name for m in pkgutil.iter_modules(studies.__path__) if not m.name.startswith("_"))


def run_study(name: str, quick: bool, output: Path) -> None:
    """Run one study; say how long it took and which files it wrote."""
    print(f"== {name}", flush=True)
    before = _files(output)
    began = time.perf_counter()
    importlib.import_module(f"studies.{name}").main(quick=quick, output=output)
    written = [path for path, changed in _files(output).items() if changed != before.get(path)]
    print(f"-- {name}: {time.perf_counter() - began:.1f} s")
    for path in sorted(written):
        print(f"   {path}")


def _files(folder: Path) -> dict[Path, int]:
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}


def main(arguments: Sequence[str] | None = None) -> None:
    """Read the command line and run what it names."""
    names = study_names()
    parser = argparse.ArgumentParser(prog="python -m studies", description="Compute and draw the figures.")
    parser.add_argument("name", nargs="*", help="studies to run; all of them by default")
    parser.add_argument("--quick", action="store_true", help="coarse and short, to see that a study runs")
    parser.add_argument("--output", type=Path, default=OUTPUT, metavar="DIR", help="folder for results (%(default)s)")
    parser.add_argument("--list", action="store_true", help="list the studies and stop")
    chosen = parser.parse_args(arguments)
    if chosen.list:
        print("\n".join(names))
        return
    if unknown := [name for name in chosen.name if name not in names]:
        parser.error(f"unknown study {', '.join(unknown)}; there are: {', '.join(names) or 'none'}")
    chosen.output.mkdir(parents=True, exist_ok=True)
    for name in chosen.name or names:
        run_study(name, chosen.quick, chosen.output)


if __name__ == "__main__":
    main()

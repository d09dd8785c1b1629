"""Run mutants: `python tests/mutation/run.py maps=70 basins=80`; with `--at cellmap/maps/grid.py:40` all of a line.

The tree is copied to `--work`.  First the tests of a room run once, with coverage, which says what tests execute each
line; a test that fails without any mutant ends the run.  Then a process that has collected them is forked for each
mutant: the copy gets the code of the mutant and runs the tests that execute it, the fastest first, up to the first
failure.  What runs at import is imported again instead.  Limits are in CPU time, so that they do not depend on the
load: 3 times that of the tests and 20 s; beyond it a mutant is killed.  The rows of `--work/results.jsonl` are kept:
what has been run is not run again.  A mutant on which the tool itself failed has no row, and the exit status is 1.
A `--work` that another run uses is refused.
Needs the package `coverage`, and Linux.
"""

from __future__ import annotations

import argparse
import contextlib
import gc
import json
import os
import resource
import runpy
import shutil
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from mutants import Mutant, chosen, mutants_of

ROOT = Path(__file__).parents[2]
USED = {"_lib": ["_lib", "basins", "attractors", "maps"]}
"""Rooms whose tests count; elsewhere those of the room itself."""
RESULTS = "_lib/bad_input"
"""What looks at the results of all rooms."""
OPTIONS = ["-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-W", "ignore::pytest.PytestAssertRewriteWarning"]
PREPARED = "h5py hypothesis llvmlite.binding matplotlib.pyplot mpmath scipy.integrate sklearn.cluster sympy"
DEFAULTS = "tests/test_names.py::test_defaults_change_on_purpose"
"""What looks at the defaults of all rooms."""
AT_IMPORT = -1
COPIED = "cellmap systems studies tests docs pyproject.toml README.md CHANGELOG.md"
KILLED_AT_IMPORT = {pytest.ExitCode.TESTS_FAILED, pytest.ExitCode.INTERRUPTED, pytest.ExitCode.USAGE_ERROR}
"""Statuses of pytest on a mutant that is imported again: a test failed, its module or its conftest was not imported."""
TOOL_FAILED = 99


class Recorder:
    """Plugin that measures what lines each test executes; what shared fixtures do counts for all their users."""

    def __init__(self, coverage: Any) -> None:
        self.coverage, self.used, self.seconds, self.failed = coverage, {}, {}, set()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        begin, self.test = cpu_seconds(), item.nodeid
        self.coverage.switch_context(item.nodeid)
        self.used[item.nodeid] = []
        done = yield
        self.coverage.switch_context("between tests")
        self.seconds[item.nodeid] = cpu_seconds() - begin
        return done

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: Any) -> Iterator[None]:
        if fixturedef.scope == "function":
            return (yield)
        self.coverage.switch_context(f"fixture {fixturedef.baseid} {fixturedef.argname}")
        done = yield
        self.coverage.switch_context(self.test)
        return done

    def pytest_runtest_call(self, item: pytest.Item) -> None:
        defined = item._fixtureinfo.name2fixturedefs.values() if hasattr(item, "_fixtureinfo") else ()
        self.used[item.nodeid] = [f"fixture {d[-1].baseid} {d[-1].argname}" for d in defined if d]

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self.failed.add(report.nodeid)


def cpu_seconds() -> float:
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


def record(tree: Path, room: str, kept: Path) -> dict[str, Any]:
    """Run the tests of a room with coverage: their times, and for each file and line the tests that execute it."""
    if not kept.exists() and forked(lambda: _record(tree, room, kept), 1e5)[0]:
        raise SystemExit(f"the tests of {room} have to pass without any mutant before one can be judged")
    found: dict[str, Any] = json.loads(kept.read_text())
    return found


def _record(tree: Path, room: str, kept: Path) -> int:
    import coverage

    measured = coverage.Coverage(include=[f"{tree}/cellmap/*"], omit=["*/_compiled/*"], data_file=None)
    recorder = Recorder(measured)
    measured.start()
    status = pytest.main([*OPTIONS, f"tests/{room}"], plugins=[recorder])
    measured.stop()
    data = measured.get_data()
    names = sorted(recorder.seconds)
    if status or not names or not data.measured_files():
        print(f"tests/{room}: pytest ended with {status!r} after {len(names)} tests; failed: {sorted(recorder.failed)}")
        return 1
    users: dict[str, set[int]] = {"": {AT_IMPORT}}
    for number, test in enumerate(names):
        for context in (test, *recorder.used[test]):
            users.setdefault(context, set()).add(number)
    lines = {
        str(Path(path).relative_to(tree)): {
            line: sorted(set().union(*(users.get(context, set()) for context in contexts)))
            for line, contexts in data.contexts_by_lineno(path).items()
        }
        for path in data.measured_files()
    }
    kept.write_text(json.dumps({"tests": names, "seconds": [recorder.seconds[n] for n in names], "lines": lines}))
    return 0


def tests_of(mutant: Mutant, recorded: list[dict[str, Any]], most: float) -> tuple[list[str], float, bool]:
    """List tests that execute a mutant, the fastest first, up to some seconds; their time; if it runs at import."""
    found: dict[str, float] = {}
    at_import = mutant.line not in mutant.function
    for room in recorded:
        lines = room["lines"].get(mutant.path, {})
        at_import |= any(AT_IMPORT in lines.get(str(line), ()) for line in mutant.lines)
        # What runs at import alone shows in what uses it: the function of a default, or the module.
        for where in (mutant.lines, mutant.function, lines) if at_import else (mutant.lines,):
            tests = {test for line in where for test in lines.get(str(line), ())} - {AT_IMPORT}
            if tests:
                break
        found |= {room["tests"][i]: room["seconds"][i] for i in tests}
    order, total = [], 0.0
    for test in sorted(found, key=found.__getitem__):
        if not order or total + found[test] <= most:
            order.append(test)
            total += found[test]
    if at_import and mutant.function and Path(DEFAULTS.partition("::")[0]).exists():
        order.append(DEFAULTS)
    return order, total, at_import


def forked(work: Callable[[], int], limit: float, log: Path | None = None) -> tuple[int, float]:
    """Do work in a child with a limit of CPU time; return its exit status, negative for a signal, and its CPU time."""
    child = os.fork()
    if child == 0:
        status = TOOL_FAILED
        try:
            os.setpgid(0, 0)
            allowed = resource.getrlimit(resource.RLIMIT_CPU)[1]
            most = 2**62 if allowed == resource.RLIM_INFINITY else allowed  # which whoever runs this has set
            resource.setrlimit(resource.RLIMIT_CPU, (min(int(limit) + 1, most), min(int(limit) + 2, most)))
            if log:
                out = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
                os.dup2(out, 1)
                os.dup2(out, 2)
            status = work()
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            os._exit(status)
    patience = time.monotonic() + 30 * limit  # what waits for ever uses no CPU time
    while True:
        ended, status, used = os.wait4(child, os.WNOHANG)
        if ended:
            break
        if time.monotonic() > patience:
            os.kill(child, signal.SIGKILL)
        time.sleep(0.02)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    return os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime


class Judge:
    """Plugin that, in place of running the tests that were collected, runs mutants; `tree` is the current directory."""

    def __init__(self, tree: Path, results: Path, work: list[tuple[Mutant, list[str], float]]) -> None:
        self.tree, self.results, self.work, self.out = tree, results, work, os.dup(1)

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        gc.unfreeze()
        items = {item.nodeid: item for item in session.items}
        for mutant, tests, seconds in self.work:
            self.judge(mutant, tests, seconds, lambda m=mutant, t=tests: self.in_place(m, [items[n] for n in t]))
        return True

    def in_place(self, mutant: Mutant, items: list[pytest.Item]) -> int:
        path = str(self.tree / mutant.path)
        codes = dict(codes_of(compile(Path(path).read_bytes(), path, "exec")))
        for found in gc.get_objects():
            if isinstance(found, FunctionType) and found.__code__.co_filename == path:
                code = found.__code__
                found.__code__ = codes.get((code.co_qualname, code.co_firstlineno), code)
        for item, following in zip(items, [*items[1:], None], strict=True):
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
        return 0

    def imported(self, tests: list[str]) -> int:
        sys.dont_write_bytecode = True
        self.rank = {test: i for i, test in enumerate(tests)}
        files = sorted({test.partition("::")[0] for test in tests})
        status = int(pytest.main([*OPTIONS, *files], plugins=[Ordered(self)]))
        return TOOL_FAILED if status and status not in KILLED_AT_IMPORT else status

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            (self.tree / "first_failure.txt").write_text(f"{report.nodeid}", encoding="utf-8")
            os._exit(1)

    def judge(self, mutant: Mutant, tests: list[str], seconds: float, work: Callable[[], int]) -> None:
        path, tell, log = self.tree / mutant.path, self.tree / "first_failure.txt", self.tree / "log.txt"
        source, times, limit = path.read_bytes(), path.stat(), 20.0 + 3.0 * seconds
        tell.unlink(missing_ok=True)
        status, used = 0, 0.0
        if tests:
            path.write_bytes(mutant.of(source))
            # Bytecode of the original is told from that of a mutant by whole seconds.
            os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns + 2 * 10**9))
            try:
                status, used = forked(work, limit, log)
            finally:
                path.write_bytes(source)
                os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
        by = "" if tests else "no test executes it"
        if status == TOOL_FAILED:
            os.write(self.out, f"NOT JUDGED {mutant}\n{log.read_text(errors='replace')[-2000:]}\n".encode())
            return
        if status < 0:
            by = f"signal {-status} (CPU time above {limit:.0f} s)"
        elif status:
            by = tell.read_text() if tell.exists() else log.read_text(errors="replace")[-300:]
        row = vars(mutant) | {"tests": len(tests), "killed": status != 0, "by": by, "seconds": used}
        with self.results.open("a") as file:
            file.write(json.dumps(row) + "\n")
        said = (
            f"{'killed  ' if status else 'SURVIVED'} {mutant}  [{len(tests)} tests, {used:.1f} of {seconds:.0f} s] {by}"
        )
        os.write(self.out, f"{said}\n".encode())


class Ordered:
    """Plugin that runs some tests in a given order, up to the first failure."""

    def __init__(self, judge: Judge) -> None:
        self.rank, self.pytest_runtest_logreport = judge.rank, judge.pytest_runtest_logreport

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        items[:] = sorted((i for i in items if i.nodeid in self.rank), key=lambda i: self.rank[i.nodeid])


def codes_of(code: CodeType) -> Iterator[tuple[tuple[str, int], CodeType]]:
    yield (code.co_qualname, code.co_firstlineno), code
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from codes_of(inner)


def rows(results: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in results.read_text().splitlines()] if results.exists() else []


def key_of(row: dict[str, Any]) -> tuple[str, int, str]:
    return row["path"], row["begin"], row["new"]


def judged(results: Path) -> set[tuple[str, int, str]]:
    return set(map(key_of, rows(results)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rooms", nargs="*", metavar="room=number")
    parser.add_argument("--at", nargs="*", default=[], metavar="path:line", help="run all mutants of these lines")
    parser.add_argument("--also", nargs="*", default=[], metavar="room", help="further rooms whose tests count")
    parser.add_argument("--constant", action="store_true", help="functions that return a constant, instead of lines")
    parser.add_argument("--most", type=float, default=60.0, metavar="SECONDS", help="of tests for each mutant")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--work", type=Path, default=Path("/tmp/cellmap-mutants"))
    parser.add_argument("--prepared", nargs="*", default=PREPARED.split(), help="modules that are imported only once")
    parser.add_argument("--root", type=Path, default=ROOT, help="tree of which the mutants are; this one by default")
    given = parser.parse_args()
    tree, results = given.work / "tree", given.work / "results.jsonl"
    given.work.mkdir(parents=True, exist_ok=True)
    # By its path: what is imported as cellmap is the copy.
    locks = runpy.run_path(str(ROOT / "cellmap/_lib/systems.py"))
    try:
        locks["lock"](given.work / "in_use")
    except locks["Locked"] as holder:
        raise SystemExit(f"--work={given.work}: {holder} uses it; give another folder") from None
    shutil.rmtree(tree, ignore_errors=True)
    tree.mkdir()
    for part in (given.root.resolve() / name for name in COPIED.split()):
        if part.exists():
            (shutil.copytree if part.is_dir() else shutil.copy2)(part, tree / part.name)
    os.chdir(tree)
    sys.path.insert(0, str(tree))
    cache, bytecode = given.work / "kernels", given.work / "bytecode"
    cache.mkdir(mode=0o700, exist_ok=True)
    sys.pycache_prefix, sys.dont_write_bytecode = str(bytecode), False
    os.environ |= {"PYTHONPATH": str(tree), "CELLMAP_CACHE_DIR": str(cache)}
    os.environ |= {"PYTHONPYCACHEPREFIX": str(bytecode), "PYTHONDONTWRITEBYTECODE": "1"}
    for name in given.prepared:
        __import__(name)
    wanted = {room: int(number) for room, _, number in (r.partition("=") for r in given.rooms)}
    mutants = [m for room, number in wanted.items() for m in chosen(tree, room, number, given.seed, given.constant)]
    for place in given.at:
        path, _, line = place.partition(":")
        mutants += [mutant for mutant in mutants_of(tree / path, tree) if mutant.line == int(line)]
    done = judged(results)
    mutants = [mutant for mutant in mutants if key_of(vars(mutant)) not in done]
    for room in dict.fromkeys(Path(mutant.path).parts[1] for mutant in mutants):
        everywhere = [RESULTS] if Path("tests", RESULTS).exists() else []
        used = list(dict.fromkeys([*USED.get(room, [room]), *everywhere, *given.also]))
        recorded = [record(tree, r, given.work / f"{r.replace('/', '.')}.json") for r in used]
        found = [(m, *tests_of(m, recorded, given.most)) for m in mutants if Path(m.path).parts[1] == room]
        judge = Judge(tree, results, [(m, tests, seconds) for m, tests, seconds, at_import in found if not at_import])
        log = given.work / "collected.txt"
        folders = [f"tests/{r}" for r in used]
        if judge.work and forked(lambda j=judge, f=folders: pytest.main([*OPTIONS, *f], plugins=[j]), 1e6, log)[0]:
            raise SystemExit(f"{' '.join(folders)} could not be collected:\n{log.read_text(errors='replace')[-2000:]}")
        for mutant, tests, seconds, at_import in found:
            if at_import:
                judge.judge(mutant, tests, seconds, lambda j=judge, t=tests: j.imported(t))
    for room in sorted({Path(row["path"]).parts[1] for row in rows(results)}):
        of_room = [row["killed"] for row in rows(results) if Path(row["path"]).parts[1] == room]
        print(f"{room}: {sum(of_room)} of {len(of_room)} killed")
    done = judged(results)
    if missed := [str(mutant) for mutant in mutants if key_of(vars(mutant)) not in done]:
        raise SystemExit(f"{len(missed)} mutants were not judged: {', '.join(missed)}")


if __name__ == "__main__":
    main()

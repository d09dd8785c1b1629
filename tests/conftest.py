"""Problems, oracles and options that the whole suite shares."""

import contextlib
import gc
import json
import os
import re
import sys
from collections.abc import Callable, Generator, Iterator, Mapping
from math import cos, inf, pi, sin
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numpy as np
import pytest
from _pytest.doctest import DoctestModule
from _pytest.pathlib import import_path
from hypothesis import settings
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

import systems
from cellmap import ForcedSystem, angle, set_threads
from cellmap._compiled.codegen.rebind import ARRAY_FUNCTIONS, rebind
from cellmap._compiled.codegen.trace import parameter_record

REFERENCE = Path(__file__).parent / "reference"

os.environ.setdefault("MPLBACKEND", "Agg")  # figures need no screen

settings.register_profile("cellmap", deadline=None, derandomize=True)
settings.load_profile("cellmap")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--update-reference", action="store_true", help="redraw the reference pictures on purpose")


def pytest_configure(config: pytest.Config) -> None:
    # The kernels of the suite are kept with pytest's own cache: nothing is left in the user's.
    if "CELLMAP_CACHE_DIR" not in os.environ and getattr(config, "cache", None) is not None:
        folder = config.cache.mkdir("kernels")
        folder.chmod(0o700)
        os.environ["CELLMAP_CACHE_DIR"] = str(folder)
    # Thousands of kernels run for a moment each: LLVM need not look for the best order of their instructions, nor for
    # the best use of registers and addresses, which takes two thirds of the time.  Results have the same bits, for
    # each instruction stays what it is.
    for option in ("enable-misched=false", "optimize-regalloc=false", "disable-post-ra", "disable-lsr", "disable-cgp"):
        llvm.set_option("", f"-{option}")
    config.pluginmanager.register(Everywhere())


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """Take one process more than there are cores: those that wait for a browser or a server leave theirs idle."""
    return (os.cpu_count() or 1) + 1


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Give whole files to each process, so that fixtures are made once, and of the programs on pages whole pages."""
    if config.getoption("dist") != "loadfile":
        return None
    from xdist.scheduler import LoadFileScheduling

    class ByFileOrPage(LoadFileScheduling):  # type: ignore[misc]
        def _split_scope(self, nodeid: str) -> str:
            page = re.search(r"\[([\w-]+\.md)-\d+\]$", nodeid)
            return page[1] if page else str(super()._split_scope(nodeid))

    return ByFileOrPage(config, log)


@pytest.hookimpl(wrapper=True)
def pytest_collection(session: pytest.Session) -> Generator[None, object, object]:
    """Keep modules and collected tests, which stay to the end, out of what is searched for garbage again and again."""
    gc.disable()
    gc.set_threshold(10_000, 20, 20)
    try:
        if hasattr(session.config, "workerinput"):
            import_in_turn(session.config)
        return (yield)
    finally:
        gc.enable()
        gc.collect()
        gc.freeze()


def import_in_turn(config: Any) -> None:
    """Import the files of tests, each process another part of them first: the bytecode is compiled once for all."""
    wanted = {config.rootpath / argument.partition("::")[0] for argument in config.args}
    files = [file for file in sorted(Path(__file__).parent.rglob("test_*.py")) if wanted & {file, *file.parents}]
    files = [file for file in files if file.parent.name not in ("bench", "site")]
    first = len(files) * int(config.workerinput["workerid"][2:]) // config.workerinput["workercount"]
    for file in files[first:] + files[:first]:
        with contextlib.suppress(Exception, pytest.skip.Exception):  # which collection tells
            import_path(file, mode="importlib", root=config.rootpath, consider_namespace_packages=False)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Give slow tests half an hour each, which they need on a machine that is busy."""
    for item in items:
        if item.get_closest_marker("slow") and not item.get_closest_marker("timeout"):
            item.add_marker(pytest.mark.timeout(1800))


class Everywhere:
    """Hooks for the examples of the packages as well, as a plugin: these do not see this folder."""

    @pytest.hookimpl(wrapper=True)
    def pytest_collect_file(self, file_path: Path) -> Generator[None, list[pytest.Collector], list[pytest.Collector]]:
        # A file without a prompt has no examples: it need be neither imported nor searched for them.
        found = yield
        if ">>>" in file_path.read_text(encoding="utf-8", errors="ignore"):
            return found
        return [collector for collector in found if not isinstance(collector, DoctestModule)]

    def pytest_runtest_teardown(self) -> None:
        # No figure is left to the next test.
        if "matplotlib.pyplot" in sys.modules:
            sys.modules["matplotlib.pyplot"].close("all")


@pytest.fixture(autouse=True)
def default_threads() -> Iterator[None]:
    """Leave no choice of threads to the next test."""
    yield
    set_threads(None)


def double_pendulum(alpha: float, beta: float, ratio: float) -> ForcedSystem:
    """Undamped double pendulum of REFERENCES.md: links of length 1, masses 1 and `ratio`, pivot at beta cos t."""

    def rhs(t: float, x: Any, p: Any) -> tuple[float, ...]:
        a, b, u, v = x
        weight = p.alpha - p.beta * cos(t)
        d = a - b
        inertia = 1.0 + p.ratio * sin(d) ** 2
        first = p.ratio * (u * u * sin(2.0 * d) + 2.0 * v * v * sin(d))
        first += weight * ((2.0 + p.ratio) * sin(a) + p.ratio * sin(a - 2.0 * b))
        second = p.ratio * v * v * sin(2.0 * d)
        second += (1.0 + p.ratio) * (2.0 * u * u * sin(d) + weight * (sin(2.0 * a - b) - sin(b)))
        return u, v, -first / (2.0 * inertia), second / (2.0 * inertia)

    coordinates = (angle("theta1"), angle("theta2"), "v1", "v2")
    return ForcedSystem(rhs, {"alpha": alpha, "beta": beta, "ratio": ratio}, 2 * pi, coordinates, "double pendulum")


@pytest.fixture(scope="session")
def problems() -> Mapping[str, ForcedSystem]:
    """Smooth systems by the names that the table of images uses."""
    w = 2.0 * pi * 50.0
    return {
        "pendulum, 3 mm": systems.driven_pendulum(),
        "pendulum, 10 mm": systems.driven_pendulum(amplitude=0.010),
        "vertically driven": systems.dimensionless_pendulum(0.1, -0.545, 0.08),
        "Duffing": systems.two_well_duffing(),
        "forced pendulum": systems.forced_pendulum(),
        "double pendulum": double_pendulum(9.8 / (0.032 * w * w), 6.0 / 32.0, 0.25),
    }


@pytest.fixture(scope="session")
def precise_images() -> list[dict[str, Any]]:
    """Unwrapped images after one period, by mpmath with 25 digits: rows of problem, start and image."""
    rows: list[dict[str, Any]] = json.loads((REFERENCE / "one_period.json").read_text(encoding="utf-8"))
    return rows


@pytest.fixture(scope="session")
def precise_image() -> Callable[[ForcedSystem, ArrayLike], NDArray[np.float64]]:
    """Oracle of 25 digits: mpmath's Taylor integrator on the same right-hand side.  Slow, one orbit at a time."""
    import mpmath

    def image(system: ForcedSystem, ic: ArrayLike) -> NDArray[np.float64]:
        with mpmath.workdps(25):
            rhs = rebind(system.rhs, {"sin": mpmath.sin, "cos": mpmath.cos})
            p = parameter_record(tuple(system.params))(*map(mpmath.mpf, system.params.values()))
            state = [mpmath.mpf(float(v)) for v in np.asarray(ic)]
            solution = mpmath.odefun(lambda t, y: list(rhs(t, tuple(y), p)), mpmath.mpf(0), state)
            return np.array([float(v) for v in solution(mpmath.mpf(system.length))])

    return image


@pytest.fixture(scope="session")
def scipy_images() -> Callable[..., NDArray[np.float64]]:
    """Oracle of about 12 digits: SciPy's DOP853 on the plain right-hand side, all orbits as one system, unwrapped."""

    def images(
        system: ForcedSystem,
        initial_conditions: ArrayLike,
        phase: float = 0.0,
        periods: float = 1.0,
        rtol: float = 1e-13,
        one_by_one: bool = False,  # as with branches, or functions that arrays do not have
    ) -> NDArray[np.float64]:
        begin = phase * system.length
        span = (begin, begin + periods * system.length)
        rhs, states = rebind(system.rhs, ARRAY_FUNCTIONS), np.atleast_2d(np.asarray(initial_conditions, dtype=float))

        def of_all(t: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
            rates = rhs(t, tuple(y.reshape(-1, len(states))), system.parameters)
            return np.concatenate([np.broadcast_to(rate, len(states)) for rate in rates])

        def solved(fun: Callable[..., Any], x: NDArray[np.float64], rtol: float) -> NDArray[np.float64]:
            solution = solve_ivp(fun, span, x, method="DOP853", rtol=rtol, atol=1e-14)
            assert solution.success
            return np.asarray(solution.y[:, -1])

        if one_by_one:
            ends = np.array([solved(system.fun, ic, rtol) for ic in states])
        else:
            # SciPy's error is a mean over all components: at worst all of it is in one orbit.
            ends = solved(of_all, states.T.ravel(), max(rtol / np.sqrt(len(states)), 3e-14)).reshape(-1, len(states)).T
        return ends.reshape(np.shape(initial_conditions))

    return images


@pytest.fixture(scope="session")
def allowance() -> Callable[..., NDArray[np.float64]]:
    """Error that a tolerance allows at images: atol + rtol abs(x), where x of an angle counts half a period at most."""

    def allowed(system: ForcedSystem, images: NDArray[np.float64], rtol: float, atol: float) -> NDArray[np.float64]:
        most = np.array([0.5 * c.period if c.period else inf for c in system.axes])
        return atol + rtol * np.minimum(np.abs(images), most)

    return allowed

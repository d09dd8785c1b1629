"""Work in tiles: on threads and on a cluster, the same bits; maps that travel to other processes."""

import os
import pickle
import signal
import threading
import time
from dataclasses import replace
from functools import partial
from math import cos, pi, sin

import cloudpickle
import numpy as np
import pytest

import systems
from cellmap import (
    CellGrid,
    ForcedSystem,
    PointMap,
    angle,
    discrete_map,
    find_basins,
    interpolated_map,
    stroboscopic_map,
)
from cellmap._lib.checkpoint import Checkpoint
from cellmap._lib.tiles import completed

# What a cluster logs when it begins and when its workers die does not matter to these tests.
pytestmark = [
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
    pytest.mark.filterwarnings("ignore::UserWarning:distributed"),
]

WINDOW = CellGrid((-pi, -300.0), (pi, 300.0), (48, 40))
GRID = CellGrid((-pi, -500.0), (pi, 500.0), (200, 170))  # three tiles


WORKERS = {"threads_per_worker": 1, "dashboard_address": None}


@pytest.fixture(scope="module", autouse=True)
def patient():
    """A cluster gives up workers that are not back some seconds after they died: too few for a busy machine."""
    dask, _ = pytest.importorskip("dask"), pytest.importorskip("distributed")
    with dask.config.set({"distributed.deploy.lost-worker-timeout": "1h"}):
        yield


@pytest.fixture(scope="module")
def client():
    import distributed

    with distributed.LocalCluster(n_workers=2, **WORKERS) as cluster, distributed.Client(cluster) as client:
        yield client


@pytest.fixture(scope="module")
def lonely():
    """A cluster of one worker, for the tests that take it away, and its client."""
    import distributed

    with distributed.LocalCluster(n_workers=1, **WORKERS) as cluster, distributed.Client(cluster) as client:
        yield cluster, client


def pendulum() -> PointMap:
    return stroboscopic_map(systems.driven_pendulum(amplitude=0.010), rtol=1e-6, atol=1e-6)


def lambda_map() -> PointMap:
    """A right-hand side that no module holds, with a value of its surroundings."""
    stiffness = 1.25
    rhs = lambda t, x, p: (x[1], -p.gamma * x[1] - stiffness * sin(x[0]) + 0.1 * cos(t))  # noqa: E731
    return stroboscopic_map(ForcedSystem(rhs, {"gamma": 0.1}, 2 * pi, (angle("theta"), "v"), name="anonymous"))


def newton_map() -> PointMap:
    return discrete_map(lambda x, p: (x[0] / 2 + p.a / (2 * x[0]),), {"a": 1.0}, ("x",), name="newton")


MAPS = {
    "stroboscopic": pendulum,
    "jumps": lambda: stroboscopic_map(systems.stick_slip_oscillator()),
    "lambda": lambda_map,
    "discrete": newton_map,
    "parameters changed": lambda: newton_map().with_params(a=4.0),
    "table": lambda: interpolated_map(pendulum(), WINDOW, outside="escape"),
    "table, multi-period steps": lambda: interpolated_map(pendulum(), WINDOW, 3, "integrate", 0.05, max_step=4),
}


def assert_same(ours, theirs, *names: str) -> None:
    """What it has by some names, to the bit."""
    for name in names:
        one, other = np.asarray(getattr(ours, name)), np.asarray(getattr(theirs, name))
        assert (one.dtype, one.shape, one.tobytes()) == (other.dtype, other.shape, other.tobytes())


def assert_same_basins(ours, theirs) -> None:
    """Labels, times and attractors to the bit, and the work counted alike."""
    assert_same(ours, theirs, "labels", "settling_time", "inaccurate")
    assert ours.cost.steps == theirs.cost.steps
    for one, other in zip(ours.attractors, theirs.attractors, strict=True):
        assert (one.kind, one.period, one.rotations) == (other.kind, other.period, other.rotations)
        assert_same(one, other, "points", "multipliers", "exponents")


# --- maps that travel


@pytest.mark.filterwarnings("ignore:.* of the cells are fallback cells:UserWarning")
@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) if n == "jumps" else n for n in MAPS])
def test_a_map_that_was_pickled_has_the_same_bits(name):
    original = MAPS[name]()
    again = pickle.loads(cloudpickle.dumps(original))
    initial_conditions = np.random.default_rng(0).uniform(0.1, 3.0, (500, original.dimension))
    assert_same(again.iterate(initial_conditions, 5), original.iterate(initial_conditions, 5), "points", "rotations")
    assert (again.recipe, again.params) == (original.recipe, original.params)
    if original.table is not None:
        assert_same(again.table, original.table, "coefficients")


def test_a_map_made_by_hand_says_what_it_lacks():
    changed = replace(newton_map(), advance=lambda orbits, periods: None)
    with pytest.raises(TypeError, match=r"cannot be pickled.*changed by hand; build it from a MapSpec"):
        cloudpickle.dumps(changed)
    with pytest.raises(ValueError, match=r"built without parameter dependence.*build it from a MapSpec"):
        changed.with_params(a=4.0)


# --- the same bits from a cluster


@pytest.mark.parametrize("wrong", [3, "tcp://localhost:8786"])
def test_something_that_is_no_client(wrong):
    find, table = partial(find_basins, newton_map(), [[1.0]]), partial(interpolated_map, pendulum(), WINDOW)
    for call in (find, table, partial(newton_map().iterate, [1.0], 1)):
        with pytest.raises(TypeError, match=r"client=.*: give a distributed\.Client"):
            call(client=wrong)


def test_iterates_and_a_table_from_a_cluster(client):
    initial_conditions = np.random.default_rng(0).uniform([-pi, -500.0], [pi, 500.0], (20_000, 2))
    ours, theirs = (pendulum().iterate(initial_conditions, 2, client=where) for where in (client, None))
    assert_same(ours, theirs, "points", "rotations", "status")
    grid = CellGrid((-pi, -3.0), (pi, 3.0), (150, 150))
    ours, theirs = (interpolated_map(lambda_map(), grid, client=where).table for where in (client, None))
    assert_same(ours, theirs, "coefficients", "indicator", "fallback")


@pytest.mark.parametrize(
    ("name", "initial_conditions"),
    [
        pytest.param("stroboscopic", GRID, marks=pytest.mark.thorough),
        ("table", GRID),
        ("discrete", CellGrid((-3.0,), (3.0,), (40_000,))),
        ("discrete", np.random.default_rng(1).uniform(-3.0, 3.0, (30_000, 1))),
    ],
    ids=["stroboscopic", "table", "discrete", "given initial conditions"],
)
def test_basins_from_a_cluster(client, name, initial_conditions):
    ours, theirs = (find_basins(MAPS[name](), initial_conditions, 400, 8, client=where) for where in (client, None))
    assert_same_basins(ours, theirs)


def test_an_error_of_a_worker_arrives(client):
    def fail(task):
        raise ArithmeticError(f"tile {task}")

    with pytest.raises(ArithmeticError, match=r"tile [012]"):
        list(completed(range(3), int, fail, client))


def test_every_tile_is_delivered_once_and_few_are_under_way(client):
    delivered, begun, most = [], [], []

    def task(number: int) -> int:
        begun.append(number)
        most.append(len(begun) - len(delivered))
        return number

    for number, result in completed(range(200), task, lambda number: number * number, client):
        delivered.append((number, result))
    assert sorted(delivered) == [(k, k * k) for k in range(200)]
    assert sorted(begun) == list(range(200))
    assert max(most) <= 5 * 16  # two groups for each of two threads, and the one that takes the place of another


@pytest.mark.thorough
def test_a_killed_worker_loses_nothing(lonely, tmp_path):
    """The only worker is killed, with the work that it holds and tiles that are half done; another takes its place."""
    marker = tmp_path / "working"

    def slow(number: int) -> int:
        marker.touch()
        time.sleep(0.05)
        return os.getpid()

    _, client = lonely
    victim = next(iter(client.run(os.getpid).values()))

    def kill() -> None:
        while not marker.exists():
            time.sleep(0.01)
        time.sleep(0.3)
        os.kill(victim, signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    delivered = dict(completed(range(60), int, slow, client))
    killer.join()
    assert sorted(delivered) == list(range(60))
    assert {*delivered.values()} - {victim}, "the work went on elsewhere"


@pytest.mark.thorough
def test_a_cluster_without_workers_is_not_waited_for_for_ever(lonely, tmp_path, monkeypatch):
    """It loses all of them in the middle: that is said, the call ends, and another one goes on from the checkpoint."""
    for name, seconds in {"_SELDOM": 0.05, "_WARNED": 0.2, "_GIVEN_UP": 1.0}.items():
        monkeypatch.setattr(f"cellmap._lib.tiles.{name}", seconds)
    path, initial_conditions, done = tmp_path / "basins.h5", CellGrid((-3.0,), (3.0,), (80_000,)), []
    original, (cluster, client) = Checkpoint.finish, lonely
    client.wait_for_workers(1)

    def finish(self, tiles, number, tally, contents):
        original(self, tiles, number, tally, contents)
        if not done:
            cluster.scale(0)
            while client.nthreads():
                time.sleep(0.01)
        done.append(number)

    monkeypatch.setattr(Checkpoint, "finish", finish)
    with (
        pytest.warns(UserWarning, match=r"client=.*: the cluster has had no workers for 0\.2 s"),
        pytest.raises(TimeoutError, match=r"client=.*no workers for 1 s; start some and call again"),
    ):
        find_basins(newton_map(), initial_conditions, client=client, checkpoint=path)
    before = len(done)
    ours, theirs = (find_basins(newton_map(), initial_conditions, checkpoint=where) for where in (path, None))
    assert_same_basins(ours, theirs)
    assert 0 < before < 5
    assert len(done) == 5, "tiles that were done are not done again"


@pytest.mark.thorough
def test_workers_that_die_of_their_work_are_told_with_the_remedy(lonely):
    """As they do where memory is short: the scheduler gives up tiles of which some workers have died."""
    cluster, client = lonely
    cluster.scale(1)  # there may be none from a test before
    client.wait_for_workers(1)

    def allow(number, dask_scheduler):
        dask_scheduler.allowed_failures = number

    client.run_on_scheduler(allow, 0)
    try:
        with pytest.raises(RuntimeError, match=r"client=.*memory is full; give them more .* call again: with a ch"):
            list(completed(range(2), int, lambda number: os.kill(os.getpid(), signal.SIGKILL), client))
    finally:
        client.run_on_scheduler(allow, 3)
    client.wait_for_workers(1)
    with pytest.raises(FileNotFoundError, match="of the work"):
        list(completed(range(2), int, missing, client))


def missing(number):
    raise FileNotFoundError("of the work")


@pytest.mark.thorough
def test_a_scheduler_that_is_lost_is_told_with_the_remedy():
    """In the middle of the work, and by a client that finds none any more."""
    import distributed

    cluster = distributed.LocalCluster(n_workers=1, processes=False, protocol="tcp", **WORKERS)
    client = distributed.Client(cluster, timeout="0.5s")

    def work(number):
        time.sleep(0.02)
        return number

    results = completed(range(200), int, work, client)
    next(results)
    cluster.close()
    for rest in (results, completed(range(2), int, work, client)):
        with pytest.raises(ConnectionError, match=r"client=.*scheduler is lost; start a cluster and a client, and"):
            list(rest)
    client.close(timeout=0.1)

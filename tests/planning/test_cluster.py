import os
import signal
import subprocess
import sys
import time
from functools import partial
from itertools import count, islice

import pytest

from taskcal.errors import FileError, TaskcalError
from taskcal.planning import workers as module
from taskcal.planning.workers import side_by_side
from tests.laws.cluster import cluster, scheduler

NO_TASKCAL = (sys.executable, "-c", "import sys; sys.modules['taskcal'] = None; from dask.__main__ import main; main()")
OTHER = "import taskcal.planning.workers as w; w.version = lambda name: '0.0.1'; from dask.__main__ import main; main()"


@pytest.fixture(scope="module")
def engine(tmp_path_factory):
    # two threads each: of two items neither waits for the other, wherever they go
    with cluster(tmp_path_factory.mktemp("dask"), threads=2) as started:
        yield f"dask:{started.address}"


def test_other_processes_give_every_result(engine):
    assert sorted(side_by_side(partial(pow, 3), range(5), engine, -1)) == [1, 3, 9, 27, 81]
    assert os.getpid() not in set(side_by_side(lambda _: os.getpid(), range(5), engine, -1))


def test_results_come_as_they_are_done(engine, tmp_path):
    gate = tmp_path / "open"

    def wait(item):
        until = time.monotonic() + 30.0
        while item == "last" and not gate.exists():
            assert time.monotonic() < until
            time.sleep(0.01)
        return item

    results = side_by_side(wait, ["last", "first"], engine, -1)
    assert next(results) == "first"
    gate.touch()
    assert list(results) == ["last"]


@pytest.mark.parametrize(("workers", "most"), [(-1, module.ITEMS_PER_THREAD * 4), (3, 3)])
def test_of_items_without_end_only_few_are_under_way(engine, workers, most):
    taken = count()
    results = side_by_side(abs, taken, engine, workers)
    got = list(islice(results, 30))
    results.close()
    assert len(set(got)) == 30
    assert next(taken) <= 30 + most


def test_a_worker_that_dies_loses_nothing(engine, tmp_path):
    def die_once(item):
        died = tmp_path / "died"
        if item == 3 and not died.exists():
            died.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return item, os.getpid()

    results = dict(side_by_side(die_once, range(12), engine, -1))
    assert (tmp_path / "died").exists()
    assert sorted(results) == list(range(12))


@pytest.mark.slow
def test_an_item_that_workers_die_of_is_an_error(engine):
    with pytest.raises(TaskcalError, match=r"2 workers .* died at the same item"):
        list(side_by_side(lambda _: os.kill(os.getpid(), signal.SIGKILL), [0], engine, -1))


def test_an_error_of_the_function_is_the_same_here(engine):
    def refuse(item):
        raise FileError("robots/a.csv", "is empty", line=item)

    with pytest.raises(FileError, match=r"robots/a\.csv:3: is empty") as refused:
        list(side_by_side(refuse, [3], engine, -1))
    assert refused.value.line == 3
    assert "refuse" in {entry.name for entry in refused.traceback}
    with pytest.raises(TimeoutError):
        list(side_by_side(lambda _: (_ for _ in ()).throw(TimeoutError), [0], engine, -1))


def test_a_scheduler_that_is_not_there_is_named(monkeypatch):
    monkeypatch.setattr(module, "SCHEDULER_TIMEOUT_S", 0.5)
    for address in ("nothing://here", "tcp://127.0.0.1:1"):
        with pytest.raises(TaskcalError, match=f"no Dask scheduler answers at '{address}'"):
            list(side_by_side(abs, [1], f"dask:{address}", -1))


@pytest.mark.slow
def test_cluster_names_absent_and_mismatched_workers(monkeypatch, tmp_path):
    """Workers that are absent or run another release are named."""
    monkeypatch.setattr(module, "SCHEDULER_TIMEOUT_S", 0.5)
    with scheduler(tmp_path, python=NO_TASKCAL) as started:
        engine = f"dask:{started.address}"
        with pytest.raises(TaskcalError, match="has no workers; start some with 'dask worker tcp://127"):
            list(side_by_side(abs, [1], engine, -1))
        monkeypatch.setattr(module, "SCHEDULER_TIMEOUT_S", 20.0)
        for python, said in [
            (
                (sys.executable, "-c", OTHER),
                "it has taskcal 0.0.1, numpy .* sources .*, here is taskcal .* numpy .* sources .*install the same on both",
            ),
            (NO_TASKCAL, "a worker cannot take part: .*taskcal.*; install there what is imported here"),
        ]:
            with started.workers(1, "--no-nanny", python=python), pytest.raises(TaskcalError, match=said):
                list(side_by_side(abs, [1], engine, -1))


@pytest.mark.long  # starts a cluster of its own
def test_a_cluster_that_loses_all_its_workers_is_not_waited_for(monkeypatch, tmp_path):
    monkeypatch.setattr(module, "NO_WORKERS_S", 1.0)
    with scheduler(tmp_path) as started, started.workers(1, "--no-nanny") as worker:
        results = side_by_side(time.sleep, [0.0, 60.0], f"dask:{started.address}", 1)
        next(results)
        worker.kill()
        with pytest.raises(TaskcalError, match="has had no workers for 1 s"):
            next(results)


@pytest.mark.long  # starts a cluster of its own
def test_a_scheduler_that_ends_is_an_error(tmp_path):
    with scheduler(tmp_path) as started, started.workers(1, "--no-nanny"):
        results = side_by_side(time.sleep, [0.0, 60.0], f"dask:{started.address}", 1)
        next(results)
        os.kill(started.process, signal.SIGKILL)
        with pytest.raises(TaskcalError, match="no longer answers"):
            next(results)


@pytest.mark.slow
def test_an_interrupt_ends_it_soon(engine):
    code = (
        "import signal, sys, time; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "from taskcal.planning.workers import side_by_side\n"
        "def say(item): time.sleep(item); return item\n"
        f"for item in side_by_side(say, [0.0, 60.0], {engine!r}, 1): print('begun', flush=True)"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as run:
        assert run.stdout is not None
        assert run.stdout.readline() == "begun\n"
        start = time.monotonic()
        run.send_signal(signal.SIGINT)
        _, said = run.communicate(timeout=30)
    assert time.monotonic() - start < 5.0
    assert said.rstrip().endswith("KeyboardInterrupt")

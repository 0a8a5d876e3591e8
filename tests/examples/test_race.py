"""What the guard of the benchmarks lets pass: noise and other work, but no doubling."""

import subprocess
import sys
from contextlib import ExitStack
from types import SimpleNamespace

import pytest

from benchmarks.baseline import GUARDED, Baseline
from benchmarks.race import Race, processor_time


def once() -> int:
    return sum(k * k for k in range(20_000))


def twice() -> int:
    return once() + once()


@pytest.fixture
def race(tmp_path):
    """A race whose baseline says that the call takes as long as its reference."""
    known = {"work / reference": {"ratio": 1.0, "tolerance": GUARDED}}
    unused = SimpleNamespace(disabled=False, extra_info={}, pedantic=lambda *_, **__: None)
    baseline = Baseline(path=tmp_path / "guard.json", known=known, renewed=False)
    return Race(benchmark=unused, baseline=baseline, clock=processor_time)


@pytest.fixture(params=[0, pytest.param(3, marks=pytest.mark.long)])
def _other_work(request):
    """Processes that never rest, more than there may be cores to spare."""
    with ExitStack() as ended:
        for _ in range(request.param):
            busy = ended.enter_context(subprocess.Popen([sys.executable, "-c", "while True: pass"]))
            ended.callback(busy.kill)
        yield


@pytest.mark.usefixtures("_other_work")
def test_a_doubling_fails_and_nothing_else_does(race):
    race("work", once, {"reference": once})
    with pytest.raises(pytest.fail.Exception, match=r"work / reference is .*, more than 1.6 times the 1 of guard.json"):
        race("work", twice, {"reference": once})


def test_processes_that_are_started_count(race):
    def start() -> None:
        subprocess.run([sys.executable, "-S", "-E", "-c", "pass"], check=True)

    def start_twice() -> None:
        start()
        start()

    with pytest.raises(pytest.fail.Exception):
        race("work", start_twice, {"reference": start})

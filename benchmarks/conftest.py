"""Settings and fixtures of the benchmarks: one BLAS thread, the virtual campaign, the race and its baseline."""

import os
from pathlib import Path
from time import perf_counter

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from benchmarks.baseline import GUARDED, TOLERANCE, Baseline
from benchmarks.race import Race, processor_time
from taskcal.campaigns.campaign import Campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate

threadpool_limits(1)  # for the BLAS libraries loaded so far …
for _variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ[_variable] = "1"  # … and for libraries and processes that are yet to start

BASELINE = pytest.StashKey[Baseline]()

MIDDLE_DEG = np.array([0.0, 10.0, 40.0, 10.0, 45.0, 20.0])
"""A posture of the IRB 6660 about which poses are drawn, well inside the limits of its four-bar."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--renew-baseline", action="store_true", help="write the measured ratios into the baseline")
    parser.addoption(
        "--guard", action="store_true", help="race what is marked guard, by processor time, against guard.json"
    )


def pytest_configure(config: pytest.Config) -> None:
    path = Path(__file__).with_name("guard.json" if config.getoption("--guard") else "baseline.json")
    tolerance = GUARDED if config.getoption("--guard") else TOLERANCE
    config.stash[BASELINE] = Baseline.read(path, renewed=config.getoption("--renew-baseline"), tolerance=tolerance)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if config.getoption("--guard"):
        left_out = [item for item in items if not item.get_closest_marker("guard")]
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if item.get_closest_marker("guard")]


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    lines = config.stash[BASELINE].report()
    if lines:
        terminalreporter.section("ratios: time of Taskcal over time of the reference")
        for line in lines:
            terminalreporter.write_line(line)


def pytest_sessionfinish(session: pytest.Session) -> None:
    session.config.stash[BASELINE].write()


@pytest.fixture
def smoke(request: pytest.FixtureRequest) -> bool:
    """Whether everything runs once only, to see that it runs."""
    return bool(request.config.getoption("benchmark_disable"))


@pytest.fixture
def race(request: pytest.FixtureRequest, benchmark) -> Race:
    """Times two or more calls against each other; in a smoke run it calls each of them once."""
    guard = request.config.getoption("--guard")
    clock = processor_time if guard else perf_counter
    return Race(benchmark=benchmark, baseline=request.config.stash[BASELINE], clock=clock, tabled=not guard)


@pytest.fixture(scope="session")
def model() -> ErrorModel:
    """The 45 parameters of the IRB 6660-205/1.9."""
    return ErrorModel(load_robot("abb-irb6660-205-1.9"))


def draw_joints(model: ErrorModel, n: int, rng: np.random.Generator) -> np.ndarray:
    """Joint positions within ±20° of the middle posture, radians: the four-bar's J3 − J2 stays within its 70°."""
    return np.radians(MIDDLE_DEG + rng.uniform(-20.0, 20.0, size=(n, len(MIDDLE_DEG))))


@pytest.fixture(scope="session")
def joints(model: ErrorModel):
    """Draws n joint positions, the same at every run."""
    return lambda n: draw_joints(model, n, np.random.default_rng(0))


@pytest.fixture(scope="session")
def campaign(model: ErrorModel) -> Campaign:
    """Sixty measured points of a virtual robot."""
    rng = np.random.default_rng(1)
    return simulate(model, draw_joints(model, 60, rng), rng=rng)[0]

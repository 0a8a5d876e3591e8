"""Settings and fixtures shared by all tests."""

import os

for _variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ[_variable] = "1"  # for the libraries and processes that are yet to start
os.environ.pop(
    "PYTHONDONTWRITEBYTECODE", None
)  # dozens of processes are started, each of which would compile the package

import atexit
import gc
import shutil
import sys
import tempfile
from collections import defaultdict
from collections.abc import Generator
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from threading import Timer
from typing import Any

import psutil
import pytest
from hypothesis import HealthCheck, settings
from threadpoolctl import threadpool_limits

from tests.checked_calls import begin_test, install_checks

sys.dont_write_bytecode = False  # for what this process is yet to import, and the workers to load

os.environ["TASKCAL_STATE_DIR"] = tempfile.mkdtemp(prefix="taskcal-state-")  # not the user's own
atexit.register(shutil.rmtree, os.environ["TASKCAL_STATE_DIR"], ignore_errors=True)

threadpool_limits(1)  # a pytest plugin may have loaded NumPy, and its BLAS, before this file

# Shapes and types in annotations are checked, but for these modules and all that is in these folders.
_UNCHECKED = {
    "compiled kernels, whose source Numba has to read, and what describes their arguments": "kernels",
    "files that pydantic checks, by annotations that it has to read": """
        correction.cell robot.robot_file io.toml_file
    """,
    "commands, whose annotations Typer has to read": "cli",
    "pages and tables, which get what was checked where it was computed": "report",
    "not arrays: names, texts, messages, options and loads, which refuse wrong ones themselves": """
        __main__ planning.study arguments effects errors performance robot.statics short_repr io.text_file
    """,
}


def _modules(package: str) -> set[str]:
    """Of a package, below it; not the packages, whose names would stand for everything in them."""
    (folder,) = find_spec(package).submodule_search_locations
    files = [path.relative_to(folder).with_suffix("") for path in Path(folder).rglob("*.py") if path.stem != "__init__"]
    return {".".join(file.parts) for file in files}


def _checked() -> list[str]:
    """All other modules of Taskcal."""
    modules = _modules("taskcal")
    unchecked = {name for names in _UNCHECKED.values() for name in names.split()}
    unknown = [name for name in sorted(unchecked) if not any(f"{module}.".startswith(f"{name}.") for module in modules)]
    if unknown:
        raise LookupError(f"no such modules to leave unchecked: {', '.join(unknown)}")
    return [
        f"taskcal.{module}"
        for module in sorted(modules)
        if not any(f"{module}.".startswith(f"{name}.") for name in unchecked)
    ]


_BESIDE = [
    f"{package}.{name}" for package in ("taskcal_devices", "taskcal_studio") for name in sorted(_modules(package))
]
_BELOW = [f"taskcal_groundwork.{name}" for name in ("options", "plugins", "said", "se3")]
install_checks([*_checked(), *_BESIDE, *_BELOW])

# The same examples at every run; compiling a kernel inside an example is slow only once.
settings.register_profile(
    "ci",
    derandomize=True,
    deadline=None,
    max_examples=25,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.register_profile("quick", settings.get_profile("ci"), max_examples=5)
settings.register_profile("thorough", settings.get_profile("ci"), derandomize=False, max_examples=1000)
settings.load_profile("ci")

QUICK_FUNCTIONS_PER_FILE = 1
"""Functions of a file whose first cases `make test-quick` runs, which has to end within a minute on two cores."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark as `quick` the first case of the first functions of every file, but for slow ones and measured robots."""
    chosen: dict[Path, set[str]] = defaultdict(set)
    for item in items:
        if any(item.get_closest_marker(name) for name in ("slow", "long", "realdata")):
            continue
        function = item.nodeid.partition("[")[0]
        if function not in chosen[item.path] and len(chosen[item.path]) < QUICK_FUNCTIONS_PER_FILE:
            chosen[item.path].add(function)
            item.add_marker("quick")


def pytest_collection_finish() -> None:
    """What was imported and collected stays: no later search for garbage needs to walk through it."""
    gc.collect()
    gc.freeze()


DATA = Path(os.environ.get("TASKCAL_DATA") or Path(__file__).parents[1] / "../shared/data").resolve()


def _require_data() -> None:
    if DATA.is_dir():
        return
    reason = f"no measured robots in {DATA}; set TASKCAL_DATA to their folder"
    if os.environ.get("CI", "").lower() in {"true", "1"}:
        pytest.fail(reason, pytrace=False)
    pytest.skip(reason)


def pytest_runtest_setup(item: pytest.Item) -> None:
    begin_test(item.path)
    if item.get_closest_marker("realdata"):
        _require_data()


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """The folder of measured robots; a test that asks for it is marked `realdata`."""
    _require_data()
    return DATA


OPEN_S, CLOSING_S = 900.0, 60.0
"""That a window may be open, and take to close, on a busy machine."""


class Chromium:
    """A browser without a window. One that hangs is killed and begun again: Playwright would wait for it without end."""

    def __init__(self, playwright: Any, program: str) -> None:
        self._playwright, self._program = playwright, program
        self._browser: Any = None

    @contextmanager
    def window(self, **options: Any) -> Generator[Any, None, None]:
        """A window of its own, without the cookies of others; what hangs in it ends with an error of Playwright."""
        if self._browser is None or not self._browser.is_connected():
            arguments = ["--no-sandbox", "--use-gl=swiftshader", "--enable-unsafe-swiftshader"]
            self._browser = self._playwright.chromium.launch(executable_path=self._program, args=arguments)
        context = self._browser.new_context(**{"viewport": {"width": 1440, "height": 900}, **options})
        try:
            with killed_after(OPEN_S):
                yield context
        finally:
            _close(context)

    def close(self) -> None:
        """End it."""
        if self._browser is not None:
            _close(self._browser)


def _close(opened: Any) -> None:
    """Close a window or a browser; one that is gone is closed."""
    from playwright.sync_api import Error

    with killed_after(CLOSING_S), suppress(Error):
        opened.close()


@contextmanager
def killed_after(seconds: float) -> Generator[None, None, None]:
    """Kill the browsers of this process if what is done with them takes longer; what waited for them goes on."""
    timer = Timer(seconds, _kill_browsers)
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _kill_browsers() -> None:
    for process in psutil.Process().children(recursive=True):
        with suppress(psutil.Error):
            if process.name().startswith(("chrom", "headless")):
                process.kill()


@pytest.fixture(scope="session")
def chromium() -> Generator[Chromium, None, None]:
    """One browser for the tests of all folders, since Playwright has one in a process."""
    from playwright.sync_api import sync_playwright

    program = os.environ.get("TASKCAL_CHROMIUM") or shutil.which("chromium")
    if program is None:
        if os.environ.get("CI") == "true":
            pytest.fail("no chromium is installed; pages have not been looked at")
        pytest.skip("no chromium is installed")
    with sync_playwright() as playwright:
        browser = Chromium(playwright, program)
        yield browser
        browser.close()

"""``taskcal doctor``: whether everything that Taskcal needs is there."""

import os
import platform
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib import import_module
from importlib.metadata import version

import typer

from taskcal.cli.options import JsonOption
from taskcal.cli.output import show_table, write_json


@dataclass(frozen=True)
class Check:
    """One thing that was looked at."""

    name: str
    ok: bool
    found: str


def command(as_json: JsonOption = False) -> None:
    """Check the installation: versions, compiled kernels, threads, the robot catalogue."""
    checks = [_check(name, look) for name, look in _LOOKS.items()]
    healthy = all(check.ok for check in checks)
    if as_json:
        write_json({"ok": healthy, "checks": [asdict(check) for check in checks]})
    else:
        rows = [(check.name, "ok" if check.ok else "BROKEN", check.found) for check in checks]
        show_table("", ("", "", "found"), rows, left=range(3))
    if not healthy:
        raise typer.Exit(1)


def _check(name: str, look: Callable[[], str]) -> Check:
    try:
        return Check(name, True, look())
    except Exception as error:  # whatever is broken, the others are still to be looked at
        return Check(name, False, f"{type(error).__name__}: {error}")


def _python() -> str:
    return f"{platform.python_version()} on {platform.system()} {platform.machine()}"


def _package(name: str) -> Callable[[], str]:
    def look() -> str:
        import_module(name)
        return version(name)

    return look


def _kernels() -> str:
    from taskcal.geometry.compiled import cache_folder, is_warm

    return f"{cache_folder()} ({'warm' if is_warm() else 'not compiled yet: taskcal warm'})"


def _threads() -> str:
    variables = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
    return ", ".join(f"{name.removesuffix('_NUM_THREADS')} {os.environ.get(name, 'not set')}" for name in variables)


def _catalogue() -> str:
    from taskcal.robot.catalogue import catalogue_names, load_robot
    from taskcal.robot.error_model import ErrorModel

    names = catalogue_names()
    if not names:
        raise RuntimeError("no robot file is installed with the package; install Taskcal again")
    sizes = [f"{name} ({len(ErrorModel(load_robot(name)))})" for name in names]
    return f"{len(names)} robots, with their parameters: {', '.join(sizes)}"


_LOOKS: dict[str, Callable[[], str]] = {
    "Python": _python,
    **{name: _package(name) for name in ("taskcal", "numpy", "scipy", "numba", "pandas", "pydantic")},
    "kernels": _kernels,
    "BLAS threads": _threads,
    "catalogue": _catalogue,
}

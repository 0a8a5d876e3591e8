"""Public names: each stands once, in the stub beside its package's ``__init__``, and is loaded when it is first used."""

import ast
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any
from warnings import warn

RENAMED = {
    "taskcal": {
        "Backlash": "taskcal.effects.Backlash",
        "Cauchy": "taskcal.estimation.Cauchy",
        "Coupling": "taskcal.effects.Coupling",
        "EncoderGain": "taskcal.effects.EncoderGain",
        "Explanation": "taskcal.identification.Explanation",
        "Harmonics": "taskcal.effects.Harmonics",
        "Load": "taskcal.effects.Load",
        "MotorHarmonics": "taskcal.effects.MotorHarmonics",
        "Overshoot": "taskcal.effects.Overshoot",
        "PathPerformance": "taskcal.performance.PathPerformance",
        "PosePerformance": "taskcal.performance.PosePerformance",
        "Registration": "taskcal.registration.Registration",
        "Settling": "taskcal.effects.Settling",
        "Spring": "taskcal.effects.Spring",
        "Squared": "taskcal.estimation.Squared",
        "Thermal": "taskcal.effects.Thermal",
        "WarmUp": "taskcal.effects.WarmUp",
        "assess_distance": "taskcal.performance.assess_distance",
        "assess_path": "taskcal.performance.assess_path",
        "assess_pose": "taskcal.performance.assess_pose",
        "follow_nests": "taskcal.campaigns.compensate_drift",
        "pose_repeatability": "taskcal.performance.pose_repeatability",
        "read_path_cycles": "taskcal.performance.read_path_cycles",
        "read_pose_cycles": "taskcal.performance.read_pose_cycles",
        "reference_task": "taskcal.demo.reference_task",
        "register_from_circles": "taskcal.registration.register_from_circles",
        "solve_calibrated": "taskcal.correction.solve_calibrated",
        "solve_near": "taskcal.kinematics.solve_near",
    },
    "taskcal.analysis": {"NearDependence": "taskcal.analysis.Collinearity"},
    "taskcal.effects": {"Overrun": "taskcal.effects.Overshoot"},
    "taskcal.identification": {
        "Remainder": "taskcal.identification.ResidualAnalysis",
        "examine_remainder": "taskcal.identification.analyse_residuals",
    },
    "taskcal.measurement": {"follow_nests": "taskcal.campaigns.compensate_drift"},
}
"""Of each package: former names, which still work for one release, and what they are called now."""


class FormerName:
    """What an attribute was called before: it still works for one release, with a warning that says what it is called now."""

    def __init__(self, now: str):
        self._now = now

    def __set_name__(self, owner: type, name: str) -> None:
        self._before = f"{owner.__name__}.{name}"

    def __get__(self, instance: object, owner: type) -> Any:
        if instance is None:
            return self
        warn(
            f"{self._before} is called {self._now} now; the old name goes with the next release",
            DeprecationWarning,
            stacklevel=2,
        )
        return getattr(instance, self._now)


def names_in_stub(package: str, file: str) -> dict[str, str]:
    """Names that a package's stub re-exports, and the module that each comes from; its own name for one of its modules.

    Args:
        package: its name.
        file: its ``__init__.py``; the stub stands beside it.
    """
    stub = ast.parse(Path(file).with_suffix(".pyi").read_text(encoding="utf-8"))
    imports = [statement for statement in stub.body if isinstance(statement, ast.ImportFrom)]
    return {alias.name: statement.module or package for statement in imports for alias in statement.names}


def load_lazily(package: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """``__getattr__``, ``__dir__`` and ``__all__`` (PEP 562) of a package whose names stand in its stub.

    Args:
        package: its name.
        file: its ``__init__.py``.
    """
    home = names_in_stub(package, file)
    renamed = RENAMED.get(package, {})

    def load(name: str) -> Any:
        if name in renamed:
            return _load_renamed(package, name, stacklevel=3)
        if name == "__version__" and "." not in package:
            from importlib.metadata import version

            return version(package)
        if name not in home:
            raise AttributeError(f"module '{package}' has no attribute '{name}'")
        if home[name] == package:
            return import_module(f"{package}.{name}")
        return getattr(import_module(home[name]), name)

    return load, lambda: sorted(home), sorted(name for name, module in home.items() if module != package)


def load_renamed(module: str) -> Callable[[str], Any]:
    """``__getattr__`` (PEP 562) of a module for the former names of what it has.

    Args:
        module: its name.
    """

    def load(name: str) -> Any:
        if name not in RENAMED.get(module, {}):
            raise AttributeError(f"module '{module}' has no attribute '{name}'")
        return _load_renamed(module, name, stacklevel=3)

    return load


def _load_renamed(package: str, name: str, *, stacklevel: int) -> Any:
    """What a former name stands for, with a warning that names the present one."""
    present = RENAMED[package][name]
    warn(
        f"{package}.{name} is called {present} now; the old name goes with the next release",
        DeprecationWarning,
        stacklevel=stacklevel,
    )
    module, _, attribute = present.rpartition(".")
    return getattr(import_module(module), attribute)

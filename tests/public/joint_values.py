"""Public functions and methods that take joint values, in a process of its own: prints, as JSON, what reads a table by its places.

The tests' own checks of types would come first; so this module is run, and imports nothing of theirs.
"""

import inspect
import json
from collections.abc import Callable, Iterator
from functools import partial
from types import ModuleType, UnionType
from typing import Any, ForwardRef, Union, get_args, get_origin

import numpy as np
import pandas as pd

import taskcal as tc

JOINTS = [f"J{k}" for k in range(1, 7)]
EXPRESSIONS = {"ErrorModel.coordinates"}
"""Their joint values are no numbers, but what is written as code."""

RESULTS = {
    "Calibration", "Comparison", "ControllerOffsets", "Correction", "Deviations", "JointMotion", "MeasuredRange",
    "ModelComparison", "Plan", "Reached", "Shots", "Spun", "TaskPoses", "ToolJoints",
}  # fmt: skip
"""Classes that functions make of arrays, and users do not."""


def public() -> Iterator[tuple[str, Callable[..., Any]]]:
    """Every public function, class and method that a namespace offers, with its name."""
    spaces = [getattr(tc, name) for name in dir(tc) if isinstance(getattr(tc, name), ModuleType)]
    found = {id(one): one for space in (tc, *spaces) for name in dir(space) if callable(one := getattr(space, name))}
    for one in found.values():
        yield one.__name__, one
        for name in dir(one) if inspect.isclass(one) else ():
            if not name.startswith("_") and callable(member := getattr(one, name)):
                yield f"{one.__name__}.{name}", member


def takes_joints(parameter: inspect.Parameter) -> bool:
    """Whether a parameter is joint values: by its name, or by its annotation of an array whose last dimension is ``joints``."""
    kind = parameter.annotation
    while get_origin(kind) not in (None, Union, UnionType):
        kind = get_args(kind)[0]
    choices = get_args(kind) or (kind,)
    texts = [str(one) if isinstance(one, str | ForwardRef) else getattr(one, "dim_str", "") for one in choices]
    return parameter.name == "q" or any(
        text.split("'")[0 if "'" not in text else 1].endswith(" joints") for text in texts
    )


def ended(call: Callable[[], Any]) -> str:
    """What a call came to: ``refused`` where it names the columns, else the error or the kind of result."""
    try:
        return f"result: {type(call()).__name__}"
    except tc.TaskcalError as error:
        return "refused" if ", ".join(reversed(JOINTS)) in str(error) else f"{type(error).__name__}: {error}"
    except Exception as error:
        return f"{type(error).__name__}: {error}"


def main() -> None:
    """Print of every parameter that takes joint values what a table with exchanged columns came to, the others not being given."""
    table = np.linspace(0.1, 0.6, 12).reshape(2, 6)
    frame = pd.DataFrame(table, columns=JOINTS)[JOINTS[::-1]]
    model = tc.ErrorModel(tc.load_robot("abb-irb120"))
    task = tc.Task(name="two poses", poses=model.poses(table))
    first = {"model": model, "task": task, "q": table, "rng": np.random.default_rng(0)}  # before options by their names
    found: dict[str, str] = {}
    for name, target in public():
        try:
            parameters = inspect.signature(target).parameters
        except ValueError:
            continue
        more = {key: first[key] for key in parameters if key in first} if name in ("plan", "simulate") else {}
        for parameter in parameters.values():
            if takes_joints(parameter) and name not in EXPRESSIONS | RESULTS:
                found[f"{name}({parameter.name})"] = ended(partial(target, **{**more, parameter.name: frame}))
    print(json.dumps(found))


if __name__ == "__main__":
    main()

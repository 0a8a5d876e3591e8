"""The file of a virtual robot's truth: defects, tracker frame and targets; written and read back."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.cli.output import plain
from taskcal.errors import FileError
from taskcal.measurement.virtual_cell import Truth
from taskcal.robot.error_model import ErrorModel
from taskcal.text_file import read_text


@dataclass(frozen=True, eq=False, kw_only=True)
class KnownTruth:
    """What a virtual robot is measured from."""

    x: Float[np.ndarray, " p"]
    """Defects in the model's order, metres and radians."""
    T_tracker_base: Float[np.ndarray, "4 4"]
    targets: dict[str, Float[np.ndarray, " 3"]]
    """Centres in the tool frame, metres."""


def truth_text(truth: Truth, targets: tuple[str, ...]) -> str:
    """The file of what a campaign was made from."""
    content = {
        "robot": truth.model.robot.name,
        "units": "metres and radians",
        "x": dict(zip(truth.model.names, truth.x.tolist(), strict=True)),
        "T_tracker_base": truth.T_tracker_base,
        "targets": dict(zip(targets, truth.T_tool_target, strict=True)),
        "unknowns": dict(truth.unknowns),
    }
    return json.dumps(plain(content), indent=1, allow_nan=False) + "\n"


def read_truth(path: Path, model: ErrorModel) -> KnownTruth:
    """Read what `truth_text` gives.

    Raises:
        FileError: it is missing, no truth, or that of another robot.
    """
    try:
        data: Any = json.loads(read_text(path, otherwise="is not JSON; write one with taskcal simulate --truth"))
    except (ValueError, RecursionError) as error:
        raise FileError(path, f"is not JSON: {error}; write one with taskcal simulate --truth") from error
    try:
        robot, defects = str(data["robot"]), {str(name): float(value) for name, value in data["x"].items()}
        base = np.asarray(data["T_tracker_base"], dtype=float)
        targets = {str(name): np.asarray(T, dtype=float)[:3, 3] for name, T in data["targets"].items()}
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        message = f"holds no truth of a virtual robot ({type(error).__name__}: {error}); write one with taskcal simulate --truth"
        raise FileError(path, message) from error
    if robot != model.robot.name:
        raise FileError(path, f"is the truth of {robot}, not of {model.robot.name}; name that robot")
    odd = sorted(set(defects) ^ set(model.names))
    if odd:
        raise FileError(path, f"and the model of {robot} differ in parameter '{odd[0]}'; write the truth again")
    values = np.array([*defects.values(), *base.ravel(), *(c for p in targets.values() for c in p)])
    if base.shape != (4, 4) or not targets or not np.all(np.isfinite(values)):
        raise FileError(path, "holds no whole truth: a frame, a target or a number is wrong; write the truth again")
    return KnownTruth(x=np.array([defects[name] for name in model.names]), T_tracker_base=base, targets=targets)

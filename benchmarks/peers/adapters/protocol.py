"""How an adapter is run: in the peer's own environment, on one case, with NumPy and the peer alone.

It prints one line of JSON, in seconds of processor time of all its threads, which other work disturbs less than the clock:
``first_s`` of the first calibration of the process, ``warm_s`` of the best of those that follow, both from arrays (or files,
where the peer reads nothing else) to a calibrated model; ``kernel_s`` is the optimiser alone, on average.
"""

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

MOST_TURNS = 20


@dataclass(frozen=True, kw_only=True)
class Case:
    """What `benchmarks.peers.cases.Case.write` has written; metres and radians."""

    folder: Path
    arrays: dict

    def __getattr__(self, name):
        return self.arrays[name]

    @classmethod
    def read(cls, folder: Path) -> "Case":
        with np.load(folder / "case.npz") as arrays:
            return cls(folder=folder, arrays={name: arrays[name] for name in arrays.files})


@dataclass(frozen=True, kw_only=True)
class Fitted:
    """A calibrated model."""

    predict: Callable
    """Held-out rows of a case to points in the tracker frame, (m, 3), metres."""
    parameters: int
    """Unknowns, frames included."""
    kernel_s: float


def start_frames(case, given: bool):
    """Pose of the base in the tracker frame and the reflector in the tool frame: registered, or neither known."""
    return (case.start_base, case.start_target) if given else (np.eye(4), np.zeros(3))


def main(calibrate: Callable) -> None:
    """Time ``calibrate(case, given)``, which returns `Fitted`, and print what came out."""
    imported = time.process_time()
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("--start", choices=("raw", "given"), default="raw")
    parser.add_argument("--seconds", type=float, default=10.0, help="for the repetitions")
    options = parser.parse_args()
    case = Case.read(options.folder)
    given = options.start == "given"
    begin = time.process_time()
    fitted = calibrate(case, given)
    first = time.process_time() - begin
    errors = np.linalg.norm(fitted.predict(case) - case.points_held, axis=1)
    turns = list(repeated(lambda: calibrate(case, given), first, options.seconds))
    warm = min((whole for whole, _ in turns), default=first)
    kernel = float(
        np.mean([alone for _, alone in turns] or [fitted.kernel_s])
    )  # short: the processor's clock has its steps
    result = {
        "import_s": imported,
        "first_s": first,
        "warm_s": warm,
        "kernel_s": kernel,
        "turns": len(turns),
        "parameters": fitted.parameters,
        "held_out_mm": float(errors.mean() * 1e3) if np.isfinite(errors).all() else None,
    }
    print(json.dumps(result))


def repeated(call: Callable, first: float, seconds: float):
    """Times of a call and of its kernel, as often as some seconds hold."""
    spent, last, turns = 0.0, first, 0
    while spent + last < seconds and turns < MOST_TURNS:
        begin = time.process_time()
        fitted = call()
        last = time.process_time() - begin
        spent, turns = spent + last, turns + 1
        yield last, fitted.kernel_s

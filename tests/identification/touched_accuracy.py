"""How accurate virtual robots become that touch planes or cubes: ``python -m tests.identification.touched_accuracy [ROBOTS]``.

The table of ``docs/how-to/calibrate-by-touching.md``: robots like an IRB 120 drawn from the tolerances, touches of 0.02 mm, and
the error in space at other postures before the robot, as far as another base and another TCP leave it; and as far as
another size of the robot leaves it besides.
"""

import sys

import numpy as np

from taskcal.identification.identify import identify
from taskcal.planning.study import aligned_errors
from taskcal.virtual.cell import simulate
from tests.reading.virtual_task import MODEL, postures

CASES = (
    ("60 of three planes", "plane", 60, 3),
    ("120 of six planes", "plane", 120, 6),
    ("60 of one cube of 100 mm", "cube", 60, 1),
    ("120 of one cube", "cube", 120, 1),
    ("120 of three cubes", "cube", 120, 3),
)
UNSEEN = 60


def but_for_size(tool: np.ndarray, error: np.ndarray, true: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """What is left of aligned errors where the robot may be larger or smaller as well."""
    grown = tool.copy()
    grown[:, :3, 3] *= 1.001
    direction = error - aligned_errors(grown, true, weights)  # of a thousandth, but for frame and TCP
    return error - direction * (np.vdot(direction, error) / np.vdot(direction, direction))


def errors(way: str, touches: int, places: int, seed: int) -> tuple[float, float]:
    """Mean error of one robot in space, millimetres; and but for its size."""
    rng = np.random.default_rng(seed)
    campaign, truth = simulate(MODEL, postures(touches, seed), rng=rng, observe=way, places=places)
    calibration = identify(MODEL, campaign)
    q, weights = postures(UNSEEN, 100_000 + seed), np.full(UNSEEN, 1.0 / UNSEEN)
    tool, true = calibration.tool_in_base(q), truth.model.poses(q, truth.x)[:, :3, 3]
    error = aligned_errors(tool, true, weights)
    return tuple(
        1e3 * float(np.linalg.norm(e, axis=1).mean()) for e in (error, but_for_size(tool, error, true, weights))
    )


def main(robots: int) -> None:
    print(f"{robots} robots each, mean of the error in space, mm")
    for name, way, touches, places in CASES:
        found = np.array([errors(way, touches, places, seed) for seed in range(robots)])
        doubt = found.std(axis=0) / np.sqrt(robots)
        means = "   ".join(f"{m:.3f} ± {d:.3f}" for m, d in zip(found.mean(axis=0), doubt, strict=True))
        print(f"{name:28} {means}", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 30)

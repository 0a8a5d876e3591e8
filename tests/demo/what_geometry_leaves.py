"""The published experiment on virtual robots that weigh and bend: ``python -m tests.demo.what_geometry_leaves [ROBOTS]``.

An experiment of some minutes, not a test. A line for each truth and fit, medians over the robots in mm: the largest residual per
axis and in space with its range, mean and largest error at new poses, and the share of their components inside the stated 95 %.
"""

import sys
from functools import partial

import numpy as np

from taskcal.analysis import published_kept
from taskcal.demo import GEARS, RIPPLE, elastic_model, reference_task, try_models
from taskcal.demo.model_trial import Fit
from taskcal.effects import PERIODIC, SOFT
from taskcal.identification.calibration import Calibration
from taskcal.identification.effect_selection import explain
from taskcal.identification.identify import identify
from taskcal.measurement.campaign import Campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import reach_task

ROBOT = load_robot("abb-irb6660-205-1.9")
GEOMETRY = ErrorModel(ROBOT)
SOFT_DRIVES, STIFF_DRIVES = 1e6, 4e6
"""Nm/rad, half and twice what is assumed."""


def expected_gears(campaign: Campaign) -> Calibration:
    """Geometry, eccentric gears as their class expects them, and of the rest what the data prove."""
    return explain(GEOMETRY + GEARS, campaign, candidates=(SOFT, PERIODIC), folds=3).calibration


def all_effects(campaign: Campaign) -> Calibration:
    """What `--effects auto` finds."""
    return explain(GEOMETRY, campaign).calibration


PUBLISHED = partial(identify, GEOMETRY, keep=published_kept(GEOMETRY))
ALL = partial(identify, GEOMETRY)

LINES: tuple[tuple[str, ErrorModel, Fit], ...] = (
    ("33", elastic_model(ROBOT) + RIPPLE, PUBLISHED),
    ("45", elastic_model(ROBOT) + RIPPLE, ALL),
    ("45, gears expected", elastic_model(ROBOT) + RIPPLE, expected_gears),
    ("45, all effects", elastic_model(ROBOT) + RIPPLE, all_effects),
    ("33, half as stiff", elastic_model(ROBOT, SOFT_DRIVES) + RIPPLE, PUBLISHED),
    ("33, twice as stiff", elastic_model(ROBOT, STIFF_DRIVES) + RIPPLE, PUBLISHED),
    ("33, no ripple", elastic_model(ROBOT), PUBLISHED),
    ("33, geometry alone", GEOMETRY, PUBLISHED),
)


def measure(name: str, truth: ErrorModel, fit: Fit, robots: int) -> str:
    """A line of the table."""
    task = reference_task()
    measured, new = reach_task(GEOMETRY, task, 60).q, reach_task(GEOMETRY, task, 200, seed=1).q
    trials = [
        try_models(truth, {name: fit}, measured, new, rng=np.random.default_rng(seed))[0] for seed in range(robots)
    ]
    axes = " ".join(f"{1e3 * size:.3f}" for size in np.median([trial.residual.per_axis for trial in trials], axis=0))
    space = 1e3 * np.array([trial.residual.maximum for trial in trials])
    mean, most = (1e3 * float(np.median([getattr(t.new, size) for t in trials])) for size in ("mean", "maximum"))
    inside = np.mean([trial.inside for trial in trials])
    return f"{name:20} {axes}  {np.median(space):.3f} ({space.min():.3f} to {space.max():.3f})  {mean:.3f} {most:.3f} {inside:.0%}"


def main(robots: int) -> None:
    """Print a line for each case."""
    for line in LINES:
        print(measure(*line, robots), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20)

"""The published experiment on virtual robots that weigh and bend: ``python -m tests.taskcal_demo.what_geometry_leaves [ROBOTS]``.

An experiment of some minutes, not a test. A line for each truth and fit, medians over the robots in mm: the largest residual per
axis and in space with its range, mean and largest error at new poses, and the share of their components inside the stated 95 %.
Then which effects are found on how many robots, and what becomes of the published parameters where no prior holds them.
"""

import sys
from collections import Counter
from contextlib import suppress
from functools import cache, partial

import numpy as np

from taskcal.analysis import published_kept
from taskcal.campaigns.campaign import Campaign
from taskcal.demo import GEARS, RIPPLE, elastic_model, reference_task, try_models
from taskcal.effects import PERIODIC, SOFT
from taskcal.errors import FitError
from taskcal.identification.calibration import Calibration
from taskcal.identification.effects import explain
from taskcal.identification.identify import identify
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import reach_task
from taskcal_demo.procedure import Fit

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
    trials = [try_models(truth, {name: fit}, *_poses(), rng=np.random.default_rng(seed))[0] for seed in range(robots)]
    axes = " ".join(f"{1e3 * size:.3f}" for size in np.median([trial.residual.per_axis for trial in trials], axis=0))
    space = 1e3 * np.array([trial.residual.maximum for trial in trials])
    mean, most = (1e3 * float(np.median([getattr(t.new, size) for t in trials])) for size in ("mean", "maximum"))
    inside = np.mean([trial.inside for trial in trials])
    return f"{name:20} {axes}  {np.median(space):.3f} ({space.min():.3f} to {space.max():.3f})  {mean:.3f} {most:.3f} {inside:.0%}"


def count_found(robots: int) -> str:
    """What is found where gears are expected, and how much more it leaves at new poses than a fit that is told everything."""
    truth = elastic_model(ROBOT) + RIPPLE
    fits: dict[str, Fit] = {"found": expected_gears, "told": partial(identify, truth)}
    pairs = [try_models(truth, fits, *_poses(), rng=np.random.default_rng(seed)) for seed in range(robots)]
    names = Counter(effect.name for found, _ in pairs for effect in found.calibration.model.effects)
    ratio = np.median([found.new.mean / told.new.mean for found, told in pairs])
    return f"found on {dict(names)} robots; {ratio:.2f} times the mean error of a fit that is told everything"


def count_without_prior(truth: ErrorModel, robots: int) -> str:
    """How many fits of the published parameters, only damped, do not end, and how far the others run off."""
    fit, largest = partial(PUBLISHED, prior=None), list[float]()
    for seed in range(robots):
        with suppress(FitError):
            (trial,) = try_models(truth, {"damped": fit}, *_poses(), rng=np.random.default_rng(seed))
            largest.append(1e3 * float(np.abs(trial.calibration.estimate).max()))
    sizes = f"{np.median(largest):.1f}, at most {max(largest):.1f} mm or mrad"
    return f"{robots - len(largest)} fits do not end; largest estimate {sizes}"


@cache
def _poses() -> tuple[np.ndarray, np.ndarray]:
    """Those measured and the new ones, radians."""
    return reach_task(GEOMETRY, reference_task(), 60).q, reach_task(GEOMETRY, reference_task(), 200, seed=1).q


def main(robots: int) -> None:
    """Print a line for each case."""
    for line in LINES:
        print(measure(*line, robots), flush=True)
    print(f"45, gears expected: {count_found(robots)}")
    for name, truth in (("elastic", elastic_model(ROBOT) + RIPPLE), ("geometry alone", GEOMETRY)):
        print(f"33, no prior, {name}: {count_without_prior(truth, robots)}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20)

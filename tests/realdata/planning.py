"""What planning is worth on measured robots: ``python -m tests.realdata.planning [ROBOT …] [--splits N]``.

An experiment of many minutes, not a test. Of each robot's rows a random part is the pool that a plan chooses from, and the others,
held out, are the task and the judges. Rows are chosen at random, planned for the geometry, planned for the model that
`identify --effects auto` fits (all effects, of their expected sizes), and planned in stages: the second stage and those after it
lower the uncertainty of the calibration from the rows before. Prints for each choice the mean error in space of the held-out rows,
mm, by geometry alone and by all effects: mean of the splits; for the planned ones also how it compares with random rows of the same
splits, and how many splits were better.
"""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product

import numpy as np

from taskcal.campaigns.campaign import Campaign
from taskcal.estimation.experiment_design import choose
from taskcal.identification.effects import competing_effects, explain
from taskcal.identification.identify import identify
from taskcal.identification.options import EffectSearch
from taskcal.observations.instrument import Measurable
from taskcal.observations.point import Tracker
from taskcal.planning.expected_error import PlanPrior, assumed_hyperparameters
from taskcal.planning.experiment import calibrated_experiments, make_experiment
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import TaskPoses
from tests.conftest import DATA
from tests.realdata.held_out import lengths
from tests.realdata.test_effects import campaign_of, model_of

ROBOTS = {"ur5": 300, "abb-irb120": 300, "ur10": 300, "barrett-wam": 120}
"""Rows of the pool that plans choose from; the others are held out."""

COUNTS = (25, 40, 60)
MANY = 100
"""Random rows with which 60 planned ones are compared."""

GOAL_ROWS = 200
"""Held-out rows, at most, that stand for the task."""

DRAWS = 2
"""Random choices of each split, of which the mean counts."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Split:
    """Rows to choose from, and those held out."""

    model: ErrorModel
    pool: Campaign
    unseen: Campaign

    @classmethod
    def of(cls, robot: str, seed: int) -> "Split":
        """A split of a robot's rows; of those of 6D poses the positions alone, which is what plans are for."""
        campaign = replace(campaign_of(DATA, robot), rotations=None)
        order = np.random.default_rng(seed).permutation(len(campaign))
        pool, unseen = (campaign.take(np.sort(part)) for part in np.split(order, [ROBOTS[robot]]))
        return cls(model=model_of(robot, ()), pool=pool, unseen=unseen)

    @property
    def goal(self) -> TaskPoses:
        """The held-out rows as a task."""
        q = self.unseen.q[np.unique(np.linspace(0, len(self.unseen) - 1, GOAL_ROWS).astype(int))]
        return TaskPoses(
            T=self.model.poses(q), q=q, weights=np.full(len(q), 1.0 / len(q)), unreachable=np.zeros(len(q), dtype=bool)
        )

    def measurable(self, rows: np.ndarray) -> Measurable:
        """Some rows of the pool as candidates."""
        return Measurable(q=self.pool.q[rows], rows=rows, visible=np.ones((len(rows), 1), dtype=bool), lost={})

    def errors(self, rows: np.ndarray) -> np.ndarray:
        """Mean error of the held-out rows by geometry alone and by all effects, mm, after these rows."""
        fitted = self.pool.take(np.sort(rows))
        fits = identify(self.model, fitted), explain(self.model, fitted).calibration
        return np.array([lengths(one, self.unseen).mean() for one in fits])


Plan = Callable[[Split, int], np.ndarray]
"""So many rows of a split's pool."""


def for_geometry(split: Split, count: int) -> np.ndarray:
    """As `taskcal plan` chooses them by default: what geometry does not explain is a smooth field."""
    return _chosen(split, count, split.model)


def for_effects(split: Split, count: int) -> np.ndarray:
    """For geometry and all effects, each parameter as large as its tolerance."""
    competing, _ = competing_effects(split.model, split.pool, EffectSearch())
    return _chosen(split, count, sum(competing, start=split.model))


def _chosen(split: Split, count: int, model: ErrorModel) -> np.ndarray:
    every = split.measurable(np.arange(len(split.pool)))
    prior = PlanPrior(hyper=assumed_hyperparameters(model))
    weighing = make_experiment(model, split.goal, every, prior, Tracker(station=None), smooth=True)
    return choose(weighing.candidates(every), count).chosen


@cache
def in_stages(split: Split, count: int) -> np.ndarray:
    """The first stage for the geometry, the others on the calibration of the rows before."""
    before = [c for c in COUNTS if c < count]
    if not before:
        return for_geometry(split, count)
    known = in_stages(split, before[-1])
    calibration = explain(split.model, split.pool.take(known)).calibration
    left = split.measurable(np.setdiff1d(np.arange(len(split.pool)), known))
    _, weighing = calibrated_experiments(calibration, split.goal, left, Tracker(station=None), None)
    more = choose(weighing.candidates(left), count - len(known)).chosen
    return np.concatenate([known, left.rows[more]])


def at_random(split: Split, count: int, draw: int) -> np.ndarray:
    """Any rows, the same for every number of them."""
    return np.random.default_rng(draw).permutation(len(split.pool))[:count]


PLANS: dict[str, Plan] = {"for geometry": for_geometry, "for effects": for_effects, "in stages": in_stages}


def compared(robot: str, splits: int, counts: Sequence[int] = COUNTS) -> dict[tuple[str, int], np.ndarray]:
    """Errors of each choice and number of rows (splits, 2), by geometry alone and by all effects, mm."""
    found: dict[tuple[str, int], list[np.ndarray]] = {}
    for seed in range(splits):
        split = Split.of(robot, seed)
        for count in (*counts, MANY):
            draws = [split.errors(at_random(split, count, draw)) for draw in range(DRAWS)]
            found.setdefault(("random", count), []).append(np.mean(draws, axis=0))
        for count, (name, plan) in product(counts, PLANS.items()):
            found.setdefault((name, count), []).append(split.errors(plan(split, count)))
    return {key: np.array(errors) for key, errors in found.items()}


def main() -> None:
    """Print a table for each robot."""
    asked = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    asked.add_argument("robots", nargs="*", metavar="ROBOT", help=f"of {', '.join(ROBOTS)}; all by default")
    asked.add_argument("--splits", type=int, default=3)
    chosen = asked.parse_args()
    for robot in chosen.robots or ROBOTS:
        found = compared(robot, chosen.splits)
        print(f"{robot}, {chosen.splits} splits: mm by geometry, by all effects (of random, splits better)")
        for (name, count), errors in found.items():
            random = found["random", count]
            share, better = errors[:, 1].mean() / random[:, 1].mean(), int((errors[:, 1] < random[:, 1]).sum())
            words = "" if name == "random" else f"  ({share:.2f}, {better} of {len(errors)})"
            print(f"{count:4d} {name:12} {errors[:, 0].mean():8.4f} {errors[:, 1].mean():8.4f}{words}", flush=True)


if __name__ == "__main__":
    main()

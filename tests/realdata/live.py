"""What choosing each row by the rows before is worth on measured robots: ``python -m tests.realdata.live ROBOT [SEED]``.

An experiment of minutes, not a test. The published rows are the only poses. A tenth of them at either end of the robot's widest
joint is the task, and set aside; of those between, 300 random ones are the candidates, and the others judge, too. Rows are chosen
as `taskcal measure` does (adaptive; all of them to be fitted, none kept out or measured again), by one plan for so many, and at
random; each choice is fitted with all effects. Prints the rms error in space, mm: at both ends together, the mean of three random
choices and each of them; at each end; and between them.
"""

import sys
import tempfile
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from taskcal.campaigns.campaign import Campaign
from taskcal.identification.calibration import Calibration
from taskcal.identification.effects import explain
from taskcal.live.journal import Journal, Purpose, Row
from taskcal.live.steering import START_ROWS, Aim, State, Steering
from taskcal.observations.instrument import Measurable
from taskcal.planning.options import PlanOptions
from taskcal.planning.plan import PoseChoice
from taskcal.task.task import Task
from tests.conftest import DATA
from tests.realdata.held_out import lengths
from tests.realdata.planning import ROBOTS, Split, at_random
from tests.realdata.test_effects import campaign_of, model_of

COUNTS = (15, 20, 30, 40, 60)
DRAWS, END = 3, 0.1
"""Random choices, and the share of the rows at each end."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Ends(Split):
    """Rows to choose from; those held out are of both ends."""

    judges: tuple[Campaign, ...]
    """Both ends, the low one, the high one, and rows between them that are not to be chosen."""

    @classmethod
    def of(cls, robot: str, seed: int) -> "Ends":
        """The candidates are drawn with the seed; the ends are always the same."""
        campaign = replace(campaign_of(DATA, robot), rotations=None)
        campaign = campaign.take(np.flatnonzero(campaign.seen))
        along = campaign.q[:, np.argmax(np.std(campaign.q, axis=0))]
        rank = np.argsort(np.argsort(along, kind="stable"), kind="stable") / len(along)
        low, high = rank < END, rank >= 1.0 - END
        inside = np.random.default_rng(seed).permutation(np.flatnonzero(~low & ~high))
        pool, rest = (campaign.take(np.sort(part)) for part in np.split(inside, [ROBOTS[robot]]))
        ends = tuple(campaign.take(np.flatnonzero(rows)) for rows in (low | high, low, high))
        return cls(model=model_of(robot, ()), pool=pool, unseen=ends[0], judges=(*ends, rest))

    def fitted(self, rows: np.ndarray) -> Calibration:
        """With all effects, as the rows were published: with their own ways and times."""
        return explain(self.model, self.pool.take(np.sort(rows))).calibration

    def errors(self, rows: np.ndarray) -> np.ndarray:
        """Rms error of each of the judges after these rows, mm."""
        fitted = self.fitted(rows)
        return np.array([np.sqrt(np.mean(lengths(fitted, judge) ** 2)) for judge in self.judges])

    def rows_at(self, q: np.ndarray) -> np.ndarray:
        """The candidates that are nearest to some poses."""
        return np.array([int(np.argmin(np.abs(self.pool.q - one).max(axis=1))) for one in q])


class AmongRows(Steering):
    """Steering to which the published rows are the only poses; all of them are chosen for the fit."""

    def __init__(self, split: Ends, folder: Path):
        aim = Aim(model=split.model, task=Task(name="ends", poses=split.goal.T, joints=split.goal.q))
        journal = Journal(folder / "rows.csv", split.model.robot, split.pool.targets[0])
        journal.begin(aim.settings)
        super().__init__(aim, journal)
        self.split = split

    @cached_property
    def _start(self) -> tuple[PoseChoice, np.ndarray, Measurable]:
        choice = PoseChoice.among(self.aim.model, self.aim.task, PlanOptions(candidates=self.split.pool.q))
        return choice, choice.choose(START_ROWS).q, choice.measurable

    def _identified(self, campaign: Campaign) -> Calibration:
        return self.split.fitted(self.split.rows_at(campaign.q))

    def purpose(self, state: State, *, doubt: bool = False) -> Purpose:
        return "chosen"

    def planned(self, count: int) -> np.ndarray:
        return self.split.rows_at(self._start[0].choose(count).q)

    def adaptive(self, count: int) -> np.ndarray:
        """So many rows, each by those before."""
        while (number := len(self.journal.rows) + 1) <= count:
            q = self.next(self.update())[0].q
            point = self.split.pool.points[self.split.rows_at(q[None])[0], 0]
            row = Row(number=number, purpose="chosen", station=1, time_s=20.0 * number, joints=q, point=point)
            self.journal.append(row)
        return self.split.rows_at(np.stack([row.joints for row in self.journal.rows[:count]]))


def main(robot: str, seed: int = 0) -> None:
    """Print a line for each number of rows and each choice."""
    split = Ends.of(robot, seed)
    print(f"{robot}, seed {seed}: rms, mm, at both ends (each draw), low, high, between", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        steering = AmongRows(split, Path(folder))
        for count in COUNTS:
            chosen = {"adaptive": [steering.adaptive(count)], "planned": [steering.planned(count)]}
            chosen["random"] = [at_random(split, count, DRAWS * seed + draw) for draw in range(DRAWS)]
            for name, draws in chosen.items():
                errors = np.array([split.errors(rows) for rows in draws])
                both, *parts = (f"{mean:8.4f}" for mean in errors.mean(axis=0))
                print(f"{count:4d} {name:9}", both, np.sort(errors[:, 0]).round(4), *parts, flush=True)


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:]))

"""How many poses a proof takes, and how often it is true: ``python -m tests.live.honest_stops FIRST LAST``, no test.

Virtual robots by number, of three kinds in turn: arms of six joints of several sizes, arms of seven, and robots that command fewer
than six directions: a SCARA, a gantry, a palletizer with rods, an arm of five axes. Each has defects of its tolerances,
compliance and gear errors, and beside them what no fit is told: waves over all joints, drives that yield under a payload, lost
motion, and drift while the robot warms up. It is measured until its error over a task is proven; its true error there, over ways
of approach and the time of the campaign, is then compared with the tolerance. That is 1, 1.25 or 1.5 times what 120 random poses
of the task leave, so that it lies near what the robot can reach; or as ``--over-floor`` or ``--tolerance-mm`` says. With
``--fixed`` 60 poses planned at once, and 60 at random, are fitted in place of all that. Prints a line of JSON for each robot; with
``--trace`` also what was known after each row.
"""

import argparse
import json
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import taskcal as tc
from taskcal.geometry import se3
from taskcal.identification.calibration import residuals_on
from taskcal.live.journal import Journal, Row
from taskcal.live.steering import Aim, Steering, as_campaign
from taskcal.live.virtual import VirtualCell
from taskcal.observations.base import TrackerNoise
from taskcal.robot.robot import Robot
from taskcal.robot.robot_file import robot_from
from tests.laws.robots import FEW_DIRECTIONS

KINDS = (
    ("ur5", "abb-irb6640-185-2.8", "abb-irb2400-12-1.55", "abb-irb120", "kuka-kr16-2", "meca500-r3", "ur10e"),
    ("franka-panda", "kinova-gen3", "motoman-sia20d"),
    ("denso-hsr065a1", *FEW_DIRECTIONS),
)
"""Robot k is of kind k modulo 3, and the next of its list, begun anew: of six joints, of seven, of fewer directions than six."""

SHOTS, ROW_S, GOALS, FLOOR_ROWS, FACTORS = 3, 20.0, 400, 120, (1.0, 1.25, 1.5)

WAVES = 3.0
"""How many times larger and shorter than those of the controller ``virtual`` the waves are."""

WINDUP_RAD, LOST_MOTION, DRIFT_RAD, DRIFT_M, EXPANSION, WARMING_S = 1e-4, 2e-5, 3e-5, 1e-5, 3e-5, 1800.0
"""Standard deviations of what a payload winds up each joint by where it pulls most, of the lost motion of each (radians, or
metres), of the drift of each until the robot is warm, of the growth of all its lengths; and the time constant of that, seconds."""


@dataclass(eq=False, kw_only=True)
class HardCell:
    """A virtual robot with effects that no fit is told."""

    cell: VirtualCell
    rng: np.random.Generator
    last: np.ndarray = field(default_factory=lambda: np.zeros(0))
    """Where the robot stands."""

    def __post_init__(self) -> None:
        robot, rng = self.cell.robot, self.rng
        n, slides = len(robot.joints), robot.prismatic
        self.cell.hidden *= WAVES
        self.cell.waves *= WAVES
        self.windup = np.where(slides, 0.0, np.abs(rng.normal(size=n)) * WINDUP_RAD)
        self.lost = 0.5 * np.abs(rng.normal(size=n)) * LOST_MOTION
        self.drift = rng.normal(size=n) * np.where(slides, DRIFT_M, DRIFT_RAD)
        self.expansion = rng.normal() * EXPANSION
        self.last = self.cell.start
        low, high = robot.bounded_limits().T
        self.most = np.abs(self._pull(rng.uniform(low, high, (200, n)))).max(axis=0) + 1e-12

    def _pull(self, q: np.ndarray) -> np.ndarray:
        """Torque of each joint by a weight of 1 N at the flange, by differences of its height: the work that turning it takes."""
        step = 1e-6 * np.eye(q.shape[1])
        high, low = (self.cell.model.nominal.poses((q[:, None] + s * step).reshape(-1, q.shape[1])) for s in (1, -1))
        return ((high - low)[:, 2, 3] / 2e-6).reshape(q.shape)

    def points(self, q: np.ndarray, sides: np.ndarray, times_s: np.ndarray) -> np.ndarray:
        """Where the reflector is, in the tracker's frame, metres.

        Args:
            q: joints, radians.
            sides: from which each joint came, −1 or 1.
            times_s: since the robot was cold.
        """
        cell, warm = self.cell, 1.0 - np.exp(-times_s / WARMING_S)
        off = cell.hidden * np.sin(np.einsum("jwk,nk->njw", cell.waves, q) + cell.phases).sum(axis=2)
        off -= self.windup * self._pull(q) / self.most
        off += sides * self.lost + warm[:, None] * self.drift
        T = cell.model.poses(q + off, cell.x)
        T[:, :3, 3] *= 1.0 + warm[:, None] * self.expansion
        return se3.apply(cell.T_tracker_base @ T, cell.target)

    def measured(self, q: np.ndarray, first: int) -> np.ndarray:
        """Means of the shots at poses that are visited one after another, the first of them as row `first`."""
        sides = np.sign(np.diff(np.vstack([self.last, q]), axis=0))
        self.last = q[-1]
        truth = self.points(q, sides, ROW_S * (first + np.arange(len(q))))
        return np.stack([self.rng.multivariate_normal(p, TrackerNoise().covariance(p) / SHOTS) for p in truth])

    def error(self, calibration: tc.Calibration, q: np.ndarray, rows: int) -> float:
        """Rms error in space of what is predicted over a task, during so many rows, approached from anywhere, metres."""
        rng = np.random.default_rng(5)
        truth = self.points(q, rng.choice([-1.0, 1.0], q.shape), rng.uniform(0.0, ROW_S * rows, len(q)))
        return float(np.sqrt(np.mean(np.sum((calibration.predict(q)[:, 0] - truth) ** 2, axis=1))))

    def fitted(self, q: np.ndarray, seed: int) -> tc.Calibration:
        """The calibration of poses that are measured one after another."""
        ids = tuple(map(str, range(1, len(q) + 1)))
        points = self.measured(q, 1)[:, None]
        return tc.explain(
            tc.ErrorModel(self.cell.robot), tc.Campaign(ids=ids, q=q, targets=("tool",), points=points), seed=seed
        ).calibration


def robot_of(number: int) -> Robot:
    """A robot by its number."""
    kind = KINDS[number % len(KINDS)]
    name = kind[number // len(KINDS) % len(kind)]
    return robot_from(FEW_DIRECTIONS[name]) if name in FEW_DIRECTIONS else tc.load_robot(name)


def known(steering: Steering, cell: HardCell, goal: np.ndarray) -> dict[str, object]:
    """What is known after a row, and what is true."""
    state, fit = steering.update(), steering._fit
    if fit is None or state.budget is None:
        return {"rows": state.rows}
    rows = [row for row in (steering.journal.rows[k] for k in steering._numbers("kept-out")) if steering.located(row)]
    errors = residuals_on(fit.calibration, as_campaign(rows, fit.calibration))[:, 0] if rows else np.zeros((0, 3))
    return {
        "rows": state.rows,
        "fitted": len(fit.rows),
        "expected_mm": state.budget.after * 1e3,
        "interval_mm": [1e3 * bound for bound in state.budget.interval],
        "true_mm": cell.error(fit.calibration, goal, state.rows) * 1e3,
        "kept_out_mm": (errors * 1e3).round(4).tolist(),
    }


def run(
    number: int, tolerance: float | None, factor: float | None, most: int, *, fixed: bool, trace: bool
) -> dict[str, object]:
    """Measure one robot until it is proven."""
    robot = robot_of(number)
    model = tc.ErrorModel(robot)
    task = tc.default_task(model)

    def cell() -> HardCell:
        return HardCell(cell=VirtualCell.drawn(robot, number), rng=np.random.default_rng([number, 1]))

    goal = tc.reach_task(model, task, GOALS, seed=77).q
    out: dict[str, object] = {"number": number, "robot": robot.name}
    if fixed:
        plans = {
            "planned": tc.plan(model, task, 60, seed=number).q,
            "random": tc.reach_task(model, task, 60, seed=79).q,
        }
        for how, q in plans.items():
            own = cell()
            out[f"{how}_60_mm"] = own.error(own.fitted(q, number), goal, 60) * 1e3
        return out
    if tolerance is None:
        own = cell()
        floor = own.error(own.fitted(tc.reach_task(model, task, FLOOR_ROWS, seed=78).q, number), goal, FLOOR_ROWS)
        tolerance = (factor or FACTORS[number % len(FACTORS)]) * floor
        out["floor_mm"] = floor * 1e3
    out["tolerance_mm"] = tolerance * 1e3
    aim = Aim(model=model, task=task, tolerance=tolerance, most=most, seed=number)
    own = cell()
    with tempfile.TemporaryDirectory() as folder:
        journal = Journal(Path(folder) / "c.csv", robot)
        journal.begin(aim.settings)
        steering = Steering(aim, journal)
        while not (state := steering.update()).proven and state.rows < aim.most:
            if trace:
                print(json.dumps({"number": number, **known(steering, own, goal)}), flush=True)
            step, _ = steering.next(state)
            journal.append(
                Row(
                    number=step.number,
                    purpose=step.purpose,
                    station=1,
                    time_s=ROW_S * step.number,
                    joints=step.q,
                    point=own.measured(step.q[None], step.number)[0],
                )
            )
        out |= {
            **known(steering, own, goal),
            "proven": state.proven,
            "look": None if state.look is None else list(state.look),
            "looks": len(journal.noted("look")),
            "fits": len(journal.noted("fit")),
        }
        out["true_mm"] = own.error(steering.calibration(), goal, state.rows) * 1e3
    return out


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("first", type=int)
    parser.add_argument("last", type=int)
    parser.add_argument("--tolerance-mm", type=float)
    parser.add_argument("--over-floor", type=float)
    parser.add_argument("--most", type=int, default=100)
    parser.add_argument("--fixed", action="store_true")
    parser.add_argument("--trace", action="store_true")
    given = parser.parse_args()
    wanted = None if given.tolerance_mm is None else given.tolerance_mm * 1e-3
    for one in range(given.first, given.last + 1):
        print(
            json.dumps(run(one, wanted, given.over_floor, given.most, fixed=given.fixed, trace=given.trace)), flush=True
        )

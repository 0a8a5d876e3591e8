"""How many poses a proof takes, and how often it is true: ``python -m tests.live.honest_stops ROBOT SEED``, no test.

A virtual robot with defects of its tolerances, compliance and gear errors, and waves over all joints that no model has, is measured
until its error over a task is proven; its true error there is then compared with the tolerance. With ``--fixed`` 60 poses planned
at once, and 60 of the task at random, are fitted, too; ``--hidden`` makes the waves larger and shorter. It prints
a line of JSON.
"""

import argparse
import json
import tempfile
from pathlib import Path

import numpy as np

import taskcal as tc
from taskcal.live.journal import Journal, Row
from taskcal.live.steering import Aim, Steering
from taskcal.live.virtual import VirtualCell
from taskcal.observations.base import TrackerNoise

SHOTS = 3


def measure(cell: VirtualCell, q: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Means of the shots at each pose."""
    truth = cell.points(q)
    return np.stack([rng.multivariate_normal(p, TrackerNoise().covariance(p) / SHOTS) for p in truth])


def true_error(calibration: tc.Calibration, cell: VirtualCell, q: np.ndarray) -> float:
    """Rms error in space of what is predicted over the task, metres."""
    return float(np.sqrt(np.mean(np.sum((calibration.predict(q)[:, 0] - cell.points(q)) ** 2, axis=1))))


def run(name: str, seed: int, tolerance: float, hidden: float, *, fixed: bool) -> dict[str, object]:
    """Measure one robot until it is proven."""
    robot = tc.load_robot(name)
    model = tc.ErrorModel(robot)
    aim = Aim(model=model, task=tc.default_task(model), tolerance=tolerance, most=120, seed=seed)
    cell, rng = VirtualCell.drawn(robot, seed), np.random.default_rng(1000 + seed)
    cell.hidden *= hidden
    cell.waves *= hidden
    goal = tc.reach_task(model, aim.task, 400, seed=77).q
    out: dict[str, object] = {"robot": name, "seed": seed, "tolerance_mm": tolerance * 1e3, "hidden": hidden}
    with tempfile.TemporaryDirectory() as folder:
        journal = Journal(Path(folder) / "c.csv", robot)
        journal.begin(aim.settings)
        steering = Steering(aim, journal)
        while not (state := steering.update()).proven and state.rows < aim.most:
            step, _ = steering.next(state)
            point = measure(cell, step.q[None], rng)[0]
            journal.append(
                Row(
                    number=step.number,
                    purpose=step.purpose,
                    station=1,
                    time_s=20.0 * step.number,
                    joints=step.q,
                    point=point,
                )
            )
        calibration = steering.calibration()
        out |= {
            "rows": state.rows,
            "proven": state.proven,
            "true_mm": true_error(calibration, cell, goal) * 1e3,
            "expected_mm": None if state.budget is None else state.budget.after * 1e3,
            "bound_mm": None if state.look is None else state.look.bound * 1e3,
            "looks": len(journal.noted("look")),
            "fits": len(journal.noted("fit")),
        }
    if fixed:
        plans = {
            "planned": tc.plan(model, aim.task, 60, seed=seed).q,
            "random": tc.reach_task(model, aim.task, 60, seed=seed).q,
        }
        for how, q in plans.items():
            campaign, _ = tc.simulate(model, q, rng=rng)
            points = measure(cell, q, rng)[:, None]
            measured = tc.Campaign(ids=campaign.ids, q=q, targets=campaign.targets, points=points)
            fitted = tc.explain(model, measured, seed=seed).calibration
            out[f"{how}_60_mm"] = true_error(fitted, cell, goal) * 1e3
    return out


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("robot")
    parser.add_argument("seed", type=int)
    parser.add_argument("--tolerance-mm", type=float, default=0.1)
    parser.add_argument("--hidden", type=float, default=1.0)
    parser.add_argument("--fixed", action="store_true")
    given = parser.parse_args()
    result = run(given.robot, given.seed, given.tolerance_mm * 1e-3, given.hidden, fixed=given.fixed)
    print(json.dumps(result), flush=True)

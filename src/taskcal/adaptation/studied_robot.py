"""One robot of a study: drawn, measured in every way, identified with every model, and compared with the truth."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.adaptation.aligned_error import aligned_errors
from taskcal.adaptation.virtual_robots import VirtualRobots
from taskcal.errors import NothingLearntError
from taskcal.identification.calibration import Calibration
from taskcal.identification.effect_selection import explain
from taskcal.identification.fit_options import FitOptions
from taskcal.identification.identify import identify
from taskcal.identification.nominal_fit import fit_nominal
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.tracker import TrackerNoise
from taskcal.measurement.virtual_cell import Truth
from taskcal.robot.error_model import ErrorModel


@dataclass(frozen=True, eq=False, kw_only=True)
class StudySetting:
    """Everything that a robot of the study needs."""

    task_q: Float[np.ndarray, "n joints"]
    weights: Float[np.ndarray, " n"]
    plans: Mapping[str, Float[np.ndarray, "count joints"]]
    """Fixed plans, by kind and count."""
    pool: Float[np.ndarray, "pool joints"]
    cases: tuple[tuple[str, str, int], ...]
    """Way to measure, kind of plan, number of poses."""
    models: Mapping[str, FitOptions]
    noise: TrackerNoise
    seed: int
    robots: VirtualRobots
    aligned: bool = False
    """Whether errors are those that are left once frames were taught."""


def _identify(model: ErrorModel, campaign: Campaign, name: str, options: FitOptions) -> Calibration:
    """The calibration that a model's name stands for."""
    if name not in ("geometry", "auto"):
        return identify(model, campaign, options=options)
    geometry = ErrorModel(model.robot, lengths_only=model.lengths_only)
    return (
        identify(geometry, campaign, options=options)
        if name == "geometry"
        else explain(geometry, campaign, options=options).calibration
    )


def try_robot(setting: StudySetting, index: int) -> tuple[int, list[dict[str, Any]]]:
    """All ways to measure, plans and models of one true robot."""
    rng = _own_numbers(setting, index)
    robots, noise = setting.robots, setting.noise
    x, task_q = robots.draw(rng), setting.task_q
    out: list[dict[str, Any]] = []
    for observe, kind, count in setting.cases:
        q = setting.plans.get(f"{kind} {count}")
        if q is None:
            q = setting.pool[rng.permutation(len(setting.pool))[:count]]
        campaign, truth = robots.measure(x, q, noise, rng, observe)
        # the same for all plans, and drawn beside the robot, which does not depend on it
        alone = np.random.default_rng(np.random.SeedSequence(setting.seed, spawn_key=(index, 1)))
        unexplained = robots.unexplained(truth, task_q, alone)
        for name, options in setting.models.items():
            learnt = True
            try:
                calibration = _identify(robots.model, campaign, name, options)
            except NothingLearntError:  # what is left to its user is the robot as it is
                learnt, calibration = False, fit_nominal(robots.model, campaign, options)
            off = _off(setting, calibration, truth)
            error, single = np.linalg.norm(off, axis=1), np.linalg.norm(off - unexplained * 1e3, axis=1)
            out.append(
                {
                    "robot": index,
                    "plan": kind,
                    "count": count,
                    "model": name,
                    "rms_mm": float(np.sqrt(np.sum(setting.weights * error**2))),
                    "max_mm": float(error.max()),
                    "rms_with_model_error_mm": float(np.sqrt(np.sum(setting.weights * single**2))),
                    "observe": observe,
                    "learnt": learnt,
                }
            )
    return index, out


def _own_numbers(setting: StudySetting, index: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(setting.seed, spawn_key=(index,)))


def _off(setting: StudySetting, calibration: Calibration, truth: Truth) -> Float[np.ndarray, "n 3"]:
    """Predicted less true tool points over the task, in the measuring frame, millimetres."""
    q, way = setting.task_q, setting.robots.conditions(setting.task_q)
    if not setting.aligned:
        return (calibration.predict(q, way) - truth.points(q, way))[:, 0] * 1e3
    true = truth.model.poses(q, truth.x, way)[:, :3, 3]
    off = aligned_errors(calibration.tool_in_base(q, way), true, setting.weights)
    return -1e3 * off @ truth.T_tracker_base[:3, :3].T


def errors_before(setting: StudySetting, robots: int) -> tuple[float, ...]:
    """What the nominal robot is off with frames that were taught with it, of every robot, metres."""
    q, model = setting.task_q, setting.robots.model
    way, out = setting.robots.conditions(q), list[float]()
    for index in range(robots):
        true = model.poses(q, setting.robots.draw(_own_numbers(setting, index)), way)[:, :3, 3]
        off = aligned_errors(model.nominal.poses(q), true, setting.weights)
        out.append(float(np.sqrt(setting.weights @ (off**2).sum(axis=1))))
    return tuple(out)

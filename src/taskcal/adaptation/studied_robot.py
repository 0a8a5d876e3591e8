"""Robots of a study: each drawn, measured in every way, identified with every model, and compared with the truth."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from taskcal.adaptation.aligned_error import aligned_errors
from taskcal.adaptation.virtual_robots import VirtualRobots
from taskcal.errors import NothingLearntError
from taskcal.identification.calibration import Calibration
from taskcal.identification.effect_selection import explain
from taskcal.identification.fit_options import FitOptions
from taskcal.identification.fitted_together import Estimate, can_fit_together, fit_together
from taskcal.identification.identify import identify
from taskcal.identification.nominal_fit import fit_nominal
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.tracker import TrackerNoise
from taskcal.measurement.virtual_cell import Truth
from taskcal.robot.error_model import ErrorModel

TOGETHER = 16
"""Robots that are tried at once: a study that is interrupted loses no more than what they take."""


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


class _Measured(NamedTuple):
    """One robot, measured in one way."""

    robot: int
    observe: str
    kind: str
    poses: int
    """How many were asked for."""
    campaign: Campaign
    truth: Truth
    unexplained: Float[np.ndarray, "n 3"]
    """What single poses of the task add, metres."""


def robots_together(setting: StudySetting) -> int:
    """How many robots are best tried at once: what is measured otherwise than by a tracker is identified one by one."""
    fitted = (can_fit_together(_model_of(setting, name), options) for name, options in setting.models.items())
    return TOGETHER if all(way == "tracker" for way, _, _ in setting.cases) and any(fitted) else 1


def try_robots(setting: StudySetting, indices: Sequence[int]) -> list[tuple[int, list[dict[str, Any]]]]:
    """All ways to measure, plans and models of some of the true robots; of each what it would be by itself."""
    measured = [case for index in indices for case in _measure(setting, index)]
    found = {name: _learn(setting, name, measured) for name in setting.models}
    rows: dict[int, list[dict[str, Any]]] = {index: [] for index in indices}
    for k, case in enumerate(measured):
        for name in setting.models:
            rows[case.robot].append(_compare(setting, case, name, found[name][k]))
    return list(rows.items())


def _measure(setting: StudySetting, index: int) -> list[_Measured]:
    """One robot in every way and by every plan."""
    rng = _own_numbers(setting, index)
    robots = setting.robots
    x, out = robots.draw(rng), list[_Measured]()
    for observe, kind, count in setting.cases:
        q = setting.plans.get(f"{kind} {count}")
        if q is None:
            q = setting.pool[rng.permutation(len(setting.pool))[:count]]
        campaign, truth = robots.measure(x, q, setting.noise, rng, observe)
        # the same for all plans, and drawn beside the robot, which does not depend on it
        alone = np.random.default_rng(np.random.SeedSequence(setting.seed, spawn_key=(index, 1)))
        unexplained = robots.unexplained(truth, setting.task_q, alone)
        out.append(_Measured(index, observe, kind, count, campaign, truth, unexplained))
    return out


def _model_of(setting: StudySetting, name: str) -> ErrorModel:
    model = setting.robots.model
    return ErrorModel(model.robot, lengths_only=model.lengths_only) if name in ("geometry", "auto") else model


def _learn(setting: StudySetting, name: str, measured: Sequence[_Measured]) -> list[Calibration | Estimate | None]:
    """What the model that a name stands for says of each campaign; None where nothing was learnt."""
    model, options = _model_of(setting, name), setting.models[name]
    campaigns = [case.campaign for case in measured]
    together = [None] * len(campaigns) if name == "auto" else fit_together(model, campaigns, options)
    out: list[Calibration | Estimate | None] = []
    for campaign, found in zip(campaigns, together, strict=True):
        try:
            found = found or _identify(model, campaign, name, options)
        except NothingLearntError:
            found = None
        if isinstance(found, Calibration) and not len(found.estimated) and options.keep != ():
            found = None  # tracker frame and targets alone
        out.append(found)
    return out


def _identify(model: ErrorModel, campaign: Campaign, name: str, options: FitOptions) -> Calibration:
    if name == "auto":
        return explain(model, campaign, options=options).calibration
    return identify(model, campaign, options=options)


def _compare(setting: StudySetting, case: _Measured, name: str, found: Calibration | Estimate | None) -> dict[str, Any]:
    """The row of one robot, way to measure and model."""
    robots, options = setting.robots, setting.models[name]
    # where nothing is learnt, what is left to its user is the robot as it is
    known = fit_nominal(robots.model, case.campaign, options) if found is None else found
    off = _off(setting, known, case.truth)
    error, single = np.linalg.norm(off, axis=1), np.linalg.norm(off - case.unexplained * 1e3, axis=1)
    return {
        "robot": case.robot,
        "plan": case.kind,
        "count": case.poses,
        "model": name,
        "rms_mm": float(np.sqrt(np.sum(setting.weights * error**2))),
        "max_mm": float(error.max()),
        "rms_with_model_error_mm": float(np.sqrt(np.sum(setting.weights * single**2))),
        "observe": case.observe,
        "learnt": found is not None,
    }


def _own_numbers(setting: StudySetting, index: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(setting.seed, spawn_key=(index,)))


def _off(setting: StudySetting, calibration: Calibration | Estimate, truth: Truth) -> Float[np.ndarray, "n 3"]:
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

"""Does the one model harm, and do its regions hold: ``python -m tests.identification.no_harm [ROBOTS] [KIND …]``.

An experiment of many minutes, not a test. Virtual robots are drawn with defects of their geometry and one kind of error beside
it, or none, and measured in 60 poses, one after another, while they warm up, so that every effect that is defined competes.
100 other poses are predicted by geometry alone, by all effects (``auto``), and by the fit that was told what there is. Without
effects, ``auto`` is compared with geometry alone, with effects with the fit that was told.
"""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from taskcal.campaigns.campaign import Campaign
from taskcal.identification.calibration import Calibration
from taskcal.identification.effects import explain
from taskcal.identification.identify import identify
from taskcal.robot.catalogue import load_robot
from taskcal.robot.conditions import conditions_in_order
from taskcal.robot.effects import (
    Backlash,
    Compliance,
    Coupling,
    Effect,
    EncoderGain,
    Harmonics,
    JointField,
    Overshoot,
    Settling,
    Spring,
    Thermal,
)
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import reach_task
from taskcal.virtual.cell import draw_defects, simulate
from taskcal_demo.procedure import reference_task
from taskcal_demo.true_robot import elastic_robot

ROBOTS = "abb-irb6660-205-1.9", "abb-irb120", "ur10"
MEASURED, NEW = 60, 100
LIMIT = 1.5
"""Largest joint position of a pose, radians."""

WARMTH = 21.0, 27.0
"""Of the robot at the first and at the last pose, °C."""


@dataclass(frozen=True, kw_only=True)
class Kind:
    """What there is beside defects of the geometry and the tracker's noise."""

    effect: Effect | None = None
    told: bool = True
    """Whether it is an effect that some fit can be told of."""
    white: float = 0.0
    """Error of every pose by itself, metres per axis."""
    elastic: bool = False
    """Of a robot of which masses, stiffness and spring are stated."""


WITHOUT = {
    "nothing": Kind(),
    "white": Kind(white=5e-5),
    "outside": Kind(effect=JointField(tolerance=1e-5, length=0.7, seed=1), told=False, white=1e-5),
}
"""No effect: the kindest case, white errors of single poses, and small errors that no effect has the form of."""

WITH = {
    "gain": Kind(effect=EncoderGain()),
    "order 1": Kind(effect=Harmonics(orders=(1,), tolerance=5e-5)),
    "order 2": Kind(effect=Harmonics(orders=(2,), tolerance=5e-5)),
    "order 6": Kind(effect=Harmonics(orders=(6,), tolerance=3e-5)),
    "order 20": Kind(effect=Harmonics(orders=(20,), tolerance=3e-5)),
    "compliance": Kind(effect=Compliance()),
    "coupling": Kind(effect=Coupling()),
    "gain of J3": Kind(effect=EncoderGain(joints=("J3",))),
    "backlash": Kind(effect=Backlash(tolerance=5e-5)),
    "settling": Kind(effect=Settling(tolerance=5e-5)),
    "overshoot": Kind(effect=Overshoot(tolerance=5e-5)),
    "thermal": Kind(effect=Thermal(reference=24.0)),
    "spring": Kind(effect=Spring(), elastic=True),
}
KINDS: Mapping[str, Kind] = {**WITHOUT, **WITH}


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Mean errors at new poses, metres, and shares of them in the stated 95 % regions."""

    geometry: float
    auto: float
    told: float
    inside: float
    """Of measured points, the tracker's noise added to what `auto` states."""
    inside_geometry: float
    chosen: bool
    """Whether more than geometry was kept."""


def draw(name: str, kind: Kind, seed: int) -> Outcome:
    """One robot, calibrated in three ways."""
    rng = np.random.default_rng(seed)
    robot = elastic_robot(load_robot("abb-irb6660-205-1.9")) if kind.elastic else load_robot(name)
    plain = ErrorModel(robot)
    true = plain if kind.effect is None else plain + kind.effect
    x = draw_defects(true, rng)

    def measured(count: int) -> tuple[Campaign, np.ndarray]:
        q = positions(plain, count, rng)
        conditions = replace(conditions_in_order(robot, q), temperature=np.linspace(*WARMTH, len(q)))
        campaign, truth = simulate(true, q, rng=rng, x=x, conditions=conditions, model_error=kind.white)
        return campaign, truth.points(q, conditions)

    campaign, _ = measured(MEASURED)
    new, points = measured(NEW)
    geometry = identify(plain, campaign)
    auto = explain(plain, campaign).calibration
    told = identify(true, campaign) if kind.effect is not None and kind.told else geometry
    errors = [
        float(np.linalg.norm(points - fit.predict(new.q, new.conditions), axis=2).mean())
        for fit in (geometry, auto, told)
    ]
    return Outcome(
        geometry=errors[0],
        auto=errors[1],
        told=errors[2],
        inside=share_inside(auto, new),
        inside_geometry=share_inside(geometry, new),
        chosen=len(auto.kept) > len(geometry.kept),
    )


def positions(model: ErrorModel, count: int, rng: np.random.Generator) -> np.ndarray:
    """Poses anywhere, or in the reference task of a robot whose four-bar does not close anywhere, radians."""
    if model.robot.four_bar is not None:
        return reach_task(model, reference_task(np.radians(20.0)), count, seed=int(rng.integers(1 << 30))).q
    limits = np.clip(model.robot.limits, -LIMIT, LIMIT)
    return rng.uniform(limits[:, 0], limits[:, 1], (count, len(limits)))


def share_inside(calibration: Calibration, new: Campaign) -> float:
    """Share of measured points in the stated 95 % regions."""
    error = calibration.residuals_on(new)
    C = calibration.predict_covariance(new.q, new.conditions) + new.covariances()
    square = np.einsum("nti,nti->nt", error, np.linalg.solve(C, error[..., None])[..., 0])
    return float((square < chdtri(3, 0.05)).mean())


def described(name: str, outcomes: Sequence[Outcome], *, told: bool) -> str:
    """A line of the table."""
    ratio = np.array([o.auto / (o.told if told else o.geometry) for o in outcomes])
    parts = [1e3 * np.median([getattr(o, key) for o in outcomes]) for key in ("geometry", "auto", "told")]
    return (
        f"{name:12} {len(outcomes):4d} {sum(o.chosen for o in outcomes):4d} {parts[0]:8.4f} {parts[1]:8.4f} {parts[2]:8.4f} "
        f"{np.median(ratio):6.3f} {np.percentile(ratio, 95):6.3f} {(ratio <= 1.1).mean():6.2f} "
        f"{np.mean([o.inside for o in outcomes]):6.3f} {np.mean([o.inside_geometry for o in outcomes]):6.3f}"
    )


HEAD = "kind, robots, more than geometry kept, mm: geometry, auto, told, ratio: median, 95 %, share to 1.1, inside: auto, geometry"


def main(arguments: Sequence[str]) -> None:
    """Print a line for each kind; without effects all ROBOTS (200), with effects a fifth of them."""
    robots = int(arguments[0]) if arguments else 200
    print(HEAD)
    for name, kind in KINDS.items():
        if arguments[1:] and name not in arguments[1:]:
            continue
        count = robots if name in WITHOUT else max(robots // 5, 1)
        outcomes = [draw(ROBOTS[seed % len(ROBOTS)], kind, seed) for seed in range(count)]
        print(described(name, outcomes, told=name in WITH), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])

"""How often 95 % intervals hold in every regime: ``python -m tests.identification.coverage_regimes [ROBOTS] [REGIME …]``.

An experiment of some minutes, not a test. Virtual IRB 6660 drawn from the tolerances are measured by a tracker and predicted at
fifty other poses, each robot with its own noise. Where effects compete, `tests.identification.no_harm` has the shares; of other
ways to measure, `tests.identification.observed_coverage`; of reduced models, `test_coverage`.
"""

import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from taskcal.identification.calibration import Calibration
from taskcal.identification.identify import identify
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Effect, JointField
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import reach_task
from taskcal.virtual.cell import Truth, draw_defects, simulate
from taskcal_demo.procedure import reference_task

ROBOT = load_robot("abb-irb6660-205-1.9")
MODEL = ErrorModel(ROBOT)

TWO_SIDED = 1.959964
"""Standard deviations of a 95 % interval."""


@dataclass(frozen=True, kw_only=True)
class Regime:
    """How robots are measured and fitted, and what is wrong with them that the fit does not know."""

    poses: int = 60
    tilt: float = 20.0
    """How far the tool is tilted and turned, degrees; none is one orientation."""
    wrong: float = 0.0
    """Share of points that are off by five millimetres."""
    white: float = 0.0
    """Error of every pose by itself, metres per axis."""
    outside: Effect | None = None
    """An error that nothing in the fit has the form of."""


REGIMES: Mapping[str, Regime] = {
    "60 poses": Regime(),
    "25 poses": Regime(poses=25),
    "15 poses": Regime(poses=15),
    "one orientation": Regime(tilt=0.0),
    "model error 50 µm": Regime(white=5e-5),
    "5 % wrong by 5 mm, left out": Regime(wrong=0.05),
    "smooth error outside the model": Regime(outside=JointField(tolerance=3e-5, length=0.7, seed=1)),
}
"""The kindest is the first, whose truth is drawn from what is fitted; the unkindest is the last."""


def measured(regime: Regime, seed: int) -> tuple[Calibration, Truth]:
    """A robot of its own, measured and identified."""
    rng = np.random.default_rng(seed)
    true = MODEL if regime.outside is None else ErrorModel(ROBOT, effects=(regime.outside,))
    q = reach_task(MODEL, reference_task(np.radians(regime.tilt)), regime.poses, seed=2 + seed).q
    campaign, truth = simulate(true, q, rng=rng, x=draw_defects(true, rng), model_error=regime.white)
    points = campaign.points.copy()
    rows = rng.permutation(len(q))[: round(regime.wrong * len(q))]
    way = rng.normal(size=(len(rows), 1, 3))
    points[rows] += 5e-3 * way / np.linalg.norm(way, axis=2, keepdims=True)
    return identify(MODEL, replace(campaign, points=points)), truth


def covered(regime: Regime, seed: int) -> tuple[float, float]:
    """Of one robot: share of coordinates inside of their intervals, and mean square of the error in space, metres²."""
    calibration, truth = measured(regime, seed)
    unseen = reach_task(MODEL, reference_task(np.radians(regime.tilt)), 50, seed=1).q
    error = (truth.points(unseen) - calibration.predict(unseen))[:, 0]
    deviation = np.sqrt(np.einsum("ntii->nti", calibration.predict_covariance(unseen, model_error=False)))[:, 0]
    spread = np.sqrt(deviation**2 + calibration.model_error[0] ** 2) if regime.outside is not None else deviation
    return float((np.abs(error) < TWO_SIDED * spread).mean()), float((error**2).sum(axis=1).mean())


def main(robots: int, names: list[str]) -> None:
    print(
        f"{robots} virtual robots in each regime: share of coordinates of unseen points inside of their 95 % interval"
    )
    for name in names or REGIMES:
        found = np.array([covered(REGIMES[name], seed) for seed in range(robots)])
        share, doubt = 100.0 * found[:, 0].mean(), 100.0 * found[:, 0].std() / np.sqrt(robots)
        rms = 1e3 * np.sqrt(found[:, 1].mean())
        print(f"{name:32} {share:5.1f} ± {doubt:.1f} %   error {rms:.3f} mm rms", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100, sys.argv[2:])

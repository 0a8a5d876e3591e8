"""Residuals of a geometric model on robots with compliance: the published experiment, simulated, without and with effects."""

from functools import partial

import numpy as np

import taskcal as tc
from taskcal.analysis import published_kept
from taskcal.demo import GEARS, RIPPLE, elastic_model, try_models
from taskcal.effects import PERIODIC, SOFT

ROBOTS, EXPLAINED = 20, 3
robot = tc.load_robot("abb-irb6660-205-1.9")
geometry = tc.ErrorModel(robot)

# as published: 60 poses in one tool orientation, one reflector, a Leica AT901, weight not compensated
task = tc.demo.reference_task()
measured, new = tc.reach_task(geometry, task, 60).q, tc.reach_task(geometry, task, 200, seed=1).q


def explained(campaign):
    """Fit geometry, eccentric gears with a prior of their class, and the other effects that are significant."""
    return tc.explain(geometry + GEARS, campaign, candidates=(SOFT, PERIODIC), folds=3).calibration


def run(truth, fits, robots=ROBOTS):
    """Print medians over virtual robots, mm."""
    trials = [try_models(truth, fits, measured, new, rng=np.random.default_rng(seed)) for seed in range(robots)]
    for same in zip(*trials, strict=True):
        x, y, z = 1e3 * np.median([t.residual.per_axis for t in same], axis=0)
        space = 1e3 * np.array([t.residual.maximum for t in same])
        mean, most = (1e3 * np.median([getattr(t.new, size) for t in same]) for size in ("mean", "maximum"))
        print(
            f"  {same[0].model:14} {x:6.3f} {y:6.3f} {z:6.3f}  {np.median(space):.3f} ({space.min():.3f} to {space.max():.3f})"
            f"   {mean:.3f} {most:.3f}   {np.mean([t.inside for t in same]):.0%}"
        )


published = {"published 33": partial(tc.identify, geometry, keep=published_kept(geometry))}
print("mm               largest residual at 60 poses           200 new poses  coverage")
print("                      X      Y      Z  3D                  mean   max    95 %")
print("measured, as published")
print("  published 33    0.096  0.122  0.092  0.180")
print("drives of 2·10⁶ Nm/rad, spring, gears")
run(elastic_model(robot) + RIPPLE, {**published, "all 45": partial(tc.identify, geometry)})
run(elastic_model(robot) + RIPPLE, {"45 and effects": explained}, EXPLAINED)
print("the same with drives of 1·10⁶ Nm/rad")
run(elastic_model(robot, 1e6) + RIPPLE, published)
print("the same with drives of 4·10⁶ Nm/rad")
run(elastic_model(robot, 4e6) + RIPPLE, published)
print("drives of 2·10⁶ Nm/rad, spring, gear errors of orders 1 and 2 only")
run(elastic_model(robot), published)
print("geometric errors only")
run(geometry, published)

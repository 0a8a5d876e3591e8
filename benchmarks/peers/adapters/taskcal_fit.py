"""Taskcal: `identify` from raw rows; the kernel is its Levenberg–Marquardt, start, noise and prior given."""

import time

import numpy as np
from protocol import Fitted, main

import taskcal as tc
from taskcal.estimation.least_squares import fit
from taskcal.identification.layout import layout_of
from taskcal.identification.problem import problem_of, whitener
from taskcal.registration.registration import register


def calibrate(case, given: bool) -> Fitted:
    model = tc.ErrorModel(robot_of(case))
    campaign = tc.Campaign(ids=range(len(case.q)), q=case.q, points=case.points[:, None], targets=("smr",))
    calibration = tc.identify(model, campaign)
    return Fitted(
        predict=lambda held: calibration.predict(held.q_held)[:, 0],
        parameters=len(model) + 9,
        kernel_s=kernel(model, campaign),
    )


def robot_of(case):
    """A robot of the catalogue, or a chain that the case describes."""
    name = str(case.robot)
    return tc.load_robot(name if not name.startswith("chain-") else case.folder / "robot.urdf")


def kernel(model, campaign) -> float:
    """Seconds of one fit from the registration, noise and prior given."""
    layout = layout_of(model, np.arange(len(model)), register(model, campaign), campaign, fixed=False)
    problem = problem_of(layout, campaign, None)
    deviations = np.concatenate([model.tolerances, np.full(9, 1.0)])
    equations = problem.equations(whitener(problem.noise))
    start = layout.start()
    begin = time.process_time()
    fit(equations, start, start, np.diag(deviations**-2), np.minimum(deviations, 1e-3))
    return time.process_time() - begin


if __name__ == "__main__":
    main(calibrate)

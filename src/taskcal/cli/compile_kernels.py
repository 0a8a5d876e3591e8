"""Compilation of every kernel, by using each once on a handful of poses."""

from typing import get_args

import numpy as np

from taskcal.identification.identify import identify
from taskcal.identification.validation import validate
from taskcal.kinematics.inverse import Spin, solve_near
from taskcal.measurement.virtual_cell import simulate
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel

SPINS: tuple[Spin, ...] = get_args(Spin)


def compile_kernels() -> None:
    """Walk, close a four-bar, solve for joints, and identify from points and from poses."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    rng = np.random.default_rng(0)
    q = rng.uniform(np.radians([-60, -20, 0, -90, -80, -90]), np.radians([60, 40, 40, 90, 80, 90]), (20, 6))
    model.jacobian(q)
    model.joint_jacobian(q)
    T = model.poses(q)
    for spin in SPINS:
        solve_near(model, T, q + 1e-3, spin=spin)
    for pose in (False, True):
        campaign, _ = simulate(model, q, rng=rng, pose=pose)
        calibration = identify(model, campaign, prior_scale=1.0, model_error=(1e-4, 1e-4))
        calibration.predict_covariance(q)
        validate(calibration, campaign, reregister=True)

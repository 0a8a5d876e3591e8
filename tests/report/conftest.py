"""Fixtures that several test modules of this folder share."""

from collections.abc import Mapping

import numpy as np
import pytest

from taskcal.identification.calibration import Calibration
from taskcal.identification.identify import identify
from taskcal.identification.residual_analysis import ResidualAnalysis, analyse_residuals
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Compliance, EncoderGain, Harmonics
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate

TARGETS = {"a": np.zeros(3), "b": np.array([0.1, 0.0, 0.0]), "c": np.array([0.0, 0.12, 0.05])}


@pytest.fixture(scope="session")
def model() -> ErrorModel:
    return ErrorModel(load_robot("abb-irb120"))


@pytest.fixture(scope="session")
def poses(model: ErrorModel) -> Mapping[str, np.ndarray]:
    """All joints move; the first three alone."""
    q = np.random.default_rng(3).uniform(*0.5 * model.robot.limits.T, size=(30, 6))
    return {"all": q, "arm": np.where(np.arange(6) < 3, q, 0.3)}


@pytest.fixture(scope="session")
def fitted() -> tuple[Calibration, ResidualAnalysis]:
    """A robot whose third joint errs three times in a turn, which the model does not have."""
    model, rng = ErrorModel(load_robot("ur5")), np.random.default_rng(0)
    true = model + Harmonics(orders=(3,), joints=("J3",))
    q = rng.uniform(-1.2, 1.2, (80, 6))
    x = np.zeros(len(true))
    x[-2] = 1e-3
    campaign, _ = simulate(true, q, rng=rng, x=x, targets=TARGETS)
    calibration = identify(model + Compliance() + EncoderGain(), campaign)
    return calibration, analyse_residuals(calibration, campaign, permutations=99)

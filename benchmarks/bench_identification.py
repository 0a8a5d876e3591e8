"""One fit of 60 poses, 45 parameters, tracker frame and target, against SciPy's least squares; all effects, against that fit."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.optimize import least_squares

from taskcal.estimation.least_squares import fit
from taskcal.geometry import walk
from taskcal.identification.belief import BASE_PRIOR, TARGET_PRIOR
from taskcal.identification.effect_selection import explain
from taskcal.identification.identify import identify
from taskcal.identification.problem import FrameLayout, Problem, observe, whitener
from taskcal.measurement.registration import register


@dataclass(frozen=True, eq=False, kw_only=True)
class Fixed:
    """A fit whose hyperparameters are given: the tracker's noise, the tolerances as they are."""

    problem: Problem
    white: np.ndarray
    start: np.ndarray
    deviations: np.ndarray
    """Standard deviations of the prior about the start."""

    @classmethod
    def of(cls, model, campaign) -> "Fixed":
        layout = FrameLayout(
            model=model,
            kept=np.arange(len(model)),
            registration=register(model, campaign),
            targets=campaign.targets,
            pose=False,
        )
        problem = Problem(frames=layout, q=campaign.q, seen=observe(campaign), noise=campaign.covariances())
        frames = np.concatenate([np.full(6, BASE_PRIOR), np.full(3, TARGET_PRIOR)])
        return cls(
            problem=problem,
            white=whitener(problem.noise),
            start=layout.start(),
            deviations=np.concatenate([model.tolerances, frames]),
        )

    @property
    def scale(self) -> np.ndarray:
        """Natural size of every entry of z."""
        return np.minimum(self.deviations, 1e-3)

    def ours(self):
        precision = np.diag(1.0 / self.deviations**2)
        equations = self.problem.equations(self.white, 0, 1.0)
        return fit(equations, self.start, self.start, precision, self.scale)

    def scipys(self, jacobian: Callable[[np.ndarray], np.ndarray] | str):
        return least_squares(self.residuals, self.start, jac=jacobian, x_scale=self.scale, method="lm")

    def residuals(self, z: np.ndarray) -> np.ndarray:
        """Whitened residuals, then the prior's rows."""
        at = self.problem.walked(z)
        T = walk.poses(at.chain, at.s, at.e)
        predicted = T[:, :3, :3] @ at.points.position[0] + T[:, :3, 3]
        data = self.white[:, 0] @ (predicted - self.problem.seen.position[:, 0])[:, :, None]
        return np.concatenate([data.reshape(-1), (z - self.start) / self.deviations])

    def jacobian(self, z: np.ndarray) -> np.ndarray:
        """Derivative of the residuals."""
        at = self.problem.walked(z)
        J = walk.columns(at.chain, at.s, at.e, at.layout, at.factor, angular=False, point=at.points.position[0])
        J[:, :, at.points.columns[0]] = walk.poses(at.chain, at.s, at.e)[:, :3, :3]
        return np.concatenate([(self.white[:, 0] @ J).reshape(-1, len(z)), np.diag(1.0 / self.deviations)])


@pytest.fixture(scope="module")
def fixed(model, campaign) -> Fixed:
    return Fixed.of(model, campaign)


def test_bare_fit_against_scipy(race, fixed):
    ours, theirs = fixed.ours(), fixed.scipys(fixed.jacobian)
    assert ours.converged
    assert theirs.success
    assert ours.objective == pytest.approx(theirs.cost, rel=1e-9)
    race(
        "fit",
        fixed.ours,
        {
            "SciPy, analytic Jacobian": lambda: fixed.scipys(fixed.jacobian),
            "SciPy, 2-point Jacobian": lambda: fixed.scipys("2-point"),
        },
        rounds=7,
    )


def test_identification_against_scipy(race, model, campaign, fixed):
    """Registration, marginal likelihood and report, against one of SciPy's fits with all that given."""
    race(
        "identify",
        lambda: identify(model, campaign),
        {
            "SciPy, analytic Jacobian": lambda: fixed.scipys(fixed.jacobian),
            "SciPy, 2-point Jacobian": lambda: fixed.scipys("2-point"),
            "fit": fixed.ours,
        },
        rounds=7,
    )


def test_all_effects_in_one_model_against_geometry_alone(race, model, campaign):
    """Some 700 parameters, their sizes, sharp orders and cross-validation, in the time of some fifty fits of geometry."""
    plain, found = identify(model, campaign), explain(model, campaign)
    assert found.stages[0].parameters == len(plain.kept)
    assert np.abs(found.calibration.predict(campaign.q) - plain.predict(campaign.q)).max() < 1e-4
    race(
        "all effects, 60 rows",
        lambda: explain(model, campaign),
        {"identify": lambda: identify(model, campaign)},
        below=120.0,
        rounds=3,
    )

"""The robots of a study: how large their defects are, and what single poses add."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from taskcal.adaptation.hyperparameters import known_hyperparameters
from taskcal.errors import CampaignError
from taskcal.estimation.prior import GaussianPrior
from taskcal.identification.calibration import Calibration
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.tracker import TrackerNoise
from taskcal.measurement.virtual_cell import Truth, simulate
from taskcal.robot.approach import conditions_in_order
from taskcal.robot.conditions import Conditions
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.model_error import ModelError, model_error_of


@dataclass(frozen=True, eq=False, kw_only=True)
class VirtualRobots:
    """Robots of one model, which differ in their defects."""

    model: ErrorModel
    deviations: Float[np.ndarray, " p"]
    """Standard deviation of every parameter, metres and radians."""
    model_error: ModelError
    """What no parameter explains at a pose."""
    joint_error: Float[np.ndarray, " joints"]
    """Standard deviation of what every joint is off at a pose, radians (metres where it slides)."""
    origin: str = "drawn from the tolerances"
    """Where the sizes come from, in words."""
    prior: GaussianPrior | None = None
    """What a fit that is told the sizes expects; None for the tolerances."""

    @classmethod
    def of_tolerances(cls, model: ErrorModel, model_error: float | None) -> "VirtualRobots":
        """As the robot's file has them."""
        nothing = np.zeros(len(model.robot.joints))
        error = model_error_of(model.robot, model_error)
        return cls(model=model, deviations=model.tolerances, model_error=error, joint_error=nothing)

    @classmethod
    def like(cls, calibration: Calibration, model_error: float | None) -> "VirtualRobots":
        """Robots like one that was calibrated: its parameters of the sizes that were found, and what single poses added.

        Raises:
            CampaignError: the calibration has no prior, whose scale tells the sizes.
        """
        if calibration.prior_scale is None:
            raise CampaignError(
                "the calibration has no prior, and does not say how large the defects of such robots are; identify with a prior"
            )
        model, known = calibration.model, known_hyperparameters(calibration)
        joints = np.zeros(len(model.robot.joints))
        joints[: len(known.joint_error)] = known.joint_error
        stated = ModelError(position=known.model_error[0], source=known.origin)
        error = stated if model_error is None else model_error_of(model.robot, model_error)
        sizes = known.deviations(model)
        prior, origin = GaussianPrior.of_deviations(sizes), "with defects of the sizes that the calibration found"
        return cls(model=model, deviations=sizes, model_error=error, joint_error=joints, origin=origin, prior=prior)

    def draw(self, rng: np.random.Generator) -> Float[np.ndarray, " p"]:
        """Defects of one robot."""
        return rng.normal(size=len(self.model)) * self.deviations

    def conditions(self, q: Float[np.ndarray, "n joints"]) -> Conditions | None:
        """How poses are reached one after another, where the model asks."""
        return conditions_in_order(self.model.robot, q) if self.model.conditioned else None

    def measure(
        self,
        x: Float[np.ndarray, " p"],
        q: Float[np.ndarray, "n joints"],
        noise: TrackerNoise,
        rng: np.random.Generator,
        observe: str = "tracker",
    ) -> tuple[Campaign, Truth]:
        """A campaign, and the robot and cell that it is of; how it is measured as `simulate` has it."""
        if observe != "tracker":
            return simulate(
                self.model,
                q,
                rng=rng,
                x=x,
                noise=noise,
                model_error=self.model_error.position,
                joint_error=self.joint_error,
                observe=observe,
            )
        off = self._joints_off(q, rng)
        campaign, truth = simulate(
            self.model,
            q + off,
            rng=rng,
            x=x,
            noise=noise,
            conditions=self.conditions(q),
            model_error=self.model_error.position,
        )
        return replace(campaign, q=q), truth

    def unexplained(
        self, truth: Truth, q: Float[np.ndarray, "n joints"], rng: np.random.Generator
    ) -> Float[np.ndarray, "n 3"]:
        """What single poses add to the tool point at each pose, metres."""
        white = self.model_error.position * rng.normal(size=(len(q), 3))
        if not self.joint_error.any():
            return white
        conditions = self.conditions(q)
        return white + (truth.points(q + self._joints_off(q, rng), conditions) - truth.points(q, conditions))[:, 0]

    def _joints_off(self, q: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        return self.joint_error * rng.normal(size=q.shape) if self.joint_error.any() else np.zeros(q.shape)

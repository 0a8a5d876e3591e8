"""Model error and prior scale: what a fit needs beside the measurements, and what the marginal likelihood finds of it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.robot.error_model import ErrorModel


@dataclass(frozen=True, eq=False, kw_only=True)
class Hyperparameters:
    """Model error and prior scale: found by the evidence, known from a calibration, or assumed."""

    variances: Float[np.ndarray, " groups"]
    """Model error of position, m², and of rotation for poses, rad²."""
    prior_factor: float
    """Factor of the prior's covariance."""
    origin: str = "what the campaign shows"
    """Where the model error comes from, in words."""
    own: Float[np.ndarray, " p"] | None = None
    """Prior standard deviation of every parameter, where each effect of each joint has a size of its own."""
    joint_error: tuple[float, ...] = ()
    """Standard deviation of how far every joint stands off at a single pose, radians (metres where it slides)."""

    def __repr__(self) -> str:
        error = self.model_error
        rotation = "" if len(error) == 1 else f" and {error[1] * 1e3:.3g} mrad"
        return f"Hyperparameters(model error {error[0] * 1e3:.3g} mm{rotation}, prior × {self.prior_scale:.2g}: {self.origin})"

    @classmethod
    def of_deviations(
        cls, model_error: Sequence[float], prior_scale: float | None = None, origin: str = "as given"
    ) -> "Hyperparameters":
        """From standard deviations.

        Args:
            model_error: per axis, metres, and radians for poses.
            prior_scale: factor of the tolerances; None for one, as where a fit had no prior.
            origin: of the model error, in words.
        """
        factor = 1.0 if prior_scale is None else float(prior_scale) ** 2
        return cls(variances=np.square(np.asarray(model_error, dtype=float)), prior_factor=factor, origin=origin)

    @property
    def model_error(self) -> tuple[float, ...]:
        """Standard deviation per axis, metres, and radians for poses."""
        return tuple(float(d) for d in np.sqrt(self.variances))

    @property
    def prior_scale(self) -> float:
        """Factor of the prior's standard deviations."""
        return float(np.sqrt(self.prior_factor))

    def deviations(self, model: ErrorModel) -> Float[np.ndarray, " p"]:
        """Prior standard deviation of every parameter of a model, metres and radians.

        Raises:
            ValueError: they are known of other parameters.
        """
        if self.own is None:
            return model.tolerances * self.prior_scale
        if len(self.own) != len(model):
            raise ValueError(f"sizes are known of {len(self.own)} parameters, the model has {len(model)}")
        return self.own

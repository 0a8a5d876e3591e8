"""What is believed before the fit: a prior over the kept parameters, and next to nothing of tracker frame and targets."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.estimation.prior import GaussianPrior
from taskcal.identification.observation_layout import ObservationLayout
from taskcal.identification.problem import FrameLayout
from taskcal.measurement.observation.pose import TURN_PRIOR

BASE_PRIOR, TARGET_PRIOR = 10.0, 1.0
"""Standard deviations of tracker frame and targets about their registration, metres and radians: as good as none."""

UNOBSERVABLE_PRIOR = 1e-6
"""The same along directions in which the poses do not locate the targets: there they stay at the tool point."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Belief:
    """Prior over the kept parameters, their natural sizes, and the precision of the frames."""

    prior: GaussianPrior | None
    sizes: Float[np.ndarray, " kept"]
    frames: Float[np.ndarray, "frames frames"]
    """Prior precision of tracker frame and targets."""

    def precision(self, factor: float) -> Float[np.ndarray, "z z"]:
        """Of a whole estimate z, frames included."""
        k, count = len(self.sizes), len(self.sizes) + len(self.frames)
        out = np.zeros((count, count))
        if self.prior is not None:
            out[:k, :k] = self.prior.precision / factor
        out[k:, k:] = self.frames
        return out

    def covariance(self, factor: float) -> Float[np.ndarray, "z z"]:
        """Of a whole estimate z, where something is believed of every parameter."""
        k, count = len(self.sizes), len(self.sizes) + len(self.frames)
        out = np.zeros((count, count))
        if self.prior is not None:
            out[:k, :k] = factor * self.prior.covariance
        out[k:, k:] = np.linalg.inv(self.frames)
        return out

    def mean(self, start: Float[np.ndarray, " z"]) -> Float[np.ndarray, " z"]:
        """Of a whole estimate z, whose frames are believed where they start."""
        out = start.copy()
        out[: len(self.sizes)] = 0.0 if self.prior is None else self.prior.mean
        return out


def frame_precision(layout: FrameLayout) -> Float[np.ndarray, "frames frames"]:
    """Next to nothing is known of tracker frame and targets, but for directions that the poses do not determine."""
    count, base = len(layout.names) - len(layout.kept), layout.base_size
    deviation = np.where(np.arange(count) < base, BASE_PRIOR, TARGET_PRIOR)
    if isinstance(layout, ObservationLayout):
        deviation[count - sum(map(len, layout.own)) :] = np.concatenate([kind.deviations for kind in layout.kinds])
    else:
        deviation[12 if layout.turned else count :] = TURN_PRIOR
    out = np.diag(deviation**-2.0)
    held = layout.registration.unobservable / UNOBSERVABLE_PRIOR**2
    if isinstance(layout, ObservationLayout):
        at = np.concatenate([place[:3] for place in layout.places]) - len(layout.kept)
        from scipy.linalg import block_diag

        turned = np.asarray(block_diag(*_axes_of_places(layout)))
        out[np.ix_(at, at)] += turned.T @ held @ turned
    elif layout.pose:  # its error frame moves in the axes of the target
        X = layout.registration.T_tool_target[0, :3, :3]
        out[6:9, 6:9] += X.T @ held @ X
    else:
        out[6:, 6:] += held
    return out


def _axes_of_places(layout: ObservationLayout) -> list[Float[np.ndarray, "3 3"]]:
    """In which each target's place on the tool is counted."""
    registered = layout.registration.T_tool_target[:, :3, :3]
    return [X if kind.turned else np.eye(3) for X, kind in zip(registered, layout.kinds, strict=True)]


def belief_of(layout: FrameLayout, prior: GaussianPrior | str | None) -> Belief:
    """The belief in a layout: its tolerances, a prior that was given, or no prior.

    Raises:
        ValueError: the prior that was given is not one over the kept parameters.
    """
    frames = np.zeros((0, 0)) if layout.fixed_frames else frame_precision(layout)
    tolerances = layout.model.tolerances[layout.kept]
    if prior is None:
        return Belief(prior=None, sizes=tolerances, frames=frames)
    if isinstance(prior, GaussianPrior):
        if len(prior.mean) != len(layout.kept):
            raise ValueError(f"the prior has {len(prior.mean)} parameters, {len(layout.kept)} are kept")
        return Belief(prior=prior, sizes=np.sqrt(np.diag(prior.covariance)), frames=frames)
    return Belief(prior=GaussianPrior.of_deviations(tolerances), sizes=tolerances, frames=frames)

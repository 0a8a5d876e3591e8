"""What the uncertainty of a predicted point is made of (JCGM 100:2008, GUM): one line for each source that is independent."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from taskcal.errors import TaskcalError
from taskcal.identification.calibration import Calibration
from taskcal.kernels.chunks import in_chunks
from taskcal_groundwork.said import Said

COVERAGE_FACTOR = 2.0
"""k of the expanded uncertainty: 95 % along one direction, of a normal distribution."""

UNEXPLAINED = "what the model cannot explain, of a single pose"

REACHED = "pose-to-pose errors of the joints, and what is not told of approach, last move or warmth"

Evaluation = Literal["A", "B"]
"""A: from the residuals of this campaign; B: from what is known beforehand."""


@dataclass(frozen=True, kw_only=True)
class Contribution:
    """One source."""

    source: str
    evaluation: Evaluation
    deviation: float
    """Standard uncertainty in space, root mean square over the poses, metres."""


@dataclass(frozen=True, kw_only=True)
class UncertaintyBudget:
    """Independent contributions to the uncertainty of the first target where it is predicted."""

    contributions: tuple[Contribution, ...]

    @property
    def combined(self) -> float:
        """Combined standard uncertainty in space, metres."""
        return float(np.sqrt(sum(one.deviation**2 for one in self.contributions)))

    @property
    def expanded(self) -> float:
        """Expanded uncertainty along one axis, k = 2, metres: a third of the variance in space."""
        return COVERAGE_FACTOR * self.combined / np.sqrt(3.0)


def budget_at(calibration: Calibration, q: Float[np.ndarray, "n joints"]) -> UncertaintyBudget:
    """The budget of a predicted position, averaged over some poses.

    Args:
        calibration: the calibration.
        q: joint positions, radians.

    Raises:
        ClosureError: a closed loop cannot be assembled at some pose.
    """
    fitted = _mean_square(calibration.predict_covariance(q, model_error=False))
    all_in_all = _mean_square(calibration.predict_covariance(q))
    own_error = 3.0 * calibration.model_error[0] ** 2 * float(calibration.growth_at(q).mean())
    rest = max(all_in_all - fitted - own_error, 0.0)
    parts: list[tuple[str, Evaluation, float]] = [
        ("parameters, tracker frame and target: posterior covariance", "A", fitted),
        (UNEXPLAINED, evaluation_of_model_error(calibration), own_error),
        (REACHED, "A", rest),
    ]
    return budget_of_parts(parts)


def budget_of_parts(parts: Iterable[tuple[str, Evaluation, float]]) -> UncertaintyBudget:
    """Make the budget of mean squares in 3D, metres²; negligible parts are left out."""
    return UncertaintyBudget(
        contributions=tuple(
            Contribution(source=source, evaluation=kind, deviation=float(np.sqrt(square)))
            for source, kind, square in parts
            if square > 1e-18
        )
    )


def evaluation_of_model_error(calibration: Calibration) -> Evaluation:
    """A where the fit estimated it, B where it was given."""
    return "A" if calibration.provenance.options.get("model_error", "estimate") == "estimate" else "B"


# Where a calibration says less than the drawing of the robot.

UNKNOWN_FROM = 3.0
"""Uncertainty of the tool, as a multiple of what the tolerances make of it, from which on a calibration is not used. A convention:
of sound campaigns, measured ones too, it is 0.3 to 2.3 all over the joints' ranges; of two joints in motion 40 to 61 there, and
0.6 to 2.4 at the measured poses, where such a calibration serves. Of the measured WAM, whose joints err by several times its
tolerances, it is 5."""


def why_unknown(calibration: Calibration, q: Float[np.ndarray, "n joints"]) -> str:
    """Why nothing that a calibration says at some poses is to be used; empty where it knows as much as tolerances do.

    Args:
        calibration: the calibration.
        q: joint positions, radians.
    """
    if not len(q):
        return ""
    parts = in_chunks(lambda rows: _stated_and_allowed(calibration, q[rows]), len(q))
    stated, allowed = (float(np.sqrt(np.concatenate(own).mean())) for own in zip(*parts, strict=True))
    if stated <= UNKNOWN_FROM * allowed:
        return ""
    return Said(
        "the calibration is uncertain there by {stated:.3g} mm (3D rms, 1σ), {times:.0f} times as much as the tolerances of a "
        "robot that was never calibrated ({allowed:.2g} mm): its rows tell too little of these poses. Measure more poses near them",
        stated=stated * 1e3,
        times=stated / allowed,
        allowed=allowed * 1e3,
    )


def _stated_and_allowed(
    calibration: Calibration, q: Float[np.ndarray, "n joints"]
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Variances of the tool's place in 3D, metres²: as the calibration states them, and by the tolerances alone."""
    model = calibration.model
    by_tolerance = model.jacobian(q, calibration.estimate)[:, :3] * model.tolerances
    # What grows beyond the measured range is the error of what is predicted. Where the tool is beside the target does not grow, nor
    # where the base is: the one is in the tool's covariance in the base, the other in the target's in the tracker frame.
    growth = calibration.growth_at(q)
    tool = np.trace(calibration.tool_covariance(q, frame="base", model_error=False)[:, :3, :3], axis1=1, axis2=2)
    target = np.trace(calibration.predict_covariance(q, model_error=False)[..., :3, :3], axis1=2, axis2=3).mean(axis=1)
    stated = tool / growth + (1.0 - 1.0 / growth) * np.minimum(tool, target)
    return stated, (by_tolerance**2).sum(axis=(1, 2))


def check_known(calibration: Calibration, q: Float[np.ndarray, "n joints"], what: str) -> None:
    """See that a calibration knows something of some poses.

    Args:
        calibration: the calibration.
        q: joint positions, radians.
        what: is to be done there, and with what.

    Raises:
        TaskcalError: it knows less than the robot's tolerances do.
    """
    refuse_unknown(why_unknown(calibration, q), what)


def refuse_unknown(why: str, what: str) -> None:
    """Refuse what would be done where `why_unknown` says why not.

    Raises:
        TaskcalError: it does.
    """
    if why:
        raise TaskcalError(
            Said("{what}: {why}, or accept that (--accept-uncertain; accept_uncertain=True)", what=what, why=why)
        )


def _mean_square(covariance: Float[np.ndarray, "n targets b b"]) -> float:
    return float(np.trace(covariance[:, 0, :3, :3], axis1=1, axis2=2).mean())

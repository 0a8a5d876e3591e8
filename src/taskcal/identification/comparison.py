"""What changed between two calibrations of a robot: in millimetres where it works, and in parameters over their uncertainty.

Tracker frame and targets do not count. The TCPs of both are put on each other by the best rigid motion of the base and the
best offset on the tool; what is left, r, is what the robot itself does otherwise. Were it unchanged, r would be normal with the
covariance S = P·(J₁·C₁·J₁ᵀ + J₂·C₂·J₂ᵀ)·P, where C are the covariances of the two estimates, taken as independent, J the
Jacobians, and P takes out what frames can do; rᵀ·S⁺·r is then χ²-distributed. They have their prior in common, so that this is
cautious: of directions that only the prior holds, nothing differs.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from jaxtyping import Float

from taskcal.arguments import checked
from taskcal.errors import TaskcalError, WrongValue
from taskcal.estimation.matrices import single_threaded
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.robot.parameter import ShownUnit
from taskcal.short_repr import short_repr

LEVEL = 0.01
"""Probability of calling a robot changed that is not. A convention: the 1 % of the tests for drift and for a fleet's outliers."""

MAX_POSES = 300
"""Poses, at most, at which two calibrations are compared where none are given. A convention that bounds the time."""

NEGLIGIBLE = 1e-7
"""Standard deviation of the difference, metres, below which a direction is taken as known to that."""

MAX_TOLERANCES = 20.0
"""Change over its tolerance, at most, that a parameter is believed to have. A convention: frames hide what would have to change
by more."""

ALIGNMENTS = 3
"""Steps in which the TCPs are put on each other; each leaves what is of second order in the step."""


@dataclass(frozen=True, kw_only=True)
class ChangedParameter:
    """A parameter in both calibrations, in SI units."""

    name: str
    unit: ShownUnit
    """In which people see it."""
    first: float
    second: float
    standard_error: float
    """Of the difference."""

    @property
    def over_sigma(self) -> float:
        """The difference over its standard error."""
        return (self.second - self.first) / self.standard_error if self.standard_error > 0.0 else 0.0


@dataclass(frozen=True, kw_only=True)
class Resemblance:
    """A parameter whose change alone would look much like the difference."""

    name: str
    unit: ShownUnit
    amount: float
    """By how much it would have changed, SI."""
    share: float
    """Of the square of the difference that it would explain."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Comparison:
    """Differences between two calibrations of one robot, frames projected out."""

    q: Float[np.ndarray, "n joints"]
    """Poses at which they were compared, radians."""
    difference: Float[np.ndarray, "n points 3"]
    """Second less first TCP, frames fitted, in the axes of the base, metres."""
    expected: float
    """Rms in space that their uncertainties alone would give, metres."""
    chance: float
    """That a robot that has not changed shows as much."""
    unexplained: float
    """What the models of the two leave unexplained at a single pose, the larger, metres in space (1σ)."""
    parameters: tuple[ChangedParameter, ...]
    """Those in both, the most changed first; empty where the nominal robots differ."""
    resembles: tuple[Resemblance, ...]
    """Parameters of which a change alone would look the most like it."""
    remarks: tuple[str, ...] = ()

    @property
    def rms(self) -> float:
        """Rms of the difference in space, metres."""
        return float(np.sqrt(np.mean(np.sum(self.difference**2, axis=2))))

    @property
    def maximum(self) -> float:
        """Largest difference in space, metres."""
        return float(np.linalg.norm(self.difference, axis=2).max())

    @property
    def excess(self) -> float:
        """Rms in space beyond what the uncertainties explain, metres."""
        return float(np.sqrt(max(self.rms**2 - self.expected**2, 0.0)))

    @property
    def verdict(self) -> Literal["unchanged", "small", "changed"]:
        """Whether chance explains the difference; if not, whether it is larger than what the models leave unexplained.

        What a model leaves unexplained is not the same everywhere, so that calibrations from different poses differ by a part of
        it though nothing has happened.
        """
        if self.chance >= LEVEL:
            return "unchanged"
        return "changed" if self.excess > self.unexplained else "small"

    def is_due(self, accuracy: float) -> bool:
        """Whether the first calibration, used today, is off by more than an accuracy, metres rms in space, for what changed."""
        return self.verdict != "unchanged" and self.excess > accuracy

    def summary(self) -> dict[str, Any]:
        """The comparison in millimetres and milliradians."""
        return {
            "poses": len(self.q),
            "rms_mm": self.rms * 1e3,
            "max_mm": self.maximum * 1e3,
            "expected_mm": self.expected * 1e3,
            "chance": self.chance,
            "unexplained_mm": self.unexplained * 1e3,
            "verdict": self.verdict,
            "resembles": [
                {"name": r.name, "unit": r.unit.name, "amount": r.amount * r.unit.factor, "share": r.share}
                for r in self.resembles
            ],
            "parameters": [
                {
                    "name": p.name,
                    "unit": p.unit.name,
                    "first": p.first * p.unit.factor,
                    "second": p.second * p.unit.factor,
                    "standard_error": p.standard_error * p.unit.factor,
                    "over_sigma": p.over_sigma,
                }
                for p in self.parameters
            ],
            "remarks": list(self.remarks),
        }


@checked
@single_threaded
def compare(first: Calibration, second: Calibration, q: Float[np.ndarray, "n joints"] | None = None) -> Comparison:
    """Compare two calibrations of one robot, whatever their parameters, targets and tracker frames.

    Args:
        first: the earlier one.
        second: the later one.
        q: poses at which it matters, radians; by default those at which both were measured.

    Raises:
        WrongValue: there are no poses.
        TaskcalError: robots with different joints, or no poses where the files do not tell those measured.
        ClosureError: a closed loop cannot be assembled at some pose.
    """
    robots = first.model.robot, second.model.robot
    if robots[0].joint_names != robots[1].joint_names:
        raise TaskcalError(
            f"{robots[0].name} has the joints {', '.join(robots[0].joint_names)}, {robots[1].name} "
            f"{', '.join(robots[1].joint_names)}: calibrations of one robot can be compared"
        )
    q = _measured(first, second) if q is None else np.asarray(q, dtype=float)
    robots[0].check_radians(q)
    if not len(q):
        raise WrongValue("q has no rows; give the poses at which a difference matters, or leave it out")
    tips = first.T_tool_target[:, :3, 3]
    T = first.tool_in_base(q)
    start = np.stack([se3.apply(T, tip) for tip in tips], axis=1)
    residual = fit_frames(second.tool_in_base(q), tips, start)[2].ravel()
    basis = np.linalg.qr(_frame_columns(T[:, :3, :3], start))[0]
    spread = [spread_without_frames(calibration, q, tips, basis) for calibration in (first, second)]
    same = robots[0].digest == robots[1].digest
    remarks = () if same else ("their nominal robots differ, so that parameters mean different things",)
    return Comparison(
        q=q,
        difference=residual.reshape(start.shape),
        expected=float(np.sqrt(sum(float(np.sum(part**2)) for part in spread) / (len(q) * len(tips)))),
        chance=_chance(residual, np.hstack(spread)),
        unexplained=float(np.sqrt(3.0) * max(first.model_error[0], second.model_error[0])),
        parameters=_parameters(first, second) if same else (),
        resembles=_resembling(second, q, tips, basis, residual),
        remarks=remarks,
    )


def _measured(first: Calibration, second: Calibration) -> Float[np.ndarray, "n joints"]:
    """Poses at which both were measured, some of them where there are many."""
    q = np.concatenate([first.q, second.q])
    return q[np.unique(np.linspace(0, len(q) - 1, min(len(q), MAX_POSES)).astype(int))]


def _frame_columns(R: Float[np.ndarray, "n 3 3"], points: Float[np.ndarray, "n points 3"]) -> Float[np.ndarray, "m f"]:
    """Derivative of the points by a small motion of the base and a small offset of every point on the tool."""
    n, k = points.shape[:2]
    columns = np.zeros((n, k, 3, 6 + 3 * k))
    columns[..., :6] = se3.by_twist(points)
    for t in range(k):
        columns[:, t, :, 6 + 3 * t : 9 + 3 * t] = R
    return columns.reshape(3 * n * k, -1)


def fit_frames(
    T: Float[np.ndarray, "n 4 4"],
    tips: Float[np.ndarray, "points 3"],
    start: Float[np.ndarray, "n points 3"],
    steps: int = ALIGNMENTS,
) -> tuple[Float[np.ndarray, "n 4 4"], Float[np.ndarray, "points 3"], Float[np.ndarray, "n points 3"]]:
    """Move the base of poses and offset points on the tool, so that these are as near to others as can be.

    Args:
        T: poses of the tool, near those that the others are of.
        tips: points on the tool, metres.
        start: the others.
        steps: of Gauss and Newton.

    Returns:
        The poses, moved; the points on the tool; what is left, metres.
    """

    def left() -> Float[np.ndarray, "n points 3"]:
        return np.stack([se3.apply(T, tip) for tip in tips], axis=1) - start

    for _ in range(steps):
        step = np.linalg.lstsq(_frame_columns(T[:, :3, :3], start), left().ravel(), rcond=1e-10)[0]
        T = se3.inverse(se3.pose(se3.exp(step[3:6]), step[:3])) @ T
        tips = tips - step[6:].reshape(tips.shape)
    return T, tips, left()


def _jacobian(calibration: Calibration, q: np.ndarray, tips: np.ndarray) -> Float[np.ndarray, "m z"]:
    """Derivative of the TCPs by the entries of z, in the axes of the base."""
    J, turn = calibration.tool_jacobian(q), calibration.predict_tool(q)[:, :3, :3]
    at_tips = np.stack([se3.carry(J, turn @ tip)[:, :3] for tip in tips], axis=1)
    return (calibration.T_tracker_base[:3, :3].T @ at_tips).reshape(-1, J.shape[2])


def spread_without_frames(
    calibration: Calibration, q: np.ndarray, tips: np.ndarray, basis: np.ndarray | None = None
) -> Float[np.ndarray, "m z"]:
    """B with B·Bᵀ the covariance of points on the tool, without what frames can do.

    Args:
        calibration: the robot.
        q: joint positions, radians or metres.
        tips: the points on the tool (points, 3), metres.
        basis: what frames can do, orthonormal (m, f); computed where it is not given.
    """
    if basis is None:
        T = calibration.tool_in_base(q)
        points = np.stack([se3.apply(T, tip) for tip in tips], axis=1)
        basis = np.linalg.qr(_frame_columns(T[:, :3, :3], points))[0]
    values, vectors = np.linalg.eigh(calibration.z_covariance)
    B = _jacobian(calibration, q, tips) @ (vectors * np.sqrt(np.maximum(values, 0.0)))
    return B - basis @ (basis.T @ B)


def _chance(residual: Float[np.ndarray, " m"], spread: Float[np.ndarray, "m z"]) -> float:
    """Probability of normal errors of this spread as far from zero."""
    U, s, _ = np.linalg.svd(spread, full_matrices=False)
    known = s > 1e-6 * s.max(initial=0.0)
    if not known.any():
        return float(np.abs(residual).max() < NEGLIGIBLE)
    from scipy.special import chdtrc

    along = U[:, known].T @ residual
    return float(chdtrc(int(known.sum()), np.sum(along**2 / (s[known] ** 2 + NEGLIGIBLE**2))))


def _parameters(first: Calibration, second: Calibration) -> tuple[ChangedParameter, ...]:
    """Parameters estimated in both, the most changed first."""
    out: list[ChangedParameter] = []
    for i in first.estimated:
        p = first.model.parameters[i]
        if p.name not in second.kept:
            continue
        k = second.names.index(p.name)
        error = float(np.hypot(first.standard_errors[i], second.standard_errors[k]))
        out.append(
            ChangedParameter(
                name=p.name,
                unit=p.shown,
                first=float(first.estimate[i]),
                second=float(second.estimate[k]),
                standard_error=error,
            )
        )
    return tuple(sorted(out, key=lambda p: -abs(p.over_sigma)))


def _resembling(
    calibration: Calibration, q: np.ndarray, tips: np.ndarray, basis: np.ndarray, residual: np.ndarray
) -> tuple[Resemblance, ...]:
    """The three parameters of which a change alone explains the most of a difference."""
    p = len(calibration.model)
    columns = _jacobian(calibration, q, tips)[:, :p]
    columns = columns - basis @ (basis.T @ columns)
    size, along = np.sum(columns**2, axis=0), columns.T @ residual
    whole = float(residual @ residual)
    seen = size > 1e-9 * size.max(initial=0.0)
    if whole == 0.0:
        return ()
    amount = np.where(seen, along / np.where(seen, size, 1.0), 0.0)
    seen &= np.abs(amount) <= MAX_TOLERANCES * calibration.model.tolerances
    share = np.where(seen, amount * along / whole, 0.0)
    best: Sequence[int] = np.argsort(-share, kind="stable")[:3].tolist()
    parameters = calibration.model.parameters
    return tuple(
        Resemblance(name=parameters[i].name, unit=parameters[i].shown, amount=float(amount[i]), share=float(share[i]))
        for i in best
        if share[i] > 0.0
    )

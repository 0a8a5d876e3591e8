"""Joints or points that were written with so few digits that this alone explains what a fit leaves."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.identification.residual_analysis import MIN_VARIATION
from taskcal.robot.robot import Robot

DIGITS = tuple(10.0**-k for k in range(6))
"""Steps that are looked for, of degrees, of millimetres and of radians, the coarsest first."""

WRITTEN = 1e-7
"""Distance from a multiple, in steps, up to which a value is one. A convention: far above the rounding of radians and degrees."""

WORTH_RATIO = (0.7, 2.0)
"""Share of the residual that the last digit is worth: less explains no half of its square. Of values that are as exact as they are
round, such as programmed ones, it is worth more than is left; 2 allows for what a fit of few rows follows."""

MIN_WRITTEN_ROWS = 10
"""Rows from which on digits are looked at. A convention: that all are multiples by chance takes 10⁻¹⁰ with as many."""


@dataclass(frozen=True, kw_only=True)
class FewDigits:
    """Values that were written with so few digits that this explains what a fit leaves."""

    of: str
    """What was written: ``joints``, ``points``."""
    step: str
    """Of the last digit, with its unit."""
    worth: float
    """What rounding to it makes of the points, root mean square, metres."""
    left: float
    """What the fit leaves, root mean square, metres."""

    @property
    def values(self) -> dict[str, str | float]:
        """That its sentence is filled with, in millimetres."""
        return {"of": self.of, "step": self.step, "worth": self.worth * 1e3, "left": self.left * 1e3}


def find_few_digits(
    q: Float[np.ndarray, "n joints"],
    points: Float[np.ndarray, "m 3"],
    columns: Float[np.ndarray, "m 3 joints"],
    left: float,
    robot: Robot,
) -> FewDigits | None:
    """Whether joints or points were rounded to what alone explains a residual; errors of rounding are uniform in a step.

    Args:
        q: joint positions as written.
        points: as written, metres.
        columns: derivatives of the points by the joint positions as written, metres and radians.
        left: root mean square distance that a fit leaves, metres.
        robot: that was measured.
    """
    if len(q) < MIN_WRITTEN_ROWS or len(points) < MIN_WRITTEN_ROWS:
        return None
    slides, moving = np.array(robot.prismatic), np.ptp(q, axis=0) > MIN_VARIATION
    by_joint = (columns**2).sum(axis=1).mean(axis=0)
    turning, sliding = moving & ~slides, moving & slides
    found: list[FewDigits] = []
    for values, size, unit, scale in (
        (q[:, turning], by_joint[turning].sum(), "°", np.pi / 180.0),
        (q[:, turning], by_joint[turning].sum(), " rad", 1.0),
        (q[:, sliding], by_joint[sliding].sum(), " mm", 1e-3),
        (points, 3.0, " mm", 1e-3),
    ):
        step = _written_to(values / scale)
        worth = 0.0 if step is None else float(np.sqrt(size / 12.0)) * step * scale
        if step is not None and WORTH_RATIO[0] * left < worth < WORTH_RATIO[1] * left:
            of = "points" if values is points else "joints"
            found.append(FewDigits(of=of, step=f"{step:g}{unit}", worth=worth, left=left))
    return max(found, key=lambda one: one.worth, default=None)


def _written_to(values: np.ndarray) -> float | None:
    """The coarsest of `DIGITS` of which all values are multiples; None where there is none."""
    return next((d for d in DIGITS if values.size and (np.abs(values / d - np.rint(values / d)) < WRITTEN).all()), None)


def few_digits_of(calibration: Calibration) -> FewDigits | None:
    """Digits that alone explain what a calibration of the geometry leaves; None where they do not, or no tracker measured all.

    Args:
        calibration: of all rows that were fitted.
    """
    layout = calibration.layout
    if not layout.tracked or calibration.model.effects or layout.stations is not None:
        return None
    row, target = np.nonzero(np.isfinite(calibration.residuals[..., 0]))
    left, q = calibration.residuals[row, target, :3], calibration.q
    points = calibration.target_poses(q)[row, target, :3, 3] + left
    J = calibration.model.joint_jacobian(q, calibration.estimate)[row]
    arm = (calibration.tool_in_base(q)[row, :3, :3] @ calibration.T_tool_target[target, :3, 3:])[..., 0]
    unknowns = len(layout.names) if calibration.effective_parameters is None else calibration.effective_parameters + 9.0
    freedom = max(1.0 - unknowns / left.size, 0.5)
    return find_few_digits(
        q,
        points,
        se3.carry(J, arm)[:, :3],
        float(np.sqrt((left**2).sum() / len(left) / freedom)),
        calibration.model.robot,
    )

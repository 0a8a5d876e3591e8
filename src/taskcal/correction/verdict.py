"""The verdict: whether the error to be expected keeps a task's tolerance, and what to do about the largest share of it.

For the target that was measured, the tool's point and the program on its part, since each adds sources to the one before. An
error is expected with a 95 % interval: errors of geometry, tool and part are the same at all poses, so that no number of poses
averages them out.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from jaxtyping import Float

from taskcal.correction.cell import Cell, Measured
from taskcal.correction.correction import Correction, ErrorBudget, budget_of
from taskcal.correction.frames import (
    FixedFrame,
    FrameCalibration,
    GraspedFrame,
    grasped_frame,
    uncertainty_at,
)
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.identification.problem import Rows
from taskcal.robot.conditions import Conditions
from taskcal.task.task import Task, reach_task

Subject = Literal["measured target", "tool point", "program on the part"]
Decision = Literal["met", "not met", "not known"]


@dataclass(frozen=True, kw_only=True)
class Judgement:
    """The verdict for one subject."""

    subject: Subject
    budget: ErrorBudget | None
    """The error to be expected; None where it is not known."""
    tolerance: float | None
    """Of the task, 3D rms, metres; None where none is stated."""
    reason: str
    """Why it is not known whether the tolerance is met; empty where it is."""

    @property
    def decision(self) -> Decision:
        """Met if all of the interval keeps the tolerance, not met if nothing of it does."""
        if self.reason or self.budget is None or self.tolerance is None:
            return "not known"
        return "met" if self.budget.interval[1] <= self.tolerance else "not met"

    def summary(self) -> dict[str, Any]:
        """In millimetres."""
        budget = self.budget
        known = budget is not None
        return {
            "subject": self.subject,
            "decision": self.decision,
            "tolerance_mm": None if self.tolerance is None else self.tolerance * 1e3,
            "expected_mm": budget.after * 1e3 if known else None,
            "interval_mm": [bound * 1e3 for bound in budget.interval] if known else None,
            "largest": budget.largest[0] if known else None,
            "share": budget.largest[1] if known else None,
            "remedy": budget.largest[2] if known else None,
            "reason": self.reason,
        }


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """The verdict for the measured target, the tool's point and the program on its part."""

    task: str
    """Name of the task; empty where the program's targets stand for one."""
    judgements: tuple[Judgement, ...]

    def summary(self) -> dict[str, Any]:
        """In millimetres."""
        return {"task": self.task, "judgements": [one.summary() for one in self.judgements]}


def judge(
    calibration: Calibration,
    task: Task | None = None,
    correction: Correction | None = None,
    cell: Cell | None = None,
    seed: int = 0,
) -> Verdict:
    """Judge a calibration over a task, and a program that was corrected by it.

    The measured target and the tool's point are judged over the task, in the branch in which the robot was measured, or where there
    is none at the program's targets, or where it was measured where none of these is known. The tool is that of the program's
    first motion, or the robot file's.

    Args:
        calibration: the calibration.
        task: with the tolerance (`Task.accuracy`).
        correction: of the program.
        cell: what was measured of its tools and parts.
        seed: of the poses that fill the task's workspace.

    Raises:
        ReachError: the robot does not reach the task.
        TaskcalError: neither a task nor a program; or what was measured of the tool does not fit.
    """
    tolerance = None if task is None else task.accuracy
    if task is not None:
        poses = reach_task(calibration.model, task, seed=seed, known=calibration.q)
        q, weights = poses.q, poses.weights
    elif correction is not None:
        targets = correction.after.q[correction.after.at_target]
        q, weights = targets if len(targets) else calibration.q, None
    else:
        raise TaskcalError("a verdict needs a task, or a corrected program")
    unstated = "" if tolerance is not None else "no tolerance is stated"
    held: dict[Subject, GraspedFrame] = {
        "measured target": _target(calibration),
        "tool point": _tool(calibration, correction, cell or Cell()),
    }
    seen = None if calibration.held_out is None else calibration.held_out.validation.rms
    judgements: list[Judgement] = []
    for subject, grasped in held.items():
        frame = FrameCalibration(
            calibration=calibration, grasped=grasped, fixed=_tracker(calibration), part_in_hand=False
        )
        uncertainty = uncertainty_at([frame], np.zeros(len(q), dtype=np.int64), q, weights=weights)
        judgements.append(_judgement(subject, budget_of(_NONE, _NONE, uncertainty), tolerance, unstated, seen))
    program, missing = (None, "no program was corrected yet") if correction is None else (correction.budget, unstated)
    if correction is not None and not len(correction.after.q):
        program, missing = None, "no target of the program is known"
    judgements.append(_judgement("program on the part", program, tolerance, missing, seen))
    return Verdict(task="" if task is None else task.name, judgements=tuple(judgements))


_NONE = np.zeros(0)
"""No predicted errors: the calibrated model's own are what is corrected."""


def _judgement(
    subject: Subject, budget: ErrorBudget | None, tolerance: float | None, missing: str, seen: float | None
) -> Judgement:
    """The verdict for a subject.

    Args:
        subject: whose.
        budget: the error to be expected of it, where it is known.
        tolerance: 3D rms, metres, where one is stated.
        missing: why nothing can be said; empty where it can.
        seen: error of held-out rows, 3D rms, metres; they contradict a smaller expectation.
    """
    reason = missing
    if budget is not None and tolerance is not None:
        low, high = budget.interval
        if low <= tolerance < high:
            reason = "the tolerance lies within the interval"
        elif seen is not None and high <= tolerance < seen:
            reason = "held-out rows were farther off than the tolerance"
    return Judgement(subject=subject, budget=budget, tolerance=tolerance, reason=reason)


def _tool(calibration: Calibration, correction: Correction | None, cell: Cell) -> GraspedFrame:
    """What the robot holds in the program, or its own tool."""
    if correction is None or not correction.program.motions:
        own = calibration.model.robot.T_flange_tool
        return grasped_frame(calibration, Measured(name="tool"), own)
    move = correction.program.motions[0]
    held, measured = (move.part, cell.part) if move.part_in_hand else (move.tool, cell.tool)
    return grasped_frame(calibration, measured(held.name), held.T)


def _target(calibration: Calibration) -> GraspedFrame:
    """The first measured target, as if the robot held it."""
    T = calibration.T_tool_target[0]

    def twists(q: Float[np.ndarray, "n joints"], conditions: Conditions | None) -> Float[np.ndarray, "n 6 z"]:
        rows = Rows.of_targets(calibration.layout, calibration.z, q, calibration.model.prepare(q, conditions))
        moved = rows.linearise().by_entry[:, :3]
        return np.concatenate([moved, np.zeros_like(moved)], axis=1)  # its rotation moves no point at its own origin

    return GraspedFrame(T_tool_grasped=T, statement="", twists=twists, covariance=np.zeros((3, 3)))


def _tracker(calibration: Calibration) -> FixedFrame:
    """The tracker's frame, in which the target is predicted."""
    return FixedFrame(
        T_base_fixed=se3.inverse(calibration.T_tracker_base),
        statement="",
        follows_base=False,
        twist=None,
        covariance=np.zeros((6, 6)),
    )

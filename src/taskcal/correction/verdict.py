"""The verdict: whether the error to be expected keeps a task's tolerance, and what to do about the largest share of it.

For the target that was measured, the tool's point and the program on its part, since each adds sources to the one before. An
error is expected with a 95 % interval: errors of geometry, tool and part are the same at all poses, so that no number of poses
averages them out.

What was not looked at is never met. A tool of which nothing was measured is where the controller or the robot file has it, and no
data tell how far it is from there: its error is what tolerances allow, not what was found. Likewise a program of which a motion
was left as it was, or is corrected at run time, goes to the part with an error that is not in the figures.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np
from jaxtyping import Float

from robot_programs.core.program import Motion
from robot_programs.core.source import Place
from taskcal.correction.cell import Cell, Measured
from taskcal.correction.correction import REMEDIES, Correction, ErrorBudget, budget_of
from taskcal.correction.frames import (
    FixedFrame,
    FrameCalibration,
    GraspedFrame,
    grasped_frame,
    uncertainty_at,
)
from taskcal.correction.path import distinct_frames
from taskcal.errors import TaskcalError, listed, shortened
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.identification.problem import Rows
from taskcal.robot.conditions import Conditions, conditions_in_order
from taskcal.task.task import Task, reach_task
from taskcal_groundwork.said import Said

Subject = Literal["measured target", "tool point", "program on the part"]
Decision = Literal["met", "not met", "not known"]

RULE = (
    "Met: the whole 95 % interval of the expected error (3D rms) is within the tolerance. Not met: none of it is. Not known: the "
    "tolerance lies within it, or the error has a part that was not measured, read or corrected."
)
"""The rule of every decision on a tolerance; `taskcal validate --accept` holds the same statistic of measured errors against it."""

Why = Literal[
    "no tolerance is stated",
    "no corrected program was given",
    "no target of the program is known",
    "the tolerance lies within the interval",
    "held-out rows were farther off than the tolerance",
    "the calibration is in doubt",
    "the controller's kinematics are not stated",
    "nothing was measured of the tool",
    "nothing was measured of the part",
    "motions were not read",
    "motions were rejected",
    "motions are corrected at run time and not assessed",
    "motions go to targets whose error is not known",
    "the correction is smaller than its uncertainty",
    "the calibration knows less there than the robot's tolerances do",
]

MAX_PLACES = 12
"""Motions that a reason names; the remarks of a correction have all."""


@dataclass(frozen=True, kw_only=True)
class Reason:
    """Why it is not known whether a tolerance is met."""

    why: Why
    detail: str = ""
    """Of what, or which motions and how many."""
    remedy: str = ""
    """What to measure."""


@dataclass(frozen=True, kw_only=True)
class Judgement:
    """The verdict for one subject."""

    subject: Subject
    budget: ErrorBudget | None
    """The error to be expected; None where it is not known."""
    tolerance: float | None
    """Of the task, 3D rms, metres; None where none is stated."""
    reasons: tuple[Reason, ...] = ()
    """Why it is not known whether the tolerance is met; empty where it is."""

    @property
    def decision(self) -> Decision:
        """Met if all of the interval keeps the tolerance, not met if nothing of it does."""
        if self.reasons or self.budget is None or self.tolerance is None:
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
            "reasons": [asdict(reason) for reason in self.reasons],
        }


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """The verdict for the measured target, the tool's point and the program on its part."""

    task: str
    """Name of the task; empty where the program's targets stand for one."""
    program: str = ""
    """Files of the program that was corrected; empty where none was."""
    tool: str
    """Whose point is judged, and where it is taken."""
    override: Reason | None = None
    """Why the program would not have been written, had that not been accepted for this one run."""
    judgements: tuple[Judgement, ...]

    def summary(self) -> dict[str, Any]:
        """In millimetres."""
        return {
            "task": self.task,
            "program": self.program,
            "tool": self.tool,
            "rule": RULE,
            "override": None if self.override is None else asdict(self.override),
            "judgements": [one.summary() for one in self.judgements],
        }


def judge(
    calibration: Calibration,
    task: Task | None = None,
    correction: Correction | None = None,
    cell: Cell | None = None,
    seed: int = 0,
    *,
    accept_uncertain: bool = False,
) -> Verdict:
    """Judge a calibration over a task, and a program that was corrected by it.

    The measured target and the tool's point are judged over the task, in the branch in which the robot was measured, or where there
    is none at the program's targets, or where it was measured where none of these is known. The tool is that of the program's
    first motion to a pose, or the robot file's.

    A program that is not written for its uncertainty is not known, unless that is accepted.

    Args:
        calibration: the calibration.
        task: with the tolerance (`Task.accuracy`).
        correction: of the program.
        cell: what was measured of its tools and parts.
        seed: of the poses that fill the task's workspace.
        accept_uncertain: whether the program is written even so; then that is the verdict's `override`.

    Raises:
        ReachError: the robot does not reach the task.
        TaskcalError: neither a task nor a program; or what was measured of the tool does not fit.
    """
    tolerance = None if task is None else task.accuracy
    if task is not None:
        poses = reach_task(calibration.model, task, seed=seed, known=calibration.q)
        q, weights, conditions = poses.q, poses.weights, None
    elif correction is not None:
        at_target = correction.after.at_target
        q, weights, conditions = correction.after.q[at_target], None, None
        if len(q):  # the program tells from which side each drive comes to its targets
            ways = conditions_in_order(calibration.model.robot, correction.after.q).approach
            conditions = Conditions(approach=None if ways is None else ways[at_target])
        else:
            q = calibration.q
    else:
        raise TaskcalError("a verdict needs a task, or a corrected program")
    cell = cell or Cell()
    common = () if tolerance is not None else (Reason(why="no tolerance is stated"),)
    common += tuple(Reason(why="the calibration is in doubt", detail=doubt) for doubt in calibration.doubts)
    motions = [move for move in (() if correction is None else correction.program.motions) if _touches(move)]
    held: dict[Subject, tuple[GraspedFrame, tuple[Reason, ...]]] = {
        "measured target": (_target(calibration), ()),
        "tool point": _tool(calibration, motions, cell),
    }
    seen = None if calibration.held_out is None else calibration.held_out.validation.rms
    judgements: list[Judgement] = []
    tracker = FixedFrame(T_base_fixed=se3.inverse(calibration.T_tracker_base))
    for subject, (grasped, reasons) in held.items():
        frame = FrameCalibration(calibration=calibration, grasped=grasped, fixed=tracker, part_in_hand=False)
        uncertainty = uncertainty_at([frame], np.zeros(len(q), dtype=np.int64), q, conditions, weights)
        budget = budget_of(_NONE, _NONE, uncertainty)
        judgements.append(_judgement(subject, budget, tolerance, (*common, *reasons), seen))
    name, tool = "" if task is None else task.name, held["tool point"][0].statement if motions else OWN_TOOL
    if correction is None:
        reasons = (Reason(why="no corrected program was given"),)
        judgements.append(_judgement("program on the part", None, tolerance, reasons, seen))
        return Verdict(task=name, tool=tool, judgements=tuple(judgements))
    doubt = _doubt(correction)
    reasons = (
        *common,
        *(
            (Reason(why="the controller's kinematics are not stated", remedy=correction.asked),)
            if correction.asked
            else ()
        ),
        *(() if len(correction.after.q) else (Reason(why="no target of the program is known"),)),
        *_left(correction),
        *_unmeasured(motions, cell, held=True),
        *(() if doubt is None or accept_uncertain else (doubt,)),
    )
    budget = correction.budget if len(correction.after.q) else None
    program = _judgement("program on the part", budget, tolerance, reasons, seen)
    if program.decision == "not met" and correction.budget.largest[0] == "part":
        program = replace(program, reasons=tuple(_unmeasured(motions, cell, held=False)))
    files = ", ".join(dict.fromkeys(source.path.name for source in correction.program.sources))
    return Verdict(
        task=name,
        program=shortened(files, MAX_FILES),
        tool=tool,
        override=doubt if accept_uncertain else None,
        judgements=(*judgements, program),
    )


MAX_FILES = 60
"""Characters of the names of a program's files, or of its tools."""


_NONE = np.zeros(0)
"""No predicted errors: the calibrated model's own are what is corrected."""


def _judgement(
    subject: Subject,
    budget: ErrorBudget | None,
    tolerance: float | None,
    reasons: tuple[Reason, ...],
    seen: float | None,
) -> Judgement:
    """The verdict for a subject.

    Args:
        subject: whose.
        budget: the error to be expected of it, where it is known.
        tolerance: 3D rms, metres, where one is stated.
        reasons: why nothing can be said; empty where it can.
        seen: error of held-out rows, 3D rms, metres; they contradict a smaller expectation.
    """
    if budget is not None and tolerance is not None:
        low, high = budget.interval
        if low <= tolerance < high:
            reasons = (*reasons, Reason(why="the tolerance lies within the interval"))
        elif seen is not None and high <= tolerance < seen:
            reasons = (*reasons, Reason(why="held-out rows were farther off than the tolerance"))
    return Judgement(subject=subject, budget=budget, tolerance=tolerance, reasons=reasons)


# What of a program is not in its figures.


def _touches(move: Motion) -> bool:
    """Whether a motion may touch the part: not one to joint positions that its text states.

    Such a motion, as to a home position, names no place on a part: tool and work object do not enter its target, which the joints
    themselves are. A motion to a pose does, and so may one that was not read.
    """
    return move.kind != "axes"


def _left(correction: Correction) -> Iterator[Reason]:
    """Motions that may touch the part and stay as they were, or of whose error nothing is known."""
    motions = correction.program.motions
    assessed = set(correction.after.move[correction.after.at_target].tolist())
    open_ = [i for i, move in enumerate(motions) if _touches(move)]
    places: dict[Why, Iterable[Place]] = {
        "motions were not read": (one.place for one in correction.program.diagnostics if one.unread),
        "motions were rejected": (motions[i].place for i in open_ if i in correction.rejected),
        "motions are corrected at run time and not assessed": ()
        if correction.helper is None
        else correction.helper.motions,
        "motions go to targets whose error is not known": (
            motions[i].place for i in open_ if i not in assessed and i not in correction.rejected
        ),
    }
    for why, given in places.items():
        found = list(dict.fromkeys(given))
        if found:
            yield Reason(why=why, detail=f"{len(found)}: {_listed(found)}")


def _listed(places: Sequence[Place]) -> str:
    """Places by file and line, each file once in a row; so many at most."""
    said: list[str] = []
    for k, place in enumerate(places):
        same = k > 0 and places[k - 1].path == place.path
        said.append(f"{place.line}" if same else f"{place.path.name}:{place.line}")
    return listed(said, MAX_PLACES)


def _doubt(correction: Correction) -> Reason | None:
    """Why a program is not written unless that is accepted; None where it is."""
    if correction.unknown:
        return Reason(why="the calibration knows less there than the robot's tolerances do", detail=correction.unknown)
    if not correction.uncertain:
        return None
    budget = correction.budget
    sizes = f"{np.sqrt(budget.correction) * 1e3:.3f} mm, u = {budget.uncertainty * 1e3:.3f} mm, 3D rms"
    return Reason(why="the correction is smaller than its uncertainty", detail=sizes, remedy=budget.remedy)


def _unmeasured(motions: Sequence[Motion], cell: Cell, *, held: bool) -> Iterator[Reason]:
    """Of what the robot holds in a program, or of what stands still there, nothing was measured; at most one reason."""
    examples, _ = distinct_frames(motions)
    frames = {"tool": dict[str, None](), "part": dict[str, None]()}
    for move in examples:
        frame = "part" if move.part_in_hand == held else "tool"
        measured = cell.part(move.part.name) if frame == "part" else cell.tool(move.tool.name)
        if not measured.is_known:
            frames[frame][f"'{measured.name}'"] = None
    for frame, names in frames.items():
        if names:
            yield _of_nothing(
                frame, Said("{names} as the controller has it", names=shortened(", ".join(names), MAX_FILES))
            )
            return


def _of_nothing(frame: str, detail: str) -> Reason:
    why: Why = "nothing was measured of the part" if frame == "part" else "nothing was measured of the tool"
    return Reason(why=why, detail=detail, remedy=REMEDIES[frame])


OWN_TOOL = "the robot's own, as its file has it"
"""The tool where no program says another one."""


def _tool(calibration: Calibration, motions: Sequence[Motion], cell: Cell) -> tuple[GraspedFrame, tuple[Reason, ...]]:
    """What the robot holds in a program, or its own tool; and why it is not known where that is."""
    if not motions:
        own = calibration.model.robot.T_flange_tool
        grasped = grasped_frame(calibration, Measured(name="tool"), own)
        return grasped, (_of_nothing("tool", OWN_TOOL),)
    move = motions[0]
    held, measured = (move.part, cell.part) if move.part_in_hand else (move.tool, cell.tool)
    return grasped_frame(calibration, measured(held.name), held.T), tuple(_unmeasured(motions[:1], cell, held=True))


def _target(calibration: Calibration) -> GraspedFrame:
    """The first measured target, as if the robot held it."""

    def twists(q: Float[np.ndarray, "n joints"], conditions: Conditions | None) -> Float[np.ndarray, "n 6 z"]:
        rows = Rows.of_targets(calibration.layout, calibration.z, q, calibration.model.prepare(q, conditions))
        moved = rows.linearise().by_entry[:, :3]
        return np.concatenate([moved, np.zeros_like(moved)], axis=1)  # its rotation moves no point at its own origin

    return GraspedFrame(T_tool_grasped=calibration.T_tool_target[0], twists=twists)

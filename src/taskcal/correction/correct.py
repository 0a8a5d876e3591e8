"""Correcting a program: every target becomes the pose at which a nominal controller moves to the joints the true robot needs."""

from collections.abc import Callable, Container, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from robot_programs.core.plan import Conflict, Plan, Wanted, plan
from robot_programs.core.program import Diagnostic, Motion, Program, Waypoint, missing_names
from robot_programs.core.source import Place, uncollected
from robot_programs.languages import language_of
from robot_programs.reading import compose_program, parse_program
from taskcal.arguments import checked
from taskcal.correction.cell import Cell, ask_for_base, base_statement, mount
from taskcal.correction.controller import (
    TURN_SPEED_RAD_S,
    UNKNOWN_POSTURE,
    UNREACHABLE,
    UNSOUGHT,
    ControllerTrajectory,
    CorrectsIn,
    JointMotion,
    ask_for_controller,
    check_controller,
    drive_directions,
    joint_motion,
    kinematics_apart,
    simulate_controller,
    state_controller,
    uses_directions,
    with_spins,
    with_spins_near,
)
from taskcal.correction.correction import SHARE_OF_UNCERTAINTY, TOLERANCE, Correction, assess, budget_of
from taskcal.correction.frames import FrameCalibration, Uncertainty, frames_on, place_motions, uncertainty_at
from taskcal.correction.options import Bounds
from taskcal.correction.path import PlacedMotions, RoundedPath
from taskcal.correction.run_time import SAME_M, helper_for
from taskcal.correction.subdivision import CorrectionProblem, Subdivision, subdivide
from taskcal.correction.tool_poses import solve_calibrated
from taskcal.errors import TaskcalError, listed
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.identification.measured_range import MeasuredRange
from taskcal.identification.uncertainty_budget import refuse_unknown, why_unknown
from taskcal.kinematics.inverse import closes, conditioning
from taskcal.kinematics.tracing import MIN_SINGULAR_RATIO
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal_groundwork.said import Said, joined, term

# How far a correction moves the targets of a program.


@dataclass(frozen=True, eq=False, kw_only=True)
class TargetChanges:
    """Deviations of every motion's nodes from the wanted tool poses."""

    shift: Float[np.ndarray, " m"]
    """Largest distance that a node is moved by, metres."""
    turn: Float[np.ndarray, " m"]
    """Largest angle that a node is turned by, radians."""
    joint: Float[np.ndarray, " m"]
    """Largest change of a revolute joint at the motion's end, radians; NaN where it is not known."""


def target_changes(robot: Robot, subdivision: Subdivision, trajectory: ControllerTrajectory) -> TargetChanges:
    """Largest shift, turn and change of joints of each motion."""
    nodes, m = subdivision.nodes, len(trajectory.end)
    shift, turn, joint = np.zeros(m), np.zeros(m), np.full(m, np.nan)
    np.maximum.at(shift, nodes.move, np.linalg.norm(nodes.T[:, :3, 3] - nodes.wanted[:, :3, 3], axis=1))
    angle = np.linalg.norm(se3.log(nodes.T[:, :3, :3] @ np.swapaxes(nodes.wanted[:, :3, :3], 1, 2)), axis=1)
    np.maximum.at(turn, nodes.move, angle)
    ends = nodes.share == 1.0
    move = nodes.move[ends]
    revolute = [j for j, slides in enumerate(robot.prismatic) if not slides]
    joint[move] = np.abs(nodes.q[ends] - trajectory.end[move])[:, revolute].max(axis=1, initial=0.0)
    return TargetChanges(shift=shift, turn=turn, joint=joint)


# Which motions are not corrected, and why.

MAX_SWINGING_RATIO = 0.1
"""Ratio of the Jacobian's singular values under which a large motion of the joints is put down to a singular posture."""


def find_rejections(
    robot: Robot,
    subdivision: Subdivision,
    changes: TargetChanges,
    bounds: Bounds,
) -> dict[int, str]:
    """Motions that are not corrected, and why."""
    nodes = subdivision.nodes
    reasons: dict[int, str] = {}
    for k in np.flatnonzero(~nodes.reached):
        if changes.shift[nodes.move[k]] <= bounds.shift:
            reasons.setdefault(int(nodes.move[k]), _why_unreached(robot, nodes.q[k]))
    for i in np.flatnonzero(subdivision.pieces):
        if i in reasons:
            continue
        if changes.shift[i] > bounds.shift:
            reasons[int(i)] = Said(
                "would move by {moved:.2f} mm, and {most:g} mm are allowed; look at where the cell file has its tool and part, or "
                "widen the bound (--max-shift-mm) if that is right",
                moved=changes.shift[i] * 1e3,
                most=bounds.shift * 1e3,
            )
        elif changes.turn[i] > bounds.turn:
            reasons[int(i)] = Said(
                "would turn by {turned:.2f}°, and {most:g}° are allowed; widen the bound (--max-turn-deg) if that is right",
                turned=np.degrees(changes.turn[i]),
                most=np.degrees(bounds.turn),
            )
        elif changes.joint[i] > bounds.joint:
            q = nodes.q[np.searchsorted(nodes.move, i, side="right") - 1]
            said = {"moved": float(np.degrees(changes.joint[i])), "most": float(np.degrees(bounds.joint))}
            reasons[int(i)] = Said(
                "would move a joint by {moved:.1f}°, and {most:g}° are allowed (--max-joint-deg)", **said
            )
            if conditioning(ErrorModel(robot), q[None])[0] <= MAX_SWINGING_RATIO:
                reasons[int(i)] = Said(
                    "{reason}; near a singular posture a small correction swings the joints", reason=reasons[int(i)]
                )
        elif not np.isfinite(subdivision.deviation[i]):
            reasons[int(i)] = Said(
                "the nominal robot cannot follow the corrected path; it passes too near to a singular posture"
            )
    return reasons


def _why_unreached(robot: Robot, q: Float[np.ndarray, " joints"]) -> str:
    """Why the calibrated robot does not reach a node, by the joint positions nearest to it that were found."""
    outside = robot.outside_limits(q[None])
    if outside:
        return Said("the calibrated robot reaches it outside its limits only: {limit}", limit=outside[0][1])
    model = ErrorModel(robot)
    if not closes(model, q[None])[0] or conditioning(model, q[None])[0] > MIN_SINGULAR_RATIO:
        return Said("is out of the calibrated robot's reach in this posture")
    return Said("lies at a singular posture, where the calibrated robot does not reach it")


# What is written for the motions that a correction changes.

MIN_SHIFT_M, MIN_TURN_RAD = 1e-7, 1e-7
"""A target that moves and turns by less keeps its text: programs state a thousandth of a millimetre."""


def keep_paths(
    motions: Sequence[Motion],
    left: Set[int],
    changing: Container[int],
    shift: Float[np.ndarray, " m"],
    tolerance: float,
) -> dict[int, str]:
    """Motions that have to stay because another one of their path stays whose text is others', and why.

    A path is lines and arcs of one routine, one after the other in the text, without a stop between them.

    Args:
        motions: of the program.
        left: numbers of those that stay because of their text.
        changing: numbers of those that are to be written.
        shift: how far each would have to move, metres.
        tolerance: a smaller step between two motions of a path is good enough, metres.
    """
    stays: dict[int, int] = {}
    number: list[int] = []
    before: Motion | None = None
    for i, motion in enumerate(motions if left else ()):
        same_text = before is not None and motion.place == before.place
        goes_on = (
            before is not None
            and (motion.routine, motion.place.path) == (before.routine, before.place.path)
            and {motion.kind, before.kind} <= {"linear", "circular"}
            and not before.stops
        )
        number.append(number[-1] if number and (same_text or goes_on) else i)
        before = motion
        if i in left and shift[i] > tolerance:
            stays.setdefault(number[-1], i)
    return {
        i: Said(
            "is of one path with the motion in {place}, which stays as it is, {off:.3f} mm from where it should be: the tool would "
            "step between them",
            place=str(motions[stays[path]].place),
            off=shift[stays[path]] * 1e3,
        )
        for i, path in enumerate(number)
        if path in stays and i in changing
    }


def _waypoints(
    motions: Sequence[Motion], subdivision: Subdivision, changes: TargetChanges, left: Set[int]
) -> dict[int, tuple[Waypoint, ...]]:
    """Waypoints of every motion that changes."""
    nodes = subdivision.nodes
    first = np.searchsorted(nodes.move, np.arange(len(motions) + 1))
    waypoints: dict[int, tuple[Waypoint, ...]] = {}
    for i, move in enumerate(motions):
        rows = range(first[i], first[i + 1])
        unchanged = subdivision.pieces[i] == 1 and changes.shift[i] < MIN_SHIFT_M and changes.turn[i] < MIN_TURN_RAD
        if i in left or not rows or unchanged:
            continue
        if move.kind == "axes":
            waypoints[i] = (Waypoint(kind="axes", q=nodes.q[rows[-1]], T=None),)
            continue
        arc = move.via is not None
        waypoints[i] = tuple(
            Waypoint(
                kind="circular" if arc else move.kind,
                q=nodes.q[k],
                T=nodes.T[k],
                via=Waypoint(kind="circular", q=nodes.q[k - 1], T=nodes.T[k - 1]) if arc else None,
                external=_external(motions, i, nodes.share[k]),
                share=float(nodes.share[k]),
            )
            for k in (rows[1::2] if arc else rows)
        )
    return waypoints


def _external(motions: Sequence[Motion], i: int, share: float) -> tuple[float, ...]:
    """Positions of the external axes at a share of a motion's length; empty where they stay, or their start is not known.

    A controller moves them in step with the way of the tool.
    """
    follows = motions[i].follows
    start, end = () if follows is None else motions[follows].external, motions[i].external
    if share >= 1.0 or start == end or len(start) != len(end):
        return ()
    return tuple(b if np.isnan(a) else a + share * (b - a) for a, b in zip(start, end, strict=True))


# What the user of a corrected program should know, by file and line.


def diagnose(
    program: Program,
    trajectory: ControllerTrajectory,
    new_trajectory: ControllerTrajectory,
    origin: Sequence[tuple[int, float, float]],
    written: Sequence[Motion],
    subdivision: Subdivision,
    motion: JointMotion,
) -> tuple[Diagnostic, ...]:
    """Diagnostics of a corrected program, by file and line.

    Args:
        program: as it was given.
        trajectory: the controller's, of that program.
        new_trajectory: the controller's, of the corrected program.
        origin: for each motion of the corrected program, the one it comes from, and the shares of its length.
        written: motions of the corrected program.
        subdivision: the corrected motions.
        motion: how the corrected program moves the joints.
    """
    motions = program.motions
    found: list[tuple[int, str]] = sorted(trajectory.warnings.items())
    for k, text in sorted(new_trajectory.rejected.items()):
        if origin[k][0] not in trajectory.rejected:
            found.append((origin[k][0], Said("as corrected, {said}", said=text)))
    for i, move in enumerate(motions):
        why = ""
        if move.kind in ("linear", "circular") and subdivision.pieces[i]:
            why = _why_undivided(move, starts=bool(np.isfinite(trajectory.start[i, 0])))
        if why:
            found.append((i, why))
    for i in np.flatnonzero(np.isfinite(subdivision.deviation) & (subdivision.deviation > subdivision.tolerance)):
        text = Said(
            "leaves its path by {off:.3f} mm between corrected targets, however finely it is divided",
            off=subdivision.deviation[i] * 1e3,
        )
        if trajectory.corners.after[i] >= 0 or trajectory.corners.before[i] >= 0:
            text = Said("{said}; its rounded corners stay clear of further targets", said=text)
        found.append((int(i), text))
    unknown = [
        i
        for (i, _, end), move in zip(origin, written, strict=True)
        if end == 1.0 and not move.stops and move.zone is None
    ]
    if unknown:
        text = Said(
            "passes by its target in a corner whose size is not known: assessed as if the tool went through the target"
        )
        if len(unknown) > 1:
            text = Said(
                "passes by its target in a corner whose size is not known, as {count} others do: assessed as if the tool went "
                "through the target",
                count=len(unknown) - 1,
            )
        found.append((unknown[0], text))
    if motion.nearest_singular is not None and motion.conditioning < MIN_SINGULAR_RATIO:
        text = Said(
            "passes near a singular posture (ratio {ratio:.3f}), where small corrections take large joint motions",
            ratio=motion.conditioning,
        )
        found.append((origin[motion.nearest_singular][0], text))
    if motion.turn_speed_assumed is not None:
        text = Said(
            "states no reorientation speed; joint speeds are those at {speed:.0f}°/s from here on, wherever the path speed would "
            "turn the tool faster",
            speed=np.degrees(TURN_SPEED_RAD_S),
        )
        found.append((origin[motion.turn_speed_assumed][0], text))
    for joint, speed, limit in zip(motion.robot.joint_names, motion.speed, motion.robot.speed_limits, strict=True):
        if speed > limit:
            found.append(
                (
                    0,
                    Said(
                        "{joint} would have to turn {times:.2f} times as fast as it can, at the programmed speed",
                        joint=joint,
                        times=speed / limit,
                    ),
                )
            )
    return (*program.diagnostics, *(Diagnostic(place=motions[i].place, text=text) for i, text in found))


def _why_undivided(move: Motion, *, starts: bool) -> str:
    """Why a line or an arc is corrected at its points alone; empty where it is divided."""
    if not starts:
        return Said("start point unknown: end points corrected, path between them not checked")
    if move.texts_motions > 1:
        return Said(
            "stands for {count} motions, so that it is not divided: corrected at its points alone",
            count=move.texts_motions,
        )
    if not move.divisible:
        return Said("does something once along its way, so that it is not divided: corrected at its points alone")
    return ""


def diagnose_new_corners(
    program: Program,
    trajectory: ControllerTrajectory,
    new_trajectory: ControllerTrajectory,
    origin: Sequence[tuple[int, float, float]],
) -> list[Diagnostic]:
    """Corners that a new program rounds, and the path that it was made of does not.

    Args:
        program: the path.
        trajectory: the controller's, of the path.
        new_trajectory: the controller's, of the new program.
        origin: for each of its motions, the one it comes from, and the shares of its length.
    """
    ends = [k for k, (i, _, end) in enumerate(origin) if end == 1.0 and trajectory.corners.after[i] < 0]
    rows = np.array([k for k in ends if new_trajectory.corners.after[k] >= 0], dtype=np.int64)
    if not len(rows):
        return []
    path = RoundedPath(segments=new_trajectory.segments, corners=new_trajectory.corners)
    past = np.linalg.norm((path.at(rows, np.ones(len(rows))) - path.segments.end[rows])[:, :3, 3], axis=1)
    worst = int(np.argmax(past))
    text = Said(
        "the new program does not stop here, and passes by at {past:.3f} mm, the farthest of {count} corners; where that is too "
        "far, let the motion stop",
        past=past[worst] * 1e3,
        count=len(rows),
    )
    return [Diagnostic(place=program.motions[origin[rows[worst]][0]].place, text=text)]


def diagnose_shared(program: Program, eased: Mapping[int, float], tolerance: float) -> list[Diagnostic]:
    """Motions whose numbers are others' as well, at the one that is farthest from where it should be."""
    if not eased:
        return []
    worst = max(eased, key=lambda i: eased[i])
    text = Said(
        "{count} motions share their numbers, which get the value of the least largest error: {error:.3f} mm, here, of "
        "{tolerance:.3f} mm tolerated",
        count=len(eased),
        error=eased[worst] * 1e3,
        tolerance=tolerance * 1e3,
    )
    return [Diagnostic(place=program.motions[worst].place, text=text)]


def diagnose_range(
    program: Program, measured: MeasuredRange, farthest: Float[np.ndarray, "m joints"]
) -> list[Diagnostic]:
    """How many motions leave the joint range that was measured, at the one that leaves it farthest.

    Args:
        program: as it was given.
        measured: the range.
        farthest: joint positions of each motion where it is farthest outside.
    """
    names = [
        Said("this one ({name})", name=move.end.name) if move.end.name else Said("this one") for move in program.motions
    ]
    text = measured.warning(farthest, names, "motions")
    if not text:
        return []
    return [Diagnostic(place=program.motions[int(measured.outside_rows(farthest)[0])].place, text=text)]


def diagnose_unchanged_files(
    program: Program, left: Container[int], at_run_time: Set[Path] = frozenset()
) -> list[Diagnostic]:
    """Files with motions, of several that are written together, in which none was corrected.

    Their text alone does not show it: the numbers of a KRL motion stand in its data list.

    Args:
        program: as it was given.
        left: motions that are left as they were.
        at_run_time: files with motions that are corrected at run time.
    """
    if len(program.sources) < 2:
        return []
    with_motions = {move.place.path for move in program.motions}
    corrected = {move.place.path for i, move in enumerate(program.motions) if i not in left}
    return [
        Diagnostic(
            place=Place(path=source.path, line=1),
            text=Said("no motion of this file was corrected; it is written with the others as it was read"),
        )
        for source in program.sources
        if source.path in with_motions - corrected - at_run_time
    ]


def diagnose_written_out(plan: "Plan[CorrectionRequest]") -> list[Diagnostic]:
    """Files with text that was written out, and how it was."""
    after = {source.path: source.text.count("\n") for source in plan.wanted.program.sources}
    return [
        Diagnostic(
            place=Place(path=source.path, line=1),
            text=Said(
                "is {more} lines longer: {ways}, where their motions need different corrections",
                more=more,
                ways=joined(", and ", plan.ways),
            ),
        )
        for source in plan.given.sources
        if plan.ways and (more := after[source.path] - source.text.count("\n"))
    ]


def diagnose_unused_frames(cell: Cell, program: Program) -> list[Diagnostic]:
    """Tools and parts of the cell that no motion speaks of, which may be misspelled."""
    tools = {move.tool.name.casefold() for move in program.motions}
    parts = {move.part.name.casefold() for move in program.motions}
    toucher = {measured.touched_with.casefold() for measured in cell.parts.values()}
    place = Place(path=program.sources[0].path, line=1)
    out: list[Diagnostic] = []
    for kind, frames, used in (("tool", cell.tools, tools | toucher), ("part", cell.parts, parts)):
        for key, measured in frames.items():
            if key not in used:
                names = ", ".join(sorted(used - {""})) or "none"
                text = Said(
                    "no motion has the cell's {kind} '{name}'; the program's: {names}",
                    kind=term(kind),
                    name=measured.name,
                    names=names,
                )
                out.append(Diagnostic(place=place, text=text))
    return out


# Corrected motions as a new program, for tool paths that no controller reads as they are.


def compose_new_program(plan: "Plan[CorrectionRequest]", into: Path, progress: Callable[[str], None]) -> Program:
    """A new program of the corrected motions, as it is read again.

    Raises:
        TaskcalError: the program is more than its motions; a motion cannot be executed, so that nothing can be written for it;
            its language cannot say it, or does not read as what was written.
    """
    found, given = plan.wanted, plan.wanted.given
    _check_plain(given)
    written: list[Motion] = []
    q: list[np.ndarray] = []
    for i, read in enumerate(given.motions):
        # the new program counts its targets in the frames as they were read
        move = replace(found.program.motions[i], tool=read.tool, part=read.part)
        if i not in plan.written:
            if i in found.trajectory.rejected:
                raise TaskcalError(f"{move.place}: {found.trajectory.rejected[i]}; a new program has no place for it")
            written.append(move)
            q.append(found.trajectory.end[i])
        for waypoint in plan.written.get(i, ()):
            end = replace(move.end, name="", T=waypoint.T, q=waypoint.q if waypoint.T is None else None, posture=None)
            via = None if waypoint.via is None else replace(end, T=waypoint.via.T)
            written.append(replace(move, kind=waypoint.kind, end=end, via=via))
            q.append(waypoint.q)
    source = compose_program(into, found.robot, written, q=np.array(q))
    first = None if language_of(into).declares_frames else given.motions[0]
    progress("reading the corrected program")
    again = parse_program(
        (source,),
        robot=found.robot,
        tool=None if first is None else first.tool,
        part=None if first is None else first.part,
    )
    if len(written) != len(again.motions):
        raise TaskcalError(
            f"the corrected program reads as {len(again.motions)} motions instead of {len(written)}; nothing was written"
        )
    return again


def _check_plain(program: Program) -> None:
    """See that nothing but motions would be lost.

    Raises:
        TaskcalError: the program has logic, or parts that were not read.
    """
    path = program.sources[0].path
    language = language_of(path)
    if language.has_logic:
        raise TaskcalError(
            f"{path} is {language.name}, whose logic a new program would lose; name an output of the same language"
        )
    if program.diagnostics:
        raise TaskcalError(
            f"{program.diagnostics[0]}; a new program would lose it: take it out of the path, or read it"
        )


# The corrected program, written into the files that were given.


def rewrite_program(plan: "Plan[CorrectionRequest]", progress: Callable[[str], None]) -> Program:
    """The corrected program, as it is read again from what was written.

    Raises:
        TaskcalError: it cannot be written, or does not read as what was written.
    """
    files, poses = plan.files, _wanted_poses(plan.wanted.program, plan.written)
    progress("reading the corrected program")
    return with_spins_near(replace(plan.wanted.given, sources=files, motions=plan.motions), poses)


def _wanted_poses(
    program: Program, waypoints: Mapping[int, tuple[Waypoint, ...]]
) -> list[list[Float[np.ndarray, "4 4"] | None]]:
    """Wanted poses of via point and end of each motion of a rewritten program."""
    poses: list[list[Float[np.ndarray, "4 4"] | None]] = []
    for i, move in enumerate(program.motions):
        for wanted in waypoints.get(i, (move,)):
            end = wanted.end.T if isinstance(wanted, Motion) else wanted.T
            poses.append([end] if wanted.via is None else [wanted.via.T, end])
    return poses


def _origins(m: int, waypoints: Mapping[int, tuple[Waypoint, ...]]) -> tuple[tuple[int, float, float], ...]:
    """For each motion of a rewritten program the one of m it comes from, and its shares where it begins and ends."""
    out: list[tuple[int, float, float]] = []
    for i in range(m):
        ends = [waypoint.share for waypoint in waypoints.get(i, ())] or [1.0]
        out += [(i, begin, end) for begin, end in zip([0.0, *ends[:-1]], ends, strict=True)]
    return tuple(out)


MAX_REASONS = 3
"""Diagnostics that are shown where no motion could be resolved."""


@checked
@uncollected()
def correct(
    calibration: Calibration,
    program: Program,
    *,
    cell: Cell | None = None,
    bounds: Bounds | None = None,
    into: str | Path | None = None,
    keep_joints: bool = False,
    accept_uncertain: bool = False,
    helper: bool = False,
    controller: Robot | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> Correction:
    """Correct a robot program by a calibration.

    Args:
        calibration: the robot that will run it.
        program: as it was written for the nominal robot. Where it leaves the rotation about the tool's axis open, one is
            chosen that the robot can follow.
        cell: what was measured of its tools and parts; by default all are where the controller has them.
        bounds: how far targets may be moved, and how well the tool keeps to its path between them.
        into: file in the language of whose suffix the corrected motions are written as a new program, RAPID, KRL or CSV; by default
            the program's own files are rewritten.
        keep_joints: leave motions to joint positions as they are, such as those to a home position that a cell checks.
        accept_uncertain: correct it even where the calibration knows less than the robot's tolerances do (`UNKNOWN_FROM`).
        helper: add a module that corrects at run time the targets that the text does not tell, and put its function around them.
        controller: the robot as its controller computes with it (`taskcal.correction.read_controller`), by which the
            program is to be read, too; the calibration's by default, which the result calls assumed unless ``cell.controller`` is
            ``"nominal"``.
        progress: told what is being done.

    Raises:
        TaskcalError: the controller's kinematics are stated to be others and not given; the program has no motion that is known;
            no rotation about the tool's axis lets the robot follow it; what was
            measured does not fit; or the calibration knows less at the targets than the robot's tolerances do; or a helper cannot
            be written for its language, or depends on what a controller does not know.
        InputError: the program has a helper already.
    """
    cell, bounds = cell or Cell(), bounds or Bounds()
    check_controller(calibration.model.robot, cell, controller)
    module = None
    if helper:
        if controller is not None and kinematics_apart(calibration.model.robot, controller) > SAME_M:
            raise TaskcalError(
                "--helper: its module computes with the robot file of the calibration, and the controller with its own kinematics; "
                "identify with these (taskcal robots import), or correct without --helper"
            )
        module = helper_for(calibration, program, cell, bounds, into)

    def found(text: Program) -> CorrectionRequest:
        if text.sources is program.sources and not program.motions:
            missing = tuple(missing_names(program.diagnostics))  # of a backup it is the first one already
            said = dict.fromkeys(str(diagnostic) for diagnostic in (*missing, *program.diagnostics))
            has = f"{program.sources[0].path} has no motion that could be resolved"
            raise TaskcalError(listed((has, *said), 1 + MAX_REASONS, "; "))
        return find_correction(
            calibration, text, cell, bounds, into=into, keep_joints=keep_joints, accept_uncertain=accept_uncertain,
            controller=controller, progress=progress,
        )  # fmt: skip

    if into is not None:
        one = found(program)
        left = {i: Conflict(why=why) for i, why in one.refused.items()}
        chosen = Plan(given=program, wanted=one, written=one.waypoints, left=left, eased={})
        return write_correction(chosen, into, progress)
    chosen = plan(
        program,
        found,
        helper=None if module is None else partial(module.wrap, keep_joints=keep_joints),
        told=lambda: progress("writing out what several motions have in common"),
    )
    correction = write_correction(chosen, None, progress)
    return correction if module is None else module.told(correction, chosen.wrappings)


@dataclass(frozen=True, eq=False, kw_only=True)
class CorrectionRequest(Wanted):
    """What a program's motions are to become, and by what that was found."""

    given: Program
    """As it was read, its frames those of the files."""
    cell: Cell
    bounds: Bounds
    calibration: Calibration
    trajectory: ControllerTrajectory
    """The controller's, of the program."""
    placed: PlacedMotions
    path: RoundedPath
    uncertainty: Uncertainty
    subdivision: Subdivision
    changes: TargetChanges
    unknown: str
    """Why the calibration knows too little at the targets."""
    robot: Robot
    """As the controller computes with it."""
    asked: str
    """What is to be stated of the controller's kinematics; empty where it is."""
    said: tuple[Diagnostic, ...]
    """Of controller and frames."""
    statements: tuple[str, ...]

    def staying(self, of_text: Set[int], changing: Container[int]) -> Mapping[int, str]:
        """Motions of a path another one of which stays because of its text."""
        return keep_paths(self.program.motions, of_text, changing, self.changes.shift, self.tolerance)


def find_correction(
    calibration: Calibration,
    program: Program,
    cell: Cell,
    bounds: Bounds,
    *,
    into: str | Path | None,
    keep_joints: bool,
    accept_uncertain: bool,
    controller: Robot | None,
    progress: Callable[[str], None],
) -> CorrectionRequest:
    """What the motions of a program are to become; for the arguments see `correct`."""
    own = calibration.model.robot
    robot, first = own if controller is None else controller, program.sources[0].path
    asked = ask_for_controller(language_of(first if into is None else Path(into)), own, cell, controller)
    progress("the joints of the nominal robot")
    mounted = mount(program, cell)
    spun = with_spins(mounted.program, robot)
    motions = spun.motions
    frames, number = frames_on(calibration, motions, cell, robot)
    # no controller runs a path as it is: its postures are chosen here, and a new program states them
    has_logic = language_of(first).has_logic
    corrects = _corrects_in(calibration, robot, motions, frames, number) if has_logic else None
    trajectory = simulate_controller(robot, motions, mounted.refused, corrects=corrects)
    unknown = why_unknown(calibration, trajectory.end[np.isfinite(trajectory.end).all(axis=1)])
    if not accept_uncertain:
        refuse_unknown(unknown, f"{first} is not corrected")
    directions = drive_directions(robot, motions, trajectory) if uses_directions(calibration.model) else None
    placed = place_motions(calibration, frames, number, directions)
    path = trajectory.path_on(placed, motions)
    progress("the uncertainty at the targets")
    ways = None if directions is None else directions.at_ends(len(motions))
    uncertainty = uncertainty_at(frames, number, trajectory.end, ways)
    progress("the joints of the calibrated robot")
    tolerance, widest = _tolerances(uncertainty) if bounds.tolerance is None else (bounds.tolerance, 0.0)
    problem = CorrectionProblem(
        robot=robot, motions=motions, calibration=calibration, placed=placed, wanted=path.segments, trajectory=trajectory,
        directions=directions, tolerance=tolerance, widest=widest,
    )  # fmt: skip
    subdivision = subdivide(problem)
    changes = target_changes(robot, subdivision, trajectory)
    kept = {i for i, move in enumerate(motions) if keep_joints and move.kind == "axes"}
    refused = trajectory.rejected | find_rejections(robot, subdivision, changes, bounds)
    return CorrectionRequest(
        program=spun,
        robot=robot,
        waypoints=_waypoints(motions, subdivision, changes, kept | refused.keys()),
        refused={i: why for i, why in refused.items() if i not in kept},
        tolerance=subdivision.tolerance,
        given=program,
        cell=cell,
        bounds=bounds,
        calibration=calibration,
        trajectory=trajectory,
        placed=placed,
        path=path,
        uncertainty=uncertainty,
        subdivision=subdivision,
        changes=changes,
        unknown=unknown,
        asked=asked,
        said=(
            *([Diagnostic(place=Place(path=first, line=1), text=asked)] if asked else ()),
            *ask_for_base(program, cell, trajectory.out_of_reach),
            *mounted.diagnostics,
        ),
        statements=tuple(
            filter(
                None,
                (
                    *dict.fromkeys(frame.statement for frame in frames),
                    base_statement(program, cell),
                    "" if has_logic or into is not None else _posture_statement(robot, motions, trajectory),
                    state_controller(own, cell, controller),
                ),
            )
        ),
    )


def write_correction(
    plan: Plan[CorrectionRequest], into: str | Path | None, progress: Callable[[str], None]
) -> Correction:
    """Write what was planned, read it again, and assess it.

    Args:
        plan: what is written.
        into: see `correct`.
        progress: the same.
    """
    found, waypoints = plan.wanted, plan.written
    program, trajectory, calibration = found.program, found.trajectory, found.calibration
    robot, motions = found.robot, program.motions
    progress("writing the corrected program")
    again = rewrite_program(plan, progress) if into is None else compose_new_program(plan, Path(into), progress)
    mounted, origins = mount(again, found.cell), _origins(len(motions), waypoints)
    at_run_time = {place.path for wrapping in plan.wrappings for place in wrapping.wrapped}
    progress("the joints of the corrected program")
    written_moves, written = mounted.program.motions, np.isin(np.arange(len(motions)), list(waypoints))
    origin = np.array([number for number, _, _ in origins], dtype=np.int64)
    near = trajectory.end[origin]
    for k, i in enumerate(origin):
        near[k] = trajectory.open_postures.get(i, near[k])  # what they differ by counts as an error
    driven = [
        move
        if move.follows is None or origin[move.follows] not in trajectory.open_postures
        else replace(move, follows=None)
        for move in written_moves
    ]
    # what no posture reached before is not looked for again: its target is as it was
    lost = {
        k: why
        for k, (i, _, _) in enumerate(origins)
        if (why := trajectory.rejected.get(i, "")).startswith((UNREACHABLE, UNSOUGHT, UNKNOWN_POSTURE))
    }
    new_trajectory = simulate_controller(robot, driven, lost | mounted.refused, near)
    motion = joint_motion(robot, written_moves, new_trajectory)
    before = assess(found.placed, found.path, trajectory)
    after = assess(found.placed, found.path, new_trajectory, origins)
    farthest = after.farthest(calibration.measured_range, len(motions))
    return Correction(
        program=program,
        sources=again.sources,
        motions=written_moves,
        bounds=found.bounds,
        tolerance=found.tolerance,
        wanted=found.path,
        before=before,
        after=after,
        budget=budget_of(before.length[before.at_target], after.length[after.at_target], found.uncertainty),
        corrected=np.flatnonzero(written),
        pieces=np.bincount(origin, minlength=len(motions)),
        origin=origins,
        shift=np.where(written, found.changes.shift, 0.0),
        turn=np.where(written, found.changes.turn, 0.0),
        uncertainty=np.sqrt(found.uncertainty.variances.sum(axis=1)),
        joint_change=np.where(written, found.changes.joint, 0.0),
        measured_range=calibration.measured_range,
        farthest=farthest,
        rejected={i: str(conflict) for i, conflict in plan.left.items()},
        diagnostics=(
            *diagnose_written_out(plan),
            *found.said,
            *diagnose_unused_frames(found.cell, program),
            *diagnose(program, trajectory, new_trajectory, origins, written_moves, found.subdivision, motion),
            *diagnose_shared(program, plan.eased, found.tolerance),
            *diagnose_range(program, calibration.measured_range, farthest),
            *([] if into is None else diagnose_new_corners(program, trajectory, new_trajectory, origins)),
            *([] if into is not None else diagnose_unchanged_files(program, plan.left, at_run_time)),
        ),
        statements=found.statements,
        motion=motion,
        unknown=found.unknown,
        doubts=calibration.doubts,
        asked=found.asked,
        added_lines=sum(plan.added_lines.values()) if into is None else 0,
    )


def _corrects_in(
    calibration: Calibration,
    robot: Robot,
    motions: Sequence[Motion],
    frames: Sequence[FrameCalibration],
    number: Int[np.ndarray, " m"],
) -> CorrectsIn:
    """What the corrections of motions' points are in several postures, in whichever direction drives turned last."""
    placed = place_motions(calibration, frames, number, None)
    nominal = PlacedMotions.nominal(robot, motions)

    def corrects(i: int, q: Float[np.ndarray, "k joints"]) -> Float[np.ndarray, "k points 4 4"]:
        rows, points = np.full(len(q), i), list[np.ndarray]()
        for target in (motions[i].via, motions[i].end):
            if target is not None and target.T is not None:
                wanted = placed.robot_tool(rows, np.repeat(target.T[None], len(q), axis=0))
                solution = solve_calibrated(calibration, wanted, q, None)
                T = nominal.tool_in_part(rows, np.ones(len(q)), solution.q)
                points.append(np.where(solution.reached[:, None, None], T, np.nan))
        return np.stack(points, axis=1)

    return corrects


def _posture_statement(robot: Robot, motions: Sequence[Motion], trajectory: ControllerTrajectory) -> str:
    """The first posture that was chosen for a path; empty where none was."""
    chosen = np.isfinite(trajectory.end[:, 0]) & np.isnan(trajectory.start[:, 0])
    for i, move in enumerate(motions):
        if chosen[i] and move.end.q is None and move.end.posture is None:
            scale = np.where(robot.prismatic, 1e3, 180.0 / np.pi)
            joints = ", ".join(f"{value:.1f}" for value in trajectory.end[i] * scale)
            return Said(
                "the posture of joints [{joints}] in {place}, which the path does not state",
                joints=joints,
                place=str(move.place),
            )
    return ""


def _tolerances(uncertainty: Uncertainty) -> tuple[float, float]:
    """Default tolerance of paths between targets, and the widest, metres.

    Args:
        uncertainty: of what is predicted at the targets.
    """
    rms = float(np.sqrt(uncertainty.mean.sum()))
    return max(TOLERANCE, SHARE_OF_UNCERTAINTY * rms), rms

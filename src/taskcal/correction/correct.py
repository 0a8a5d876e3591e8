"""Correcting a program: every target becomes the pose at which a nominal controller moves to the joints the true robot needs."""

from collections.abc import Callable, Container, Hashable, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from robot_programs.core.program import (
    Diagnostic,
    Motion,
    Program,
    Visit,
    Waypoint,
    Wrapping,
    keep_together,
    missing_names,
)
from robot_programs.core.source import Place, Source, uncollected
from robot_programs.languages import language_of
from robot_programs.reading import compose_program, parse_program
from taskcal.arguments import checked
from taskcal.correction.cell import Cell, ask_for_base, base_statement, mount
from taskcal.correction.controller import (
    TURN_SPEED_RAD_S,
    UNREACHABLE,
    UNSOUGHT,
    ControllerTrajectory,
    JointMotion,
    drive_directions,
    joint_motion,
    simulate_controller,
    uses_directions,
    with_spins,
    with_spins_near,
)
from taskcal.correction.correction import (
    SHARE_OF_UNCERTAINTY,
    TOLERANCE,
    Bounds,
    Correction,
    assess,
    budget_of,
)
from taskcal.correction.frames import Uncertainty, frames_on, place_motions, uncertainty_at
from taskcal.correction.path import RoundedPath
from taskcal.correction.run_time import helper_for
from taskcal.correction.subdivision import CorrectionProblem, Subdivision, subdivide
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.identification.measured_range import MeasuredRange
from taskcal.identification.uncertainty_budget import check_known
from taskcal.kinematics.inverse import closes, conditioning
from taskcal.kinematics.tracing import MIN_SINGULAR_RATIO
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot

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
            reasons[int(i)] = (
                f"would move by {changes.shift[i] * 1e3:.2f} mm, and {bounds.shift * 1e3:g} mm are allowed; look at where "
                "the cell file has its tool and part, or widen the bound (--max-shift-mm) if that is right"
            )
        elif changes.turn[i] > bounds.turn:
            reasons[int(i)] = (
                f"would turn by {np.degrees(changes.turn[i]):.2f}°, and {np.degrees(bounds.turn):g}° are allowed; widen the bound "
                "(--max-turn-deg) if that is right"
            )
        elif changes.joint[i] > bounds.joint:
            reasons[int(i)] = (
                f"would move a joint by {np.degrees(changes.joint[i]):.1f}°, and {np.degrees(bounds.joint):g}° are allowed "
                f"(--max-joint-deg){_why_joints_swing(robot, nodes.q[np.searchsorted(nodes.move, i, side='right') - 1])}"
            )
        elif not np.isfinite(subdivision.deviation[i]):
            reasons[int(i)] = (
                "the nominal robot cannot follow the corrected path; it passes too near to a singular posture"
            )
    return reasons


def _why_joints_swing(robot: Robot, q: Float[np.ndarray, " joints"]) -> str:
    """Reason for a large motion of a joint by a small correction; empty away from singular postures."""
    if conditioning(ErrorModel(robot), q[None])[0] > MAX_SWINGING_RATIO:
        return ""
    return "; near a singular posture a small correction swings the joints"


def _why_unreached(robot: Robot, q: Float[np.ndarray, " joints"]) -> str:
    """Why the calibrated robot does not reach a node, by the joint positions nearest to it that were found."""
    outside = robot.outside_limits(q[None])
    if outside:
        return f"the calibrated robot reaches it outside its limits only: {outside[0][1]}"
    model = ErrorModel(robot)
    if not closes(model, q[None])[0] or conditioning(model, q[None])[0] > MIN_SINGULAR_RATIO:
        return "is out of the calibrated robot's reach in this posture"
    return "lies at a singular posture, where the calibrated robot does not reach it"


# What is written for the motions that a correction changes.

MIN_SHIFT_M, MIN_TURN_RAD = 1e-7, 1e-7
"""A target that moves and turns by less keeps its text: programs state a thousandth of a millimetre."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Chosen:
    """What is written."""

    waypoints: Mapping[int, tuple[Waypoint, ...]]
    """By number of the motion."""
    rejected: dict[int, str]
    """Motions left unchanged, with the reason."""
    of_text: frozenset[int]
    """Those of them that others share their text with."""
    eased: Mapping[int, float]
    """Motions whose numbers are others' as well, with the distance of the value for all of them from their own, metres."""


def choose_waypoints(
    problem: CorrectionProblem,
    subdivision: Subdivision,
    changes: TargetChanges,
    bounds: Bounds,
    *,
    keep_joints: bool,
    program: Program | None,
    visits: Sequence[Visit] | None = None,
) -> Chosen:
    """Choose the waypoints to write, and the motions that are left unchanged.

    Where motions share their numbers and need different ones, all get the value of the least largest error, if that is within the
    tolerance.

    Args:
        problem: what is corrected.
        subdivision: as corrected.
        changes: how far that moves the targets.
        bounds: how far they may be moved.
        keep_joints: leave motions to joint positions as they are.
        program: the one whose own text is rewritten; None where a new one is written.
        visits: of the program, where its own text does not tell them.
    """
    motions, robot = problem.motions, problem.robot
    joint_motions = {i for i, move in enumerate(motions) if keep_joints and move.kind == "axes"}
    found = problem.trajectory.rejected | find_rejections(robot, subdivision, changes, bounds)
    rejected = {i: why for i, why in found.items() if i not in joint_motions}
    waypoints = _waypoints(motions, subdivision, changes, joint_motions | rejected.keys())
    of_text, eased = set[int](), dict[int, tuple[Waypoint, ...]]()
    exact = dict(waypoints)
    if program is not None:
        visits = tuple(program.visits()) if visits is None else visits
        while True:
            more = program.unwritable(robot, waypoints, subdivision.tolerance)
            if more and not of_text and not eased:
                eased = program.least_worst(robot, waypoints, more, subdivision.tolerance)
                waypoints |= eased
                more = program.unwritable(robot, waypoints, subdivision.tolerance) if eased else more
            of_text.update(more)
            more = more or keep_together(visits, rejected, waypoints)
            more = more or keep_paths(
                motions, of_text & rejected.keys(), waypoints, changes.shift, subdivision.tolerance
            )
            if not more:
                break
            rejected |= more
            waypoints = {i: path for i, path in waypoints.items() if i not in more}
    off = {i: _distance(exact[i][0], eased[i][0]) for i in eased if i in waypoints}
    return Chosen(waypoints=waypoints, rejected=rejected, of_text=frozenset(of_text), eased=off)


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
        i: f"is of one path with the motion in {motions[stays[path]].place}, which stays as it is, "
        f"{shift[stays[path]] * 1e3:.3f} mm from where it should be: the tool would step between them"
        for i, path in enumerate(number)
        if path in stays and i in changing
    }


def _distance(one: Waypoint, other: Waypoint) -> float:
    assert one.T is not None
    assert other.T is not None
    return float(np.linalg.norm(one.T[:3, 3] - other.T[:3, 3]))


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
            found.append((origin[k][0], f"as corrected, {text}"))
    for i, move in enumerate(motions):
        why = ""
        if move.kind in ("linear", "circular") and subdivision.pieces[i]:
            why = _why_undivided(move, starts=bool(np.isfinite(trajectory.start[i, 0])))
        if why:
            found.append((i, why))
    for i in np.flatnonzero(np.isfinite(subdivision.deviation) & (subdivision.deviation > subdivision.tolerance)):
        text = f"leaves its path by {subdivision.deviation[i] * 1e3:.3f} mm between corrected targets, however finely it is divided"
        if trajectory.corners.after[i] >= 0 or trajectory.corners.before[i] >= 0:
            text += "; its rounded corners stay clear of further targets"
        found.append((int(i), text))
    unknown = [
        i
        for (i, _, end), move in zip(origin, written, strict=True)
        if end == 1.0 and not move.stops and move.zone is None
    ]
    if unknown:
        others = f", as {len(unknown) - 1} others do" if len(unknown) > 1 else ""
        text = (
            f"passes by its target in a corner whose size is not known{others}: assessed as if the tool went through the "
            "target"
        )
        found.append((unknown[0], text))
    if motion.nearest_singular is not None and motion.conditioning < MIN_SINGULAR_RATIO:
        text = (
            f"passes near a singular posture (ratio {motion.conditioning:.3f}), where small corrections take large joint "
            "motions"
        )
        found.append((origin[motion.nearest_singular][0], text))
    if motion.turn_speed_assumed is not None:
        text = (
            f"states no reorientation speed; joint speeds are those at {np.degrees(TURN_SPEED_RAD_S):.0f}°/s from here on, "
            "wherever the path speed would turn the tool faster"
        )
        found.append((origin[motion.turn_speed_assumed][0], text))
    for joint, speed, limit in zip(motion.robot.joint_names, motion.speed, motion.robot.speed_limits, strict=True):
        if speed > limit:
            found.append(
                (0, f"{joint} would have to turn {speed / limit:.2f} times as fast as it can, at the programmed speed")
            )
    return (*program.diagnostics, *(Diagnostic(place=motions[i].place, text=text) for i, text in found))


def _why_undivided(move: Motion, *, starts: bool) -> str:
    """Why a line or an arc is corrected at its points alone; empty where it is divided."""
    if not starts:
        return "start point unknown: end points corrected, path between them not checked"
    if move.texts_motions > 1:
        return f"stands for {move.texts_motions} motions, so that it is not divided: corrected at its points alone"
    if not move.divisible:
        return "does something once along its way, so that it is not divided: corrected at its points alone"
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
    text = (
        f"the new program does not stop here, and passes by at {past[worst] * 1e3:.3f} mm, the farthest of {len(rows)} corners; "
        "where that is too far, let the motion stop"
    )
    return [Diagnostic(place=program.motions[origin[rows[worst]][0]].place, text=text)]


def diagnose_shared(program: Program, eased: Mapping[int, float], tolerance: float) -> list[Diagnostic]:
    """Motions whose numbers are others' as well, at the one that is farthest from where it should be."""
    if not eased:
        return []
    worst = max(eased, key=lambda i: eased[i])
    text = (
        f"{len(eased)} motions share their numbers, which get the value of the least largest error: {eased[worst] * 1e3:.3f} mm, "
        f"here, of {tolerance * 1e3:.3f} mm tolerated"
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
    names = [f"this one{f' ({move.end.name})' if move.end.name else ''}" for move in program.motions]
    text = measured.warning(farthest, names, "motions")
    if not text:
        return []
    return [Diagnostic(place=program.motions[int(measured.outside_rows(farthest)[0])].place, text=text)]


def diagnose_unchanged_files(program: Program, rejected: Container[int]) -> list[Diagnostic]:
    """Files with motions, of several that are written together, in which none was corrected.

    Their text alone does not show it: the numbers of a KRL motion stand in its data list.
    """
    if len(program.sources) < 2:
        return []
    with_motions = {move.place.path for move in program.motions}
    corrected = {move.place.path for i, move in enumerate(program.motions) if i not in rejected}
    return [
        Diagnostic(
            place=Place(path=source.path, line=1),
            text="no motion of this file was corrected; it is written with the others as it was read",
        )
        for source in program.sources
        if source.path in with_motions - corrected
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
                text = f"no motion has the cell's {kind} '{measured.name}'; the program's: {names}"
                out.append(Diagnostic(place=place, text=text))
    return out


# Corrected motions as a new program, for tool paths that no controller reads as they are.


def compose_new_program(
    into: Path,
    robot: Robot,
    program: Program,
    waypoints: Mapping[int, tuple[Waypoint, ...]],
    trajectory: ControllerTrajectory,
) -> Source:
    """A new program of the corrected motions.

    Raises:
        TaskcalError: the program is more than its motions; a motion cannot be executed, so that nothing can be written for it;
            or its language cannot say it.
    """
    _check_plain(program)
    written: list[Motion] = []
    q: list[np.ndarray] = []
    for i, move in enumerate(program.motions):
        if i not in waypoints:
            if i in trajectory.rejected:
                raise TaskcalError(f"{move.place}: {trajectory.rejected[i]}; a new program has no place for it")
            written.append(move)
            q.append(trajectory.end[i])
            continue
        for waypoint in waypoints[i]:
            end = replace(move.end, name="", T=waypoint.T, q=waypoint.q if waypoint.T is None else None, posture=None)
            via = None if waypoint.via is None else replace(end, T=waypoint.via.T)
            written.append(replace(move, kind=waypoint.kind, end=end, via=via))
            q.append(waypoint.q)
    return compose_program(into, robot, written, q=np.array(q))


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


# Whether a rewritten program, read again, says what was to be written.

ROUNDING_M = 1e-5
"""Numbers are written to this at least, metres."""


def check_reading(
    motions: Sequence[Motion],
    pieces: Int[np.ndarray, " m"],
    waypoints: Mapping[int, tuple[Waypoint, ...]],
    tolerance: float,
) -> None:
    """See that rewritten motions go where they should: what they share with others may have been changed for those.

    Args:
        motions: of the rewritten program, as read again.
        pieces: into how many of them each motion of the given program became.
        waypoints: what was to be written, by number of the motion.
        tolerance: how far a target may be off that goes with another one, metres.

    Raises:
        TaskcalError: one does not.
    """
    first = np.cumsum(pieces) - pieces
    for i, path in waypoints.items():
        for move, waypoint in zip(motions[first[i] : first[i] + pieces[i]], path, strict=True):
            if waypoint.T is None or move.end.T is None:
                continue
            off = float(np.linalg.norm(move.end.T[:3, 3] - waypoint.T[:3, 3]))
            if off > tolerance + ROUNDING_M:
                raise TaskcalError(
                    f"{move.place}: the corrected program reads {off * 1e3:.3f} mm beside what it should say; nothing was written"
                )


# The corrected program: written, and read again from what was written.


@dataclass(frozen=True, eq=False, kw_only=True)
class RewrittenProgram:
    """The corrected program."""

    sources: tuple[Source, ...]
    motions: tuple[Motion, ...]
    """Motions as read again from its sources."""
    refused: dict[int, str]
    """Those of which it is not known where they lead."""
    pieces: Int[np.ndarray, " m"]
    """Into how many motions each of the given program became."""
    origin: tuple[tuple[int, float, float], ...]
    """For each of its motions, the one it comes from and the shares of that one's length where it begins and ends."""


def rewrite_program(
    given: Program,
    program: Program,
    robot: Robot,
    cell: Cell,
    waypoints: Mapping[int, tuple[Waypoint, ...]],
    trajectory: ControllerTrajectory,
    *,
    into: str | Path | None,
    tolerance: float,
    progress: Callable[[str], None],
) -> RewrittenProgram:
    """Write the corrected files, and read the program from them again.

    Args:
        given: the program as it was read, whose frames are those of the files.
        program: with its frames in the robot's base.
        robot: the robot.
        cell: where the robot stands, and what its external axes carry.
        waypoints: what to write, by number of the motion.
        trajectory: of the controller in the program.
        into: file of a new program; None to rewrite the program's own files.
        tolerance: how far a target may be off that goes with another one, metres.
        progress: told what is being done.

    Raises:
        TaskcalError: it cannot be written, or does not read as what was written.
    """
    progress("writing the corrected program")
    if into is None:
        sources = program.rewrite(robot, waypoints)
        progress("reading the corrected program")
        again = replace(given, motions=given.motions_in(sources))
    else:
        first = given.motions[0]
        # the new program counts its targets in the frames as they were read
        pairs = zip(program.motions, given.motions, strict=True)
        framed = replace(program, motions=tuple(replace(move, tool=read.tool, part=read.part) for move, read in pairs))
        sources = (compose_new_program(Path(into), robot, framed, waypoints, trajectory),)
        declares = language_of(Path(into)).declares_frames
        tool, part = (None, None) if declares else (first.tool, first.part)
        progress("reading the corrected program")
        again = parse_program(sources, robot=robot, tool=tool, part=part)
    pieces = np.array([len(waypoints.get(i, (1,))) for i in range(len(program.motions))], dtype=np.int64)
    origin = _origins(len(program.motions), waypoints)
    if len(origin) != len(again.motions):
        raise TaskcalError(
            f"the corrected program reads as {len(again.motions)} motions instead of {len(origin)}; nothing was written"
        )
    if into is None:
        again = with_spins_near(again, _wanted_poses(program, waypoints))
    mounted = mount(again, cell)
    if into is None:
        check_reading(mounted.program.motions, pieces, waypoints, tolerance)
    return RewrittenProgram(
        sources=sources, motions=mounted.program.motions, refused=mounted.refused, pieces=pieces, origin=origin
    )


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
        progress: told what is being done.

    Raises:
        TaskcalError: the program has no motion that is known; no rotation about the tool's axis lets the robot follow it; what was
            measured does not fit; or the calibration knows less at the targets than the robot's tolerances do; or a helper cannot
            be written for its language, or depends on what a controller does not know.
        InputError: the program has a helper already.
    """
    cell, bounds = cell or Cell(), bounds or Bounds()
    module, wrappings = None, list[Wrapping]()
    if helper:
        module = helper_for(calibration, program, cell, bounds, into)
        wrappings.append(module.wrap(program, keep_joints=keep_joints))
        program = wrappings[0].program
    if not program.motions and not any(one.wrapped for one in wrappings):
        missing = tuple(missing_names(program.diagnostics))  # of a backup it is the first one already
        said = dict.fromkeys(str(diagnostic) for diagnostic in (*missing, *program.diagnostics))
        why = "".join(f"; {text}" for text in list(said)[:MAX_REASONS])
        raise TaskcalError(f"{program.sources[0].path} has no motion that could be resolved{why}")

    def corrected(program: Program, visits: Sequence[Visit] | None = None) -> tuple[Correction, frozenset[int]]:
        return _correct(
            calibration, program, cell, bounds, into=into, keep_joints=keep_joints, accept_uncertain=accept_uncertain,
            visits=visits, progress=progress,
        )  # fmt: skip

    first = best = corrected(program)
    written_out, of_text, written, told = program, best[1], program, None
    ways, chosen = list[str](), tuple[str, ...]()
    for _ in range(MAX_WRITING_OUT if of_text else 0):
        sources, way, visits = written_out.written_out(of_text), WRITTEN_OUT, None
        if sources is None:  # an array does not tell which motions go to a place above which others
            way, visits = TABLED, tuple(written_out.visits())
            sources = written_out.tabled(of_text)
        if sources is None:
            break
        ways.append(way)
        progress("writing out what several motions have in common")
        written_out = written_out.reread(sources)
        found, of_text = corrected(written_out, visits)
        if len(of_text) * len(best[0].program.motions) < len(best[1]) * len(found.program.motions):
            best, written, told, chosen = (found, of_text), written_out, visits, tuple(dict.fromkeys(ways))
        if not of_text or way == TABLED:
            break
    found = best[0] if best is first else _with_written_out(best[0], program, chosen)
    if module is None:
        return found
    if best[1]:
        declared = bool(wrappings[0].wrapped)
        wrappings.append(module.wrap(written, best[1], declared=declared, keep_joints=keep_joints))
        if wrappings[1].wrapped:
            wrapped = wrappings[1].program
            found, _ = corrected(wrapped, None if told is None else _at_places(told, wrapped.motions))
    return module.told(found, wrappings)


MAX_WRITING_OUT = 4
"""Loops, routines that are called in their turns, loops in those, and routines again: who writes a program nests no deeper."""


def _at_places(visits: Sequence[Visit], motions: Sequence[Motion]) -> list[Visit]:
    """Visits by the motions of a program some of whose lines are none any longer, at the same places."""
    by_place: dict[Place, dict[Hashable, Visit]] = {}
    for visit in visits:
        by_place.setdefault(visit.place, {})[visit.target] = visit
    return [replace(visit, number=i) for i, one in enumerate(motions) for visit in by_place.get(one.place, {}).values()]


WRITTEN_OUT = "loops are written turn by turn, or routines once for each call"
TABLED = "targets of loops stand in arrays, an element for each turn"
"""How text for several motions got numbers for each of them."""


def _with_written_out(found: Correction, program: Program, ways: Sequence[str]) -> Correction:
    """The correction of a program written out, with a diagnostic that says so, and how."""
    before = [source.text.count("\n") for source in program.sources]
    after = [source.text.count("\n") for source in found.program.sources]
    said = [
        Diagnostic(
            place=Place(path=source.path, line=1),
            text=f"is {new - old} lines longer: {', and '.join(ways)}, where their motions need different corrections",
        )
        for source, old, new in zip(program.sources, before, after, strict=True)
        if new != old
    ]
    return replace(found, diagnostics=(*said, *found.diagnostics))


def _correct(
    calibration: Calibration,
    program: Program,
    cell: Cell,
    bounds: Bounds,
    *,
    into: str | Path | None,
    keep_joints: bool,
    accept_uncertain: bool,
    visits: Sequence[Visit] | None,
    progress: Callable[[str], None],
) -> tuple[Correction, frozenset[int]]:
    """Correct a program as its text is; says also which motions stay because others have their text."""
    robot = calibration.model.robot
    progress("the joints of the nominal robot")
    given, mounted = program, mount(program, cell)
    program = with_spins(mounted.program, robot)
    motions = program.motions
    trajectory = simulate_controller(robot, motions, mounted.refused)
    if not accept_uncertain:
        ends = trajectory.end[np.isfinite(trajectory.end).all(axis=1)]
        check_known(calibration, ends, f"{given.sources[0].path} is not corrected")
    frames, number = frames_on(calibration, motions, cell)
    directions = drive_directions(robot, motions, trajectory) if uses_directions(calibration.model) else None
    placed = place_motions(calibration, frames, number, directions)
    path = trajectory.path_on(placed, motions)
    progress("the uncertainty at the targets")
    uncertainty = uncertainty_at(frames, number, trajectory.end, directions)
    progress("the joints of the calibrated robot")
    tolerance, widest = _tolerances(uncertainty) if bounds.tolerance is None else (bounds.tolerance, 0.0)
    problem = CorrectionProblem(
        robot=robot, motions=motions, calibration=calibration, placed=placed, wanted=path.segments, trajectory=trajectory,
        directions=directions, tolerance=tolerance, widest=widest,
    )  # fmt: skip
    subdivision = subdivide(problem)
    changes = target_changes(robot, subdivision, trajectory)
    chosen = choose_waypoints(
        problem,
        subdivision,
        changes,
        bounds,
        keep_joints=keep_joints,
        program=program if into is None else None,
        visits=visits,
    )
    waypoints, rejected = chosen.waypoints, chosen.rejected
    rewritten = rewrite_program(
        given,
        program,
        robot,
        cell,
        waypoints,
        trajectory,
        into=into,
        tolerance=subdivision.tolerance,
        progress=progress,
    )
    progress("the joints of the corrected program")
    written_moves, written = rewritten.motions, np.isin(np.arange(len(motions)), list(waypoints))
    near = trajectory.end[[number for number, _, _ in rewritten.origin]]
    # what no posture reached before is not looked for again: its target is as it was
    lost = {
        k: why
        for k, (i, _, _) in enumerate(rewritten.origin)
        if (why := trajectory.rejected.get(i)) in (UNREACHABLE, UNSOUGHT)
    }
    new_trajectory = simulate_controller(robot, written_moves, lost | rewritten.refused, near)
    motion = joint_motion(robot, written_moves, new_trajectory)
    before, after = assess(placed, path, trajectory), assess(placed, path, new_trajectory, rewritten.origin)
    farthest = after.farthest(calibration.measured_range, len(motions))
    correction = Correction(
        program=program,
        sources=rewritten.sources,
        motions=written_moves,
        bounds=bounds,
        tolerance=subdivision.tolerance,
        wanted=path,
        before=before,
        after=after,
        budget=budget_of(before.length[before.at_target], after.length[after.at_target], uncertainty),
        corrected=np.flatnonzero(written),
        pieces=rewritten.pieces,
        origin=rewritten.origin,
        shift=np.where(written, changes.shift, 0.0),
        turn=np.where(written, changes.turn, 0.0),
        uncertainty=np.sqrt(uncertainty.variances.sum(axis=1)),
        joint_change=np.where(written, changes.joint, 0.0),
        measured_range=calibration.measured_range,
        farthest=farthest,
        rejected=rejected,
        diagnostics=(
            *ask_for_base(given, cell, trajectory.out_of_reach),
            *mounted.diagnostics,
            *diagnose_unused_frames(cell, program),
            *diagnose(program, trajectory, new_trajectory, rewritten.origin, written_moves, subdivision, motion),
            *diagnose_shared(program, chosen.eased, subdivision.tolerance),
            *diagnose_range(program, calibration.measured_range, farthest),
            *([] if into is None else diagnose_new_corners(program, trajectory, new_trajectory, rewritten.origin)),
            *([] if into is not None else diagnose_unchanged_files(program, rejected)),
        ),
        statements=tuple(
            filter(None, (*dict.fromkeys(frame.statement for frame in frames), base_statement(given, cell)))
        ),
        motion=motion,
    )
    return correction, chosen.of_text


def _tolerances(uncertainty: Uncertainty) -> tuple[float, float]:
    """Default tolerance of paths between targets, and the widest, metres.

    Args:
        uncertainty: of what is predicted at the targets.
    """
    rms = float(np.sqrt(uncertainty.mean.sum()))
    return max(TOLERANCE, SHARE_OF_UNCERTAINTY * rms), rms

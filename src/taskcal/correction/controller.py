"""The nominal controller: its kinematics, open spins, the joints to which it moves, how fast, and in which direction."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Bool, Float, Int

from robot_programs.core.program import GradedPosture, Language, Motion, Posture, Program, Target
from taskcal.correction.cell import Cell
from taskcal.correction.path import PlacedMotions, RoundedCorners, RoundedPath, Segments, find_corners
from taskcal.errors import FileError, ReachError, TaskcalError
from taskcal.geometry import se3
from taskcal.kinematics.inverse import ANY_MISS, conditioning, find_postures, freedom_of, solve_near
from taskcal.kinematics.spin import about_z, choose_spin
from taskcal.kinematics.tracing import NOT_TURNED, Outcome, Traced, not_turned, rejections, trace, turned
from taskcal.robot.catalogue import catalogue_names, describe_robot, load_robot
from taskcal.robot.conditions import MAX_REST_MOTION, Conditions, drive_motion
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.importers.ur import arm_rows
from taskcal.robot.robot import Robot
from taskcal.robot.robot_file import robot_from
from taskcal.short_repr import short_repr
from taskcal_groundwork.said import Said

P = TypeVar("P", bound=Program)

# The kinematics with which a controller computes, where they are not those of the robot file.

MAX_FACTORY_M = 0.02
"""Farthest that a factory's kinematics put a flange from where the robot file has it, metres: they differ by some millimetres, and
two types of arms by more than this."""

COMPARED_POSES = 40
"""At which two kinematics are compared."""


def read_controller(path: str | Path, robot: Robot) -> Robot:
    """A robot as its controller computes with it: with the kinematics that the factory measured of a UR's arm.

    Args:
        path: ``calibration.conf`` of the controller, or a program that was saved on it (``.urp``).
        robot: of the calibration, by whatever robot file; limits, speeds and the tool are its own.

    Raises:
        FileError: the file does not state such kinematics, or not those of a robot of this type.
    """
    rows = arm_rows(path)
    if len(robot.joints) != 6 or any(robot.prismatic) or robot.description.get("four_bar"):
        raise FileError(path, f"has the kinematics of a UR, and the calibration is of {robot.name}: leave it out")
    nominals: list[Robot | None] = [None]
    if any(key.startswith("delta_") for key in rows):
        named = [load_robot(name) for name in catalogue_names() if name.startswith("ur")]
        nominals = [one for one in (robot, *named) if _is_nominal_table(one)]
    made = [_with_table(robot, describe_robot(path, nominal=nominal)) for nominal in nominals]
    apart = [kinematics_apart(robot, one) for one in made]
    best = int(np.argmin(apart)) if apart else 0
    if not apart or apart[best] > MAX_FACTORY_M:
        off = f"its flange is up to {apart[best] * 1e3:.0f} mm from" if apart else "no nominal table fits"
        raise FileError(path, f"is not of a {robot.name}: {off} where the calibration's robot file has it")
    return made[best]


def _is_nominal_table(robot: Robot) -> bool:
    """Whether a robot has the table that a catalogue prints, to which deltas can be added: of right angles, without offsets."""
    joints = robot.description["joint"]
    return len(joints) == len(robot.joints) == 6 and all(
        "dh" in joint and joint["dh"].get("alpha_deg", 0.0) % 90.0 == 0.0 and not joint.get("offset_deg")
        for joint in joints
    )


def _with_table(robot: Robot, described: Mapping[str, Any]) -> Robot:
    """A robot with the table of another description."""
    own = robot.description
    joints = [
        {key: value for key, value in joint.items() if key not in ("steps", "mdh")}
        | {key: table[key] for key in ("dh", "offset_deg")}
        for joint, table in zip(own["joint"], described["joint"], strict=False)
    ]
    return robot_from({**own, "joint": joints, "source": described["source"]})


def kinematics_apart(robot: Robot, other: Robot) -> float:
    """Farthest that two robots of as many joints put the flange from each other, metres; infinite for another number of joints."""
    if len(robot.joints) != len(other.joints):
        return np.inf
    lower, upper = robot.bounded_limits().T
    q = np.random.default_rng(0).uniform(lower, upper, size=(COMPARED_POSES, len(robot.joints)))
    places = [(one.tool_poses(q) @ se3.inverse(one.T_flange_tool))[:, :3, 3] for one in (robot, other)]
    return float(np.linalg.norm(places[0] - places[1], axis=1).max())


ABSOLUTE = "ABB's Absolute Accuracy, KUKA's absolutely accurate robot model, FANUC's factory calibration"


def check_controller(robot: Robot, cell: Cell, controller: Robot | None) -> None:
    """See that what is stated of a controller's kinematics goes together, and that they are known.

    Args:
        robot: of the calibration.
        cell: its ``controller`` says with which kinematics the controller computes.
        controller: the robot with the controller's own kinematics, where these are given.

    Raises:
        TaskcalError: they do not, or are not.
    """
    if controller is not None and cell.controller == "nominal":
        raise TaskcalError(
            "the controller is stated to compute with nominal dimensions, and kinematics of its own are given: keep one of them"
        )
    if controller is not None and len(controller.joints) != len(robot.joints):
        raise TaskcalError(
            f"the controller's robot has {len(controller.joints)} joints, and {robot.name} {len(robot.joints)}"
        )
    if controller is None and cell.controller == "calibrated":
        raise TaskcalError(
            "the cell file states that the controller computes with kinematics that a factory measured, which are not known here: "
            f"give those of a UR (--controller-kinematics); switch others off ({ABSOLUTE}), and state [robot] controller = "
            '"nominal"'
        )


def ask_for_controller(language: Language, robot: Robot, cell: Cell, controller: Robot | None) -> str:
    """What to state where a language's controllers have kinematics of their own, and nothing says with which one computes."""
    if not language.controller_kinematics or controller is not None or cell.controller:
        return ""
    return Said(
        "a controller of {language} computes with the kinematics that the factory measured of its own arm, often millimetres from "
        "nominal ones; name them (--controller-kinematics FILE: {files}), or state that it computes with the dimensions of {robot} "
        'in the calibration (--nominal-controller, or [robot] controller = "nominal" in the cell file)',
        language=language.name,
        files=language.controller_kinematics,
        robot=robot.name,
    )


def state_controller(robot: Robot, cell: Cell, controller: Robot | None) -> str:
    """For which controller a correction is, and whether that is stated; arguments as of `check_controller`."""
    if controller is not None:
        apart = kinematics_apart(robot, controller) * 1e3
        return Said(
            "a controller that computes with kinematics of its own ({source}), up to {apart:.2f} mm from those of {robot} in the "
            "calibration",
            source=str(controller.description["source"][0]),
            apart=float(apart),
            robot=robot.name,
        )
    nominal = Said(
        "a controller that computes with the nominal lengths of {robot}, as its robot file has them", robot=robot.name
    )
    if cell.controller:
        return Said("{nominal}, which is stated", nominal=nominal)
    return Said(
        '{nominal}, which is assumed: state [robot] controller = "nominal" in the cell file, or "calibrated" if a factory '
        "calibration is switched on ({absolute})",
        nominal=nominal,
        absolute=ABSOLUTE,
    )


# Spins of targets that leave them open.


def with_spins(program: P, robot: Robot) -> P:
    """The program with the rotation about the tool's axis chosen wherever it leaves that open.

    Motions that follow each other get spins that the robot can go through without jumps, inside its limits; see
    `choose_spin`. What is written in the program's files does not change.

    Raises:
        ReachError: no rotations let the robot follow the motions; names the line.
    """
    motions = list(program.motions)
    for run in _runs(motions):
        first = motions[run[0]]
        tip = se3.inverse(robot.T_flange_tool) @ first.tool.T
        try:
            spun = choose_spin(ErrorModel(robot), first.part.T @ _poses(motions, run), tip=tip)
        except ReachError as error:
            raise ReachError(f"{first.place}: of the motions from this line on: {error}") from error
        _place(motions, run, se3.inverse(first.part.T) @ spun.T)
    return replace(program, motions=tuple(motions))


def with_spins_near(program: P, paths: Sequence[Sequence[Float[np.ndarray, "4 4"] | None]]) -> P:
    """The program with the rotation about the tool's axis, where that is open, as near as it can be to that of other poses.

    Args:
        program: the program.
        paths: of each motion the poses of its via point, if it has one, and of its end; None where it goes to joint positions.
    """
    motions = list(program.motions)
    for k, path in enumerate(paths):
        if not motions[k].end.free_spin:
            continue
        T, wanted = _poses(motions, [k]), np.stack([pose for pose in path if pose is not None])
        x = (np.swapaxes(T[:, :3, :3], 1, 2) @ wanted[:, :3, :1])[:, :, 0]
        _place(motions, [k], T @ about_z(np.arctan2(x[:, 1], x[:, 0])))
    return replace(program, motions=tuple(motions))


def _runs(motions: Sequence[Motion]) -> list[list[int]]:
    """Motions whose spin is open, in runs that follow each other with one tool and one part."""
    runs: list[list[int]] = []
    for k, move in enumerate(motions):
        if not (move.end.free_spin and move.tool.stated):
            continue
        before = motions[k - 1]
        same_frames = move.tool is before.tool and move.part is before.part
        if runs and runs[-1][-1] == k - 1 and move.follows == k - 1 and same_frames:
            runs[-1].append(k)
        else:
            runs.append([k])
    return runs


def _poses(motions: Sequence[Motion], run: Sequence[int]) -> Float[np.ndarray, "n 4 4"]:
    """Poses of the via points and the ends of some motions, in their order."""
    targets = [t for k in run for t in (motions[k].via, motions[k].end) if t is not None]
    return np.stack([target.T for target in targets if target.T is not None])


def _place(motions: list[Motion], run: Sequence[int], T: Float[np.ndarray, "n 4 4"]) -> None:
    """Give some motions other poses, in the order of `_poses`."""
    poses = iter(T)
    for k in run:
        via = motions[k].via
        via = None if via is None else replace(via, T=next(poses))
        motions[k] = replace(motions[k], via=via, end=replace(motions[k].end, T=next(poses)))


# The joints of a program: in its targets, along lines and arcs, and in rounded corners.

CORNER_SAMPLE_SHARE = 0.5
"""Corners of lines and arcs are sampled in the middle, and at this share of both halves."""

MAX_STEP_M, MAX_STEP_RAD = 0.02, np.radians(5.0)
"""Segments are followed in steps not longer than this, metres and radians."""

CORNER_LOST = Said(
    "rounds a corner where the robot does not reach it inside its joint limits; it is taken to meet its target"
)


@dataclass(frozen=True, eq=False, kw_only=True)
class ControllerTrajectory:
    """Joint values of a nominal controller along the motions of a program."""

    start: Float[np.ndarray, "m joints"]
    """Where each motion begins, radians: in the target before it; NaN where that is not known."""
    end: Float[np.ndarray, "m joints"]
    """In its target; NaN where it cannot be executed."""
    passes: Float[np.ndarray, "m joints"]
    """Where it ends: in its target, or in the middle of the corner in which it is left for the next one."""
    segments: Segments
    """Tool in part's frame along each motion, to its target; of use for lines and arcs."""
    corners: RoundedCorners
    """Between motions that do not stop."""
    rejected: dict[int, str]
    """Motions that cannot be executed, and why."""
    out_of_reach: tuple[int, ...]
    """Those among them that lead where the robot does not reach in any posture."""
    warnings: dict[int, str]
    """Motions whose posture data disagree with where the path leads."""
    open_postures: Mapping[int, Float[np.ndarray, " joints"]]
    """Motions that several postures may reach, which are corrected alike, with the one that is corrected most unlike the others."""
    move: Int[np.ndarray, " k"]
    """Motion of every sample along lines and arcs whose start is known, in order; the last one of each is where it ends."""
    share: Float[np.ndarray, " k"]
    """Share of the motion's length."""
    q: Float[np.ndarray, "k joints"]
    """Joint positions there, radians."""

    def path_on(self, placed: PlacedMotions, motions: Sequence[Motion]) -> RoundedPath:
        """The path that the program asks for on some robot, its corners rounded as here."""
        own = self.segments
        wanted = placed.segments(motions, own.end, own.via, np.isfinite(self.end[:, 0]))
        return RoundedPath(segments=wanted, corners=self.corners)


def simulate_controller(
    robot: Robot,
    motions: Sequence[Motion],
    refused: Mapping[int, str] | None = None,
    near: Float[np.ndarray, "m joints"] | None = None,
    corrects: "CorrectsIn | None" = None,
) -> ControllerTrajectory:
    """Simulate the nominal controller executing a program.

    Args:
        robot: the robot as its controller knows it.
        motions: the motions, in the order of the program.
        refused: motions of which it is not known where they lead, and why.
        near: where motions end whose targets state no posture, about, radians; NaN where that is not known. By default in the
            posture that is nearest to the one before, and at first in the best one.
        corrects: what the correction is in a posture. Where it is given, no posture is chosen that the program leaves to the
            controller: the motion is rejected, unless all that are possible are corrected alike.
    """
    nowhere = np.full((len(motions), len(robot.joints)), np.nan)
    refused = dict(refused or {})
    while True:
        simulation = _Simulation(robot, motions, dict(refused), nowhere if near is None else near, corrects)
        trajectory = simulation.run()
        more = simulation.unsettled()
        if not more:
            return trajectory
        refused |= dict.fromkeys(more, UNKNOWN_BEGINNING)


CorrectsIn = Callable[[int, Float[np.ndarray, "k joints"]], Float[np.ndarray, "k points 4 4"]]
"""From the number of a motion and postures that reach it to the corrected poses of its points; NaN where one has none."""

ALIKE_M, ALIKE_ARM_M = 2e-5, 0.1
"""Corrected poses are alike whose points, on the tool's tip and so far from it, differ by less: as paths do between targets."""

STATE_IT = Said("state it (URScript: qnear; KRL: S and T), or go to joint positions right before it")
UNKNOWN_POSTURE = "the text does not tell in which posture the robot reaches it"
UNKNOWN_BEGINNING = Said(
    "the text does not tell in which posture the robot reaches it: it begins in several places, from which it is reached in "
    "different ones; {state}",
    state=STATE_IT,
)


MIN_STRETCH, MAX_STRETCH = 8, 16_384
"""Motions that are traced at a time, at least and at most: so many take 30 MB. Behind one that is not reached it is twice as many
as were before it: were it all that is left each time, a long program with many such would take time by its square."""

MAX_IN_VAIN = 200
"""Poses that are looked for in all postures, 10 ms each, and not reached. Behind so many, those that few of Newton's steps do not
reach from where the robot was last are taken to be out of reach, too."""

FEW_STEPS = 10
"""Of Newton's; from a seed near by four are enough."""

UNREACHABLE = Said("is out of reach, or reached outside the joint limits only")
UNSOUGHT = Said(
    "is not reached from the posture before, and was not looked for in others, as {count} such searches were in vain",
    count=MAX_IN_VAIN,
)


class _Simulation:
    """One run through a program; motions that follow each other along lines and arcs are traced together."""

    def __init__(
        self,
        robot: Robot,
        motions: Sequence[Motion],
        refused: dict[int, str],
        near: Float[np.ndarray, "m joints"],
        corrects: CorrectsIn | None,
    ):
        self.robot, self.motions, self.near, self.corrects = robot, motions, near, corrects
        self.model = ErrorModel(robot)
        self.nominal = PlacedMotions.nominal(robot, motions)
        m, joints = len(motions), len(robot.joints)
        self.start, self.end = np.full((m, joints), np.nan), np.full((m, joints), np.nan)
        self.rejected = refused
        self.out_of_reach: list[int] = []
        self.warnings: dict[int, str] = {}
        self.samples: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        self.last: np.ndarray | None = None
        self.open: dict[int, np.ndarray] = {}
        self.untold: set[int] = set()
        """Motions of which the text does not tell the posture."""
        self.by_others: dict[int, np.ndarray] = {}
        """Motions whose posture follows from all places where others end, with the possible ones."""
        self.all_known = not refused
        """Whether it is known of all motions where they lead."""
        self.in_vain = 0
        """Poses so far that were looked for in all postures, and not reached."""
        self.stretch = MAX_STRETCH
        """How many motions are traced at a time, at most."""
        self._take_joint_targets()
        self.segments = self._segments()

    def run(self) -> ControllerTrajectory:
        joints = len(self.robot.joints)
        done = np.zeros(len(self.motions), dtype=bool)

        def begins(i: int) -> bool:
            previous = self.motions[i].follows
            return previous is None or bool(done[previous])

        for ready in (lambda i: begins(i) and not self._waits(i), begins, lambda _: True):
            while self._take_all(done, ready):
                pass
        parts = self.samples or [(np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros((0, joints)))]
        move, share, q = (np.concatenate(column) for column in zip(*parts, strict=True))
        order = np.argsort(move, kind="stable")
        return self._round_corners(move[order], share[order], q[order])

    def _take_all(self, done: Bool[np.ndarray, " m"], ready: Callable[[int], bool]) -> bool:
        """Go through motions that are ready, in the order of the text; whether there was one."""
        i, before = 0, int(done.sum())
        while i < len(self.motions):
            if done[i] or not ready(i):
                i += 1
                continue
            stop = self._take(i)
            done[i:stop] = True
            i = stop
        return int(done.sum()) > before

    def _take(self, i: int) -> int:
        """Go through a motion, and those that continue it; returns the motion to go on with."""
        previous = self.motions[i].follows
        if previous is not None and previous not in self.open:
            self.start[i] = self.end[previous]
        if self._is_path(i):
            return self._trace(i)
        if i not in self.rejected and np.isnan(self.end[i, 0]):
            self._solve_pose(i)
        if i not in self.rejected:
            self.last = self.end[i]
        return i + 1

    def _waits(self, i: int) -> bool:
        """Whether the posture of a motion follows from where all others end."""
        move = self.motions[i]
        return self.corrects is not None and move.begins_at_motion and move.end.q is None and move.end.posture is None

    def _round_corners(
        self, move: Int[np.ndarray, " k"], share: Float[np.ndarray, " k"], q: Float[np.ndarray, "k joints"]
    ) -> ControllerTrajectory:
        """The trajectory with samples along lines and arcs to their targets, those in rounded corners replaced."""
        motions, start, end, passes = self.motions, self.start, self.end, self.end
        known = np.asarray(np.isfinite(start).all(axis=1) & np.isfinite(end).all(axis=1))
        corners = find_corners(motions, self.segments, known, self._driven)
        path = RoundedPath(segments=self.segments, corners=corners).bent()
        corners = path.corners
        if (corners.after >= 0).any():
            move, share, q, added = self._with_corner_samples(move, share, q, corners)
            alone = np.flatnonzero((corners.after >= 0) & ~np.isin(np.arange(len(motions)), move))
            rows = np.flatnonzero(path.inside(move, share))
            number = np.concatenate([move[rows], alone])
            at = np.concatenate([share[rows], np.ones(len(alone))])
            seeds = np.concatenate([q[rows], end[alone]])
            solution = solve_near(self.model, self.nominal.robot_tool(number, path.at(number, at)), seeds)
            corner = np.where(at > 0.5, number, corners.before[number])  # a corner is known by the motion that is left
            lost = np.unique(corner[~solution.reached])
            solved = ~np.isin(corner, lost)
            q[rows[solved[: len(rows)]]] = solution.q[: len(rows)][solved[: len(rows)]]
            passes = end.copy()
            middle = solved & (at == 1.0)
            passes[number[middle]] = solution.q[middle]
            needed = ~added
            needed[rows] |= solved[: len(rows)]
            move, share, q = move[needed], share[needed], q[needed]
            corners = corners.only(~np.isin(np.arange(len(motions)), lost))
            for i in lost:
                self.warnings.setdefault(int(i), CORNER_LOST)
        return ControllerTrajectory(
            start=start,
            end=end,
            passes=passes,
            segments=self.segments,
            corners=corners,
            rejected=self.rejected,
            open_postures=self.open,
            out_of_reach=tuple(self.out_of_reach),
            warnings=self.warnings,
            move=move,
            share=share,
            q=q,
        )

    def _driven(self, rows: Int[np.ndarray, " n"], share: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n 4 4"]:
        """Tool in part along motions of the joints."""
        q = self.start[rows] + share[:, None] * (self.end[rows] - self.start[rows])
        return self.nominal.tool_in_part(rows, share, q)

    def _with_corner_samples(
        self,
        sampled_move: Int[np.ndarray, " n"],
        sampled_share: Float[np.ndarray, " n"],
        sampled_q: Float[np.ndarray, "n joints"],
        corners: RoundedCorners,
    ) -> tuple[Int[np.ndarray, " k"], Float[np.ndarray, " k"], Float[np.ndarray, "k joints"], Bool[np.ndarray, " k"]]:
        """Samples with further ones inside corners, at about the joints there, and which these are."""
        sampled = np.unique(sampled_move)
        exit_, entry = corners.exit.max(axis=1, initial=0.0), corners.entry.max(axis=1, initial=0.0)
        left, joined = sampled[exit_[sampled] > 0.0], sampled[entry[sampled] > 0.0]
        move = np.concatenate([left, joined])
        share = np.concatenate([1.0 - CORNER_SAMPLE_SHARE * exit_[left], CORNER_SAMPLE_SHARE * entry[joined]])
        after = np.searchsorted(sampled_move + sampled_share, move + share)
        before = np.maximum(after - 1, 0)
        first = (after == 0) | (sampled_move[before] != move)
        before_q = np.where(first[:, None], self.start[move], sampled_q[before])
        before_share = np.where(first, 0.0, sampled_share[before])
        between = (share - before_share) / np.maximum(sampled_share[after] - before_share, 1e-12)
        q = before_q + between[:, None] * (sampled_q[after] - before_q)
        move, share = np.concatenate([sampled_move, move]), np.concatenate([sampled_share, share])
        order = np.lexsort((share, move))
        added = np.arange(len(move)) >= len(sampled_move)
        return move[order], share[order], np.concatenate([sampled_q, q])[order], added[order]

    def _take_joint_targets(self) -> None:
        """Ends of motions to joint positions."""
        for i, move in enumerate(self.motions):
            if move.end.q is None or i in self.rejected:
                continue
            if len(move.end.q) != len(self.robot.joints):
                count = len(self.robot.joints)
                said = {"positions": len(move.end.q), "robot": self.robot.name, "count": count}
                self.rejected[i] = Said("has {positions} joint positions; {robot} has {count} joints", **said)
                continue
            outside = self.robot.outside_limits(move.end.q[None])
            if outside:
                self.rejected[i] = outside[0][1]
            else:
                self.end[i] = move.end.q

    def _segments(self) -> Segments:
        """Segments of all motions, tool in part; each starts where the motion before ended, seen with its own frames."""
        m = len(self.motions)
        end, via = np.full((m, 4, 4), np.nan), np.full((m, 3), np.nan)
        to_joints = np.flatnonzero(np.isfinite(self.end[:, 0]))
        if len(to_joints):
            end[to_joints] = self.nominal.tool_in_part(to_joints, np.ones(len(to_joints)), self.end[to_joints])
        for i, move in enumerate(self.motions):
            if i in self.rejected:
                continue
            if move.end.T is not None:
                end[i] = move.end.T
            if move.via is not None and move.via.T is not None:
                via[i] = move.via.T[:3, 3]
        return self.nominal.segments(self.motions, end, via, np.isfinite(end[:, 0, 0]))

    def _is_path(self, i: int) -> bool:
        """Whether a motion is a line or an arc from a place that is known."""
        if i in self.rejected:
            return False
        return self.motions[i].kind in ("linear", "circular") and bool(np.isfinite(self.start[i]).all())

    def _trace(self, first: int) -> int:
        """Follow lines and arcs that continue each other; returns the motion to go on with."""
        stop = first + 1
        while (
            stop < len(self.motions)
            and self.motions[stop].kind in ("linear", "circular")
            and self.motions[stop].follows == stop - 1
            and stop not in self.rejected
            and stop < first + self.stretch
        ):
            stop += 1
        rows = np.arange(first, stop)
        steps = _steps(self.segments.length[rows], self.segments.turn[rows])
        move = np.repeat(rows, steps)
        last = np.cumsum(steps) - 1
        number = np.arange(len(move)) - np.repeat(last + 1 - steps, steps) + 1
        share = number / np.repeat(steps, steps)
        traced = trace(self.model, self.nominal.robot_tool(move, self.segments.at(move, share)), self.start[first])
        reached = traced.reached
        end = int(np.argmin(reached)) if not reached.all() else len(reached)
        whole = int(np.searchsorted(last, end, side="left"))  # motions of which every sample was reached
        kept = last[whole - 1] + 1 if whole else 0
        self.samples.append((move[:kept], share[:kept], traced.q[:kept]))
        for k in range(whole):
            i = first + k
            self.end[i] = traced.q[last[k]]
            self.start[i] = self.start[first] if k == 0 else self.end[i - 1]
        if whole:
            self.last = self.end[first + whole - 1]
            self._compare_postures(range(first, first + whole))
        if end < len(reached):
            why = dict(rejections(self.robot, traced))[end]
            reason = Said("{why}, {share:.0%} of the way there", why=why, share=share[end])
            if traced.outcome[end] == Outcome.OUT_OF_REACH:
                self._reject_as_lost(first + whole, reason)
            else:
                self.rejected[first + whole] = reason
            self.stretch = min(max(2 * whole, MIN_STRETCH), MAX_STRETCH)
            return first + whole + 1
        self.stretch = min(2 * self.stretch, MAX_STRETCH)
        return stop

    def _solve_pose(self, i: int) -> None:
        """Find the joint positions of a pose that is not reached along a known path."""
        move = self.motions[i]
        if self.in_vain >= MAX_IN_VAIN and not self._within_reach[i]:
            self._reject_as_lost(i, UNSOUGHT)
            return
        T = self.nominal.robot_tool(np.array([i]), self.segments.end[[i]])[0]
        if self.corrects is not None and np.isnan(self.start[i, 0]):
            self._settle(i, T, self.corrects)
            return
        if move.end.posture is None and np.isfinite(self.near[i, 0]):
            seed = self.near[i]
        else:
            seed = self.start[i] if np.isfinite(self.start[i, 0]) else self.last
        near = np.zeros((0, len(self.robot.joints)))
        if seed is not None:
            solution = solve_near(self.model, T[None], seed[None])
            near = solution.q[solution.reached]
            if len(near) and _agrees(self.robot, move.end, near)[0]:
                self.end[i] = near[0]
                return
        agreeing = self._agreeing(i, T)
        if not len(agreeing):
            return
        if seed is None:
            self.end[i] = agreeing[0]
        else:
            self.end[i] = agreeing[np.argmin(np.abs(agreeing - seed).max(axis=1))]

    def _agreeing(self, i: int, T: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "k joints"]:
        """Postures that reach a pose and are those that its target states; of one that is not reached, its end is found or not."""
        try:
            postures = np.concatenate([turned(self.robot, q) for q in find_postures(self.model, T)])
        except ReachError:
            self.in_vain += 1
            self._reject_as_lost(i, self._why_lost(T))
            return np.zeros((0, len(self.robot.joints)))
        agreeing = postures[_agrees(self.robot, self.motions[i].end, postures)]
        if not len(agreeing):
            self._take_nearest(i, postures)
        return agreeing

    def _settle(self, i: int, T: Float[np.ndarray, "4 4"], corrects: CorrectsIn) -> None:
        """Find the posture of a pose to which it is not known from where: the only one, or any if all are corrected alike."""
        move, stated = self.motions[i], self.motions[i].end.posture is not None
        if not stated and move.follows in self.untold:
            before = self.motions[move.follows].place.line
            why = Said(
                "the text does not tell in which posture the robot reaches it, as that of the motion before it, in line {line}, is "
                "not known; {state}",
                line=before,
                state=STATE_IT,
            )
            self._reject_as_untold(i, why)
            return
        agreeing = self._agreeing(i, T)
        if not len(agreeing):
            return
        agreeing = agreeing[np.sort(np.unique(np.round(agreeing, SAME_JOINTS_DIGITS), axis=0, return_index=True)[1])]
        if self._waits(i):
            from_others = self._from_others(i, agreeing)
            if from_others is not None:
                self.end[i] = from_others
                self.by_others[i] = agreeing
                return
        if len(agreeing) == 1:
            self.end[i] = agreeing[0]
            return
        apart = _distances(corrects(i, agreeing))
        middle = int(np.argmin(apart.max(axis=1)))
        if freedom_of(self.model).rank < len(self.robot.joints) or not apart[middle].max() < ALIKE_M:
            why = Said("the text does not tell in which posture the robot reaches it; {state}", state=STATE_IT)
            if np.isfinite(apart).all():
                why = Said(
                    "the text does not tell in which posture the robot reaches it: the corrections of those possible differ by up "
                    "to {apart:.3g} mm; {state}",
                    apart=apart.max() * 1e3,
                    state=STATE_IT,
                )
            self._reject_as_untold(i, why)
            return
        self.end[i], self.open[i] = agreeing[middle], agreeing[int(np.argmax(apart[middle]))]

    def _reject_as_untold(self, i: int, why: str) -> None:
        self.rejected[i] = why
        self.untold.add(i)

    def _from_others(self, i: int, postures: Float[np.ndarray, "k joints"]) -> Float[np.ndarray, " joints"] | None:
        """Joint positions at the end of a motion that begins where any other ends; None where they differ, or are not known."""
        others = np.unique(np.round(self.end[np.isfinite(self.end[:, 0])], SAME_JOINTS_DIGITS), axis=0)
        if not self.all_known or self.untold or self.open or not len(others):
            return None
        if self.motions[i].kind == "joint":
            found = postures[[int(np.linalg.norm(postures - q, axis=1).argmin()) for q in others]]
        else:
            found = self._ends_of_lines(i, others)
        return found[0] if len(found) and np.abs(found - found[0]).max() < SAME_JOINTS_RAD else None

    def _ends_of_lines(self, i: int, q: Float[np.ndarray, "k joints"]) -> Float[np.ndarray, "r joints"]:
        """Joint positions to which a line or an arc leads from some, as far as it can be followed from there."""
        rows, own = np.full(len(q), i), self.segments
        segments = Segments(
            start=self.nominal.tool_in_part(rows, np.zeros(len(q)), q), end=own.end[rows], via=own.via[rows]
        )
        steps = _steps(segments.length, segments.turn)

        def traced(k: Int[np.ndarray, " n"], share: Float[np.ndarray, " n"], start: np.ndarray) -> Traced:
            return trace(self.model, self.nominal.robot_tool(np.full(len(k), i), segments.at(k, share)), start)

        def single(k: int) -> Float[np.ndarray, "r joints"]:
            found = traced(np.full(steps[k], k), np.arange(1, steps[k] + 1) / steps[k], q[k])
            return found.q[-1:] if found.reached.all() else q[:0]

        first = single(0)
        if len(first) and len(q) > 1:  # back from its end to every other place and there again, all at once
            way = [np.abs(np.arange(2 * n) + 1 - n) / n for n in steps.tolist()]
            number = np.repeat(np.arange(len(q)), 2 * steps)
            found = traced(number, np.concatenate(way), first[0])
            turns = np.cumsum(2 * steps) - steps - 1
            if found.reached.all() and np.abs(found.q[turns] - q).max() < SAME_JOINTS_RAD:
                return found.q[turns + steps]
        return np.concatenate([first, *map(single, range(1, len(q)))])

    def unsettled(self) -> list[int]:
        """Motions whose posture does not follow from the places where all others end, when these are known."""
        return [
            i
            for i, postures in self.by_others.items()
            if (q := self._from_others(i, postures)) is None or np.abs(q - self.end[i]).max() > SAME_JOINTS_RAD
        ]

    def _reject_as_lost(self, i: int, why: str = UNREACHABLE) -> None:
        self.rejected[i] = why
        if not why.startswith(NOT_TURNED):
            self.out_of_reach.append(i)

    def _why_lost(self, T: Float[np.ndarray, "4 4"]) -> str:
        """Whether a pose is out of reach, or a robot of few joints meets it in place and cannot turn the tool so."""
        freedom = freedom_of(self.model)
        if freedom.whole:
            return UNREACHABLE
        try:
            R = self.model.poses(find_postures(self.model, T, miss=ANY_MISS))[:, :3, :3]
        except ReachError:
            return UNREACHABLE
        left = np.degrees(np.linalg.norm(se3.log(R @ T[:3, :3].T), axis=1).min())
        return not_turned(left, freedom)

    @cached_property
    def _within_reach(self) -> Bool[np.ndarray, " m"]:
        """Whether few of Newton's steps lead from the last posture to the ends of motions; all at once."""
        rows = np.flatnonzero(np.isfinite(self.segments.end[:, 0, 0]))
        T = self.nominal.robot_tool(rows, self.segments.end[rows])
        seed = self.robot.bounded_limits().mean(axis=1) if self.last is None else self.last
        reached = np.zeros(len(self.motions), dtype=bool)
        reached[rows] = solve_near(self.model, T, np.tile(seed, (len(rows), 1)), iterations=FEW_STEPS).reached
        return reached

    def _take_nearest(self, i: int, postures: Float[np.ndarray, "n joints"]) -> None:
        """Take the posture nearest to a stated one that is not reached, where the controller does so."""
        end = self.motions[i].end
        stated = Said(
            "states the posture {posture}, in which the robot does not reach it inside its joint limits",
            posture=str(end.posture),
        )
        if not isinstance(end.posture, GradedPosture):
            self.rejected[i] = Said("{stated}; it does so in other postures only", stated=stated)
            return
        miss = end.posture.miss(self.robot, postures)
        nearest = int(np.argmin(miss))
        joints = ", ".join(f"{angle:.1f}" for angle in np.degrees(postures[nearest]))
        text = Said(
            "{stated}; the nearest is at joints [{joints}]°, {off:.0f}° from it",
            stated=stated,
            joints=joints,
            off=np.degrees(miss[nearest]),
        )
        if end.posture_binds and miss[nearest] > end.posture.tolerated:
            self.rejected[i] = text
        else:
            self.end[i] = postures[nearest]
            self.warnings[i] = Said("{nearest}, and is taken", nearest=text)

    def _compare_postures(self, motions: Iterable[int]) -> None:
        """Warn of lines and arcs that lead to their ends in other postures than these state."""
        stated: dict[Posture, list[int]] = {}
        for i in motions:
            posture = self.motions[i].end.posture
            if posture is not None:
                stated.setdefault(posture, []).append(i)
        for posture, rows in stated.items():
            for i in np.array(rows)[~posture.agrees(self.robot, self.end[rows])]:
                self.warnings[int(i)] = Said(
                    "says posture {posture}, but the path leads there in another", posture=str(posture)
                )


SAME_JOINTS_DIGITS, SAME_JOINTS_RAD = 6, 1e-5
"""Joint positions that agree to so many digits, and within so much, radians or metres, are one."""


def _steps(length: Float[np.ndarray, " k"], turn: Float[np.ndarray, "k 3"]) -> Int[np.ndarray, " k"]:
    """In how many steps segments are followed, at least in two."""
    steps = np.maximum(length / MAX_STEP_M, np.linalg.norm(turn, axis=1) / MAX_STEP_RAD)
    return np.maximum(np.ceil(steps).astype(np.int64), 2)


def _distances(T: Float[np.ndarray, "k points 4 4"]) -> Float[np.ndarray, "k k"]:
    """Largest distance of each of some sets of poses from each other one, metres; infinite where a pose is not known."""
    p = T[..., :3, 3]
    points = np.stack([p, *(p + ALIKE_ARM_M * T[..., :3, j] for j in range(3))], axis=2).reshape(len(T), -1, 3)
    apart = np.array([np.linalg.norm(points - own, axis=2).max(axis=1) for own in points])
    return np.where(np.isfinite(apart), apart, np.inf)


def _agrees(robot: Robot, target: Target, q: Float[np.ndarray, "n joints"]) -> np.ndarray:
    return np.ones(len(q), dtype=bool) if target.posture is None else target.posture.agrees(robot, q)


# How fast the joints move along a program, and how near it passes to singular postures.

MIN_STEP_S = 1e-9
"""Samples nearer together in time than this are one, seconds."""

TURN_SPEED_RAD_S = float(np.radians(500.0))
"""Reorientation speed where a program states none, radians per second: that of all of ABB's predefined speeddata
(Technical reference manual, RAPID, data type speeddata)."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class JointMotion:
    """Largest joint speeds and accelerations along lines and arcs of known speed, and the posture nearest to singular.

    Finite differences over the samples of the path. Accelerations in corners are left out: there the controller slows down as
    its drives need it.
    """

    robot: Robot
    speed: Float[np.ndarray, " joints"]
    """Radians or metres per second; NaN where no speed is known."""
    acceleration: Float[np.ndarray, " joints"]
    """Radians or metres per second squared."""
    conditioning: float
    """Smallest ratio of the smallest to the largest singular value of the Jacobian, a metre counting as two radians."""
    nearest_singular: int | None
    """Motion where that is."""
    turn_speed_assumed: int | None = None
    """First motion that states no reorientation speed and turns faster than `TURN_SPEED_RAD_S` at its path speed."""

    def summary(self) -> dict[str, Any]:
        """Summarise in degrees and millimetres, with shares of the limits where the robot file states them."""
        scale = np.where(self.robot.prismatic, 1e3, 180.0 / np.pi)
        return {
            "joint_speed": _against(self.robot, self.speed, self.robot.speed_limits, scale),
            "joint_acceleration": _against(self.robot, self.acceleration, self.robot.acceleration_limits, scale),
            "smallest_singular_ratio": self.conditioning if np.isfinite(self.conditioning) else None,
        }


def _against(
    robot: Robot, value: Float[np.ndarray, " joints"], limit: Float[np.ndarray, " joints"], scale: np.ndarray
) -> dict[str, Any]:
    return {
        name: {
            "largest": float(value[j] * scale[j]),
            "limit": float(limit[j] * scale[j]) if np.isfinite(limit[j]) else None,
        }
        for j, name in enumerate(robot.joint_names)
        if np.isfinite(value[j])
    }


def joint_motion(robot: Robot, motions: Sequence[Motion], trajectory: ControllerTrajectory) -> JointMotion:
    """Speeds and accelerations of the joints along a program's lines and arcs."""
    joints = len(robot.joints)
    speed, acceleration = np.full(joints, np.nan), np.full(joints, np.nan)
    assumed: int | None = None
    i = trajectory.move
    if len(i):
        starts = np.flatnonzero(np.diff(i, prepend=-1))
        before = np.concatenate([[0.0], trajectory.share[:-1]])
        before[starts] = 0.0
        q0 = np.concatenate([trajectory.q[:1], trajectory.q[:-1]])
        corners = trajectory.corners
        joined = corners.before[i[starts]]
        q0[starts] = np.where((joined >= 0)[:, None], trajectory.passes[joined], trajectory.start[i[starts]])
        time, assumed = _durations(motions, trajectory, trajectory.share - before)
        with np.errstate(invalid="ignore", divide="ignore"):
            rate = (trajectory.q - q0) / time[:, None]
            change = np.diff(rate, axis=0) / (0.5 * (time[1:] + time[:-1]))[:, None]
            turning = RoundedPath(segments=trajectory.segments, corners=corners).inside(i, trajectory.share)
            change[(np.diff(i) != 0) | turning[1:] | turning[:-1]] = np.nan
        speed, acceleration = _largest(rate, speed), _largest(change, acceleration)
    ends = np.isfinite(trajectory.end[:, 0])
    move = np.concatenate([i, np.flatnonzero(ends)])
    q = np.concatenate([trajectory.q, trajectory.passes[ends]])
    ratio = conditioning(ErrorModel(robot), q) if len(q) else np.array([np.inf])
    nearest = int(np.argmin(ratio))
    return JointMotion(
        robot=robot,
        speed=speed,
        acceleration=acceleration,
        conditioning=float(ratio[nearest]),
        nearest_singular=int(move[nearest]) if len(q) else None,
        turn_speed_assumed=assumed,
    )


def _durations(
    motions: Sequence[Motion], trajectory: ControllerTrajectory, step: Float[np.ndarray, " k"]
) -> tuple[Float[np.ndarray, " k"], int | None]:
    """Time between the samples of the path, seconds, and the first motion where an assumed reorientation speed sets it.

    A controller keeps to the path speed and to the reorientation speed, whichever takes longer.

    Args:
        motions: the motions of the program.
        trajectory: their samples.
        step: share of its motion's length that each sample is behind the one before.
    """
    speed = np.array([move.speed or np.nan for move in motions])[trajectory.move]
    stated = np.array([move.turn_speed or np.nan for move in motions])[trajectory.move]
    unstated = np.isnan(stated)
    along = trajectory.segments.length[trajectory.move] * step / speed
    about = (
        np.linalg.norm(trajectory.segments.turn, axis=1)[trajectory.move]
        * step
        / np.where(unstated, TURN_SPEED_RAD_S, stated)
    )
    time = np.maximum(along, about)
    rows = np.flatnonzero(unstated & (about > along))
    return np.where(time > MIN_STEP_S, time, np.nan), int(trajectory.move[rows[0]]) if len(rows) else None


def _largest(values: Float[np.ndarray, "k joints"], otherwise: Float[np.ndarray, " joints"]) -> np.ndarray:
    complete = np.isfinite(values).all(axis=1)
    return np.abs(values[complete]).max(axis=0) if complete.any() else otherwise


# In which direction each drive turns along a program: it decides on which side of its lost motion the drive stands.

END_SHARE = 1e-9
"""Share of a motion before its end, which is its own place and not the start of the next motion."""


@dataclass(frozen=True, eq=False, kw_only=True)
class DriveDirections:
    """Approach direction of each drive along the motions of a program."""

    place: Float[np.ndarray, " k"]
    """Of each sample, in order: number of its motion plus the share of that motion's length."""
    approach: Float[np.ndarray, "k joints"]
    """As in `Conditions`: 1 where the joint's value grew, −1 where it fell, 0 where unknown, between them at a reversal."""

    def at(self, move: Int[np.ndarray, " n"], share: Float[np.ndarray, " n"]) -> Conditions:
        """The conditions at shares of the lengths of some motions; from one sample to the next a drive turns over evenly."""
        place = move + np.clip(share, 0.0, 1.0 - END_SHARE)
        if not len(self.place):
            return Conditions(approach=np.zeros((len(place), self.approach.shape[1])))
        columns = [np.interp(place, self.place, column) for column in self.approach.T]
        return Conditions(approach=np.stack(columns, axis=1))

    def at_ends(self, count: int) -> Conditions:
        """The conditions at the ends of so many motions, all of the program."""
        return self.at(np.arange(count), np.ones(count))


def uses_directions(model: ErrorModel) -> bool:
    """Whether an effect of the model depends on the direction in which a drive turned last."""
    return any("approach" in (*effect.needs, *effect.uses) for effect in model.effects)


def drive_directions(robot: Robot, motions: Sequence[Motion], trajectory: ControllerTrajectory) -> DriveDirections:
    """Follow the drives through a program.

    A drive has turned over when it has gone back by twice `MAX_REST_MOTION`; less is what a controller reports of a joint
    at rest. Where it is not known from where a motion begins, directions are unknown until the drives turn.
    """
    number = np.arange(len(motions))
    started = np.flatnonzero(np.isfinite(trajectory.start[:, 0]))
    alone = np.flatnonzero(np.isfinite(trajectory.end[:, 0]) & ~np.isin(number, trajectory.move))
    along = trajectory.move + np.minimum(trajectory.share, 1.0 - END_SHARE)
    place = np.concatenate([started, along, alone + 1.0 - END_SHARE])
    q = np.concatenate([trajectory.start[started], trajectory.q, trajectory.passes[alone]])
    order = np.argsort(place, kind="stable")
    place, turned = place[order], q[order] @ drive_motion(robot).T
    of_move = place.astype(np.int64)
    continues = np.array(
        [move.follows is not None and move.follows == i - 1 for i, move in enumerate(motions)], dtype=bool
    )
    first = np.diff(of_move, prepend=-1) > 0
    gap = first & ~continues[of_move]
    step = np.diff(turned, axis=0, prepend=turned[:1])
    approach = np.zeros_like(turned)
    for i in range(len(turned)):
        if not gap[i] and i:
            approach[i] = np.clip(approach[i - 1] + step[i] / MAX_REST_MOTION, -1.0, 1.0)
    return DriveDirections(place=place, approach=approach)

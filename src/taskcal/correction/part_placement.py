"""Placement of a part: expected error of a program or a task over placements.

A placement moves what stands still, the part or the fixed tool, rigidly in the robot's base: shifted along its axes, and turned
about the vertical through the middle of the targets. Motions to joint positions stay.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from robot_programs.core.program import THROUGH_TARGET, Frame, Motion, Program, Target
from robot_programs.core.source import Place
from taskcal.arguments import Named, by_name, checked, chosen_options
from taskcal.correction.cell import Cell, mount
from taskcal.correction.controller import (
    ControllerTrajectory,
    DriveDirections,
    drive_directions,
    simulate_controller,
    uses_directions,
    with_spins,
)
from taskcal.correction.correction import Deviations, assess
from taskcal.correction.frames import FrameCalibration, frames_on, place_motions, uncertainty_at
from taskcal.correction.options import Bounds, PlacementOptions
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.identification.uncertainty_budget import why_unknown
from taskcal.kinematics.inverse import conditioning, solve_near
from taskcal.kinematics.tracing import MIN_SINGULAR_RATIO
from taskcal.robot.conditions import Conditions
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal.robot.statics import Load
from taskcal.short_repr import short_repr
from taskcal.task.task import Task, reach_task

# Where a part may be put: a grid of shifts and turns from where it stands.

MAX_PLACEMENTS = 5000


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Region:
    """Region of displacements of a part.

    Raises:
        TaskcalError: a bound is not a number or above the other one, or the grid has no or too many placements.
    """

    low: Float[np.ndarray, " 3"]
    """Along the axes of the robot's base, metres."""
    high: Float[np.ndarray, " 3"]
    turn: tuple[float, float] = (0.0, 0.0)
    """About the vertical through the middle of the targets, radians."""
    steps: tuple[int, int] = (5, 3)
    """Placements along each axis along which it may be moved, and turns, where it may be turned."""

    def __post_init__(self) -> None:
        for low, high in (*zip(self.low, self.high, strict=True), self.turn):
            if not (np.isfinite(low) and np.isfinite(high) and low <= high):
                raise TaskcalError(f"a region goes from {low:g} to {high:g}; give the smaller number first")
        if min(self.steps) < 1:
            raise TaskcalError(f"steps and turns must be at least 1, not {self.steps[0]} and {self.steps[1]}")
        if len(self.grid()) > MAX_PLACEMENTS:
            raise TaskcalError(
                f"a region has {len(self.grid())} placements; give fewer steps, for {MAX_PLACEMENTS} at most"
            )

    def grid(self) -> Float[np.ndarray, "n 4"]:
        """Shifts and turns, metres and radians."""
        bounds = [*zip(self.low, self.high, strict=True), self.turn]
        counts = [self.steps[0]] * 3 + [self.steps[1]]
        axes = [np.linspace(a, b, n if b > a else 1) for (a, b), n in zip(bounds, counts, strict=True)]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 4)


# How placements of a part are looked at.


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class PlacedPart:
    """A placement of the part, and what is to be expected there; errors are rms in space over the targets, metres."""

    shift: Float[np.ndarray, " 3"]
    """Along the base's axes, metres."""
    turn: float
    """About the vertical through the middle of the targets, radians."""
    reached: float
    """Share of the motions that can be executed inside the joint limits."""
    obstacle: str
    """Why the first of the others cannot be, or why the calibration is not used there; empty where all can."""
    before: float
    """Without correction: of a calibrated robot its known error with its uncertainty, else that of its tolerances."""
    after: float
    """Corrected: the uncertainty of the calibration; NaN without one."""
    compliance: float
    """How far the process force deflects the tool, in neither of the two; NaN without a force."""
    margin: float
    """Least distance of a joint to its limits, radians; infinite where there are none."""
    outside: str = ""
    """How many targets lie outside of what the calibration was measured at, and which one the farthest; empty where none does, or
    without a calibration."""
    outside_targets: int | None = None
    """Their number; None without a calibration."""
    conditioning: float
    """Of the posture nearest to a singular one; see `taskcal.kinematics.inverse.conditioning`."""

    @property
    def expected(self) -> float:
        """Error that ranks placements: corrected where there is a calibration, with the deflection."""
        error = self.before if np.isnan(self.after) else self.after
        return float(np.hypot(error, 0.0 if np.isnan(self.compliance) else self.compliance))

    @property
    def possible(self) -> bool:
        """Whether every motion can be executed, none comes near a singular posture, and the calibration knows something there."""
        return self.reached == 1.0 and not self.obstacle and self.conditioning >= MIN_SINGULAR_RATIO

    def summary(self) -> dict[str, Any]:
        """In millimetres and degrees; None for what is not known."""
        values: dict[str, Any] = {f"{axis}_mm": float(v * 1e3) for axis, v in zip("xyz", self.shift, strict=True)}
        values |= {
            "turn_deg": float(np.degrees(self.turn)),
            "reached": self.reached,
            "before_mm": self.before * 1e3,
            "after_mm": self.after * 1e3,
            "compliance_mm": self.compliance * 1e3,
            "expected_mm": self.expected * 1e3,
            "joint_margin_deg": float(np.degrees(self.margin)),
            "smallest_singular_ratio": self.conditioning,
        }
        finite = {k: v if np.isfinite(v) else None for k, v in values.items()}
        outside = {"outside_targets": self.outside_targets, "outside": self.outside}
        return {**finite, "obstacle": self.obstacle, "possible": self.possible, **outside}


MIN_GAIN = 0.1
"""Share of the expected error by which a placement has to be better to be worth its move: an rms over 30 targets of three axes each
is itself uncertain by 1/√(2·90) = 7.5 %."""

MIN_MARGIN = Bounds().joint
"""A recommended placement leaves the joints as much as a correction may move them, or at least what they have now, radians."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class PartPlacements:
    """All placements of a region, and the one where the part stands."""

    name: str
    """Of the program or task."""
    now: PlacedPart
    all: tuple[PlacedPart, ...]
    tolerance: float | None = None
    """Of the task, 3D rms, metres; None where none is stated."""

    @property
    def ranked(self) -> tuple[PlacedPart, ...]:
        """Possible placements, the smallest error first; of equal ones the farthest from a singular posture."""
        return tuple(sorted((p for p in self.all if p.possible), key=lambda p: (round(p.expected, 9), -p.conditioning)))

    def unfit(self, placed: PlacedPart) -> str:
        """Why the part is not to be there, better than now or not; empty where nothing speaks against it."""
        if self.tolerance is not None and not placed.expected <= self.tolerance:
            return (
                f"{placed.expected * 1e3:.3g} mm are expected there, where the task allows {self.tolerance * 1e3:g} mm"
            )
        return placed.outside

    def objection(self, placed: PlacedPart) -> str:
        """Why a placement is not worth moving the part there; empty where it is (`unfit`, `MIN_GAIN`, `MIN_MARGIN`)."""
        if reason := self.unfit(placed):
            return reason
        if self.may_stay and not placed.expected <= (1.0 - MIN_GAIN) * self.now.expected:
            return f"an error less than {MIN_GAIN:.0%} smaller is not worth a move"
        if placed.margin < MIN_MARGIN and not (self.now.possible and placed.margin >= self.now.margin):
            return f"a correction may move a joint by {np.degrees(MIN_MARGIN):g}°, and it has not as much left there"
        return ""

    @property
    def may_stay(self) -> bool:
        """Whether the part may be where it stands now."""
        return self.now.possible and not self.unfit(self.now)

    @property
    def unmet(self) -> str:
        """Why the part is to be nowhere, not where it stands either, by the best placement; empty where it may be somewhere."""
        if self.recommended is not None or self.may_stay:
            return ""
        return self.objection(self.ranked[0]) if self.ranked else self.obstacle

    @property
    def obstacle(self) -> str:
        """Why the first placement that is not possible is not."""
        return next((placed.obstacle for placed in self.all if placed.obstacle), "none: all are near singularities")

    @property
    def recommended(self) -> PlacedPart | None:
        """The possible placement of the smallest error that is worth moving the part there; None where it had better stay."""
        return next((placed for placed in self.ranked if not self.objection(placed)), None)


@by_name(PlacementOptions)
@checked
def place(
    _kind: Callable[Named, PlacementOptions],
    on: Calibration | Robot,
    what: Program | Task,
    region: Region,
    cell: Cell | None = None,
    progress: Callable[[int, int], None] | None = None,
    options: PlacementOptions | None = None,
    *_args: Named.args,
    **_named: Named.kwargs,
) -> PartPlacements:
    """Compute the expected error of a program or a task over placements of its part.

    Args:
        on: the robot as calibrated; or a robot, whose tolerances then count.
        what: a program, or a task.
        region: where the part may be put.
        cell: what was measured of a program's tools and parts; by default all are where the controller has them.
        progress: called with the number of placements that were looked at, and of all.
        options: all at once; those that are named replace what is in them.

    Raises:
        TypeError: an option that does not exist; the message names all.
        TaskcalError: there is no motion to a pose; the robot's file does not tell how it yields; or a part is to be touched off
            that is in the robot's hand.
    """
    calibration, chosen = (
        on if isinstance(on, Calibration) else None,
        chosen_options(_kind, options, *_args, **_named),
    )
    robot = on.model.robot if isinstance(on, Calibration) else on
    name, motions = _moves_of(what, robot, cell or Cell(), chosen.count, chosen.seed)
    origins = [move.flange(move.end.T)[:3, 3] for move in motions if move.end.T is not None]
    if not origins:
        raise TaskcalError(f"{name} has no motion to a pose, so that its part can be anywhere")
    held = next((move for move in motions if move.part_in_hand), None)
    if chosen.touched_off and held is not None:
        raise TaskcalError(
            f"{held.place}: the part is in the robot's hand, so that there is nothing to touch off where it is put"
        )
    view = _View(robot, calibration, cell or Cell(), _loaded(on, robot, chosen.force), chosen)
    middle, grid = np.mean(origins, axis=0), region.grid()
    now, near = view.at(motions, middle, np.zeros(3), 0.0, None)
    placed: list[PlacedPart] = []
    for number, row in enumerate(grid):
        # poses of a task may be reached in whatever posture; a controller that begins a program is in one that follows from it
        one, ends = view.at(motions, middle, row[:3], float(row[3]), near if isinstance(what, Task) else None)
        near = np.where(np.isfinite(ends), ends, near)  # the next placement is beside this one
        placed.append(one)
        if progress is not None:
            progress(number + 1, len(grid))
    tolerance = what.accuracy if isinstance(what, Task) else None
    return PartPlacements(name=name, now=now, all=tuple(placed), tolerance=tolerance)


def _moves_of(what: Program | Task, robot: Robot, cell: Cell, count: int, seed: int) -> tuple[str, Sequence[Motion]]:
    if isinstance(what, Program):
        mounted = mount(what, cell)
        kept = [i for i in range(len(what.motions)) if i not in mounted.refused]
        motions = with_spins(mounted.program, robot).motions
        number = {old: new for new, old in enumerate(kept)}
        # at the targets themselves, however their corners are rounded
        return str(what.sources[0].path), [
            replace(
                motions[i], zone=THROUGH_TARGET, follows=None if (f := motions[i].follows) is None else number.get(f)
            )
            for i in kept
        ]
    model = ErrorModel(robot)
    T = reach_task(model, what, count, seed).T
    tool = Frame(name=f"{robot.name}'s tool", T=robot.T_flange_tool)
    part = Frame(name="task", T=np.eye(4))
    return what.name, [
        Motion(
            kind="joint",
            end=Target(name="", T=pose, q=None, posture=None, place=place),
            tool=tool,
            part=part,
            stops=True,
            place=place,
        )
        for i, pose in enumerate(T)
        for place in (Place(path=Path(what.name), line=i + 1),)
    ]


def _loaded(
    on: Calibration | Robot, robot: Robot, force: tuple[float, float, float] | None
) -> tuple[ErrorModel, ErrorModel, Float[np.ndarray, " p"]] | None:
    """The model without and with the force, and its estimate; None without a force."""
    if force is None:
        return None
    if isinstance(on, Calibration):
        model, x = on.model, on.estimate
    else:
        from taskcal.robot.effects import Compliance

        if not any(robot.statics.stiffness):
            raise TaskcalError(
                f"{robot.name}: its file states no stiffness, so how a force deflects it is not known; add stiffness_nm_rad"
            )
        model = ErrorModel(robot) + Compliance()
        x = np.zeros(len(model))
    return model.under(Load()), model.under(Load(force=force)), x


@dataclass(frozen=True, eq=False)
class _View:
    """Motions that are evaluated at each placement."""

    robot: Robot
    calibration: Calibration | None
    cell: Cell
    loaded: tuple[ErrorModel, ErrorModel, Float[np.ndarray, " p"]] | None
    chosen: PlacementOptions

    def at(
        self,
        motions: Sequence[Motion],
        middle: Float[np.ndarray, " 3"],
        shift: Float[np.ndarray, " 3"],
        turn: float,
        near: Float[np.ndarray, "m joints"] | None,
    ) -> tuple[PlacedPart, Float[np.ndarray, "m joints"]]:
        """A placement of what stands still, and the joint positions at the ends of the motions.

        Args:
            motions: of the program, or to the poses of a task.
            middle: of the targets, about which the part is turned.
            shift: of the part.
            turn: of the part.
            near: joint positions at the ends of the motions in a placement beside this one; unknown ones NaN.
        """
        about = se3.translation(*middle) @ se3.rotation("z", turn) @ se3.translation(*-middle)
        S = se3.translation(*shift) @ about
        moved = _moved(motions, S)
        if near is not None:
            moved = _found_from(self.robot, moved, near)
        trajectory = simulate_controller(self.robot, moved)
        ends = np.isfinite(trajectory.end[:, 0])
        q = np.concatenate([trajectory.end[ends], trajectory.q])
        nothing = np.nan, np.nan
        before, after = self._errors(moved, trajectory) if ends.any() else nothing
        refused = sorted(trajectory.rejected.items())
        obstacle = f"{motions[refused[0][0]].place} {refused[0][1]}" if refused else ""
        if self.calibration is not None and not (obstacle or self.chosen.accept_uncertain):
            obstacle = why_unknown(self.calibration, trajectory.end[ends])
        outside, outside_targets = self._outside(moved, trajectory.end)
        limits = self.robot.limits
        placed = PlacedPart(
            shift=np.asarray(shift, dtype=float),
            turn=turn,
            reached=1.0 - len(refused) / len(motions),
            obstacle=obstacle,
            before=before,
            after=after,
            compliance=self._deflection(trajectory.end[ends]) if ends.any() else np.nan,
            margin=float(np.minimum(q - limits[:, 0], limits[:, 1] - q).min()) if len(q) else np.nan,
            outside=outside,
            outside_targets=outside_targets,
            conditioning=float(conditioning(ErrorModel(self.robot), q).min()) if len(q) else 0.0,
        )
        return placed, trajectory.end

    def _outside(self, motions: Sequence[Motion], end: Float[np.ndarray, "m joints"]) -> tuple[str, int | None]:
        """The warning of targets outside of what was measured, and their number."""
        if self.calibration is None:
            return "", None
        measured = self.calibration.measured_range
        names = [f"{move.place}{f' ({move.end.name})' if move.end.name else ''}" for move in motions]
        return measured.warning(end, names, "targets"), int(measured.outside(end).sum())

    def _errors(self, motions: Sequence[Motion], trajectory: ControllerTrajectory) -> tuple[float, float]:
        """Rms errors at the targets before and after a correction, metres."""
        if self.calibration is None:
            model = ErrorModel(self.robot)
            ends = trajectory.end[np.isfinite(trajectory.end[:, 0])]
            effect = model.jacobian(ends, angular=False) * model.tolerances
            if self.chosen.touched_off:
                effect = without_rigid_motion(model.poses(ends)[:, :3, 3], effect)
            return float(np.sqrt((effect**2).sum(axis=(1, 2)).mean())), np.nan
        frames, number = frames_on(self.calibration, motions, self.cell)
        told = uses_directions(self.calibration.model)
        directions = drive_directions(self.robot, motions, trajectory) if told else None
        placed = place_motions(self.calibration, frames, number, directions)
        found = assess(placed, trajectory.path_on(placed, motions), trajectory)
        if self.chosen.touched_off:
            known, left = on_touched_parts(frames, number, trajectory, directions, found)
        else:
            ways = None if directions is None else directions.at_ends(len(motions))
            left = float(uncertainty_at(frames, number, trajectory.end, ways).mean.sum())
            known = float((found.length[found.at_target] ** 2).mean())
        return float(np.sqrt(known + left)), float(np.sqrt(left))

    def _deflection(self, q: Float[np.ndarray, "n joints"]) -> float:
        """Rms deflection of the tool by the force, metres."""
        if self.loaded is None:
            return np.nan
        free, pushed, x = self.loaded
        moved = pushed.poses(q, x)[:, :3, 3] - free.poses(q, x)[:, :3, 3]
        return float(np.sqrt((moved**2).sum(axis=1).mean()))


def _found_from(robot: Robot, motions: list[Motion], near: Float[np.ndarray, "m joints"]) -> list[Motion]:
    """Free motions with their joint positions, all at once, where these follow from those of a placement beside this one."""
    free = [
        i
        for i, move in enumerate(motions)
        if move.kind == "joint" and move.end.T is not None and move.end.q is None
        and move.end.posture is None and move.follows is None and np.isfinite(near[i]).all()
    ]  # fmt: skip
    if not free:
        return motions
    T = np.stack([motions[i].flange(motions[i].end.T) for i in free]) @ robot.T_flange_tool  # pyright: ignore[reportArgumentType]
    solution = solve_near(ErrorModel(robot), T, near[free])
    out = list(motions)
    for k, i in enumerate(free):
        if solution.reached[k]:
            out[i] = replace(motions[i], end=replace(motions[i].end, q=solution.q[k]))
    return out


def _moved(motions: Sequence[Motion], S: Float[np.ndarray, "4 4"]) -> list[Motion]:
    """Motions with what stands still moved in the base; each frame is one object as before."""
    frames: dict[Frame, Frame] = {}

    def moved(frame: Frame) -> Frame:
        return frames.setdefault(frame, replace(frame, T=S @ frame.T))

    return [
        replace(move, tool=moved(move.tool)) if move.part_in_hand else replace(move, part=moved(move.part))
        for move in motions
    ]


# Errors at targets on a part that was touched off, or measured, where it stands.
#
# Whatever is common to all targets, a shift and a turn of the part against the robot, is then found and taken out.
# What is left is the error of the targets against each other.


def on_touched_parts(
    frames: Sequence[FrameCalibration],
    number: Int[np.ndarray, " m"],
    trajectory: ControllerTrajectory,
    directions: DriveDirections | None,
    found: Deviations,
) -> tuple[float, float]:
    """Mean squares of the known error and of what is not known, each part touched off for itself, metres²."""
    known, left, count = 0.0, 0.0, 0
    for k, frame in enumerate(frames):
        rows = np.flatnonzero(found.at_target & (number[found.move] == k))
        if not len(rows):
            continue
        points = trajectory.segments.end[found.move[rows]][:, :3, 3]
        known += float((without_rigid_motion(points, found.error[rows][:, :, None]) ** 2).sum())
        conditions = None if directions is None else directions.at(found.move[rows], np.ones(len(rows)))
        left += len(rows) * touched_off_variance(frame, found.q[rows], conditions)
        count += len(rows)
    return known / max(count, 1), left / max(count, 1)


def touched_off_variance(
    frame: FrameCalibration, q: Float[np.ndarray, "n joints"], conditions: Conditions | None = None
) -> float:
    """Mean square of the error in space that a calibration must expect at targets of one touched part, metres².

    What errs at a pose alone counts whole; touching off takes little of it where the targets are many.
    """
    moved = frame.moved(q, conditions)
    left = without_rigid_motion(frame.points(moved), frame.spread(moved))
    single = np.trace(moved.errors.single[:, 0], axis1=1, axis2=2)
    return float((left**2).sum(axis=(1, 2)).mean() + single.mean())


def without_rigid_motion(
    points: Float[np.ndarray, "n 3"], errors: Float[np.ndarray, "n 3 k"]
) -> Float[np.ndarray, "n 3 k"]:
    """Errors less the small rigid motion of all points that comes nearest to them, in least squares.

    Args:
        points: where the errors are, metres.
        errors: k sets of them.
    """
    about = points - points.mean(axis=0)
    size = max(float(np.abs(about).max(initial=0.0)), 1e-9)
    A = (se3.by_twist(about) / np.r_[1.0, 1.0, 1.0, [size] * 3]).reshape(-1, 6)
    flat = errors.reshape(len(A), -1)
    motion = np.linalg.lstsq(A, flat, rcond=1e-9)[0]  # targets on a line leave the turn about it open
    return (flat - A @ motion).reshape(errors.shape)

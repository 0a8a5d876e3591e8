"""The closed loop on virtual robots: plan, measure, identify, correct a milling program, and see where the true tool goes.

The controller takes its robot for nominal. The true robot bends, yields, errs in its gears, loses motion and grows
(`true_robot`), and the fit is told nothing of it; three reflectors on the spindle are measured, the cutters are known by these
reflectors, and the robot touches the parts off with them. What counts is the path of the true cutter on the true part: in the
program as it was written, in the same program with its parts touched off, and in that one corrected.
"""

import hashlib
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.special import chdtri

from robot_programs.core.program import Motion, Program
from robot_programs.rapid.read import read_rapid
from taskcal.campaigns.campaign import Campaign
from taskcal.correction.cell import Cell, Measured
from taskcal.correction.controller import ControllerTrajectory, simulate_controller
from taskcal.correction.correct import correct
from taskcal.correction.correction import TOLERANCE, Correction, Deviations, assess
from taskcal.correction.frames import fit_points
from taskcal.correction.options import Bounds
from taskcal.correction.path import PlacedMotions, Placement
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration, load_calibration, package_version
from taskcal.identification.effects import select_effects
from taskcal.io.files import write_whole
from taskcal.kinematics.inverse import solve_near
from taskcal.observations.point import Reflector, Station
from taskcal.planning.plan import plan
from taskcal.planning.workers import side_by_side
from taskcal.robot.conditions import conditions_in_order
from taskcal.robot.effects import Compliance, Harmonics
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal.short_repr import short_repr
from taskcal.virtual.cell import simulate
from taskcal_demo.milling import ROWS, Milling, milling_program, with_part_frames
from taskcal_demo.procedure import reference_task, rms
from taskcal_demo.true_robot import Sizes, TrueRobot, draw_true_robot

# Touching off: the controller's frames of parts, set by the robot's own cutter at marks on them.

JOG_ROUNDS = 4
"""The robot's error changes by a thousandth of each step, so that fewer would do."""

Poses = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False, kw_only=True)
class TouchedPart:
    """A part that the robot has touched."""

    T: Float[np.ndarray, "4 4"]
    """Its frame in the base, as the controller then has it."""
    q: Float[np.ndarray, "marks joints"]
    """Joint positions at its marks, in the order in which they were touched, radians."""


def touch_off(
    robot: Robot,
    move: Motion,
    near: Float[np.ndarray, " joints"],
    placement: Placement,
    true_poses: Poses,
    marks: Float[np.ndarray, "marks 3"],
) -> TouchedPart:
    """Touch a part with the cutter of a motion, jogged to each mark, and set the controller's frame by it.

    The frame is where the controller then believes the marks to be. What the robot's errors have in common there is so
    removed from the program.

    Args:
        robot: as its controller knows it.
        move: whose tool touches, and whose part is touched.
        near: joint positions over the part, radians.
        placement: where both truly are.
        true_poses: joint positions (n, joints) to poses (n, 4, 4) of the true robot's tool in its base.
        marks: where the cutter truly stands, upright, when it touches each, in the part's frame, metres.

    Raises:
        TaskcalError: the robot does not reach the marks.
    """
    nominal = ErrorModel(robot)
    upright = np.repeat(se3.rotation("x", np.pi)[None], len(marks), axis=0)
    believed, reached, q = marks, marks, np.repeat(near[None], len(marks), axis=0)
    for _ in range(JOG_ROUNDS):
        upright[:, :3, 3] = believed
        jogged = solve_near(nominal, move.flange(upright) @ robot.T_flange_tool, q)
        if not jogged.reached.all():
            raise TaskcalError(f"the robot does not reach the marks on '{move.part.name}'; move the workspace")
        q, reached = jogged.q, believed
        believed = believed + marks - placement.tool_in_part(true_poses(q))[:, :3, 3]
    return TouchedPart(T=move.part.T @ fit_points(marks, reached)[0], q=q)


REFLECTORS: Mapping[str, tuple[float, float, float]] = {
    "smr1": (0.06, 0.0, -0.12), "smr2": (-0.05, 0.11, -0.2), "smr3": (-0.05, -0.11, -0.2),
}  # fmt: skip
"""On the spindle, in its tool frame, metres."""

TOUCHED = 1e-5
"""Standard uncertainty with which reflectors and cutters are measured against each other, per axis, metres."""

MARKS = np.array([[0.12, 0.1, 0.0], [-0.12, 0.1, 0.0], [-0.12, -0.1, 0.0], [0.12, -0.1, 0.0]])
"""Where the robot touches a part off, in its frame, metres."""

TOUCHED_PART = 2e-5
"""Standard uncertainty of the cutter's place on a mark that it touches, per axis, metres."""

POSES, CANDIDATES = 60, 500


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class LoopRun:
    """One true robot, measured, identified and corrected."""

    truth: TrueRobot
    calibration: Calibration
    cell: Cell
    """What was measured of tools and parts."""
    correction: Correction
    before: Deviations
    """Of the true cutter on the true parts, in the program as it was written; motions to joint positions, which are on no
    part, are left out."""
    touched_off: Deviations
    """In the same program with the parts' frames touched off by the robot's own cutter."""
    after: Deviations
    """In the corrected program, which was the touched-off one."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ClosedLoop:
    """Common part of all true robots."""

    robot: Robot
    milling: Milling
    program: Program
    q: Float[np.ndarray, "n joints"]
    """Planned measuring poses, radians."""
    station: Station


def prepare_closed_loop(
    robot: Robot,
    *,
    poses: int = POSES,
    rows: int = ROWS,
    candidates: int = CANDIDATES,
    seed: int = 0,
    progress: Callable[[str], None] = lambda _: None,
) -> ClosedLoop:
    """Plan the measuring poses and write the milling program, for the reference task.

    Args:
        robot: an IRB 6660-205/1.9, whose reference workspace it is.
        poses: to measure.
        rows: that the milled surface is cut in.
        candidates: poses from which those to measure are chosen.
        seed: of the plan.
        progress: told what is being done.
    """
    task = reference_task(np.radians(20.0))
    station = Station(
        position=np.array([4.2, -1.6, 0.9]),
        reach=20.0,
        nearest=0.5,
        reflectors=tuple(
            Reflector(name=name, position=np.array(p), axis=None, acceptance=np.pi) for name, p in REFLECTORS.items()
        ),
        keep_out=(),
    )
    progress("the milling program")
    milling = milling_program(robot, task, rows)
    expected = _expected_model(robot)
    # the planned model has effects for what geometry leaves; no more is allowed for
    chosen = plan(
        expected, task, poses, seed=seed, station=station, candidates=candidates, model_error=0.0, progress=progress
    )
    return ClosedLoop(robot=robot, milling=milling, program=read_rapid((milling.source,)), q=chosen.q, station=station)


def find_effects(model: ErrorModel, campaign: Campaign) -> Calibration:
    """Geometry, and whatever effects the data prove, as `taskcal identify --effects auto` does."""
    return select_effects(model, campaign).calibration


def run_closed_loop(
    loop: ClosedLoop,
    seed: int,
    *,
    sizes: Sizes | None = None,
    fit: Callable[[ErrorModel, Campaign], Calibration] | None = None,
) -> LoopRun:
    """Measure, identify and correct one true robot.

    Args:
        loop: what it has in common with the others.
        seed: of its defects and of everything measured.
        sizes: of what its truth is made of.
        fit: how it is identified, from the nominal robot's geometric model; by default `find_effects`.
    """
    rng = np.random.default_rng(seed)
    true = draw_true_robot(loop.robot, rng, sizes)
    offsets = {name: np.array(p) + 2e-3 * rng.normal(size=3) for name, p in REFLECTORS.items()}
    T_tracker_base = se3.pose(se3.exp(0.01 * rng.normal(size=3)), np.zeros(3)) @ loop.station.T_tracker_base
    calibration = (fit or find_effects)(ErrorModel(loop.robot), _measure(loop, true, offsets, T_tracker_base, rng))
    motions, placements = loop.program.motions, _true_placements(loop)
    trajectory = simulate_controller(loop.robot, motions)
    parts = _touch_parts(loop, trajectory, true, placements, rng)
    touched = with_part_frames(loop.milling, {name: part.T for name, part in parts.items()})
    program = read_rapid((touched.source,))
    cell = _measure_cell(program, offsets, placements, parts, rng)
    correction = correct(calibration, program, cell=cell, bounds=Bounds(tolerance=TOLERANCE))
    placed = PlacedMotions(
        # the time goes with the place in the program, however densely that is looked at
        tool_in_base=lambda q, move, share: true.milled(q, (move + share) / len(motions)),
        placements=tuple(placements.values()),
        number=np.array([list(placements).index((m.tool.name, m.part.name)) for m in motions], dtype=np.int64),
    )
    wanted = trajectory.path_on(placed, motions)
    cutting = np.array([move.kind != "axes" for move in motions])

    def deviations(
        trajectory: ControllerTrajectory, origin: Sequence[tuple[int, float, float]] | None = None
    ) -> Deviations:
        return assess(placed, wanted, trajectory, origin).of_moves(cutting)

    return LoopRun(
        truth=true,
        calibration=calibration,
        cell=cell,
        correction=correction,
        before=deviations(trajectory),
        touched_off=deviations(simulate_controller(loop.robot, program.motions)),
        after=deviations(simulate_controller(loop.robot, correction.motions), correction.origin),
    )


def run_closed_loops(
    loop: ClosedLoop,
    seeds: Sequence[int],
    progress: Callable[[str], None] = lambda _: None,
    *,
    sizes: Sizes | None = None,
    fits: Path | None = None,
    workers: int = -1,
) -> list[LoopRun]:
    """Run one true robot for each seed, side by side.

    Args:
        loop: what the robots have in common.
        seeds: of each robot's defects and measurements.
        progress: told how many are done, and how long the others will take.
        sizes: of what their truths are made of.
        fits: folder in which every robot's calibration is kept as soon as it is found, and taken from there in the next run.
        workers: processes; −1 for one per core.
    """
    progress(f"robot 1 of {len(seeds)}: measured, its effects searched, corrected")
    begin = time.monotonic()
    jobs = partial(_run_keeping, loop, sizes, fits)
    runs: dict[int, LoopRun] = {}
    with closing(side_by_side(jobs, enumerate(seeds), "loky", workers if len(seeds) > 1 else 1)) as done:
        for number, run in done:
            runs[number] = run
            left = (time.monotonic() - begin) / len(runs) * (len(seeds) - len(runs)) / 60.0
            progress(f"{len(runs)} of {len(seeds)} robots measured, identified, corrected; about {left:.0f} min left")
    return [runs[number] for number in range(len(seeds))]


def _run_keeping(
    loop: ClosedLoop, sizes: Sizes | None, fits: Path | None, numbered: tuple[int, int]
) -> tuple[int, LoopRun]:
    number, seed = numbered
    return number, run_closed_loop(loop, seed, sizes=sizes, fit=None if fits is None else partial(_find_or_load, fits))


def _find_or_load(folder: Path, model: ErrorModel, campaign: Campaign) -> Calibration:
    """The calibration of a campaign by this version of the package, from its file if there is one.

    Whoever works on the fit itself deletes the folder: within a version its files are used without a check.
    """
    name = hashlib.sha256("\n".join((package_version(), repr(model), campaign.digest)).encode()).hexdigest()[:16]
    path = folder / f"{name}.json"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(path, find_effects(model, campaign).to_text())
    return load_calibration(path)


def _expected_model(robot: Robot) -> ErrorModel:
    """Model for which the measuring poses are planned."""
    return ErrorModel(robot) + Compliance() + Harmonics()


def _measure(
    loop: ClosedLoop,
    true: TrueRobot,
    offsets: Mapping[str, Float[np.ndarray, " 3"]],
    T_tracker_base: Float[np.ndarray, "4 4"],
    rng: np.random.Generator,
) -> Campaign:
    """The campaign: it tells the order of the poses and when each was measured, and no temperature."""
    conditions = true.measured(loop.q)
    campaign, _ = simulate(
        true.model, loop.q, rng=rng, x=true.x, targets=offsets, T_tracker_base=T_tracker_base, conditions=conditions
    )
    return replace(campaign, conditions=replace(conditions_in_order(loop.robot, loop.q), time=conditions.time))


def _true_placements(loop: ClosedLoop) -> dict[tuple[str, str], Placement]:
    """True poses of cutters and parts: the controller's, in the true base and on the true spindle."""
    into_tool = se3.inverse(loop.robot.T_flange_tool)
    out: dict[tuple[str, str], Placement] = {}
    for move in loop.program.motions:
        out[move.tool.name, move.part.name] = Placement(
            T_tool_grasped=into_tool @ move.tool.T, T_base_fixed=move.part.T, part_in_hand=False
        )
    return out


def _touch_parts(
    loop: ClosedLoop,
    trajectory: ControllerTrajectory,
    true: TrueRobot,
    placements: Mapping[tuple[str, str], Placement],
    rng: np.random.Generator,
) -> dict[str, TouchedPart]:
    """The parts that are cut, each touched with the cutter that cuts it, before the milling begins."""
    parts: dict[str, TouchedPart] = {}
    for number, move in enumerate(loop.program.motions):
        if move.kind != "axes" and move.part.name not in parts:
            marks = MARKS + TOUCHED_PART * rng.normal(size=MARKS.shape)
            placement = placements[move.tool.name, move.part.name]
            parts[move.part.name] = touch_off(loop.robot, move, trajectory.end[number], placement, true.touching, marks)
    return parts


def _measure_cell(
    program: Program,
    offsets: Mapping[str, Float[np.ndarray, " 3"]],
    placements: Mapping[tuple[str, str], Placement],
    parts: Mapping[str, TouchedPart],
    rng: np.random.Generator,
) -> Cell:
    """Cutters measured against the reflectors, and parts touched with them."""
    tools: dict[str, Measured] = {}
    touched: dict[str, Measured] = {}
    for move in program.motions:
        name, part = move.tool.name, move.part.name
        if name.casefold() not in tools:
            inward = se3.inverse(placements[name, part].T_tool_grasped)
            reflectors = {r: se3.apply(inward, p) + TOUCHED * rng.normal(size=3) for r, p in offsets.items()}
            tools[name.casefold()] = Measured(
                name=name, reflectors=reflectors, controller=move.tool.T, uncertainty=TOUCHED
            )
        if part in parts and part.casefold() not in touched:
            touched[part.casefold()] = Measured(
                name=part, touched=parts[part].q, touched_with=name, uncertainty=TOUCHED_PART
            )
    return Cell(tools=tools, parts=touched)


# How far the true cutter of a closed loop is from its path, in a few numbers, and how far it was said to be.

LINES: tuple[str, str, str] = "as programmed", "touched off", "corrected"
"""What is told of every robot."""

RADIUS_95 = float(np.sqrt(chdtri(3, 1.0 - 0.95) / 3.0))
"""Within which 95 % of errors lie that are alike in all directions, as a multiple of their root mean square in space."""


def errors_by_line(run: LoopRun) -> dict[str, Deviations]:
    """Errors of the true cutter on the true parts, by what was done against them."""
    return dict(zip(LINES, (run.before, run.touched_off, run.after), strict=True))


def largest_errors(runs: Sequence[LoopRun]) -> dict[str, Float[np.ndarray, " runs"]]:
    """The largest error of every robot in each line of `LINES`, and the ``stated`` radius of 95 % at the worst target, metres."""
    largest = {line: np.array([errors_by_line(run)[line].length.max() for run in runs]) for line in LINES}
    return {**largest, "stated": np.array([RADIUS_95 * stated_errors(run).max() for run in runs])}


def stated_errors(run: LoopRun) -> Float[np.ndarray, " k"]:
    """Root mean square of the error in space that the correction states for every point of `LoopRun.after`, metres."""
    return run.correction.uncertainty[run.after.move]


def share_within(run: LoopRun) -> float:
    """Share of the points of the corrected program at which the true error is within the stated radius of 95 %."""
    return float((run.after.length <= RADIUS_95 * stated_errors(run)).mean())


@dataclass(frozen=True, kw_only=True)
class StatedAndTrue:
    """The true errors of corrected programs, all points of all robots together, and what was stated of them; metres."""

    rms: float
    stated_rms: float
    largest: float
    stated_95: float
    """Radius at the worst target of all robots."""
    within: float
    """Share of the points within the radius that is stated at each to hold 95 %."""

    @classmethod
    def of(cls, runs: Sequence[LoopRun]) -> "StatedAndTrue":
        """Of some robots."""
        true = np.concatenate([run.after.length for run in runs])
        stated = np.concatenate([stated_errors(run) for run in runs])
        return cls(
            rms=rms(true),
            stated_rms=rms(stated),
            largest=float(true.max()),
            stated_95=float(RADIUS_95 * stated.max()),
            within=float((true <= RADIUS_95 * stated).mean()),
        )

    @property
    def held(self) -> bool:
        """Whether the errors are no larger than stated, root mean square, and at least 95 % of them within their radius."""
        return self.rms <= self.stated_rms and self.within >= 0.95


def summarise_runs(runs: Sequence[LoopRun]) -> list[dict[str, Any]]:
    """Largest and root-mean-square errors of every robot, millimetres, what was stated, and the effects that were found."""
    names = dict(zip(LINES, ("before", "touched_off", "after"), strict=True))
    return [
        {
            **{f"{names[line]}_max_mm": float(e.length.max() * 1e3) for line, e in errors_by_line(run).items()},
            **{f"{names[line]}_rms_mm": rms(e.length) * 1e3 for line, e in errors_by_line(run).items()},
            "stated_mm": float(stated_errors(run).max() * 1e3),
            "stated_rms_mm": rms(stated_errors(run)) * 1e3,
            "stated_95_mm": float(RADIUS_95 * stated_errors(run).max() * 1e3),
            "within_95": share_within(run),
            "effects": [effect.name for effect in run.calibration.model.effects],
            "refused": float(len(run.correction.rejected)),
        }
        for run in runs
    ]

"""The closed loop on virtual robots: plan, measure, identify, correct a milling program, and see where the true tool goes.

The controller takes its robot for nominal. The true robot has defects of geometry, drives that yield and gears that err;
three reflectors on the spindle are measured, the cutters are known by these reflectors, and the parts are measured by the
tracker. What counts is the way of the true cutter on the true part, before the correction and after it.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import joblib
import numpy as np
from jaxtyping import Float

from taskcal.adaptation.plan import plan
from taskcal.correction.assessment import Deviations, assess
from taskcal.correction.cell import Cell, Measured
from taskcal.correction.controller import drive
from taskcal.correction.correct import correct, piece_origins, wanted_ways
from taskcal.correction.correction import Correction
from taskcal.correction.placement import Placed, Placement
from taskcal.correction.rigid_motion import fit_points
from taskcal.demo.milling import ROWS, Milling, milling_program
from taskcal.demo.reference import reference_task
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.identification.identify import identify
from taskcal.measurement.station import Reflector, Station
from taskcal.measurement.tracker import TrackerNoise
from taskcal.measurement.virtual_cell import Truth, draw_defects, simulate
from taskcal.programs.program import Program
from taskcal.programs.rapid.read import read_rapid
from taskcal.robot.effects import Compliance, Harmonics
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal.short_repr import short_repr

REFLECTORS: Mapping[str, tuple[float, float, float]] = {
    "smr1": (0.06, 0.0, -0.12), "smr2": (-0.05, 0.11, -0.2), "smr3": (-0.05, -0.11, -0.2),
}  # fmt: skip
"""On the spindle, in its tool frame, metres."""

TOUCHED = 1e-5
"""Standard uncertainty with which reflectors and cutters are measured against each other, per axis, metres."""

MARKS = np.array([[0.12, 0.1, 0.0], [-0.12, 0.1, 0.0], [-0.12, -0.1, 0.0], [0.12, -0.1, 0.0]])
"""Where the tracker measures a part, in its frame, metres."""

MARKED = 2e-5
"""Standard uncertainty of a part that is fitted to its marks, per axis, metres."""

POSES = 60


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class LoopRun:
    """One true robot, measured, identified and corrected."""

    truth: Truth
    calibration: Calibration
    cell: Cell
    """What was measured of tools and parts."""
    correction: Correction
    before: Deviations
    """Of the true cutter on the true parts, in the program as it was written; motions to joint positions, which are on no
    part, are left out."""
    after: Deviations
    """In the corrected program."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ClosedLoop:
    """What all true robots have in common."""

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
    seed: int = 0,
    progress: Callable[[str], None] = lambda _: None,
) -> ClosedLoop:
    """Plan the measuring poses and write the milling program, for the reference task.

    Args:
        robot: an IRB 6660-205/1.9, whose reference workspace it is.
        poses: to measure.
        rows: that the milled surface is cut in.
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
    known = _known_model(robot)
    # what the robots have beside geometry is in the model that is fitted
    chosen = plan(known, task, poses, seed=seed, station=station, candidates=500, model_error=0.0, progress=progress)
    return ClosedLoop(robot=robot, milling=milling, program=read_rapid((milling.source,)), q=chosen.q, station=station)


def run_closed_loop(loop: ClosedLoop, seed: int) -> LoopRun:
    """Measure, identify and correct one true robot.

    Args:
        loop: what it has in common with the others.
        seed: of its defects and of everything measured.
    """
    rng = np.random.default_rng(seed)
    model = ErrorModel(loop.robot) + Compliance(tolerance=1e-4) + Harmonics(tolerance=5e-5)
    x = draw_defects(model, rng)
    offsets = {name: np.array(p) + 2e-3 * rng.normal(size=3) for name, p in REFLECTORS.items()}
    T_tracker_base = se3.pose(se3.exp(0.01 * rng.normal(size=3)), np.zeros(3)) @ loop.station.T_tracker_base
    campaign, truth = simulate(model, loop.q, rng=rng, x=x, targets=offsets, T_tracker_base=T_tracker_base)
    calibration = identify(_known_model(loop.robot), campaign)
    placements = _true_placements(loop)
    cell = _measure_cell(loop, truth, offsets, placements, rng)
    correction = correct(calibration, loop.program, cell=cell)
    moves = loop.program.moves
    placed = Placed(
        tool_in_base=lambda q: model.poses(q, x),
        placements=tuple(placements.values()),
        number=np.array([list(placements).index((m.tool.name, m.part.name)) for m in moves], dtype=np.int64),
    )
    driven = drive(loop.robot, moves)
    wanted = wanted_ways(driven, placed, moves)
    again = drive(loop.robot, correction.moves)
    cutting = np.array([move.kind != "axes" for move in moves])
    return LoopRun(
        truth=truth,
        calibration=calibration,
        cell=cell,
        correction=correction,
        before=assess(placed, wanted, driven).of_moves(cutting),
        after=assess(placed, wanted, again, piece_origins(correction.pieces)).of_moves(cutting),
    )


def run_closed_loops(
    loop: ClosedLoop, seeds: Sequence[int], progress: Callable[[str], None] = lambda _: None
) -> list[LoopRun]:
    """Run one true robot for each seed, on all cores.

    Args:
        loop: what the robots have in common.
        seeds: of each robot's defects and measurements.
        progress: told how many are done.
    """
    jobs = (joblib.delayed(run_closed_loop)(loop, seed) for seed in seeds)
    done = cast(Iterator[LoopRun], joblib.Parallel(n_jobs=-1, return_as="generator")(jobs))
    runs: list[LoopRun] = []
    for run in done:
        runs.append(run)
        progress(f"{len(runs)} of {len(seeds)} robots measured, identified, corrected")
    return runs


def _known_model(robot: Robot) -> ErrorModel:
    """What is identified."""
    return ErrorModel(robot) + Compliance() + Harmonics()


def _true_placements(loop: ClosedLoop) -> dict[tuple[str, str], Placement]:
    """Where the cutters and parts truly are: where the controller has them, in the true base and on the true spindle."""
    into_tool = se3.inverse(loop.robot.T_flange_tool)
    out: dict[tuple[str, str], Placement] = {}
    for move in loop.program.moves:
        out[move.tool.name, move.part.name] = Placement(
            T_tool_held=into_tool @ move.tool.T, T_base_standing=move.part.T, part_in_hand=False
        )
    return out


def _measure_cell(
    loop: ClosedLoop,
    truth: Truth,
    offsets: Mapping[str, Float[np.ndarray, " 3"]],
    placements: Mapping[tuple[str, str], Placement],
    rng: np.random.Generator,
) -> Cell:
    """Cutters measured against the reflectors, and parts measured by the tracker."""
    noise = TrackerNoise()
    tools: dict[str, Measured] = {}
    parts: dict[str, Measured] = {}
    for (tool, part), placement in placements.items():
        inward = se3.inverse(placement.T_tool_held)
        reflectors = {name: se3.apply(inward, p) + TOUCHED * rng.normal(size=3) for name, p in offsets.items()}
        tools[tool.casefold()] = Measured(name=tool, reflectors=reflectors, uncertainty=TOUCHED)
        marks = se3.apply(truth.T_tracker_base @ placement.T_base_standing, MARKS)
        seen = marks + (np.linalg.cholesky(noise.covariance(marks)) @ rng.normal(size=(len(marks), 3, 1)))[..., 0]
        parts[part.casefold()] = Measured(name=part, in_tracker=fit_points(MARKS, seen)[0], uncertainty=MARKED)
    return Cell(tools=tools, parts=parts)


def largest_errors(runs: Sequence[LoopRun]) -> dict[str, Float[np.ndarray, " runs"]]:
    """The largest error of every robot before and after, metres."""
    return {
        "before": np.array([run.before.length.max() for run in runs]),
        "after": np.array([run.after.length.max() for run in runs]),
    }


def summarise_runs(runs: Sequence[LoopRun]) -> list[dict[str, float]]:
    """Largest and root-mean-square errors of every robot, millimetres."""
    return [
        {
            "before_max_mm": float(run.before.length.max() * 1e3),
            "after_max_mm": float(run.after.length.max() * 1e3),
            "before_rms_mm": float((run.before.length**2).mean() ** 0.5 * 1e3),
            "after_rms_mm": float((run.after.length**2).mean() ** 0.5 * 1e3),
            "refused": float(len(run.correction.refused)),
        }
        for run in runs
    ]

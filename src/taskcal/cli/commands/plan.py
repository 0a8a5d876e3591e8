"""``taskcal plan``: the poses to measure."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

import taskcal
from taskcal.cli.command import Told, option, output_option
from taskcal.cli.options.campaign import MeasuredOptions
from taskcal.cli.options.common import ModelOptions, TaskOption
from taskcal.cli.options.observing import ObservingOptions, describe_fixtures
from taskcal.cli.options.page import PageOptions
from taskcal.cli.run import File, Result, Run
from taskcal.planning.options import PlannedPoses, PlanOptions
from taskcal_groundwork.options import Written

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np

    import taskcal.report.plan
    from robot_programs.core.program import Motion
    from robot_programs.core.source import Source
    from taskcal.live.program import Program
    from taskcal.observations import Instrument


# Measuring programs that ``taskcal plan`` writes beside the plan.

SLOW = 0.02
"""Speed of the TCP into a socket and out of it, in RAPID, metres per second."""


class Stop(NamedTuple):
    """End of one motion of a program."""

    q: "np.ndarray"
    note: str
    halts: bool = True
    waits: bool = False
    speed: float | None = None
    """Metres per second; None for the program's."""


@dataclass(frozen=True, kw_only=True)
class MeasuringOptions:
    """Programs that drive the robot through the poses to measure, and how they drive it."""

    program: list[Path] | None = option(
        None,
        "MEASURE.mod",
        "Write a robot program that stops in every pose: RAPID .mod, KRL .src, TP .ls, URScript .script or .csv; repeatable.",
        writes="later",
    )
    wait_s: float = option(3.0, "S", "Waiting time in each pose.", low=0.0, high=600.0)
    wait_input: str = option(
        "",
        "INPUT",
        "Wait in each pose for a digital input in place of a time, until it has gone off and on: its name in RAPID, its number in "
        "KRL, TP and URScript.",
    )
    speed_mm_s: float = option(250.0, "MM/S", "TCP speed, in RAPID.", low=0.1, high=10_000.0)
    speed_percent: float = option(10.0, "P", "Joint speed override, in KRL, TP and URScript.", low=0.1, high=100.0)

    @property
    def paths(self) -> tuple[Path, ...]:
        """Files to write."""
        return tuple(self.program or ())

    def compose(
        self, model: "taskcal.ErrorModel", plan: "taskcal.Plan", visits: "Program | None" = None
    ) -> "tuple[Source, ...]":
        """Programs that visit the poses of a plan: a file for each setup of fixtures, where there are several.

        Each motion has a comment that names the pose of the plan. A socket is entered slowly along its axis; the program waits
        there, and leaves the same way.

        Raises:
            TaskcalError: a language cannot say it, or its suffix is not known.
        """
        import numpy as np

        if visits is not None:
            stops = [Stop(q, f"pose {name}", waits=True) for name, q in zip(visits.ids, visits.q, strict=True)]
            return tuple(self._halting(path, model, stops) for path in self.paths)
        stage = np.zeros(len(plan.q), dtype=int) if plan.of is None else plan.instrument.stages[plan.of]
        return tuple(
            self._visiting(path, model, plan, np.flatnonzero(stage == number))
            for paths in self.paths_of(plan.instrument)
            for number, path in enumerate(paths)
        )

    def paths_of(self, instrument: "Instrument") -> tuple[tuple[Path, ...], ...]:
        """Paths that are written for each file that was asked for: one, or one for each setup of fixtures, numbered from 1."""
        count = int(instrument.stages.max()) + 1
        if count == 1:
            return tuple((path,) for path in self.paths)
        return tuple(tuple(path.with_stem(f"{path.stem}_{k + 1}") for k in range(count)) for path in self.paths)

    def _visiting(self, path: Path, model: "taskcal.ErrorModel", plan: "taskcal.Plan", rows: "np.ndarray") -> "Source":
        """The program of some of the poses."""
        import numpy as np

        visits = plan.q[:, None]
        if plan.of is not None:
            inward = plan.instrument.visits(model.nominal, plan.q, plan.of)
            visits = np.concatenate([inward, inward[:, -2::-1]], axis=1)
        seat, via = visits.shape[1] // 2, {one.pose: one.via for one in plan.blocked}
        slow = min(self.speed_mm_s * 1e-3, SLOW)
        said = {seat: plan.instrument.seated, 0: "approach", 2 * seat: "out"} if seat else {}
        stops: list[Stop] = []
        for row in rows:
            round_by = via.get(int(row))
            stops += [Stop(q, f"on the way to pose {row}") for q in ([] if round_by is None else round_by)]
            unsafe = "not clear from the pose before" if row in via and round_by is None else ""
            for k, q in enumerate(visits[row]):
                remark = unsafe if unsafe and not k else said.get(k, "")
                name = plan.names[row] if plan.names else ""
                note = " ".join(part for part in (f"pose {row}", name, remark) if part)
                stops.append(Stop(q, note, halts=k in (0, seat, 2 * seat), waits=k == seat, speed=slow if k else None))
        return self._halting(path, model, stops)

    def _halting(self, path: Path, model: "taskcal.ErrorModel", stops: "list[Stop]") -> "Source":
        """The program of some stops."""
        import numpy as np

        from robot_programs.reading import motions_to_joints

        motions = motions_to_joints(
            model.robot,
            np.stack([stop.q for stop in stops]),
            path,
            stops=[stop.halts for stop in stops],
            waits=[stop.waits for stop in stops],
            speeds=[stop.speed for stop in stops],
        )
        return self._composed(path, model.robot, motions, [stop.note for stop in stops])

    def _composed(self, path: Path, robot: "taskcal.Robot", motions: "Sequence[Motion]", notes: list[str]) -> "Source":
        from robot_programs.reading import compose_program

        return compose_program(
            path,
            robot,
            motions,
            notes=notes,
            wait_s=self.wait_s,
            wait_input=self.wait_input,
            speed=self.speed_mm_s * 1e-3,
            joint_speed_percent=self.speed_percent,
        )

    def check(self, robot: "taskcal.Robot") -> None:
        """Check, before anything is computed, that a program can be written to each file.

        Raises:
            TaskcalError: it cannot.
        """
        for path in self.paths:
            self._composed(path, robot, [], [])


@dataclass(frozen=True, kw_only=True)
class ExtendedOptions(MeasuredOptions):
    """A campaign to go on from, and how it is read; some are of a plan without a tracker too."""

    of_others = ("distances", "wire_scale", "board", "camera")


@dataclass(frozen=True, eq=False, kw_only=True)
class Setting:
    """Inputs of a plan, read."""

    model: "taskcal.ErrorModel"
    calibration: "taskcal.Calibration | None"
    task: "taskcal.Task"
    station: "taskcal.Station | None"
    campaign: "taskcal.Campaign | None"
    instrument: "Instrument"

    @property
    def measured(self) -> int:
        """Rows that are there already."""
        if self.campaign is not None:
            return len(self.campaign)
        return 0 if self.calibration is None else len(self.calibration.ids)


def command(
    *,
    run: Run,
    task: TaskOption,
    output: Path = output_option(..., "PLAN.csv", "Output CSV: planned joint values."),
    of: ModelOptions,
    poses: PlannedPoses,
    choice: Annotated[Written[PlanOptions], Told(("campaign", "calibration", "observe"))],
    programs: MeasuringOptions,
    observing: ObservingOptions,
    measured: ExtendedOptions,
    page: PageOptions,
) -> Result:
    """Plan measurement poses that minimise the expected task error.

    The poses are reachable, free of collisions with the robot and obstacles, visible to the tracker, and listed in the order of
    visiting.

    With --observe they are for a ball in sockets, a wire or a wrist camera, without a tracker.

    With --calibration they reduce the uncertainty of that calibration; with --campaign they complement its poses.
    """
    _check_sources(of, measured, choice, observing, poses.kept_out)
    setting = _read(task, of, measured, choice, observing)
    run.free("--program", *(path for own in programs.paths_of(setting.instrument) for path in own))
    programs.check(setting.model.robot)
    begin = run.bar(["candidates"], 5)  # candidates, choice, exchange, two rounds of refinement
    chosen = _plan(setting, choice, poses.count, measured.campaign or of.calibration, begin)
    visits = _visits(chosen, setting, poses.kept_out, choice.seed)
    sources = programs.compose(setting.model, chosen, visits)
    known = {
        "visible": _visible(chosen, setting.station),
        "station": choice.station,
        "clearance_mm": _clearance(chosen, setting) if chosen.of is None else None,
        "calibration": of.calibration,
        "kept_out": poses.kept_out or None,
        "programs": [str(source.path) for source in sources] or None,
    }
    result: dict[str, Any] = {
        "plan": output,
        "robot": setting.model.robot.name,
        "task": setting.task.name,
        **chosen.summary(),
        "measured_before": setting.measured,
        **{name: value for name, value in known.items() if value is not None},
    }
    if chosen.of is not None and chosen.instrument.label:
        result["standing"] = describe_fixtures(chosen.instrument.fixtures)
        result["fixtures_stated"] = observing.stated is not None
    text = _text(chosen, setting, visits)
    files = [File("plan", output, text, ", in the order in which to visit the poses")]
    counts = _counts(chosen, visits)
    files += [File("program", one.path, one.encode(), f", {count} poses") for one, count in zip(sources, cycle(counts))]
    return Result(
        summary=result,
        sections=lambda: taskcal.report.plan.plan_sections(result, setting.model.robot),
        files=files,
        page=lambda: taskcal.report.plan.plan_page(setting.model, setting.task, chosen, result, seed=choice.seed),
    )


def _counts(chosen: "taskcal.Plan", visits: "Program | None") -> list[int]:
    """Poses of a program; of one for each setup of fixtures, where there are several."""
    import numpy as np

    if chosen.of is None:
        return [len(chosen.q if visits is None else visits.q)]
    return np.bincount(chosen.instrument.stages[chosen.of]).tolist()


def _visits(chosen: "taskcal.Plan", setting: Setting, kept_out: int | None, seed: int) -> "Program | None":
    """The poses to visit where some are kept out, these in among the others."""
    from taskcal.live.program import Program
    from taskcal.planning.plan import draw_task_poses

    if not kept_out:
        return None
    out = draw_task_poses(setting.model, setting.task, kept_out, seed=seed, station=setting.station)
    return Program.of(chosen.q, out)


def _text(chosen: "taskcal.Plan", setting: Setting, visits: "Program | None") -> str:
    """The table of joints, and without a tracker of what is to be filled in."""
    from taskcal.reading.writer import joints_text

    if visits is not None:
        return joints_text(visits.q, setting.model.robot, {"id": visits.ids})
    columns = {} if chosen.of is None else chosen.instrument.columns(chosen.of)
    if chosen.stations > 1:
        columns = {"station": [f"{k + 1}" for k in chosen.station]}
    return joints_text(chosen.q, setting.model.robot, columns)


def _check_sources(
    of: ModelOptions,
    measured: ExtendedOptions,
    choice: Written[PlanOptions],
    observing: ObservingOptions,
    kept_out: int | None,
) -> None:
    """See that a plan without a tracker begins anew, and that poses are kept out of one with a tracker at one place.

    Raises:
        typer.BadParameter: it would go on, or they are not.
    """
    if observing.fixed and (measured.campaign or of.calibration):
        given = "--campaign" if measured.campaign else "--calibration"
        raise typer.BadParameter(
            f"a plan for --observe {observing.observe} begins anew; give --robot alone", param_hint=given
        )
    if measured.campaign is None:
        observing.check(measured)
    if kept_out and (observing.fixed or choice.stations > 1):
        raise typer.BadParameter(
            "poses are kept out of a campaign with a tracker at one place; leave out --observe and --stations",
            param_hint="--kept-out",
        )


def _read(
    path: Path,
    of: ModelOptions,
    measured: ExtendedOptions,
    choice: Written[PlanOptions],
    observing: ObservingOptions,
) -> Setting:

    model, calibration = of.load()
    task = taskcal.load_task(path)
    station = None if choice.station is None else taskcal.load_station(choice.station)
    return Setting(
        model=model,
        calibration=calibration,
        task=task,
        station=None if observing.fixed else station,
        instrument=observing.load(model, task, station, measured),
        campaign=None if measured.campaign is None else measured.read(measured.campaign, model.robot).campaign,
    )


def _plan(
    setting: Setting, choice: Written[PlanOptions], count: int, source: Path | None, progress: Callable[[str], None]
) -> "taskcal.Plan":
    """The plan.

    Raises:
        FileError: the campaign or calibration of `source` does not go with robot or station.
        ReachError: fewer poses can be measured than were asked for, or the task's accuracy is out of reach.
    """
    from taskcal.errors import CampaignError, FileError
    from taskcal.planning.plan import check_demands

    try:
        options = choice.made(
            station=setting.station,
            campaign=setting.campaign,
            calibration=setting.calibration,
            observe=None if setting.instrument.kind.in_tracker else setting.instrument,
            progress=progress,
        )
        chosen = taskcal.plan(setting.model, setting.task, count, options)
    except CampaignError as error:
        if source is None:
            raise
        raise FileError(source, str(error)) from error
    check_demands(chosen, count)
    return chosen


def _visible(chosen: "taskcal.Plan", station: "taskcal.Station | None") -> list[list[str]] | None:
    """Names of the reflectors seen at each pose, where a station says so."""
    if station is None:
        return None
    names = [reflector.name for reflector in station.reflectors]
    return [[name for name, seen in zip(names, row, strict=True) if seen] for row in chosen.visible]


def _clearance(chosen: "taskcal.Plan", setting: Setting) -> dict[str, list[float] | None]:
    """Gaps at each pose, between links and from them to the station's boxes; None where there is nothing to keep clear of."""
    import numpy as np

    from taskcal.kinematics.clearance import gap_between_links, gap_to_boxes, place_links

    links = place_links(setting.model, chosen.q)
    gaps = {"between_links": gap_between_links(links), "to_keep_out": gap_to_boxes(links, setting.instrument.obstacles)}
    return {name: (gap * 1e3).tolist() if np.isfinite(gap).all() else None for name, gap in gaps.items()}

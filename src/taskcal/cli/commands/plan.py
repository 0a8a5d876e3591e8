"""``taskcal plan``: the poses to measure."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import typer

import taskcal
from taskcal.cli.command import option
from taskcal.cli.options.campaign import MeasuredOptions
from taskcal.cli.options.common import (
    TARGET_WITHIN_MM,
    ModelErrorOption,
    ModelOptions,
    SeedOption,
    TargetWithinOption,
    TaskOption,
    check_one_model_error,
    metres,
)
from taskcal.cli.options.observing import ObservingOptions, describe_fixtures, tell_how_to_measure
from taskcal.cli.options.page import PageOptions
from taskcal.cli.output import files_of_task, show, show_facts
from taskcal.cli.progress import bar_over

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np

    from robot_programs.core.program import Motion
    from robot_programs.core.source import Source
    from taskcal.live.program import Program
    from taskcal.observations import Instrument
    from taskcal.report.page import Page


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
    )
    wait_s: float = option(3.0, "S", "Waiting time in each pose.", min=0.0, max=600.0)
    wait_input: str = option(
        "",
        "INPUT",
        "Wait in each pose for a digital input in place of a time, until it has gone off and on: its name in RAPID, its number in "
        "KRL, TP and URScript.",
    )
    speed_mm_s: float = option(250.0, "MM/S", "TCP speed, in RAPID.", min=0.1, max=10_000.0)
    speed_percent: float = option(10.0, "P", "Joint speed override, in KRL, TP and URScript.", min=0.1, max=100.0)

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

    def paths_of(self, instrument: "Instrument | None") -> tuple[tuple[Path, ...], ...]:
        """Paths that are written for each file that was asked for: one, or one for each setup of fixtures, numbered from 1."""
        count = 1 if instrument is None else int(instrument.stages.max()) + 1
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


@dataclass(frozen=True, kw_only=True)
class PlanOptions:
    """Selection of the poses."""

    count: int = option(60, "N", "Poses to measure.", also="-n", min=1)
    seed: SeedOption = 0
    station: Path | None = option(
        None,
        "STATION.toml",
        "Tracker, reflectors and obstacles; by default one reflector at the TCP, always visible. With --observe only its "
        "obstacles count.",
    )
    criterion: Literal["task", "D", "A", "E", "O1", "O2", "O3", "O4", "O5"] = option(
        "task", help="Expected error over the task, or a classical criterion."
    )
    candidates: int = option(10_000, "N", "Candidate poses.", min=1)
    stations: int = option(1, "N", "Places that the tracker is moved to, as many poses at each.", min=1)
    kept_out: int | None = option(
        None,
        "N",
        "Poses of the task that chance chooses, beside the others, to judge by; and every tenth is the first one again. For "
        "taskcal measure --program, which needs 6 or more to prove a tolerance.",
        min=1,
    )
    model_error_mm: ModelErrorOption = None
    target_within_mm: TargetWithinOption = TARGET_WITHIN_MM


@dataclass(frozen=True, eq=False, kw_only=True)
class Setting:
    """Inputs of a plan, read."""

    model: "taskcal.ErrorModel"
    calibration: "taskcal.Calibration | None"
    task: "taskcal.Task"
    station: "taskcal.Station | None"
    campaign: "taskcal.Campaign | None"
    instrument: "Instrument | None" = None
    """What measures, if not a tracker."""

    @property
    def measured(self) -> int:
        """Rows that are there already."""
        if self.campaign is not None:
            return len(self.campaign)
        return 0 if self.calibration is None else len(self.calibration.ids)


def command(
    *,
    task: TaskOption,
    output: Path = option(..., "PLAN.csv", "Output CSV: planned joint values.", also="-o"),
    of: ModelOptions,
    choice: PlanOptions,
    programs: MeasuringOptions,
    observing: ObservingOptions,
    measured: ExtendedOptions,
    page: PageOptions,
) -> None:
    """Plan measurement poses that minimise the expected task error.

    The poses are reachable, free of collisions with the robot and obstacles, visible to the tracker, and listed in the order of
    visiting.

    With --observe they are for a ball in sockets, a wire or a wrist camera, without a tracker.

    With --calibration they reduce the uncertainty of that calibration; with --campaign they complement its poses.
    """
    _check_sources(of, measured, choice, observing)
    setting = _read(task, of, measured, choice, observing) if observing.fixed else None
    numbered = programs.paths_of(None if setting is None else setting.instrument)
    paths = tuple(path for own in numbered for path in own)
    outputs = page.begin(
        "plan",
        [("--output", output), *(("--program", path) for path in paths)],
        [of.robot, of.calibration, *files_of_task(task), choice.station, *measured.inputs, *observing.files],
    )
    setting = setting or _read(task, of, measured, choice, observing)
    robot = setting.model.robot
    programs.check(robot)
    steps = 5 + page.asked  # candidates, choice, exchange, two rounds of refinement, page
    with bar_over(["candidates"], steps) as begin:
        chosen = _plan(setting, choice, measured.campaign or of.calibration, begin)
        visits = _visits(chosen, setting, choice)
        contents: dict[Path, str | bytes] = {output: _text(chosen, setting, visits)}
        for source in programs.compose(setting.model, chosen, visits):
            contents[source.path] = source.encode()

        def make() -> "Page":
            from taskcal.report.plan import plan_page

            begin("page")
            return plan_page(setting.model, setting.task, chosen, seed=choice.seed)

        made = page.write(outputs, contents, make)
    result = {"plan": output, "robot": robot.name, **chosen.summary(), **_visible(chosen, setting.station)}
    if choice.station is not None:
        result["station"] = choice.station
    if chosen.of is None:
        result["clearance_mm"] = _clearance(chosen, setting)
    result["measured_before"] = setting.measured
    if of.calibration is not None:
        result["calibration"] = of.calibration
    if choice.kept_out:
        result["kept_out"] = choice.kept_out
    if paths:
        result["programs"] = [str(path) for path in paths]
    if chosen.of is not None and chosen.instrument.label:
        result["standing"] = describe_fixtures(chosen.instrument.fixtures)

    def show_plan() -> None:
        _show(result, chosen, setting, page.in_words(made), visited=len(chosen.q if visits is None else visits.q))
        if chosen.of is not None:
            tell_how_to_measure(chosen, robot, stated=observing.stated is not None)

    page.give(result, show_plan)


def _visits(chosen: "taskcal.Plan", setting: Setting, choice: PlanOptions) -> "Program | None":
    """The poses to visit where some are kept out, these in among the others."""
    from taskcal.live.program import Program
    from taskcal.planning.plan import draw_task_poses

    if not choice.kept_out:
        return None
    out = draw_task_poses(setting.model, setting.task, choice.kept_out, seed=choice.seed, station=setting.station)
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
    of: ModelOptions, measured: ExtendedOptions, choice: PlanOptions, observing: ObservingOptions
) -> None:
    """See that what is known of the model error comes from one place, and that a plan without a tracker begins anew.

    Raises:
        typer.BadParameter: it comes from two, or such a plan would go on.
    """
    if observing.fixed and (measured.campaign or of.calibration):
        given = "--campaign" if measured.campaign else "--calibration"
        raise typer.BadParameter(
            f"a plan for --observe {observing.observe} begins anew; give --robot alone", param_hint=given
        )
    if measured.campaign is None:
        observing.check(measured)
    if choice.kept_out and (observing.fixed or choice.stations > 1):
        raise typer.BadParameter(
            "poses are kept out of a campaign with a tracker at one place; leave out --observe and --stations",
            param_hint="--kept-out",
        )
    if choice.stations > 1 and (observing.fixed or measured.campaign or of.calibration):
        raise typer.BadParameter(
            "stations are those of a tracker and of a plan that begins anew; leave out --observe, --campaign and --calibration",
            param_hint="--stations",
        )
    check_one_model_error(choice.model_error_mm, measured.campaign, of.calibration)
    if of.calibration is not None and choice.target_within_mm != TARGET_WITHIN_MM:
        raise typer.BadParameter("the calibration has its own; omit it", param_hint="--target-within-mm")
    if of.calibration is not None and measured.campaign is not None:
        raise typer.BadParameter("give --calibration or --campaign, not both", param_hint="--calibration / --campaign")


def _read(
    path: Path, of: ModelOptions, measured: ExtendedOptions, choice: PlanOptions, observing: ObservingOptions
) -> Setting:

    model, calibration = of.load()
    task = taskcal.load_task(path)
    station = None if choice.station is None else taskcal.load_station(choice.station)
    instrument = observing.load(model, task, () if station is None else station.keep_out, measured)
    return Setting(
        model=model,
        calibration=calibration,
        task=task,
        station=None if instrument is not None else station,
        instrument=instrument,
        campaign=None if measured.campaign is None else measured.read(measured.campaign, model.robot).campaign,
    )


def _plan(
    setting: Setting, choice: PlanOptions, source: Path | None, progress: Callable[[str], None]
) -> "taskcal.Plan":
    """The plan.

    Raises:
        FileError: the campaign or calibration of `source` does not go with robot or station.
        ReachError: fewer poses can be measured than were asked for, or the task's accuracy is out of reach.
    """
    from taskcal.errors import CampaignError, FileError
    from taskcal.planning.plan import check_demands

    try:
        chosen = taskcal.plan(
            setting.model,
            setting.task,
            choice.count,
            seed=choice.seed,
            station=setting.station,
            criterion=choice.criterion,
            campaign=setting.campaign,
            calibration=setting.calibration,
            candidates=choice.candidates,
            model_error=metres(choice.model_error_mm),
            progress=progress,
            observe=setting.instrument,
            stations=choice.stations,
            target_within=choice.target_within_mm * 1e-3,
        )
    except CampaignError as error:
        if source is None:
            raise
        raise FileError(source, str(error)) from error
    check_demands(chosen, choice.count)
    return chosen


def _visible(chosen: "taskcal.Plan", station: "taskcal.Station | None") -> dict[str, Any]:
    """Names of the reflectors seen at each pose, where a station says so."""
    if station is None:
        return {}
    names = [reflector.name for reflector in station.reflectors]
    return {"visible": [[name for name, seen in zip(names, row, strict=True) if seen] for row in chosen.visible]}


def _clearance(chosen: "taskcal.Plan", setting: Setting) -> dict[str, list[float] | None]:
    """Gaps at each pose, between links and from them to the station's boxes; None where there is nothing to keep clear of."""
    import numpy as np

    from taskcal.kinematics.clearance import gap_between_links, gap_to_boxes, place_links

    links = place_links(setting.model, chosen.q)
    boxes = () if setting.station is None else setting.station.keep_out
    gaps = {"between_links": gap_between_links(links), "to_keep_out": gap_to_boxes(links, boxes)}
    return {name: (gap * 1e3).tolist() if np.isfinite(gap).all() else None for name, gap in gaps.items()}


def _in_words(clearance: Mapping[str, list[float] | None], model: "taskcal.ErrorModel") -> str:
    """The least gaps of all poses, and of what."""
    radii = model.robot.link_radii
    if radii is None:
        return "not checked: the robot file states no link_radii_mm"
    said = {"between_links": "between links", "to_keep_out": "to keep-out boxes"}
    gaps = [f"{min(gap):.0f} mm {said[name]}" for name, gap in clearance.items() if gap]
    return f"at least {', '.join(gaps) or '–'}; links as capsules of {min(radii) * 1e3:g} to {max(radii) * 1e3:g} mm radius"


def _views_in_words(chosen: "taskcal.Plan") -> str:
    """The least and the largest of each figure of the poses; empty where there are none."""
    units = {"mm": " mm", "deg": "°"}
    out: list[str] = []
    for name, values in chosen.views.items():
        what, _, unit = name.rpartition("_")
        shown = f"{values.min():.0f} to {values.max():.0f}{units.get(unit, '')}"
        out.append(f"{what or name} {shown}")
    return ", ".join(out)


def _show(result: Mapping[str, Any], chosen: "taskcal.Plan", setting: Setting, pages: str, *, visited: int) -> None:
    import numpy as np

    from taskcal.planning.plan import describe_accuracy, describe_lost
    from taskcal.report.content import state_model_error
    from taskcal.report.plan import tabulate_by_count, tabulate_expected_errors

    show(tabulate_expected_errors(chosen, setting.task.name, measured_before=result["measured_before"]))
    show(tabulate_by_count(chosen))
    single = f"expected error {result['expected_with_model_error_mm']:.3f} mm (3D rms), model error included"
    facts = [
        ("accuracy", describe_accuracy(chosen)),
        ("model error", state_model_error(result["model_error_mm"], result["model_error_origin"])),
        ("single pose", single),
        ("candidates", f"{chosen.candidates} feasible; rejected: {describe_lost(chosen) or 'none'}"),
        ("criterion", f"{chosen.criterion}; {chosen.exchanges} exchanges after the greedy start"),
        ("plan", f"wrote {result['plan']}, in the order in which to visit the poses"),
    ]
    facts[4:4] = [("images", f"{view}")] if (view := _views_in_words(chosen)) else []
    if "visible" in result:
        seen = [len(names) for names in result["visible"]]
        number = f"{min(seen)} to {max(seen)}" if min(seen) < max(seen) else str(max(seen))
        facts.insert(4, ("reflectors", f"{number} visible at each pose"))
    if "clearance_mm" in result:
        facts.insert(-2, ("clearance", _in_words(result["clearance_mm"], setting.model)))
    counts = [visited] if chosen.of is None else np.bincount(chosen.instrument.stages[chosen.of])
    programs = result.get("programs", [])
    facts += [("program", f"wrote {path}, {counts[k % len(counts)]} poses") for k, path in enumerate(programs)]
    if pages:
        facts.append(("report", f"wrote {pages}"))
    show_facts(facts)

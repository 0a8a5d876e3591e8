"""``taskcal measure``: the campaign that chooses its own poses, and stops when the task's tolerance is proven."""

import json
import signal
import sys
import threading
import time
from collections.abc import Callable, Generator, Mapping
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

import taskcal
from taskcal.cli.command import option, output_option
from taskcal.cli.options.common import RobotOption, TaskOption, look_at
from taskcal.cli.options.observing import ObservingOptions, describe_fixtures
from taskcal.cli.output import info, plain, say, show_facts, tell
from taskcal.cli.run import JsonOption
from taskcal.errors import listed
from taskcal.live.options import Driving, RowOptions
from taskcal_groundwork.options import Seed
from taskcal_groundwork.said import Said

if TYPE_CHECKING:
    from taskcal.live.devices import Controller
    from taskcal.live.program import Program
    from taskcal.live.runner import Answer, Ending, Left, Question, RunEvent, Runner
    from taskcal.live.steering import Aim, State, Steering
    from taskcal.observations import Instrument, Observation
    from taskcal.reading import ReadOptions


@dataclass(frozen=True, kw_only=True)
class DeviceOptions(Driving):
    """What is read, and how it is reached."""

    controller: str = option(
        ..., "NAME", "Where the joints come from: hand, virtual, …; an unknown name lists them all.", also="-c"
    )
    controller_address: str | None = option(None, "ADDRESS", "Of the controller, such as HOST or HOST:PORT.")
    instrument: str = option(..., "NAME", "Where the points come from: folder, virtual, …", also="-i")
    instrument_address: str | None = option(
        None, "ADDRESS", "Of the instrument, such as HOST:PORT, or a path for folder."
    )
    columns: str = option(
        "",
        "'NAME …'",
        "Columns of the instrument's lines, such as 'x_mm y_mm z_mm', where no header states them; - skips one.",
    )
    timeout_s: float = option(5.0, "S", "Limit of each answer of a device.", low=0.1, high=600.0)
    program: Path | None = option(
        None,
        "PLAN.csv",
        "Poses that a program on the controller visits, as taskcal plan wrote them with it: rows are taken where the robot stands.",
        callback=look_at,
    )
    drive: bool = option(
        False, help="Move the robot, the first time at a tenth of the speed; without it the controller is only read."
    )

    @contextmanager
    def opened(self, robot: "taskcal.Robot", observed: "Instrument") -> "Generator[tuple[Controller, Any]]":
        """Both connections, which are closed at the end.

        Args:
            robot: whose joints are read.
            observed: what measures in its cell.

        Raises:
            UnknownName: there is no such controller or instrument.
            DeviceError: one cannot be reached, or does not measure that.
            typer.BadParameter: the controller cannot move a robot.
        """
        from taskcal.live.devices import controller_of, instrument_of

        controller, instrument = controller_of(self.controller), instrument_of(self.instrument)
        if self.drive and not controller.can_move:
            raise typer.BadParameter(f"'{self.controller}' does not move a robot; leave it out", param_hint="--drive")
        if self.drive and self.program is not None:
            raise typer.BadParameter(
                "the robot is moved by the program or by Taskcal; leave one out", param_hint="--drive"
            )
        with ExitStack() as stack:
            first = stack.enter_context(controller.open(self.controller_address, robot, self.timeout_s))
            second = stack.enter_context(instrument.open(self.instrument_address, self.timeout_s, self.columns))
            second.observes(observed)
            yield first, second


@dataclass(frozen=True, kw_only=True)
class LengthOptions:
    """Lengths that are stated beside the rows."""

    distances: Path | None = option(
        None,
        "FILE",
        "Stated distances of sockets: columns socket_a, socket_b, distance_mm, and u_mm where known.",
        callback=look_at,
    )
    wire_scale: bool = option(
        False, help="Fit the scale of measured lengths (d_mm) too; the robot's size is then nominal."
    )

    board: Path | None = option(None, "BOARD.toml", "The one printed board that images show.", callback=look_at)
    camera: Path | None = option(
        None,
        "CAMERA.toml|.yaml",
        "The camera that takes them, by which the first poses are chosen; the fit finds its own.",
        callback=look_at,
    )

    def read_options(self, observed: "Instrument") -> "ReadOptions":
        """Stated options, as the reader takes them.

        Args:
            observed: what measures.
        """
        from taskcal.reading import ReadOptions

        stated = ReadOptions(distances=self.distances, wire_scale=self.wire_scale)
        if observed.looked_for is None:
            return stated
        return replace(stated, board=self.board, lens=observed.looked_for.lens.model)


def command(
    *,
    robot: RobotOption,
    task: TaskOption,
    devices: DeviceOptions,
    observing: ObservingOptions,
    lengths: LengthOptions,
    output: Path = output_option(
        ..., "CAMPAIGN.csv", "The campaign; calibration and report are written beside it.", writes="updated"
    ),
    resume: bool = option(False, help="Go on with the campaign that is there."),
    station: Path | None = option(
        None,
        "STATION.toml",
        "Tracker, its one reflector and keep-out boxes; with --observe only these boxes count.",
        callback=look_at,
    ),
    rows: RowOptions,
    seed: Seed = 0,
    as_json: JsonOption = False,
) -> None:
    """Measure live: choose each pose by what was measured so far, until the tolerance is proven.

    Every row is on the disk before the next pose is shown. Ctrl-C finishes the row in hand, and --resume goes on.

    A person moves the robot, or with --program a program on the controller, or with --drive Taskcal. With --observe a ball in
    sockets, a wire, images of a printed board or another instrument takes the tracker's place. With --json, each event and
    each question is a line; answers are read from standard input.
    """
    beside = {".calibration.json": "calibration", ".report.html": "report"}
    files = {name: output.with_suffix(suffix) for suffix, name in beside.items()}
    if (watched := devices.instrument_address) is not None:
        _check_apart(output, Path(watched))
    _check_observed(devices, observing, lengths, rows)
    from taskcal.live.journal import Journal
    from taskcal.live.program import Program
    from taskcal.live.steering import Steering

    aim = _observed(_aim(robot, task, station, rows, seed), observing, lengths)
    program = Program.read(devices.program, aim.model.robot) if devices.program is not None else None
    options = lengths.read_options(aim.instrument)
    journal = Journal(output, aim.model.robot, aim.instrument.targets[0], observe=aim.instrument, options=options)
    terminal = _Terminal(aim=aim, as_json=as_json)
    if aim.tolerance is None:
        terminal.note(
            Said(
                "the task states no accuracy: {most} rows are measured, and nothing is proven (--accuracy-mm states one)",
                most=aim.most,
            )
        )
    with closing(journal), devices.opened(aim.model.robot, aim.instrument) as (controller, instrument):
        if resume:
            journal.resume(aim.settings)
            instrument.knows([row.image for row in journal.rows if row.image])
            terminal.note(Said("{file}: {rows} rows are there; going on", file=str(output), rows=len(journal.rows)))
        else:
            journal.begin({**aim.settings, "begun": time.time()})
        typed = instrument.asked or not controller.streams
        with _finishing_the_row(typed=typed, as_json=as_json) as stopped:
            steering = Steering(aim, journal)
            taker = rows_taker(rows, controller, instrument, stopped, aim.instrument.kind)
            controller.asks(terminal.typed, taker.rules.arrived)
            instrument.asks(terminal.typed)
            outcome = _runner(
                devices, program, steering=steering, taker=taker, tell=terminal.tell, ask=terminal.ask
            ).run()
    result = _finish(steering, outcome, files)
    _give(result, outcome, aim, output, as_json=as_json)


def _check_apart(campaign: Path, watched: Path) -> None:
    """See that the campaign is not where an instrument reads, which would take its rows for measurements.

    Raises:
        FileError: it is.
    """
    from taskcal.errors import FileError

    if watched.resolve() in (campaign.resolve(), campaign.resolve().parent):
        raise FileError(
            campaign, "would be read as points, where --instrument-address looks for them; write it to another folder"
        )


def _runner(devices: DeviceOptions, program: "Program | None", **session: Any) -> "Runner":
    """A session, by who moves the robot."""
    from taskcal.live.program import ProgramRunner
    from taskcal.live.runner import Mover, Runner

    if program is not None:
        return ProgramRunner(program=program, **session)
    drive = Mover(
        controller=session["taker"].controller, aim=session["steering"].aim, speed=devices.speed_percent / 100.0
    )
    return Runner(drive=drive if devices.drive else None, **session)


def _check_observed(
    devices: DeviceOptions, observing: ObservingOptions, lengths: LengthOptions, rows: RowOptions
) -> None:
    """See that options go with what is observed.

    Raises:
        typer.BadParameter: they do not.
    """
    observing.check(lengths)
    if not observing.fixed:
        return
    instrument, kind = observing.instrument, observing.instrument.kind
    if kind.pictured and rows.shots not in (None, 1):
        raise typer.BadParameter("one image is taken in each pose; leave it out", param_hint="--shots")
    if (kind.oriented and not kind.pictured) or not instrument.extends:
        raise typer.BadParameter(
            f"'{observing.observe}' is not measured live; plan its rows (taskcal plan --observe {observing.observe}), and fill in "
            "the plan's file",
            param_hint="--observe",
        )
    if devices.program is not None:
        raise typer.BadParameter(
            f"a program is followed by a tracker's points alone; leave it out, or --observe {observing.observe}",
            param_hint="--program",
        )
    if devices.drive and kind.touched:
        raise typer.BadParameter(
            "Taskcal does not drive a robot to where it touches; move it by hand", param_hint="--drive"
        )


def _observed(aim: "Aim", observing: ObservingOptions, lengths: LengthOptions) -> "Aim":
    """The aim with what measures instead of a tracker, with as many candidates for each fixture; no distance counts unless stated.

    Raises:
        FileError: a file cannot be read.
        ReachError: no fixtures are stated, and the robot does not reach the task.
    """
    if not observing.fixed:
        return aim
    observe = observing.load(aim.model, aim.task, aim.station, replace(lengths, distances=lengths.distances or ()))
    if observe.looked_for is not None and len(observe.looked_for.boards) > 1:
        raise typer.BadParameter("has several boards; one is measured live: leave the others out", param_hint="--board")
    if observe.label and observing.stated is None:
        names = ", ".join(
            f"{one['name']} ({', '.join(f'{mm:.0f}' for mm in one['position_mm'])})"
            for one in describe_fixtures(observe.fixtures)
        )
        info(
            f"default {observe.label} positions assumed, x y z mm in the base: {names}; place them there, or state theirs"
        )
    import numpy as np

    if not observe.observation(np.arange(0)).tells_scale:
        info("no length is stated, so that the robot's size is that of its tolerances; state one (--distances)")
    return replace(aim, station=None, observe=observe, candidates=aim.candidates * observe.count)


def rows_taker(
    rows: RowOptions,
    controller: "Controller",
    instrument: Any,
    stopped: Callable[[], bool],
    kind: "type[Observation] | None" = None,
) -> Any:
    """What takes rows of a kind of observation, by the options."""
    from taskcal.live.stillness import SEATED_WITHIN, Rules, Taker
    from taskcal.observations.point import Point

    kind = kind or Point
    shots = rows.shots or (3 if instrument.streams and not kind.pictured else 1)
    rules = Rules(settle_s=rows.settle, max_scatter_m=rows.max_scatter, shots=shots)
    if kind.touched:
        rules = replace(rules, arrived=SEATED_WITHIN)
    return Taker(controller=controller, instrument=instrument, rules=rules, stopped=stopped, kind=kind.key)


def _aim(robot: str, task: Path, station: Path | None, rows: RowOptions, seed: int) -> "Aim":
    """What is to be proven.

    Raises:
        TaskcalError: no such robot, task or station, or a station of several reflectors.
    """
    from taskcal.errors import FileError
    from taskcal.live.steering import Aim

    model, described = taskcal.ErrorModel(taskcal.load_robot(robot)), taskcal.load_task(task)
    stood = None if station is None else taskcal.load_station(station)
    if station is not None and stood is not None and len(stood.reflectors) != 1:
        raise FileError(station, f"has {len(stood.reflectors)} reflectors; one is measured live: leave the others out")
    return Aim(
        model=model,
        task=described,
        station=stood,
        tolerance=rows.accuracy or described.accuracy,
        most=rows.most,
        seed=seed,
        effects=rows.effects == "auto",
    )


@contextmanager
def _finishing_the_row(*, typed: bool, as_json: bool) -> Generator[Callable[[], bool]]:
    """Let Ctrl-C end the measurement after the row in hand, and a second one at once; what is typed is no row yet."""
    from taskcal.live.stillness import StoppedError

    asked = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield asked.is_set
        return

    def hear(*_: Any) -> None:
        if asked.is_set():
            raise KeyboardInterrupt
        asked.set()
        if typed:
            raise StoppedError
        if not as_json:  # a program that asks for it knows
            info("stopping after the row in hand; Ctrl-C again stops at once, without it")

    earlier, before = signal.set_wakeup_fd(-1), signal.signal(signal.SIGINT, hear)
    try:
        yield asked.is_set
    finally:
        signal.signal(signal.SIGINT, before)
        signal.set_wakeup_fd(earlier)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Terminal:
    """Shows events, and asks: people in words, programs by lines of JSON."""

    aim: "Aim"
    as_json: bool

    def tell(self, event: "RunEvent") -> None:
        """Show an event."""
        if event.text is not None:
            self.note(event.text)
        elif self.as_json:
            if (line := _line(self.aim, event)) is not None:
                print(json.dumps(plain(line), allow_nan=False), flush=True)
        elif event.kind == "pose" and event.step is not None:
            step = event.step
            after = "" if event.next_error is None else f", after it {event.next_error * 1e3:.4f} mm are expected"
            at = f", {self.aim.instrument.label} {step.fixture}" if step.fixture else ""
            joints = " ".join(f"{name} {value:.3f}" for name, value in _pose(self.aim.model.robot, step.q).items())
            info(f"pose {step.number}, {step.purpose}{at}{after}: {joints}")
        elif event.left is not None:
            info(_left_in_words(event.left))
        elif event.kind == "row" and event.taken is not None:
            taken = event.taken
            if taken.corners is not None:
                info(f"  measured, {taken.corners.images[0]}, {len(taken.corners.id)} corners")
                return
            scatter = f", scatter {taken.scatter * 1e3:.3f} mm" if taken.scatter else ""  # none of a seated ball
            info(f"  measured, {taken.shots} shots{scatter}")
        elif event.state is not None and event.state.rows and event.state.budget is not None:
            for line in _in_words(event.state, self.aim, event.pose_s):
                say(line)

    def note(self, text: "Said") -> None:
        """Tell something in words."""
        if self.as_json:
            print(json.dumps({"note": text, "said": text.parts}), flush=True)
        else:
            info(text)

    def ask(self, question: "Question") -> "Answer":
        """The answer to a question; where nobody is there to give one, it is to stop."""
        from taskcal.live.runner import MEANINGS

        answers = question.answers
        listed = "".join(f"  {answer}: {MEANINGS[answer]}\n" for answer in answers)
        asked = f"{question.text}\n{listed}> "
        event = {"question": question.text, "answers": list(answers), "said": question.text.parts}
        while (line := self._line(asked, event)) is not None:
            text = line.strip().casefold()
            meant: list[Answer] = [answer for answer in answers if text and answer.startswith(text)]
            if len(meant) == 1:
                return meant[0]
            asked = f"answer one of: {', '.join(answers)}\n> "
        self.note(Said("nobody is there to answer: stopped; --resume goes on"))
        return "stop"

    def typed(self, text: str) -> str:
        """The line that a person types for joints or a reading.

        Raises:
            DeviceError: the input has ended.
        """
        from taskcal.live.devices import DeviceError

        said = text.parts if isinstance(text, Said) else None
        line = self._line(f"{text} ", {"question": text, "answers": None, "said": said})
        if line is None:
            raise DeviceError("the input has ended, and nothing more can be typed; resume (--resume)")
        return line

    def _line(self, text: str, event: Mapping[str, Any]) -> str | None:
        """Ask, and read a line; None where the input has ended."""
        if self.as_json:
            print(json.dumps(event), flush=True)
        else:
            print(text, end="", file=sys.stderr, flush=True)
        line = sys.stdin.readline()
        if self.as_json and line:
            print(json.dumps({"answered": line.strip()}), flush=True)
        return line or None


MAX_NAMED = 5
"""Poses of a program that are left and are named. A convention."""


def _left_in_words(left: "Left") -> str:
    """What a program still has to visit."""
    named = listed(left.ids, MAX_NAMED)
    text = f"left of the program: {len(left.ids)} poses, {named}"
    if left.next_error is not None and left.all is not None:
        text = f"left of the program: {len(left.ids)} poses, those first that bring most: {named}; "
        text += f"{left.next_error * 1e3:.4f} mm expected after the best, {left.all * 1e3:.4f} mm after all"
    return text


def _pose(robot: "taskcal.Robot", q: Any) -> dict[str, float]:
    """Joints by the names of a campaign's columns."""
    import numpy as np

    return {
        f"{name}_{'mm' if slides else 'deg'}": float(value * 1e3 if slides else np.degrees(value))
        for name, slides, value in zip(robot.joint_names, robot.prismatic, q, strict=True)
    }


def _in_words(state: "State", aim: "Aim", pose_s: float | None) -> list[str]:
    """What is known, in words."""
    assert state.budget is not None
    low, high = state.budget.interval
    text = f"{state.rows} rows: {state.budget.after * 1e3:.4f} mm expected over the task (95 %: {low * 1e3:.4f} to "
    text += f"{high * 1e3:.4f})"
    if aim.tolerance is not None:
        text += f", tolerance {aim.tolerance * 1e3:g} mm {'met' if state.met else 'not met'}"
    if len(state.kept_out):
        text += (
            f"; {len(state.kept_out)} pose{'s' * (len(state.kept_out) > 1)} kept out: {_rms(state) * 1e3:.4f} mm rms"
        )
    if state.look is not None:
        text += f", at most {state.look.bound * 1e3:.4f} mm by the look at {state.look.kept_out}"
    if state.more:
        left = "" if pose_s is None else f", {state.more * pose_s / 60.0:.0f} min"
        text += f"; about {state.more} more{left}"
    return [text]


def _rms(state: "State") -> float:
    import numpy as np

    return float(np.sqrt(np.mean(state.kept_out**2))) if len(state.kept_out) else float("nan")


def _line(aim: "Aim", event: "RunEvent") -> dict[str, Any] | None:
    """An event for programs: the pose to go to, the row taken, or what is known after it; lengths that are not known are null."""
    step, taken, state = event.step, event.taken, event.state
    if event.kind == "pose" and step is not None:
        after = None if event.next_error is None else event.next_error * 1e3
        return {
            "go_to": _pose(aim.model.robot, step.q),
            "number": step.number,
            "purpose": step.purpose,
            "error_after_mm": after,
            **({aim.instrument.label: step.fixture} if step.fixture else {}),
        }
    if event.left is not None:
        errors = {"error_after_mm": event.left.next_error, "error_after_all_mm": event.left.all}
        millimetres = {name: None if error is None else error * 1e3 for name, error in errors.items()}
        return {"left": list(event.left.ids), **millimetres}
    if event.kind == "row" and step is not None and taken is not None:
        image = {} if taken.corners is None else {"image": taken.corners.images[0]}
        return {"measured": step.number, "shots": taken.shots, "scatter_mm": taken.scatter * 1e3, **image}
    if state is None or not state.rows:
        return None
    budget, look = state.budget, state.look
    known = budget is not None
    return {
        "rows": state.rows,
        "pose": _pose(aim.model.robot, state.last) if state.last is not None else None,
        "purpose": state.purpose,
        "expected_error_mm": budget.after * 1e3 if known else None,
        "interval_mm": [bound * 1e3 for bound in budget.interval] if known else None,
        "kept_out": len(state.kept_out),
        "kept_out_rms_mm": _rms(state) * 1e3,
        "bound_mm": None if look is None else look.bound * 1e3,
        "tolerance_mm": None if aim.tolerance is None else aim.tolerance * 1e3,
        "proven": state.proven,
        "poses_left": state.more,
        "seconds_a_pose": event.pose_s,
    }


def _finish(steering: "Steering", outcome: "Ending", files: Mapping[str, Path]) -> dict[str, Any]:
    """Write calibration and report beside the campaign, if there are rows enough.

    Raises:
        TaskcalError: a file cannot be written.
    """
    from taskcal.correction.verdict import judge
    from taskcal.io.files import write_all
    from taskcal.planning.task_map import uncertainty_over
    from taskcal.report.calibration import calibration_page, calibration_sections
    from taskcal.report.verdict import verdict_section

    result: dict[str, Any] = {"ended": outcome.reason, "rows": outcome.state.rows, "proven": outcome.state.proven}
    if outcome.state.budget is None:
        return {**result, "calibration": None, "report": None}
    task, calibration = steering.aim.task, steering.calibration()
    judged, over = judge(calibration, task).summary(), uncertainty_over(calibration, task)
    sections = calibration_sections(calibration, judged=judged, over=over, space=task.workspace)
    page = calibration_page(calibration, [verdict_section(judged), *sections])
    calibration.save(files["calibration"])
    write_all({files["report"]: page.html()})
    return {**result, **{name: str(path) for name, path in files.items()}}


_ENDS = {
    "proven": "proven: all of the 95 % interval keeps the tolerance, and the poses kept out confirm it",
    "consistent": "expected, not proven: all of the 95 % interval keeps the tolerance, and the rows kept out do where they were "
    "measured, which are no poses of the task",
    "most": "not proven: as many rows as --most allows; --resume with more goes on",
    "visited": "not proven: every pose of the program is measured; plan more, and go on with --resume and their --program",
    "stopped": "stopped; --resume goes on",
}


def _give(result: Mapping[str, Any], outcome: "Ending", aim: "Aim", output: Path, *, as_json: bool) -> None:
    if as_json:
        print(json.dumps(plain({**result, "campaign": str(output)}), allow_nan=False), flush=True)
        return
    facts = [("ended", _ENDS[outcome.reason]), ("campaign", f"{output}, {outcome.state.rows} rows")]
    if aim.instrument.looked_for is not None:
        facts.append(("corners", f"{output.with_suffix('.corners.csv')}, for --images"))
    if outcome.state.proven and aim.tolerance is not None:
        facts.append(("tolerance", f"{aim.tolerance * 1e3:g} mm, 3D rms over '{aim.task.name}'"))
    if result["calibration"] is not None:
        facts += [("calibration", f"wrote {result['calibration']}"), ("report", f"wrote {result['report']}")]
    else:
        facts.append(("calibration", "none: too few rows yet"))
    tell()
    show_facts(facts)

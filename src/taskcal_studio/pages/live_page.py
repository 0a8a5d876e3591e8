"""Measuring live: where to go next, what is known after each row, and when the task's tolerance is proven."""

import asyncio
import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from nicegui import ui
from nicegui.element import Element

from taskcal.errors import TaskcalError
from taskcal.live.devices import Device, controllers, instruments
from taskcal.live.options import Driving
from taskcal.report.chart import Axis, Figure, Level, Panel, Series
from taskcal.report.content import TextTable
from taskcal.robot.robot import Robot
from taskcal.task.task import load_task
from taskcal_studio.controls import (
    button,
    choice,
    command_line,
    facts,
    line_of_text,
    message,
    tabulated,
    text,
    tick,
)
from taskcal_studio.option_form import of_project, option_fields
from taskcal_studio.pages.task_page import posture
from taskcal_studio.project import LAYOUT, Choices, Project, free_name, plain_name
from taskcal_studio.results import CSV_PROGRAM, MAX_STEM, robot_of
from taskcal_studio.robot_meshes import meshes_if_sound
from taskcal_studio.runs import ASKS, CommandRun, Studio
from taskcal_studio.stated_options import arguments, asked, offered, stated_or_begun
from taskcal_studio.steps import POLL_S, begin, download, is_running, link, show_run
from taskcal_studio.texts import Texts
from taskcal_studio.views import CellView, add_views, figure

REPORT = ".report.html"
"""Ending of the report on a campaign that was measured live."""


@dataclass(frozen=True, kw_only=True)
class RunProgress:
    """What the lines of a run say."""

    known: Mapping[int, Mapping[str, Any]] = field(default_factory=dict)
    """What is known after each row, by the number of rows."""
    go_to: Mapping[str, Any] | None = None
    """Pose that is shown; None before the first."""
    left: Mapping[str, Any] | None = None
    """Poses of a program that are left; None where no program moves the robot."""
    taken: Mapping[str, Any] | None = None
    """Shots of the last row."""
    question: Mapping[str, Any] | None = None
    """That waits for an answer."""
    notes: Sequence[Mapping[str, Any]] = ()
    """What it told in words."""

    @classmethod
    def of(cls, lines: Sequence[str]) -> "RunProgress":
        """Read lines of ``taskcal measure --json``."""
        said = list(filter(None, map(_parsed, lines)))
        return cls(
            known={one["rows"]: one for one in said if "expected_error_mm" in one},
            go_to=next((one for one in reversed(said) if "go_to" in one), None),
            left=next((one for one in reversed(said) if "left" in one), None),
            taken=next((one for one in reversed(said) if "measured" in one), None),
            question=next((one if "question" in one else None for one in reversed(said) if _ASKED & one.keys()), None),
            notes=[one for one in said if "note" in one],
        )

    @property
    def last(self) -> Mapping[str, Any] | None:
        """What is known now; None before the first row."""
        return self.known[max(self.known)] if self.known else None


_ASKED = {"question", "answered"}


def _parsed(line: str) -> dict[str, Any]:
    """An event; nothing of a line that is not whole."""
    with suppress(ValueError):
        said = json.loads(line)
        return said if isinstance(said, dict) else {}
    return {}


async def build(studio: Studio, texts: Texts) -> None:
    """Fill the page."""
    project, run = studio.project, studio.run_of(ASKS)
    robot = await asyncio.to_thread(robot_of, project)
    await asyncio.to_thread(load_task, project.path(project.choices.task))  # one that cannot be read is said at once
    if run is not None and is_running(run):
        meshes = await asyncio.to_thread(meshes_if_sound, project)
        command_line(run.line, texts)
        _ShownRun(run, robot, texts).follow(partial(CellView, robot, meshes=meshes))
        return
    if run is not None:
        show_run(studio, ASKS, texts)
        _show_end(run, project, texts)
        _ShownRun(run, robot, texts).show()
    _choose(project, texts)
    drives = _drives(project, texts)
    _begin_buttons(studio, run, drives, texts)


def arguments_of(choices: Choices, *, resume: bool, drive: bool = False) -> list[str]:
    """Arguments of ``taskcal`` for measuring the campaign that is chosen for it; driving is no choice that is kept."""
    return asked(
        "measure",
        arguments("measure", choices.options, without=(SPEED,)),
        robot=choices.robot,
        task=choices.task,
        output=choices.live_campaign,
        station=choices.station,
        **choices.live,
        drive=drive,
        speed_percent=f"{speed_of(choices):g}" if drive else "",
        seed=stated_or_begun("plan", choices.options)["seed"],
        resume=resume,
    )


SPEED = "speed-percent"


def speed_of(choices: Choices) -> float:
    """Limit of the speed with which Taskcal drives, percent of the joints' largest ones."""
    return float(stated_or_begun("measure", choices.options).get(SPEED) or Driving.speed_percent)


def go_on(studio: Studio, *, drive: bool = False) -> None:
    """Go on with the campaign that was measured last; what its rows said before is shown with them."""
    before, project = studio.run_of(ASKS), studio.project
    campaign = project.choices.live_campaign
    stem = Path(campaign).stem
    calibration = f"{LAYOUT.calibrations}/{stem}.json"
    beside = campaign.removesuffix(".csv")
    begin(
        studio,
        ASKS,
        arguments_of(project.choices, resume=project.path(campaign).is_file(), drive=drive),
        chosen={"campaign": campaign, "calibration": calibration},
        moves={calibration: f"{beside}.calibration.json", f"{LAYOUT.reports}/{stem}{REPORT}": f"{beside}{REPORT}"},
        page="live",
    )
    run = studio.run_of(ASKS)
    if before is not None and run is not None and run is not before and f"--output={campaign}" in before.arguments:
        run.lines[:0] = [line for line in before.lines if '"expected_error_mm"' in line]


def _begin_anew(studio: Studio, *, drive: bool) -> None:
    """Measure a campaign whose name no other and no calibration has."""
    project = studio.project
    others = (*project.files(LAYOUT.campaigns), *project.calibrations())
    wanted = plain_name(f"live-{Path(project.choices.task).stem[:MAX_STEM]}.csv", [".csv"])
    project.choose(live_campaign=f"{LAYOUT.campaigns}/{free_name(wanted, [f'{Path(one).stem}.csv' for one in others])}")
    go_on(studio, drive=drive)


def _choose(project: Project, texts: Texts) -> None:
    """What is read, and when a row counts."""
    live = {str(name): value for name, value in project.choices.live.items()}

    def keep(name: str, value: object) -> None:
        project.choose(live={**project.choices.live, name: str(value).strip()})

    def device(role: str, known: Mapping[str, type[Device]]) -> type[Device] | None:
        def take(name: str) -> None:
            project.choose(live={**project.choices.live, role: name, f"{role}-address": ""})
            ui.navigate.reload()

        choice(texts(f"live.{role}"), {name: name for name in known}, live.get(role, ""), take)
        chosen = known.get(live.get(role, ""))
        if chosen is not None and chosen.reached:
            said = texts("live.address", name=chosen.name, how=chosen.reached)
            line_of_text(said, live.get(f"{role}-address", ""), partial(keep, f"{role}-address"))
        return chosen

    def visit(path: str) -> None:
        keep("program", "" if path == "-" else path)
        ui.navigate.reload()

    with ui.element("div").classes("fields"):
        device("controller", controllers())
        instrument = device("instrument", {name: kind for name, kind in instruments().items() if not kind.asked})
        if instrument is not None and instrument.reached:
            line_of_text(texts("live.columns"), live.get("columns", ""), partial(keep, "columns"))
        tables = [path for path in project.files(LAYOUT.plans, (".csv",)) if not path.endswith(CSV_PROGRAM)]
        plans = {path: Path(path).name for path in tables}
        nobody = {"-": texts("live.no_program")}
        choice(texts("live.program"), nobody | plans, live.get("program") or "-", visit)
    rows = (name for name in offered("measure") if name != SPEED)
    option_fields(project, texts, of_project(project, "measure"), *rows)
    text("p", texts("live.by_program" if live.get("program") else "live.limits")).classes("quiet")


def _drives(project: Project, texts: Texts) -> Callable[[], bool]:
    """Whether it was confirmed, for the next start alone, that Taskcal drives the robot, where the controller can."""
    choices = project.choices
    kind = controllers().get(choices.live.get("controller", ""))
    if kind is None or not kind.can_move or choices.live.get("program"):
        return lambda: False
    confirmed = False

    def confirm(value: bool) -> None:
        nonlocal confirmed
        confirmed = value

    with ui.element("details"):
        text("summary", texts("live.drive"))
        stated = of_project(project, "measure")

        def limit(name: str, given: str) -> None:
            stated.keep(name, given)
            ui.navigate.reload()  # what was confirmed was another speed

        option_fields(project, texts, replace(stated, keep=limit), SPEED)
        message(texts("live.drive_how", percent=texts.number(speed_of(choices), "g")))
        tick(texts("live.drive_confirm", percent=texts.number(speed_of(choices), "g")), False, confirm)
    return lambda: confirmed


def _begin_buttons(studio: Studio, run: CommandRun | None, drives: Callable[[], bool], texts: Texts) -> None:
    choices = studio.project.choices
    if choices.live.get("controller") not in controllers() or choices.live.get("instrument") not in instruments():
        text("p", texts("live.first"))
        return
    proven = run is not None and run.result is not None and run.result.get("proven") is True
    begun = bool(choices.live_campaign) and studio.project.path(choices.live_campaign).is_file() and not proven
    with ui.element("div").classes("row"):
        if begun:
            name = Path(choices.live_campaign).name
            button(texts("live.go_on", name=name), lambda: go_on(studio, drive=drives()))
        button(texts("live.start"), lambda: _begin_anew(studio, drive=drives()), plain=begun)


MAX_NOTES = 3
"""Last ones that are shown while it is measured."""

ENDS = {"proven": "live.proven", "most": "live.ended_most", "visited": "live.ended_visited", "stopped": "live.stopped"}
"""Texts, by how ``taskcal measure`` says that it ended."""


def _show_end(run: CommandRun, project: Project, texts: Texts) -> None:
    """How it ended; verdict and report, if there are rows enough."""
    result = run.result or {}
    if result.get("ended") not in ENDS:
        return
    message(texts(ENDS[result["ended"]]), fine=result["ended"] not in ("most", "visited"))
    if result.get("calibration"):
        with ui.element("div").classes("row"):
            link(texts("live.verdict"), "/result").classes("act")
            download(texts, f"{LAYOUT.reports}/{Path(result['campaign']).stem}{REPORT}")


class _ShownRun:
    """A run on the page, as far as it is."""

    def __init__(self, run: CommandRun, robot: Robot, texts: Texts) -> None:
        self._run, self._robot, self._texts = run, robot, texts
        self._units = np.where(robot.prismatic, 1e-3, np.pi / 180.0)
        self._read = (-1, -1)
        self._asked = ""

    def follow(self, view_of: Callable[[Float[np.ndarray, "n joints"]], CellView]) -> None:
        """Show it as it goes on; the page is shown anew as it ends."""
        texts, run = self._texts, self._run
        with ui.element("div").classes("row"):
            said = text("span", texts("live.waiting")).props("role=status")

            async def stop() -> None:
                measured = RunProgress.of(run.lines)
                if measured.go_to is None and measured.left is None:  # it may not hear yet, and has no row in hand
                    await run.cancel()
                    return
                if measured.question is not None and measured.question["answers"]:
                    run.answer("stop")
                    return
                run.interrupt()
                said.set_text(texts("live.stopping"))
                halt.set_text(texts("live.stop_at_once"))

            halt = button(texts("live.stop"), stop)
        asked, notes = ui.element("div"), ui.element("div")
        with ui.element("div").classes("side-by-side"):
            drawn = ui.element("div")
            where = ui.element("div").classes("go-to")
        place = ui.element("div")
        view: CellView | None = None

        def look() -> None:
            nonlocal view
            if self._read != (len(run.lines), len(run.messages)):
                self._read = len(run.lines), len(run.messages)
                measured = RunProgress.of(run.lines)
                for part in (notes, where, place):
                    part.clear()
                with notes:
                    for note in [*run.messages, *notes_of(measured, texts)][-MAX_NOTES:]:
                        message(note, fine=True)
                if measured.go_to is not None and view is None:
                    with drawn:
                        view = view_of(self._postures(measured))
                        with ui.element("div").classes("row"):
                            add_views(view, texts("live.drawing"), texts)
                self._ask(measured, asked)
                with where:
                    self._pose(measured, view)
                with place:
                    self._known(measured)
                    self._left(measured)
                if measured.question is not None:
                    said.set_text(texts("live.asked"))
                elif measured.left is not None and halt.text == texts("live.stop"):
                    said.set_text(texts("live.here_program", count=len(measured.left["left"])))
                elif measured.go_to is not None and halt.text == texts("live.stop"):
                    done = (measured.taken or {}).get("measured") == measured.go_to["number"]
                    said.set_text(texts("live.taken" if done else "live.here", number=measured.go_to["number"]))
            if not is_running(run):
                timer.deactivate()
                ui.navigate.reload()

        timer = ui.timer(POLL_S, look)

    def show(self) -> None:
        """Show what was told, and known in the end."""
        measured = RunProgress.of(self._run.lines)
        for note in notes_of(measured, self._texts)[-MAX_NOTES:]:
            message(note, fine=True)
        self._known(measured)

    def _postures(self, measured: RunProgress) -> Float[np.ndarray, "n joints"]:
        """What the first view shows as a whole: the pose to go to, those measured, and the robot stretched out."""
        poses = [(measured.go_to or {})["go_to"], *(one["pose"] for one in measured.known.values())]
        return np.array([*(np.array(list(pose.values())) * self._units for pose in poses), posture(self._robot)])

    def _ask(self, measured: RunProgress, place: Element) -> None:
        """Show the question that waits, with its answers; once, so that what is being typed stays."""
        texts, run, question = self._texts, self._run, measured.question
        now = "" if question is None else json.dumps([question, sum('"question"' in line for line in run.lines)])
        if now == self._asked:
            return
        self._asked = now
        place.clear()
        if question is None:
            return
        with place:
            if question["answers"]:
                message(texts.sentence(question["said"]))
                with ui.element("div").classes("row"):
                    for number, answer in enumerate(question["answers"]):
                        button(texts.named("live", f"answer_{answer}"), partial(run.answer, answer), plain=number > 0)
                return
            if question["said"] is None:  # of a controller of another package
                message(question["question"])
            elif wrong := question["said"]["values"].get("wrong"):  # what it asks for is said below
                message(texts.sentence(wrong))
            names = " ".join(str(name) for name in (measured.go_to or {"go_to": ()})["go_to"])
            typed = ""

            def take(line: str) -> None:
                nonlocal typed
                typed = line

            line_of_text(texts("live.joints", names=names), "", take)
            button(texts("live.take_joints"), lambda: run.answer(typed))

    def _left(self, measured: RunProgress) -> None:
        """Poses of the program that are left, those first that bring most."""
        if measured.left is None:
            return
        texts, left = self._texts, measured.left["left"]
        shown = [
            (one.partition("-")[0], texts.named("live", f"purpose_{one.partition('-')[2] or 'chosen'}"))
            for one in left[:MAX_LEFT]
        ]
        title = texts("live.left_of_program", count=len(left))
        header = (texts("live.pose"), texts("live.serves"))
        tabulated(TextTable.of_rows(title, header, shown, text_columns=(0, 1)))

    def _pose(self, measured: RunProgress, view: CellView | None) -> None:
        """The pose to go to, in numbers and drawn."""
        if measured.go_to is None:
            return
        texts, pose = self._texts, measured.go_to["go_to"]
        if view is not None:
            with suppress(TaskcalError):  # a loop that does not close is not drawn; the numbers stand
                view.move(np.array(list(pose.values())) * self._units)
        rows = [
            (name, f"{texts.number(value, '.3f')}{' mm' if slides else '°'}")
            for name, value, slides in zip(self._robot.joint_names, pose.values(), self._robot.prismatic, strict=True)
        ]
        purpose = texts.named("live", f"purpose_{measured.go_to['purpose']}")
        title = texts("live.go_to", number=measured.go_to["number"], purpose=purpose)
        tabulated(TextTable.of_rows(title, (texts("robot.joint"), texts("live.position")), rows))

    def _known(self, measured: RunProgress) -> None:
        """What is known after the last row, and its curve."""
        last, texts = measured.last, self._texts
        if last is None:
            return
        text("h2", texts("live.known"))
        facts(facts_of(measured, last, texts))
        if sum(one["expected_error_mm"] is not None for one in measured.known.values()) > 1:
            figure(texts("live.curve"), draw_curve(measured.known, texts), texts, texts("live.curve_note"))


MAX_LEFT = 8
"""Poses of a program that are left and are shown. A convention."""


def notes_of(measured: RunProgress, texts: Texts) -> list[str]:
    """What was told in words, in the page's language."""
    return [texts.sentence(note["said"]) for note in measured.notes]


def facts_of(measured: RunProgress, last: Mapping[str, Any], texts: Texts) -> list[tuple[str, str]]:
    """Facts after a row."""

    def mm(value: float) -> str:
        return texts.number(value, ".4f")

    rows, taken = str(last["rows"]), measured.taken
    if taken is not None:
        rows = texts("live.rows_last", rows=rows, shots=taken["shots"], scatter=mm(taken["scatter_mm"]))
    expected = texts("live.not_yet")
    if last["expected_error_mm"] is not None:
        low, high = map(mm, last["interval_mm"])
        expected = texts("live.interval", error=mm(last["expected_error_mm"]), low=low, high=high)
    told = [(texts("live.rows"), rows), (texts("live.expected"), expected)]
    if last["tolerance_mm"] is not None:
        told.append((texts("live.tolerance"), f"{texts.number(last['tolerance_mm'], 'g')} mm"))
    if last["kept_out"] and last["kept_out_rms_mm"] is not None:
        values = {"count": last["kept_out"], "rms": mm(last["kept_out_rms_mm"])}
        known = last["bound_mm"] is not None
        said = (
            texts("live.bound", **values, bound=mm(last["bound_mm"])) if known else texts("live.kept_out_rms", **values)
        )
        told.append((texts("live.kept_out"), said))
    next_ = measured.left or measured.go_to or {}
    for name, key in (("one_more", "error_after_mm"), ("all_more", "error_after_all_mm")):
        if (after := next_.get(key)) is not None and not last["proven"]:
            told.append((texts(f"live.{name if measured.left is None else f'{name}_program'}"), f"{mm(after)} mm"))
    if last["poses_left"] and not last["proven"]:
        left, pace = str(last["poses_left"]), last["seconds_a_pose"]
        if pace is not None:
            left = texts("live.left_min", count=left, minutes=f"{last['poses_left'] * pace / 60.0:.0f}")
        told.append((texts("live.left"), left))
    return told


def draw_curve(known: Mapping[int, Mapping[str, Any]], texts: Texts) -> Figure:
    """The expected error over the rows with its interval, and the tolerance."""
    rows = sorted(count for count, one in known.items() if one["expected_error_mm"] is not None)
    low, high = np.array([known[count]["interval_mm"] for count in rows]).T
    errors = [known[count]["expected_error_mm"] for count in rows]
    tolerance = known[rows[-1]]["tolerance_mm"]
    levels = () if tolerance is None else (Level(at=tolerance, name=texts("live.tolerance")),)
    series = (
        Series(kind="line", x=rows, y=errors),
        Series(name=texts("live.expected"), x=rows, y=errors, low=low, high=high),
    )
    y = Axis(unit="mm", log=True)
    return Figure(panels=(Panel(x=Axis(title=texts("live.axis"), whole=True), y=y, series=series, levels=levels),))

"""The measurements: what was understood of a file, what seems wrong with it, and its points."""

import asyncio
import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
from nicegui import ui

from taskcal.errors import TaskcalError
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.reader import read_campaign
from taskcal.measurement.writer import campaign_text
from taskcal.robot.robot import Robot
from taskcal.studio.command_run import CommandRun, Status
from taskcal.studio.controls import button, choice, drop_zone, facts, line_of_text, message, set_attribute, table, text
from taskcal.studio.file_names import free_name
from taskcal.studio.pages.robot_page import robot_of
from taskcal.studio.point_view import MOST_PICKED, PointView
from taskcal.studio.project import CAMPAIGN_ENDINGS, LAYOUT, Project
from taskcal.studio.robot_view import VIEWS
from taskcal.studio.run_panel import show_run
from taskcal.studio.studio import Studio
from taskcal.studio.texts import Texts

ROWS_SHOWN = 12


async def build(studio: Studio, texts: Texts) -> None:
    """Fill the page."""
    project = studio.project
    choices = project.choices
    files = {path: path for path in project.files(LAYOUT.campaigns, CAMPAIGN_ENDINGS)}

    def take(path: str) -> None:
        project.choose(campaign=path)
        ui.navigate.reload()

    if files:
        choice(texts("measurements.choose"), files, choices.campaign, take)
    drop_zone(texts, "campaign", texts("measurements.drop"), CAMPAIGN_ENDINGS)
    try:
        robot = await asyncio.to_thread(robot_of, project)
    except TaskcalError as error:
        message(str(error))
        text("a", texts("robot.title")).props("href=/robot")
        return
    if not choices.campaign:
        text("p", texts("measurements.none"))
        return
    text("h2", texts("measurements.understood"))
    show_run(studio, "convert", texts, about=choices.campaign)
    try:
        campaign = await asyncio.to_thread(read_campaign, project.path(choices.campaign), robot)
    except TaskcalError as error:
        message(in_project(str(error), project))
        _Correction(studio, texts)
        _mistakes(studio, texts)
        return
    _understood(campaign, robot, texts)
    _Correction(studio, texts)
    _mistakes(studio, texts)
    _in_space(campaign, texts)


def in_project(said: str, project: Project) -> str:
    """What is said, with the project's files named as from its folder."""
    return said.replace(f"{project.folder}/", "")


def campaign_facts(campaign: Campaign, texts: Texts) -> list[tuple[str, str]]:
    """What a campaign holds."""
    lost = int((~campaign.valid).sum())
    told = [
        (texts("measurements.rows"), str(len(campaign))),
        (texts("measurements.targets"), ", ".join(campaign.targets)),
        (texts("measurements.lost"), str(lost)),
        (texts("measurements.references"), ", ".join(campaign.reference_points) or "–"),
    ]
    present = [name for name in ("temperature", "time", "approach", "move") if getattr(campaign, name) is not None]
    told += [(texts("measurements.besides"), ", ".join(texts(f"measurements.{name}") for name in present) or "–")]
    return told


def _understood(campaign: Campaign, robot: Robot, texts: Texts) -> None:
    facts(campaign_facts(campaign, texts))
    for note in campaign.notes:
        message(note, fine=True)
    if campaign.observations:
        return
    lines = list(csv.reader(campaign_text(campaign, robot).splitlines()))
    table(texts("measurements.first_rows", count=min(ROWS_SHOWN, len(campaign))), lines[0], lines[1 : ROWS_SHOWN + 1])


class _Correction:
    """What a user states of a file that it does not say: the file is written anew with it, and used from then on."""

    def __init__(self, studio: Studio, texts: Texts) -> None:
        self._studio, self._texts = studio, texts
        self._stated = {"columns": "", "decimal": "", "angles": ""}
        with ui.element("details"):
            text("summary", texts("measurements.correct"))
            text("p", texts("measurements.correct_how")).classes("quiet")
            line_of_text(texts("measurements.columns"), "", self._state("columns"))
            marks = {"-": texts("measurements.told"), "point": "1.5", "comma": "1,5"}
            choice(texts("measurements.decimal"), marks, "-", self._state("decimal"))
            forms = ("abc", "wpr", "rpy-deg", "rpy-rad", "rotation-vector-rad", "rotation-vector-deg", "none")
            angles = {"-": texts("measurements.told"), **{form: form for form in forms}}
            choice(texts("measurements.angles"), angles, "-", self._state("angles"))
            button(texts("measurements.write"), self._write)

    def _state(self, name: str) -> Callable[[str], None]:
        def state(value: str) -> None:
            self._stated[name] = "" if value == "-" else value.strip()

        return state

    def _write(self) -> None:
        project = self._studio.project
        options = [f"--{name}={value}" for name, value in self._stated.items() if value]
        begin_rewriting(self._studio, "convert", "plain", [*options, f"--robot={project.choices.robot}"])


def begin_rewriting(studio: Studio, command: str, ending: str, options: list[str]) -> None:
    """Run a command that writes the campaign anew, beside the old file, and use what it writes from then on."""
    project = studio.project
    before = project.choices.campaign
    taken = [Path(path).name for path in project.files(LAYOUT.campaigns)]
    after = f"{LAYOUT.campaigns}/{free_name(f'{Path(before).stem}-{ending}.csv', taken)}"
    option = "--fix" if command == "doctor" else "--output"

    async def use(_: CommandRun) -> None:
        if project.path(after).exists() and project.choices.campaign == before:
            project.choose(campaign=after)

    try:
        studio.start("mend" if command == "doctor" else command, [command, before, *options, option, after], use)
    except TaskcalError as error:
        ui.notify(str(error))
        return
    ui.navigate.reload()


def _mistakes(studio: Studio, texts: Texts) -> None:
    """The doctor's findings, and what mends them."""
    choices = studio.project.choices
    text("h2", texts("measurements.mistakes"))
    asked = ["doctor", choices.campaign, f"--robot={choices.robot}", "--json"]

    def look() -> None:
        try:
            studio.start("doctor", asked)
        except TaskcalError as error:
            ui.notify(str(error))
            return
        ui.navigate.reload()

    mending = show_run(studio, "mend", texts)
    run = show_run(studio, "doctor", texts, about=choices.campaign)
    if run is None or run.status is not Status.running:
        button(texts("measurements.look"), look)
    if run is None or run.status is not Status.done or run.result is None:
        return
    findings = run.result["findings"]
    if not findings:
        message(texts("measurements.sound"), fine=True)
        return
    rows = [
        (
            finding["id"],
            ", ".join(finding["subject"]),
            f"{finding['error_before_mm']:.2f}",
            f"{finding['error_after_mm']:.2f}",
            f"{finding['confidence']:.0%}",
            finding["fix"],
        )
        for finding in findings
    ]
    header = [texts(f"measurements.{key}") for key in ("finding", "of", "before", "after", "sure", "mends")]
    table(texts("measurements.found"), header, rows, words=(0, 1, 5))
    if mending is None or mending.status is not Status.running:
        options = [f"--robot={choices.robot}", "--json"]
        button(texts("measurements.mend"), lambda: begin_rewriting(studio, "doctor", "mended", options))


def _in_space(campaign: Campaign, texts: Texts) -> None:
    """The points, to be turned and picked."""
    rows, targets = np.nonzero(campaign.valid & np.isfinite(campaign.points).all(axis=2))
    if not len(rows):
        return
    points = campaign.points[rows, targets]
    text("h2", texts("measurements.space"))

    def pick(number: int) -> None:
        view.mark([number])
        row, target = int(rows[number]), int(targets[number])
        x, y, z = points[number] * 1e3
        picked.set_text(f"{campaign.row(row)}, {campaign.targets[target]}: {x:.4f} {y:.4f} {z:.4f} mm")

    view = PointView(points, pick)
    set_attribute(view.scene, "aria-label", texts("measurements.space_of", count=len(points)))
    view.scene.props("role=img")
    with ui.element("div").classes("row"):
        for name in VIEWS:
            button(texts(f"robot.view_{name}"), lambda name=name: view.look(name), plain=True)
    size = np.ptp(points, axis=0) * 1e3
    hint = texts("measurements.pick") if len(points) <= MOST_PICKED else texts("measurements.too_many")
    picked = text("p", f"{size[0]:.0f} × {size[1]:.0f} × {size[2]:.0f} mm. {hint}").props("role=status")

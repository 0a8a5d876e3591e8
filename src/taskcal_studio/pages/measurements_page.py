"""The measurements: what was understood of a file, what seems wrong with it, and its points."""

import asyncio
import csv
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from nicegui import ui
from nicegui.element import Element

from taskcal.campaigns.campaign import Campaign
from taskcal.campaigns.drift import compensate_drift, observe_reference_points
from taskcal.campaigns.performance import RepeatedPoses, pose_repeatability
from taskcal.diagnosis.diagnose import MISTAKES
from taskcal.diagnosis.mistakes import other_convention
from taskcal.errors import CampaignError, TaskcalError
from taskcal.observations import images_of
from taskcal.reading.detection import SUFFIXES
from taskcal.reading.writer import campaign_text
from taskcal.report.chart import SERIES, SHAPES, Axis, Figure, Panel, Series
from taskcal.report.content import Column, TextTable
from taskcal.report.diagnosis import campaign_section, findings_table
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal_studio.controls import button, drop_zone, facts, headline, message, tabulated, text
from taskcal_studio.files import IMAGES
from taskcal_studio.measured_rows import MeasuredRows, registered_rows
from taskcal_studio.pages.column_editor import ColumnEditor
from taskcal_studio.project import CAMPAIGN_ENDINGS, LAYOUT, ROBOT_ENDINGS, free_name
from taskcal_studio.results import (
    examined,
    options_of_images,
    read_measured,
    robot_of,
    shows_images,
    stated_of_images,
)
from taskcal_studio.robot_meshes import RobotMeshes, meshes_if_sound
from taskcal_studio.runs import Status, Studio
from taskcal_studio.sections import show_sections
from taskcal_studio.selection import RowSelection
from taskcal_studio.stated_options import asked
from taskcal_studio.steps import begin, choose_file, choose_or_drop, is_running, link, show_error, show_run
from taskcal_studio.texts import LIBRARY_LANGUAGE, Texts
from taskcal_studio.views import CONCERNED, INK, MAX_PICKED, CellView, RowPlayer, figure

# Whether anything moved while it was measured, and how well poses repeat: figures of a campaign over its rows.


def show_course(campaign: Campaign, texts: Texts) -> None:
    """Show reference points over the rows and the scatter of poses that recur, each where there is any."""
    text("h2", texts("course.title"))
    repeated: RepeatedPoses | None = None
    with suppress(CampaignError):
        repeated = pose_repeatability(campaign)
    if campaign.reference_points:
        for remark in compensate_drift(campaign).remarks:
            message(remark, fine=True)
        figure(texts("course.drift"), draw_drift(campaign, texts), texts, texts("course.drift_note"), selects=True)
    if repeated is not None:
        said = repeated.summary()
        facts(
            [
                (texts("course.repeated"), str(said["poses"])),
                (
                    texts("course.rp"),
                    f"{texts.number(said['RP_l_mean_mm'], '.3f')}; {texts.number(said['RP_l_max_mm'], '.3f')} mm",
                ),
            ]
        )
        drawn = draw_repeatability(repeated, texts)
        figure(texts("course.scatter"), drawn, texts, texts("course.scatter_note"), selects=True)
    if repeated is None and not campaign.reference_points:
        text("p", texts("course.no_references")).classes("quiet")


def draw_drift(campaign: Campaign, texts: Texts) -> Figure:
    """Draw the distance of every reference point from its median place, row by row, but for rows in which it is rejected."""
    rejected = observe_reference_points(campaign.reference_points).lost
    series = tuple(
        Series(
            name=name,
            x=np.arange(len(points)),
            y=np.where(rejected[:, k], np.nan, np.linalg.norm(points - np.nanmedian(points, axis=0), axis=1)) * 1e3,
            colour=SERIES[k % len(SERIES)],
            shape=SHAPES[k % len(SHAPES)],
            rows=range(len(points)),
        )
        for k, (name, points) in enumerate(campaign.reference_points.items())
    )
    y = Axis(title=texts("course.away"), zero=True)
    return Figure(panels=(Panel(x=Axis(title=texts("course.row"), whole=True), y=y, series=series),))


def draw_repeatability(repeated: RepeatedPoses, texts: Texts) -> Figure:
    """The repeatability of every pose that recurs."""
    first = tuple(str(rows[0]) for rows in repeated.rows)
    bars = Series(kind="bars", x=repeated.repeatability * 1e3, y=range(len(first)), rows=first)
    y = Axis(title=texts("course.row"), categories=first)
    return Figure(panels=(Panel(x=Axis(title="RP", unit="mm", zero=True), y=y, series=(bars,)),))


MAX_FIRST_ROWS = 12

OF_ROWS = ("gross-rows", "duplicate-poses", "rows-shuffled")
"""Findings whose subjects are rows, by their ids."""

MAX_CONCERNED = 30
"""Of the rows that findings concern."""


async def build(studio: Studio, texts: Texts) -> None:
    """Fill the page."""
    project = studio.project
    choices = project.choices
    first = ui.element("div")
    files = {path: path for path in project.files(LAYOUT.campaigns, CAMPAIGN_ENDINGS)}
    if files:
        choose_file(project, texts, "campaign", files)
    drop_zone(texts, "campaign", texts("measurements.drop"), CAMPAIGN_ENDINGS, several=True)
    link(texts("measurements.live"), "/live")
    pictured = await asyncio.to_thread(shows_images, project)
    _images(studio, texts, pictured=pictured)
    robot = await asyncio.to_thread(robot_of, project)
    if not choices.campaign:
        text("p", texts("measurements.none"))
        return
    if pictured and not choices.board:
        return
    try:
        campaign = await asyncio.to_thread(read_measured, project, robot)
    except TaskcalError as error:
        await _unread(error, studio, robot, texts)
        return
    if (images := images_of(campaign.observations)) and images[1].pictures is None:
        studio.unread = await asyncio.to_thread(examined, project)
        message(texts("measurements.names_images"))
        return
    findings = await _mistakes(studio, texts, partial(_count, first, campaign, texts))
    show_run(studio, "convert", texts, about=choices.campaign)
    measured = await asyncio.to_thread(registered_rows, ErrorModel(robot), campaign)
    meshes = await asyncio.to_thread(meshes_if_sound, project)
    with RowSelection(len(campaign)) as selection:
        _understood(campaign, robot, texts)
        ColumnEditor(studio, robot, texts)
        concerned = concerned_rows(findings, campaign)
        _list_concerned(concerned, campaign, robot, texts)
        _in_space(campaign, measured, robot, meshes, concerned, selection, texts)
        if campaign.tracked:
            show_course(campaign, texts)


def _images(studio: Studio, texts: Texts, *, pictured: bool) -> None:
    """Ask for images, their boards and their lens, and have their corners found; of a campaign with corners for its boards."""
    project = studio.project
    choices, folders = project.choices, project.image_folders()
    with ui.element("details") as whole:
        if pictured or choices.images:
            whole.props("open")
        text("summary", texts("measurements.boards"))
        text("p", texts("measurements.boards_how" if pictured else "measurements.images_how")).classes("quiet")
        if folders:
            listed = {path: f"{path} ({count})" for path, count in folders.items()}
            choose_file(project, texts, "images", listed, none=texts("measurements.new_folder"))
        drop_zone(texts, IMAGES, texts("measurements.drop_images"), sorted(SUFFIXES), several=True)
        choose_or_drop(project, texts, "board")
        choose_file(project, texts, "lens", {name: texts(f"measurements.{name}") for name in ("pinhole", "fisheye")})
        choose_or_drop(project, texts, "camera", none=texts("measurements.no_camera"))
        if pictured or choices.images not in folders:
            return
        times = {name: texts(f"measurements.by_{name}") for name in ("names", "exif")}
        choose_file(project, texts, "image_times", times, none=texts("measurements.by_rows"))
        if is_running(show_run(studio, "corners", texts)):
            return
        if choices.campaign and choices.board:
            button(texts("measurements.find_corners"), lambda: find_corners(studio))
        else:
            text("p", texts("measurements.find_first"))


def find_corners(studio: Studio) -> None:
    """Find the corners of the images, and make a campaign of them and of the joints that are chosen."""
    project, choices = studio.project, studio.project.choices
    taken = [Path(path).name for path in project.files(LAYOUT.campaigns)]
    found = f"{LAYOUT.campaigns}/{free_name(f'{Path(choices.campaign).stem}-images.csv', taken)}"
    given = {"robot": choices.robot, "images": choices.images, "image_times": choices.image_times, "output": found}
    arguments = asked("convert", file=choices.campaign, **given, **stated_of_images(choices))
    begin(studio, "corners", arguments, outputs=[found], chosen={"campaign": found}, page="measurements")


async def _unread(error: TaskcalError, studio: Studio, robot: Robot, texts: Texts) -> None:
    """Say why a file is not read, and ask for what it leaves open; two files that were dropped together are joined."""
    choices = studio.project.choices
    studio.unread = await asyncio.to_thread(examined, studio.project)
    run = show_run(studio, "convert", texts, about=choices.campaign)
    show_error(studio.project, error)
    editor = ColumnEditor(studio, robot, texts, is_open=True)
    if choices.points and not is_running(run):
        editor.join(choices.points)


def _understood(campaign: Campaign, robot: Robot, texts: Texts) -> None:
    show_sections([campaign_section(campaign)], texts)
    for note in campaign.notes:
        message(note, fine=True)
    if not campaign.tracked:
        return
    first = campaign.take(slice(MAX_FIRST_ROWS))
    header, *rows = csv.reader(campaign_text(first, robot).splitlines())
    shown = TextTable.of_rows(texts("measurements.first_rows", count=len(rows)), tuple(header), map(tuple, rows))
    tabulated(shown, range(len(rows)))


def _count(place: Element, campaign: Campaign, texts: Texts, findings: Sequence[Mapping[str, Any]] | None) -> None:
    """How many rows there are, and how much is wrong with them; None where that is not known yet."""
    place.clear()
    with place:
        if findings is None:
            headline(texts("measurements.headline", rows=len(campaign)), texts("measurements.not_examined"))
        elif findings:
            named = ", ".join(dict.fromkeys(texts.named("doctor", one["id"]) for one in findings))
            headline(texts("measurements.headline_found", rows=len(campaign), count=len(findings)), named, style="bad")
        else:
            headline(texts("measurements.headline", rows=len(campaign)), texts("measurements.sound"), style="good")


async def _mistakes(
    studio: Studio, texts: Texts, count: Callable[[Sequence[Mapping[str, Any]] | None], None]
) -> Sequence[Mapping[str, Any]]:
    """Examine the campaign if it or the robot is another than was examined last; show the findings, with what mends each.

    Args:
        studio: whose campaign it is.
        texts: of the page.
        count: shows what there is, and what of it is wrong; called again once that is known.
    """
    project = studio.project
    choices = project.choices
    text("h2", texts("measurements.mistakes"))
    now = await asyncio.to_thread(examined, project)
    if now != studio.examined and not is_running(studio.run_of("doctor")):
        options = await asyncio.to_thread(options_of_images, project)
        studio.start("doctor", asked("doctor", campaign=choices.campaign, robot=choices.robot, **options))
        studio.examined = now
    show_run(studio, "mend", texts)
    around = ui.element("div")

    def ended() -> None:
        if studio.findings() or studio.examined != now:  # something was changed while the doctor looked
            ui.navigate.reload()
            return
        around.clear()
        with around:
            tell()

    def tell() -> None:
        run = show_run(studio, "doctor", texts, about=choices.campaign, ended=ended)
        done = run is not None and run.status is Status.done and studio.examined == now
        count(studio.findings() if done else None)

    with around:
        tell()
    findings = studio.findings() if studio.examined == now else ()
    if findings:
        _list_findings(findings, studio, texts, now)
    return findings


def _list_findings(findings: Sequence[Mapping[str, Any]], studio: Studio, texts: Texts, now: str) -> None:
    mends = Column(texts("measurements.mends"), lambda one: mend(one, texts))
    table = findings_table(findings, lambda one: f"{texts.named('doctor', one['id'])} ({one['id']})", mends)
    tabulated(replace(table, title=texts("measurements.found")), texts=texts)
    if is_running(studio.run_of("mend")):
        return
    written = [one for one in findings if is_of_file(one)]
    if len(written) > 1:
        text("p", texts("measurements.together"))
        with ui.element("ul"):
            for one in written:
                text("li", texts.named("mend", one["id"], subject=", ".join(one["subject"])))
    with ui.element("div").classes("row"):
        for finding in findings:
            if finding in written[1:]:
                continue  # the file is written without all of them
            if not is_of_file(finding) and finding["alternative"] and not is_of_robot(finding):
                continue
            label = texts.named("mend", finding["id"], subject=", ".join(finding["subject"]))
            if finding in written and len(written) > 1:
                label = texts("measurements.mend_all", count=len(written))
            button(label, lambda finding=finding: mend_finding(studio, finding), plain=is_of_plan(finding))
        if studio.project.choices.accepted != now and any(map(is_in_the_way, findings)):
            button(texts("measurements.accept"), lambda: _accept(studio, now), plain=True)


def is_of_robot(finding: Mapping[str, Any]) -> bool:
    """Whether another robot file mends a finding."""
    return MISTAKES[finding["id"]].part == "robot"


def is_of_plan(finding: Mapping[str, Any]) -> bool:
    """Whether other measurements mend a finding."""
    return MISTAKES[finding["id"]].measured_anew


def is_in_the_way(finding: Mapping[str, Any]) -> bool:
    """Whether a finding is to be mended, or accepted, before one goes on."""
    return not is_of_plan(finding) and not finding["alternative"]


def is_of_file(finding: Mapping[str, Any]) -> bool:
    """Whether the campaign's file is written anew without a finding."""
    return is_in_the_way(finding) and not is_of_robot(finding)


def mend_finding(studio: Studio, finding: Mapping[str, Any]) -> None:
    """Do what mends a finding: another robot, a new version of the same measurements, or a plan to measure by."""
    project, choices = studio.project, studio.project.choices
    if finding["id"] == "dh-convention":
        exchanged = other_convention(robot_of(project))
        if exchanged is not None:
            robot, convention = exchanged
            content = tomli_w.dumps(dict(robot.description)).encode()
            with project.change():
                put = project.put(LAYOUT.robots, f"{robot.name}-{convention}.toml", content, ROBOT_ENDINGS)
                project.choose(robot=put)
        ui.navigate.reload()
    elif finding["id"] == "other-robot" and finding["subject"]:
        project.choose(robot=finding["subject"][0])
        ui.navigate.reload()
    elif is_of_robot(finding) or is_of_plan(finding):
        ui.navigate.to("/robot" if is_of_robot(finding) else "/plan")
    else:
        taken = [Path(path).name for path in project.files(LAYOUT.campaigns)]
        new = f"{LAYOUT.campaigns}/{free_name(f'{Path(choices.campaign).stem}.csv', taken)}"
        place = choices.campaign if choices.campaign.lower().endswith(".csv") else new
        mended = f"{LAYOUT.history}/mended.csv"
        project.path(mended).unlink(missing_ok=True)
        options = options_of_images(project)
        arguments = asked("doctor", campaign=choices.campaign, robot=choices.robot, **options, fix=mended)
        begin(studio, "mend", arguments, chosen={"campaign": place}, moves={place: mended})


def _accept(studio: Studio, now: str) -> None:
    studio.project.choose(accepted=now)
    ui.navigate.reload()


def mend(finding: Mapping[str, Any], texts: Texts) -> str:
    """State the remedy of a finding: the doctor's line, and its meaning where that line is in another language."""
    if texts.language == LIBRARY_LANGUAGE:
        return finding["fix"]
    return f"{texts.named('mend', finding['id'], subject=', '.join(finding['subject']))} ({finding['fix']})"


def concerned_rows(findings: Sequence[Mapping[str, Any]], campaign: Campaign) -> Mapping[int, str]:
    """Rows that findings concern, by their numbers, and the finding of each."""
    numbers = {name: number for number, name in enumerate(campaign.ids)}
    return {
        numbers[name]: finding["id"]
        for finding in findings
        if finding["id"] in OF_ROWS
        for name in finding["subject"]
        if name in numbers
    }


def _list_concerned(concerned: Mapping[int, str], campaign: Campaign, robot: Robot, texts: Texts) -> None:
    if not (concerned and campaign.tracked):
        return
    listed = sorted(concerned)[:MAX_CONCERNED]
    header, *rows = csv.reader(campaign_text(campaign.take(listed), robot).splitlines())
    told = [
        (texts.named("doctor", concerned[number]), campaign.row(number), *row[1:])
        for number, row in zip(listed, rows, strict=True)
    ]
    names = (texts("measurements.finding"), texts("measurements.row"), *header[1:])
    title = texts("measurements.concerned", count=len(concerned))
    tabulated(TextTable.of_rows(title, names, told, text_columns=(0, 1)), listed)


def _in_space(
    campaign: Campaign,
    measured: MeasuredRows,
    robot: Robot,
    meshes: RobotMeshes | None,
    concerned: Mapping[int, str],
    selection: RowSelection,
    texts: Texts,
) -> None:
    """The robot at the selected row, and all points; those of rows that a finding concerns stand out."""
    points, rows, _ = measured.cloud
    if not len(points):
        return
    text("h2", texts("measurements.space"))
    view = CellView(
        robot if measured.in_base else None,
        campaign.q,
        meshes=meshes,
        cloud=points,
        colours=np.where(np.isin(rows, list(concerned))[:, None], CONCERNED, INK),
        on_pick=lambda number: selection.choose(int(rows[number])),
        instruments=measured.standing,
        targets=len(campaign.targets),
    )

    def tell(row: int) -> str:
        places = campaign.points[row] * 1e3
        seen = [(name, at) for name, at in zip(campaign.targets, places, strict=True) if np.isfinite(at).all()]
        return ": ".join(
            (
                campaign.row(row),
                "; ".join(
                    f"{name} {' '.join(texts.number(value, '.4f') for value in at.tolist())} mm" for name, at in seen
                ),
            )
        )

    label = texts("measurements.space_of", count=len(points))
    RowPlayer(
        view,
        campaign.q,
        selection,
        label,
        texts,
        tell=tell,
        beams=lambda row, _: measured.beams(row),
        points=measured.at,
    )
    size = np.ptp(points, axis=0) * 1e3
    hint = texts("measurements.pick") if len(points) <= MAX_PICKED else texts("measurements.too_many")
    text("p", f"{size[0]:.0f} × {size[1]:.0f} × {size[2]:.0f} mm. {hint}").classes("quiet")
    if not measured.in_base:
        text("p", texts("measurements.not_placed")).classes("quiet")
    if concerned:
        text("p", texts("measurements.concerned_dark")).classes("quiet")

"""Pages of the studio as a simulated user sees them: what they show is what the library computes from the same files."""

import csv
import io
import json
import re
import shutil
from contextlib import chdir, redirect_stdout
from pathlib import Path

import numpy as np
import pytest
from nicegui import ui
from openpyxl import Workbook

from taskcal.campaigns.campaign import Campaign
from taskcal.cli import main
from taskcal.errors import ReachError
from taskcal.geometry import se3
from taskcal.identification.calibration import load_calibration
from taskcal.observations.point import load_station
from taskcal.planning.plan import Plan
from taskcal.reading.reader import read_campaign
from taskcal.reading.writer import write_campaign, write_joints
from taskcal.report.calibration import calibration_sections
from taskcal.report.content import TextTable
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import load_task, reach_task
from taskcal.virtual.cell import simulate
from taskcal_groundwork.said import term
from taskcal_studio.files import take_file
from taskcal_studio.measured_rows import registered_rows
from taskcal_studio.pages.identify_page import arguments_of
from taskcal_studio.pages.weight_page import POSES
from taskcal_studio.project import LAYOUT, Project
from taskcal_studio.results import examined
from taskcal_studio.runs import CommandRun, Status
from taskcal_studio.server import ROAD
from taskcal_studio.texts import LANGUAGES, Texts
from taskcal_studio.views import MARK
from tests.observations.pictured import COLUMNS, CORNERS, LENS, ROWS, SQUARE, take_pictures
from tests.taskcal_studio.visitor import Visitor, visit

ROBOT = load_robot("ur5")
MODEL = ErrorModel(ROBOT)
TEXTS = Texts("en")

TASK = """name = "box"
[workspace]
frame = "base"
shape = "box"
center_mm = [-450.0, -150.0, 350.0]
size_mm = [100.0, 120.0, 140.0]
[[workspace.orientation]]
rpy_deg = [180.0, 20.0, 0.0]
cone_deg = 10.0
spin_deg = 30.0
[accuracy]
position_mm = 0.1
"""


def campaign_of_two_targets() -> Campaign:
    """Forty rows of two targets, one of which is lost in three rows."""
    rng = np.random.default_rng(3)
    targets = {"A": [0.03, 0.0, 0.1], "B": [-0.02, 0.05, 0.08]}
    campaign, _ = simulate(MODEL, rng.uniform(-1.2, 1.2, (40, 6)), targets=targets, rng=rng)
    campaign.points[[4, 9, 11], 1] = np.nan
    return campaign


def fit(folder: Path) -> None:
    """Fit the project's campaign as its page does, and keep what the command printed."""
    line = "identify campaigns/one.csv --robot ur5 --output calibrations/one.json --holdout 0.3 --json --force"
    with chdir(folder), redirect_stdout(io.StringIO()) as said:
        assert main(line.split()) == 0
    (folder / "calibrations" / "one.result.json").write_text(said.getvalue())


@pytest.fixture(scope="session")
def worked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project with a campaign, a task and a calibration, which tests only look at."""
    folder = tmp_path_factory.mktemp("pages")
    project = Project(folder)
    for name in ("campaigns", "tasks", "calibrations"):
        (folder / name).mkdir()
    write_campaign(folder / "campaigns" / "one.csv", campaign_of_two_targets(), ROBOT)
    (folder / "tasks" / "box.toml").write_text(TASK)
    fit(folder)
    project.choose(
        robot="ur5", campaign="campaigns/one.csv", task="tasks/box.toml", calibration="calibrations/one.json"
    )
    return folder


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """A project with a task, which a test may change."""
    (tmp_path / "tasks").mkdir()
    (tmp_path / "tasks" / "box.toml").write_text(TASK)
    Project(tmp_path).choose(robot="ur5", task="tasks/box.toml")
    return tmp_path


def numbers(said: str) -> list[float]:
    """Numbers in a text, in their order."""
    return [float(found) for found in re.findall(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?", said)]


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_page_has_its_title_and_its_place_on_the_road(language, worked, caplog) -> None:
    texts = Texts(language)
    titles = [texts(f"{page.key}.title") for page in ROAD]

    async def look(user: Visitor) -> None:
        for page, title in zip(ROAD, titles, strict=True):
            await user.open(page.key)
            assert user.said("h1") == [title]
            (nav,) = user.elements("nav")
            road = user.elements("a", within=nav)
            assert [(link.text, link.props["href"]) for link in road] == [
                (name, f"/{one.key}") for name, one in zip(titles, ROAD, strict=True)
            ]
            assert [link.text for link in road if "aria-current" in link.props] == [title]
            marked = [e for e in user.elements("a") if e.props.get("aria-current") == "true"]
            assert [e.text for e in marked] == [LANGUAGES[language], texts("frame.dark")]

    visit(worked, look, **{"accept-language": language, "cookie": "taskcal-theme=dark"})
    assert not [record for record in caplog.records if record.levelname == "ERROR"]


def test_settings_are_kept_and_lead_back_to_their_page(worked) -> None:
    async def ask(user: Visitor) -> None:
        answer = await user.http.get("/settings?language=de&theme=odd&page=task")
        assert (answer.status_code, answer.headers["location"]) == (303, "/task")
        assert dict(answer.cookies) == {"taskcal-language": "de"}
        assert (await user.http.get("/settings?page=nowhere")).headers["location"] == f"/{ROAD[0].key}"
        assert (await user.http.get("/")).headers["location"] == f"/{ROAD[0].key}"
        assert (await user.http.get("/alive")).json() == {"taskcal": "studio"}

    visit(worked, ask)


def test_dropped_files_are_kept_as_they_are_and_chosen(own) -> None:
    content = {
        "campaign": b"J1,J2\n",
        "task": TASK.encode(),
        "station": b"x",
        "cell": b"y",
        "program": b"z",
        "robot": b"r",
    }
    names = {"campaign": "a.csv", "program": "b.mod"}

    async def drop(user: Visitor) -> None:
        for kind, sent in content.items():
            name = names.get(kind, f"{kind}.toml")
            answer = await user.http.post(f"/drop/{kind}", content=sent, headers={"x-file-name": f"my%20{name}"})
            path = answer.json()["path"]
            assert (own / path).read_bytes() == sent
            assert path.endswith(f"/my-{name}")
            assert getattr(user.studio.project.choices, kind) == path
        assert (await user.http.post("/drop/other", content=b"")).status_code == 404
        refused = await user.http.post("/drop/task", content=b"", headers={"x-file-name": "a.csv"})
        assert (refused.status_code, ".toml" in refused.json()["message"]) == (422, True)
        given = await user.http.get("/file/campaigns/my-a.csv")
        assert given.content == content["campaign"]

    visit(own, drop)


def test_the_tool_is_shown_where_the_joints_put_it(worked) -> None:
    async def jog(user: Visitor) -> None:
        await user.open("robot")
        q = np.zeros(6)

        def is_there() -> None:
            T = MODEL.poses(q[None])[0]
            place, turned = user.said("dd")[:2]
            np.testing.assert_allclose(numbers(place), T[:3, 3] * 1e3, atol=1e-4)
            np.testing.assert_allclose(se3.from_quaternion(np.array(numbers(turned))), T[:3, :3], atol=1e-5)
            for name, degrees in zip(ROBOT.joint_names, np.degrees(q), strict=True):
                assert float(user.named(f"{name} (°)").value) == pytest.approx(degrees, abs=1e-4)
                assert float(user.named(name, type="range").value) == pytest.approx(degrees, abs=1e-4)
            reasons = [reason for _, reason in ROBOT.outside_limits(q[None])]
            assert user.said("div", "message") == reasons

        is_there()
        for joint, degrees in ((0, 12.5), (4, -33.25), (2, 400.0), (1, 1e-3)):
            user.leave(f"{ROBOT.joint_names[joint]} (°)", str(degrees))
            q[joint] = np.radians(degrees)
            is_there()
        user.tell(user.named(ROBOT.joint_names[5], type="range"), "moved", {"value": 80, "said": 2})
        q[5] = np.radians(80.0)
        is_there()
        for nothing in ("", "-", "1e999", "x", "0x10", "nan"):
            user.leave(f"{ROBOT.joint_names[0]} (°)", nothing)
            is_there()
        user.press(TEXTS("robot.home"))
        q[:] = 0.0
        is_there()
        (table,) = user.tables().values()
        assert [row[0] for row in table[1:]] == list(ROBOT.joint_names)
        np.testing.assert_allclose(
            [[*numbers(row[2]), *numbers(row[3])] for row in table[1:]], np.degrees(ROBOT.limits)
        )

    visit(worked, jog)


def test_the_first_rows_and_a_picked_point_are_the_file_s(worked) -> None:
    campaign = read_campaign(worked / "campaigns" / "one.csv", ROBOT)

    async def look(user: Visitor) -> None:
        await user.open("measurements")
        facts = user.facts()
        assert facts["poses"] == "40"
        assert facts["targets on the tool"] == "A, B"
        assert facts["missing points (beam lost)"] == "3"
        ((header, *rows),) = (
            table
            for title, table in user.tables().items()
            if title == TEXTS("measurements.first_rows", count=len(table) - 1)
        )
        written = written_rows(worked)
        assert written[0].keys() <= set(header)
        assert 0 < len(rows) < len(written)
        for row, one in zip(rows, written, strict=False):
            assert one.items() <= dict(zip(header, row, strict=True)).items()
        (scene,) = (e for e in user.all() if "click3d" in {one.type for one in e._event_listeners.values()})
        measured = registered_rows(MODEL, campaign)
        for row, target in ((7, 0), (30, 1), (11, 0)):
            user.click_in(scene, *measured.points[row, target] + [0.0, 1e-6, 0.0])
            (said,) = (text for text in user.said("span") if text.startswith("row "))
            assert said.startswith(f"{campaign.row(row)}: ")
            of_target = next(
                part for part in said.split(": ", 1)[1].split("; ") if part.startswith(campaign.targets[target])
            )
            np.testing.assert_allclose(
                numbers(of_target.replace("−", "-")), campaign.points[row, target] * 1e3, atol=1e-4
            )

    visit(worked, look)


def test_a_row_is_selected_by_clicks_keys_and_slider_alike(worked) -> None:
    campaign = read_campaign(worked / "campaigns" / "one.csv", ROBOT)
    measured = registered_rows(MODEL, campaign)

    async def select(user: Visitor) -> None:
        await user.open("measurements")
        (area,) = (
            e for e in user.elements("div") if {"click", "keydown"} <= {one.type for one in e._event_listeners.values()}
        )
        slider = user.named(TEXTS("player.pose"))
        (scene,) = (e for e in user.all() if isinstance(e, ui.scene))

        def is_selected(row: int) -> None:
            assert slider.value == str(row)
            assert [said for said in user.said("span") if said.startswith(f"{campaign.row(row)}: ")]
            marks = [one for one in scene.objects.values() if one.color == MARK and one.visible_]
            np.testing.assert_allclose([[one.x, one.y, one.z] for one in marks], measured.at(row))

        is_selected(0)
        for event, said, row in (
            ("click", "7", 7), ("keydown", 1, 8), ("keydown", -1, 7), ("click", "40", 7), ("click", "-1", 7), ("click", "39", 39),
            ("keydown", 1, 39), ("click", "0", 0), ("keydown", -1, 0),
        ):  # fmt: skip
            user.tell(area, event, said)
            is_selected(row)
        user.tell(slider, "moved", {"value": "5", "said": 1})
        is_selected(5)
        shown = {e.props["data-row"] for e in user.elements("tr") if "data-row" in e.props}
        assert shown == {str(row) for row in range(len(shown))}

    visit(worked, select)


def written_rows(folder: Path) -> list[dict[str, str]]:
    """Rows of the campaign's file, by their columns."""
    with (folder / "campaigns" / "one.csv").open() as file:
        return list(csv.DictReader(file))


def finished(
    studio, kind: str, arguments: list[str], result: dict | None, messages: tuple[str, ...] = (), status=Status.done
) -> None:
    """A run that has ended."""
    run = CommandRun(arguments, studio.project.folder, kind)
    run.status, run.result, run.messages = status, result, list(messages)
    studio._runs[kind] = run


@pytest.mark.parametrize("language", LANGUAGES)
def test_findings_are_listed_and_their_rows_stand_out(worked, language) -> None:
    texts = Texts(language)
    campaign = read_campaign(worked / "campaigns" / "one.csv", ROBOT)
    finding = {
        "error_before_mm": 7.125,
        "error_after_mm": 0.5,
        "confidence": 0.98,
        "fix": "look at it",
        "alternative": False,
    }
    rows = [21, 5, 33]
    findings = [
        {"id": "joint-sign", "subject": ["J3"], **finding},
        {"id": "gross-rows", "subject": [campaign.ids[row] for row in rows], **finding},
    ]

    async def look(user: Visitor) -> None:
        arguments = ["doctor", "campaigns/one.csv", "--robot=ur5", "--json"]
        finished(user.studio, "doctor", arguments, {"findings": findings}, ("error: a", "b"))
        user.studio.examined = examined(user.studio.project)
        await user.open("measurements")
        assert "taskcal doctor campaigns/one.csv --robot=ur5" in user.said("code")
        assert [e.text for e in user.elements("div") if e.props.get("role") == "alert"] == ["a"]
        tables = user.tables()
        (_, *told) = tables[texts("measurements.found")]
        assert [(*(numbers(cell.replace(",", ".")) for cell in row[2:5]),) for row in told] == [
            ([7.12], [0.5], [98])
        ] * 2
        assert all(finding["fix"] in row[5] for row in told)
        (header, *listed) = tables[texts("measurements.concerned", count=3)]
        written = written_rows(worked)
        assert [row[1] for row in listed] == [campaign.row(row) for row in sorted(rows)]
        for row, k in zip(listed, sorted(rows), strict=True):
            shown = dict(zip(header, row, strict=True))
            assert all(shown.get(name, value) == value for name, value in written[k].items())

    visit(worked, look, **{"accept-language": language})


@pytest.mark.parametrize(
    ("said", "result", "uncertain"),
    [("--accept-uncertain", None, True), ("--accept-uncertain", {}, False), ("--max-shift-mm", None, False)],
)
def test_a_refusal_for_what_is_not_known_leads_to_more_poses(worked, tmp_path, said, result, uncertain) -> None:
    """And may be overridden for one run; neither does another refusal, nor what is withheld, whose verdict says what helps."""
    own = Path(shutil.copytree(worked, tmp_path / "own"))
    (own / LAYOUT.programs).mkdir()
    (own / LAYOUT.programs / "a.mod").write_text("MODULE a\nPROC main()\nENDPROC\nENDMODULE\n")
    Project(own).choose(program=f"{LAYOUT.programs}/a.mod")

    async def look(user: Visitor) -> None:
        arguments = ["correct", user.studio.project.choices.program]
        finished(user.studio, "correct", arguments, result, (f"error: it is not corrected ({said})",), Status.refused)
        await user.open("program")
        links = [e.text for e in user.elements("a") if e.props.get("href") == "/plan" and e.text == TEXTS("plan.title")]
        assert len(links) == 1 + uncertain  # one of the road
        assert (TEXTS("program.write_anyway") in user.said("button")) == uncertain

    visit(own, look)


def test_a_box_that_is_edited_is_saved_and_reached_as_said(own) -> None:
    path = own / "tasks" / "box.toml"

    async def edit(user: Visitor) -> None:
        await user.open("task")
        center, size, turn = (TEXTS(f"task.{of}") for of in ("center", "size", "turn"))

        def is_shown() -> None:
            workspace = load_task(path).workspace
            for k, letter in enumerate("xyz"):
                for label, unit, values in ((center, "mm", workspace.center), (size, "mm", workspace.size)):
                    assert float(user.named(f"{label} {letter} ({unit})").value) == pytest.approx(values[k] * 1e3)
            reached = 1.0 - reach_task(MODEL, load_task(path), 60).unreachable.mean()
            assert TEXTS("task.reached", share=f"{reached:.0%}") in user.said("p") + user.said("div")

        is_shown()
        user.leave(f"{center} x (mm)", "-512.34")
        user.leave(f"{size} z (mm)", "300")
        user.leave(f"{size} y (mm)", "-5")
        user.leave(f"{turn} z (°)", "30")
        workspace = load_task(path).workspace
        np.testing.assert_allclose(workspace.center, [-0.5123, -0.15, 0.35], atol=1e-9)
        np.testing.assert_allclose(workspace.size, [0.1, 0.12, 0.3], atol=1e-9)
        np.testing.assert_allclose(workspace.turned, se3.rotation("z", np.radians(30.0))[:3, :3], atol=1e-6)
        is_shown()
        user.leave(f"{center} z (mm)", "5000")
        with pytest.raises(ReachError) as refused:
            reach_task(MODEL, load_task(path), 60)
        assert user.said("div", "message") == [str(refused.value)]

    visit(own, edit)


def test_orientations_are_turned_added_and_taken_away(own) -> None:
    path = own / "tasks" / "box.toml"

    async def edit(user: Visitor) -> None:
        await user.open("task")

        def orientations():
            found = load_task(path).workspace.orientations
            directions = [numbers(said.split("=")[-1]) for said in user.said("p") if "points to" in said]
            np.testing.assert_allclose(directions, [one.rotation[:, 2] for one in found], atol=1e-3)
            return found

        user.leave(TEXTS("task.pitch"), "55")
        user.leave(TEXTS("task.cone"), "12.5")
        user.leave(TEXTS("task.spin"), "181")  # is none
        (one,) = orientations()
        R = se3.rotation("y", np.radians(55.0)) @ se3.rotation("x", np.pi)
        np.testing.assert_allclose(one.rotation, R[:3, :3], atol=1e-6)
        np.testing.assert_allclose(np.degrees([one.cone, one.spin]), [12.5, 30.0])
        await user.again(lambda: user.press(TEXTS("task.add_orientation")))
        assert len(orientations()) == 2
        fields = [e for e in user.all() if e.props.get("aria-label") == TEXTS("task.yaw")]
        user.tell(fields[1], "left", {"value": "90", "said": 1})
        first, second = orientations()
        np.testing.assert_allclose(first.rotation, one.rotation, atol=1e-9)
        np.testing.assert_allclose(second.rotation, se3.rotation("z", np.pi / 2)[:3, :3] @ R[:3, :3], atol=1e-6)
        await user.again(lambda: user.press(TEXTS("task.remove_orientation", number=1)))
        (left,) = orientations()
        np.testing.assert_allclose(left.rotation, second.rotation, atol=1e-9)

    visit(own, edit)


def test_parameters_are_weighed_by_their_tolerances(worked) -> None:
    async def look(user: Visitor) -> None:
        await user.open("weight")
        task = load_task(worked / "tasks" / "box.toml")
        poses = reach_task(MODEL, task, POSES)
        moved = np.linalg.norm(MODEL.jacobian(poses.q)[:, :3], axis=1) * [p.tolerance for p in MODEL.parameters]
        ((_, *rows),) = user.tables().values()
        found = {p.name: k for k, p in enumerate(MODEL.parameters)}
        shown = [found[row[0]] for row in rows]
        np.testing.assert_allclose([float(row[-2]) for row in rows], moved.max(axis=0)[shown] * 1e3, atol=6e-5)
        rms = np.sqrt(np.mean(moved**2, axis=0))
        np.testing.assert_allclose([float(row[-1]) for row in rows], rms[shown] * 1e3, atol=6e-5)
        least = min(float(row[-2]) for row in rows)
        assert np.delete(moved.max(axis=0), shown).max() * 1e3 <= least + 1e-4
        assert [row[3] for row in rows] == sorted((row[3] for row in rows), key=float, reverse=True)
        reached, apart = (numbers(said) for said in user.said("dd"))
        assert reached == [round(100.0 * (1.0 - poses.unreachable.mean()))]
        assert apart[1] == len(MODEL)

    visit(worked, look)


def test_a_plan_is_shown_pose_by_pose(own) -> None:
    q = np.random.default_rng(2).uniform(-1.0, 1.0, (3, 6))
    (own / "plans").mkdir()
    write_joints(own / "plans" / "m_box_3.csv", q, ROBOT)
    (own / "plans" / "m_box_3.mod").write_text("")
    (own / "plans" / "other.csv").write_text("")
    plan = Plan(
        q=q, rows=(0, 1, 2), visible=np.ones((3, 1), dtype=bool), expected=0.21e-3, random=np.full(5, 0.32e-3), grid=0.43e-3,
        by_count=np.array([2e-3, 1e-3, 0.21e-3]), before=3e-3, criterion="task", exchanges=1,
        lost={"not reached": 5, "in a keep-out box": 0}, candidates=77,
    )  # fmt: skip
    result = {
        **plan.summary(), "task": "box", "measured_before": 0, "plan": "plans/m_box_3.csv",
        "clearance_mm": {"between_links": [11.2, 22.4, 33.1], "to_keep_out": None}, "programs": ["plans/m_box_3.mod"],
    }  # fmt: skip
    (own / "plans" / "m_box_3.csv.result.json").write_text(json.dumps(result))

    async def look(user: Visitor) -> None:
        await user.open("plan")
        user.leave(TEXTS("option.count"), "3")
        assert user.studio.project.choices.options == {"plan": {"count": "3"}}
        for wrong in ("0", "3.4"):
            user.leave(TEXTS("option.count"), wrong)
            assert any(wrong in said for said in user.said("span", "message"))
        assert user.studio.project.choices.options == {"plan": {"count": "3"}}
        await user.open("plan")
        facts = user.facts()
        assert numbers(user.said("p", "headline")[0]) == [0.21]
        assert numbers(facts["candidates"]) == [77, 5]
        expected, by_count, each = user.tables().values()
        assert [row[1] for row in expected[1:]] == ["0.210", "0.320", "0.430", "3.000"]
        assert by_count[1:] == [["3", "0.210"]]
        links = {e.props["href"] for e in user.elements("a") if "keep=1" in e.props["href"]}
        assert links == {"/file/plans/m_box_3.csv?keep=1", "/file/plans/m_box_3.mod?keep=1"}
        assert [(row[0], row[-1]) for row in each[1:]] == [("0", "11"), ("1", "22"), ("2", "33")]
        slider = user.named(TEXTS("player.pose"))
        for pose in (2, 0, 1):
            user.tell(slider, "moved", {"value": str(pose), "said": 1})
            assert any(
                numbers(said)[:3] == [pose, 3, [11, 22, 33][pose]] for said in user.said("span") if "id " in said
            )
        user.tell(slider, "moved", {"value": "3", "said": 1})
        assert slider.value == "1"
        user.press(TEXTS("player.play"))
        await user.until(lambda: slider.value == "2" and TEXTS("player.play") in user.said("button"))

    visit(own, look)


def test_a_station_is_begun_and_its_tracker_moved(own) -> None:
    async def edit(user: Visitor) -> None:
        await user.open("plan")
        await user.again(lambda: user.press(TEXTS("station.begin")))
        path = own / user.studio.project.choices.station
        before = load_station(path)
        user.leave(TEXTS("station.at", axis="y"), "-2345.5")
        after = load_station(path)
        np.testing.assert_allclose(after.position, [before.position[0], -2.3455, before.position[2]])
        assert user.facts()[TEXTS("station.reflectors")] == ", ".join(one.name for one in before.reflectors)

    visit(own, edit)


def test_what_is_asked_of_a_fit_is_kept(worked, tmp_path) -> None:
    own = Path(shutil.copytree(worked, tmp_path / "own"))

    async def ask(user: Visitor) -> None:
        await user.open("identify")
        share = f"{TEXTS('option.holdout')} (%)"
        assert user.named(share).props["value"] == "30"
        user.leave(share, "25")
        user.leave(TEXTS("option.seed"), "7")
        box = next(one for one in user.elements("input") if one.props.get("type") == "checkbox")
        user.tell(box, "change", True)
        await user.again(lambda: user.leave(TEXTS("option.effects_own"), "compliance, harmonics:J2"))
        kept = {"holdout": "0.25", "seed": "7", "field": "true", "effects": "compliance, harmonics:J2"}
        assert user.studio.project.choices.options == {"identify": kept}
        await user.again(lambda: user.choose(TEXTS("option.effects"), "auto"))
        assert user.studio.project.choices.options["identify"]["effects"] == "auto"
        user.choose(TEXTS("option.effects"), "not offered")
        await user.again(lambda: user.leave(TEXTS("option.effects_own"), ""))
        assert user.studio.project.choices.options == {"identify": {**kept, "effects": "none"}}

    visit(own, ask)


def test_what_a_workbook_leaves_open_is_stated_on_its_page(own) -> None:
    """Its hidden rows and its smaller sheet: the rows are shown as they are read then, and the campaign is written with them."""
    book, campaign = Workbook(), campaign_of_two_targets()
    write_campaign(own / "all.csv", campaign, ROBOT)
    header, *rows = csv.reader((own / "all.csv").read_text().splitlines())
    for sheet, shown in ((book.active, rows), (book.create_sheet("Second"), rows[20:])):
        sheet.append(header)
        for row in shown:
            sheet.append([row[0], *(float(cell) if cell else None for cell in row[1:])])
    book["Second"].row_dimensions[3].hidden = True
    (own / "campaigns").mkdir()
    book.save(own / "campaigns" / "two.xlsx")
    Project(own).choose(campaign="campaigns/two.xlsx")

    async def ask(user: Visitor) -> None:
        await user.open("measurements")
        columns = TEXTS("measurements.columns")
        assert user.tables()[columns][1][0] == rows[0][0]
        user.leave(TEXTS("option.sheet"), "Nowhere")
        assert any("Nowhere" in one for one in user.said("div", "message"))
        user.leave(TEXTS("option.sheet"), "Second")
        assert user.tables()[columns][1][0] == rows[20][0]
        user.choose(TEXTS("option.hidden_rows"), "drop")
        await user.until(lambda: user.tables()[columns][2][0] == rows[22][0])
        user.press(TEXTS("measurements.write"))
        await user.ended("convert")
        assert user.studio.project.choices.campaign == "campaigns/two-plain.csv"
        kept = [20, *range(22, 40)]
        np.testing.assert_allclose(
            read_campaign(own / "campaigns" / "two-plain.csv", ROBOT).q, campaign.q[kept], atol=1e-7
        )

    visit(own, ask)


def test_an_option_that_cannot_be_is_refused_in_its_field(worked, tmp_path) -> None:
    """In the language and the units of the page, and what was there stays."""
    own = Path(shutil.copytree(worked, tmp_path / "own"))
    texts = Texts("de")
    fields = {
        f"{texts('option.holdout')} (%)": ("120", "120 % liegt nicht zwischen 0 % und 100 %"),
        f"{texts('option.model_error_mm')} (mm)": ("-0,5", "„-0,5“ ist keine Zahl wie 1"),
        f"{texts('option.target_within_mm')} (mm)": ("1e9", "1e+09 mm liegt nicht von 0 mm bis 100000 mm"),
        texts("option.folds"): ("5", "Nehmen Sie „Zurückgehalten von den Stellungen“ oder „Teile"),
    }

    async def ask(user: Visitor) -> None:
        await user.open("identify")
        for label, (given, said) in fields.items():
            user.leave(label, given)
            assert any(one.startswith(said) for one in user.said("span", "message")), (
                label,
                user.said("span", "message"),
            )
        assert user.studio.project.choices.options == {}

    visit(own, ask, **{"accept-language": "de"})


@pytest.mark.parametrize("rough", [0.0, 5e-4])
def test_effects_are_offered_where_more_than_noise_is_left(worked, tmp_path, rough) -> None:
    own = Path(shutil.copytree(worked, tmp_path / "own"))
    rng = np.random.default_rng(3)
    campaign, _ = simulate(MODEL, rng.uniform(-1.2, 1.2, (40, 6)), rng=rng, model_error=rough)
    write_campaign(own / "campaigns" / "one.csv", campaign, ROBOT)
    fit(own)

    async def look(user: Visitor) -> None:
        await user.open("identify")
        assert (TEXTS("identify.with_effects") in user.said("button")) == bool(rough)

    visit(own, look)


def test_a_result_shows_the_calibration_s_own_errors(worked) -> None:
    calibration = load_calibration(worked / "calibrations" / "one.json")
    result = json.loads((worked / "calibrations" / "one.result.json").read_text())
    sizes = np.linalg.norm(calibration.residuals[:, :, :3], axis=2)

    async def look(user: Visitor) -> None:
        await user.open("result")
        tables = user.tables()
        (_, *rows) = tables[TEXTS("result.worst", count=20)]
        largest = np.sort(sizes[np.isfinite(sizes)])[::-1][:20]
        np.testing.assert_allclose([float(row[-1]) for row in rows], largest * 1e3, atol=6e-5)
        for row in rows:
            at = list(calibration.ids).index(row[0]), calibration.targets.index(row[1])
            np.testing.assert_allclose([float(v) for v in row[2:5]], calibration.residuals[at][:3] * 1e3, atol=6e-5)
        said = [block for section in calibration_sections(calibration) for block in section.blocks]
        for table in (one for one in said if isinstance(one, TextTable)):
            shown = [[cell.replace("−", "-") for cell in row] for row in tables[table.title]]
            assert shown == [[cell.replace("−", "-") for cell in row] for row in (table.header, *table.rows)]
        means = {row[0]: numbers(" ".join(row[1:])) for row in tables["Position error of held-out rows"][1:]}
        assert round(result["held_out"]["mean_mm"], 3) in np.round(means["calibrated"], 3)
        slider, scales = user.named(TEXTS("result.scale")), []
        for place in range(int(slider.props["min"]), int(slider.props["max"]) + 1):
            user.tell(slider, "moved", {"value": str(place), "said": 1})
            scales += [float(said[2:]) for said in user.said("span") if said.startswith("× ")]
        assert scales[0] == 1.0
        assert np.all(np.diff(scales) > 0.0)
        assert user.facts()[TEXTS("result.drawn")] == f"{np.isfinite(sizes).sum()} / {np.isfinite(sizes).sum()}"
        await user.open("identify")
        (table,) = (table for title, table in user.tables().items() if title == TEXTS("identify.errors"))
        shown = dict(zip(*table, strict=True))
        held = result["held_out"]
        wanted = {"nominal": result["nominal"]["mean_mm"], "fitted": result["fitted"]["mean_mm"]}
        wanted |= {"unseen": held["mean_mm"], "largest": held["max_mm"]}
        assert shown[TEXTS("identify.rows")] == str(result["rows"])
        assert shown[TEXTS("identify.parameters")] == str(len(result["parameters"]))
        for name, value in wanted.items():
            assert float(shown[TEXTS(f"identify.{name}")]) == pytest.approx(value, abs=6e-4)

    visit(worked, look)


@pytest.mark.long
@pytest.mark.parametrize("language", LANGUAGES)
def test_corners_are_read_with_a_board_and_their_camera_shown(language, tmp_path) -> None:
    """The page asks for the board of a file of corners; the fit takes it, and its result shows camera and residuals."""
    seen, texts = take_pictures(4, 12), Texts(language)
    image, corner = np.divmod(np.arange(len(seen.pixel)), len(CORNERS))
    columns = {"image": image, "corner": corner, "u_px": seen.pixel[:, 0], "v_px": seen.pixel[:, 1]}
    columns |= {"width_px": np.full(len(image), LENS.width), "height_px": np.full(len(image), LENS.height)}
    columns |= {f"J{j + 1}_deg": np.degrees(seen.q[image, j]) for j in range(6)}
    rows = [",".join(columns), *(",".join(map(str, row)) for row in zip(*columns.values(), strict=True))]
    (tmp_path / "campaigns").mkdir()
    (tmp_path / "calibrations").mkdir()
    (tmp_path / "campaigns" / "shots.csv").write_text("\n".join(rows) + "\n")
    project = Project(tmp_path)
    project.choose(robot="ur5", campaign="campaigns/shots.csv")

    async def without_board(user: Visitor) -> None:
        await user.open("measurements")
        assert texts("measurements.boards") in user.said("summary")
        assert texts.said(term("Import summary")) not in user.said("h2")

    visit(tmp_path, without_board, **{"accept-language": language})
    board = f'[[board]]\nkind = "checkerboard"\ncolumns = {COLUMNS}\nrows = {ROWS}\nsquare_mm = {SQUARE * 1e3}\n'
    take_file(project, "board", "board.toml", board.encode(), "")
    assert project.choices.board == "boards/board.toml"
    arguments, calibration = arguments_of(project)
    with chdir(tmp_path), redirect_stdout(io.StringIO()) as said:
        assert main(arguments) == 0
    (tmp_path / "calibrations" / f"{Path(calibration).stem}.result.json").write_text(said.getvalue())
    project.choose(calibration=calibration)

    async def with_board(user: Visitor) -> None:
        await user.open("measurements")
        assert texts.said(term("Import summary")) in user.said("h2")
        await user.open("result")
        assert texts.said(term("Camera and hand-eye")) in user.said("summary")
        assert any(texts.said(term("all images")) in caption for caption in user.said("figcaption"))

    visit(tmp_path, with_board, **{"accept-language": language})

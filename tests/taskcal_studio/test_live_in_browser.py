"""Measuring live in a real browser, from an empty table to the proof; and what the page makes of a command's lines."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taskcal.live.program import Program
from taskcal.live.virtual import VirtualCell
from taskcal.reading.reader import read_campaign
from taskcal.reading.writer import joints_text
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.default_task import default_task, task_text
from taskcal.task.task import load_task, reach_task
from taskcal_studio.pages.live_page import RunProgress, arguments_of, draw_curve, facts_of
from taskcal_studio.project import Project
from taskcal_studio.texts import Texts
from tests.taskcal_studio.conftest import open_tab, served, server_of
from tests.taskcal_studio.test_robot_in_browser import serious

ROBOT = load_robot("ur5")


@pytest.fixture
def project(tmp_path: Path) -> Project:
    """A project with a robot and a task that asks for 0.06 mm."""
    project = Project(tmp_path)
    (tmp_path / "tasks").mkdir()
    task = replace(default_task(ErrorModel(ROBOT)), accuracy=6e-5)
    (tmp_path / "tasks" / "box.toml").write_text(task_text(task))
    project.choose(name="live", robot="ur5", task="tasks/box.toml")
    return project


def state(rows: int, error: float | None) -> str:
    """A line of the command, after a row."""
    interval = None if error is None else [0.9 * error, 1.2 * error]
    known: dict[str, Any] = {"rows": rows, "expected_error_mm": error, "interval_mm": interval, "tolerance_mm": 0.1}
    known |= {"kept_out": 0, "kept_out_rms_mm": None, "bound_mm": None, "poses_left": 7, "seconds_a_pose": 60.0}
    return json.dumps(known | {"proven": False})


def test_a_page_reads_lines_as_the_command_writes_them() -> None:
    """Rows that come twice, as after going on, count once; a half-written last line not at all."""
    pose = json.dumps({"go_to": {"J1_deg": 1.0}, "number": 14, "purpose": "kept-out", "error_after_mm": 0.14})
    lines = [state(12, None), state(13, 0.2), state(13, 0.15), '{"measured": 13, "shots": 3, "scatter_mm": 0.02}', pose]
    measured = RunProgress.of([*lines, '{"rows": 14, "expec'])
    assert (list(measured.known), measured.last) == ([12, 13], json.loads(lines[2]))
    told = dict(facts_of(measured, measured.known[13], Texts("de")))
    assert told["Erwarteter Fehler über die Aufgabe"] == "0,1500 mm (95 %: 0,1350 bis 0,1800 mm)"
    assert told["Nach dieser Stellung erwartet"] == "0,1400 mm"
    assert told["Noch etwa Stellungen"] == "7, 7 min"
    (panel,) = draw_curve(measured.known, Texts("en")).panels
    assert [list(one.x) for one in panel.series] == [[13], [13]]
    assert [level.at for level in panel.levels] == [0.1]


def test_only_what_is_stated_is_an_option_and_nothing_drives(project: Project) -> None:
    project.choose(
        live={"controller": "virtual", "shots": "5", "columns": "", "speed-percent": "7"},
        live_campaign="campaigns/a.csv",
    )
    arguments = arguments_of(project.choices, resume=True)
    assert {"--controller=virtual", "--shots=5", "--output=campaigns/a.csv", "--resume"} <= set(arguments)
    assert not [one for one in arguments if one.startswith(("--columns", "--drive", "--speed", "--station"))]
    confirmed = arguments_of(project.choices, resume=True, drive=True)
    assert set(confirmed) - set(arguments) == {"--drive", "--speed-percent=7"}


def test_a_question_waits_until_it_is_answered() -> None:
    question = '{"question": "moved?", "answers": ["again", "stop"], "said": {"template": "moved?", "values": {}}}'
    asked = RunProgress.of([question]).question
    assert asked is not None
    assert asked["answers"] == ["again", "stop"]
    assert RunProgress.of([question, '{"answered": "again"}']).question is None
    left = RunProgress.of(['{"left": ["3", "5-kept-out"], "error_after_mm": 0.1, "error_after_all_mm": 0.05}'])
    told = dict(facts_of(left, json.loads(state(13, 0.2)), Texts("en")))
    assert (told["Expected after the best pose left"], told["Expected after all poses left"]) == (
        "0.1000 mm",
        "0.0500 mm",
    )


@pytest.mark.browser
@pytest.mark.long
def test_measuring_live_from_an_empty_table_to_the_proof(chromium: Any, project: Project) -> None:
    """The studio is killed, the run stopped, and the page loaded anew on the way; each time it goes on."""
    folder = project.folder
    campaign = folder / "campaigns" / "live-box.csv"
    with served(folder) as address:
        with open_tab(chromium, address) as tab:
            page = tab.open("live")
            page.get_by_text("Choose a controller and an instrument first.").wait_for()
            for device in ("Controller", "Instrument"):
                page.locator(f"select[data-name^={device}]").select_option("virtual")
                page.locator(f"select[data-name^={device}][data-was=virtual]").wait_for()
            assert serious(page) == []
            tab.picture("live-begin")
            page.get_by_role("button", name="Start a new campaign").click()
            page.locator(".go-to td").first.wait_for()
        server_of(folder).kill()
    with served(folder) as address, open_tab(chromium, address) as tab:
        page = tab.open("live")
        page.get_by_text("The studio ended while this was being computed: taskcal measure").wait_for()
        killed = campaign.read_text()
        page.get_by_role("button", name="Compute it with what is chosen now").click()
        page.locator(".go-to td").first.wait_for()
        page.get_by_role("button", name="Stop after this row").click()
        go_on = page.get_by_role("button", name="Go on with live-box.csv")
        go_on.wait_for()
        before = campaign.read_text()
        assert before.startswith(killed)
        page = tab.open("live")
        go_on.click()
        page.locator(".go-to td").first.wait_for()
        page.locator("figcaption", has_text="Expected error over the task").wait_for()
        tab.picture("live")
        page = tab.open("live")
        page.locator("dt", has_text="Rows measured").wait_for()
        assert serious(page) == []
        page.get_by_text("Proven: all of the 95 % interval").wait_for(timeout=300_000)
        tab.picture("live-proven")
        assert campaign.read_text().startswith(before)
        choices = project.choices
        assert (choices.campaign, choices.calibration) == ("campaigns/live-box.csv", "calibrations/live-box.json")
        assert len(read_campaign(campaign, ROBOT)) == int(page.locator("dd").first.inner_text().split(";")[0])
        page.get_by_role("link", name="See the verdict").click()
        page.wait_for_url("**/result")
        tab.ready().get_by_text("box").first.wait_for()
        assert tab.complaints == []


@pytest.mark.browser
@pytest.mark.long
def test_questions_and_joints_are_answered_on_the_page(chromium: Any, project: Project) -> None:
    """By hand: first by a program, whose poses are asked for, then with joints that are typed; a wrong line is asked for again."""
    folder, q = (
        project.folder,
        reach_task(ErrorModel(ROBOT), load_task(project.folder / "tasks/box.toml"), 12, seed=1).q,
    )
    plan, cell = Program.of(q, q[:0]), VirtualCell.drawn(ROBOT, 1)
    (folder / "plans").mkdir()
    (folder / "plans" / "visit.csv").write_text(joints_text(plan.q, ROBOT, {"id": plan.ids}))
    (folder / "points.txt").write_text("x_mm y_mm z_mm\n")
    devices = {"controller": "hand", "instrument": "folder", "instrument-address": "points.txt"}
    project.choose(live={**devices, "program": "plans/visit.csv"})

    def measure(joints: Any) -> None:
        with (folder / "points.txt").open("a") as file:
            file.write(" ".join(f"{value:.4f}" for value in cell.points(joints[None])[0] * 1e3) + "\n")

    with served(folder) as address, open_tab(chromium, address) as tab:
        page = tab.open("live")
        page.get_by_role("button", name="Start a new campaign").click()
        page.get_by_text("12 poses of the program are left").wait_for()
        measure(q[1])
        page.get_by_text("is the robot at pose 1?").wait_for()
        assert serious(page) == []
        tab.picture("live-question")
        page.get_by_role("button", name="No, at another").click()
        page.get_by_text("is the robot at pose 2?").wait_for()
        page.get_by_role("button", name="Yes, at this pose").click()
        page.get_by_text("Left of the program: 11 poses").wait_for()
        page.get_by_role("button", name="Stop after this row").click()
        page.get_by_text("Stopped; every row is in the file.").wait_for()
        project.choose(live=devices)
        page = tab.open("live")
        page.get_by_role("button", name="Go on with").click()
        field = page.get_by_label("The joints as they are")
        field.wait_for()
        shown = page.locator(".go-to td:last-child").all_inner_texts()
        degrees = np.array([float(value.strip("°").replace("−", "-")) for value in shown])
        for joints, wrong in (
            ("10 20", "2 values; 6 are needed, in this order."),
            (degrees + 3.0 * np.eye(6)[0], "J1_deg is 3.0 from the pose"),
            (degrees, None),
        ):
            numbers = joints if isinstance(joints, str) else " ".join(f"{value:.4f}" for value in joints)
            field.fill(numbers)
            page.get_by_role("button", name="The robot stands there").click()
            if wrong is not None:
                page.get_by_text(wrong).wait_for()
        measure(np.radians(degrees))
        page.locator("dd", has_text="2; of the last one 1 shots").wait_for()
        page.get_by_role("button", name="Stop after this row").click()
        page.get_by_text("Stopped; every row is in the file.").wait_for()
        campaign = read_campaign(folder / "campaigns" / "live-box.csv", ROBOT)
        np.testing.assert_allclose(campaign.q, [q[1], np.radians(degrees)], atol=1e-5)
        assert tab.complaints == []

"""Where each step stands follows from what the project's files hold, and from nothing else."""

import asyncio
import json
import os
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from nicegui import ui

from taskcal_studio.project import LAYOUT, Project
from taskcal_studio.results import (
    MADE_FROM,
    StepStatus,
    changed_since,
    contents,
    corrected_of,
    made,
    next_step,
    plan_of,
    report_of,
    result_of,
    steps_of,
)
from taskcal_studio.runs import CommandRun, Studio
from taskcal_studio.steps import begin

FILES = {
    "campaign": "campaigns/a.csv",
    "task": "tasks/a.toml",
    "station": "stations/a.toml",
    "calibration": "calibrations/a.json",
    "program": "programs/a.mod",
    "cell": "cells/a.toml",
    "header": LAYOUT.header,
    "camera": "cameras/a.toml",
}

CONTENTS = {**FILES, "corrected": result_of(corrected_of(FILES["program"]))}
"""What results are made from: choices, and what the correction of the program printed."""

PRODUCTS = {"plans": "plan", "calibrations": "identify", "corrected": "program", "reports": "report"}
"""Page of the results in a folder."""


def put(project: Project, path: str, content: str) -> None:
    (project.folder / path).parent.mkdir(exist_ok=True)
    (project.folder / path).write_text(content)


def product_of(project: Project, folder: str) -> str:
    choices = project.choices
    return {
        LAYOUT.plans: plan_of(choices),
        LAYOUT.calibrations: choices.calibration,
        LAYOUT.corrected: corrected_of(choices.program),
        LAYOUT.reports: report_of(choices.calibration),
    }[folder]


@pytest.fixture
def whole(tmp_path: Path) -> Project:
    """A project in which everything was made from what it has now."""
    project = Project(tmp_path)
    for path in FILES.values():
        put(project, path, "")
    project.choose(robot="ur5", observe="pixels", **{role: path for role, path in FILES.items() if role != "header"})
    for folder in MADE_FROM:
        product = product_of(project, folder)
        put(project, product, "{}")
        put(project, result_of(product), json.dumps({"written": [product]}))
        put(project, LAYOUT.made, json.dumps(made(project, product, contents(project))))
    return project


def test_a_new_project_asks_for_a_robot_before_all_else(tmp_path: Path) -> None:
    steps = steps_of(Project(tmp_path))
    assert steps["robot"].state is StepStatus.needed
    assert {step.because[0] for step in steps.values() if step.state is StepStatus.impossible} == {"robot", "identify"}
    assert {next_step(steps, page) for page in steps} == {"robot"}


def test_nothing_is_open_where_all_was_made_from_what_is_there(whole: Project) -> None:
    steps = steps_of(whole)
    assert {page: step.state for page, step in steps.items()} == dict.fromkeys(steps, StepStatus.done) | {
        "weight": StepStatus.optional,
        "live": StepStatus.optional,
    }
    pages = list(steps)
    assert [next_step(steps, page) for page in pages] == [*pages[1:], ""]


@pytest.mark.parametrize(("folder", "role"), [(folder, role) for folder, roles in MADE_FROM.items() for role in roles])
def test_a_change_is_named_until_the_content_is_back(whole: Project, folder: str, role: str) -> None:
    page, before, former = PRODUCTS[folder], whole.choices, ""
    if role == "robot":
        whole.choose(robot="ur10")
    else:
        former = (whole.folder / CONTENTS[role]).read_text()
        put(whole, CONTENTS[role], "# other\n")
    step = steps_of(whole)[page]
    assert step.state is StepStatus.outdated
    assert role in step.because
    whole.choose(robot=before.robot)
    if role != "robot":
        put(whole, CONTENTS[role], former)
        os.utime(whole.folder / CONTENTS[role], (0, 0))
    assert steps_of(whole)[page].state is StepStatus.done


def test_what_follows_from_an_outdated_fit_is_outdated(whole: Project) -> None:
    put(whole, FILES["campaign"], "other")
    steps = steps_of(whole)
    for page in ("identify", "result", "program", "report"):
        assert (page, steps[page].state, steps[page].because) == (page, StepStatus.outdated, ("campaign",))
    assert next_step(steps, "report") == "identify"


def test_a_program_that_cannot_be_corrected_holds_nobody_up(whole: Project) -> None:
    """That nothing was written for its uncertainty is a result; where none was tried, the road waits for it."""
    corrected = corrected_of(whole.choices.program)
    put(whole, result_of(corrected), json.dumps({"written": []}))
    assert next_step(steps_of(whole), "program") == "report"
    (whole.folder / result_of(corrected)).unlink()
    assert next_step(steps_of(whole), "result") == "program"


def test_same_content_under_another_name_changes_nothing(whole: Project) -> None:
    put(whole, "campaigns/b.csv", "")
    whole.choose(campaign="campaigns/b.csv")
    assert steps_of(whole)["identify"].state is StepStatus.done


def test_the_table_that_a_task_names_is_part_of_it(whole: Project) -> None:
    put(whole, FILES["task"], 'poses = "a.csv"')
    before = contents(whole)["task"]
    put(whole, "tasks/a.csv", "x")
    assert contents(whole)["task"] != before


def test_a_result_made_elsewhere_is_judged_by_its_own_record(whole: Project) -> None:
    """A calibration that was written over by another program counts by the robot that it names; of others nothing is known."""
    robot = contents(whole)["robot"]
    put(whole, FILES["calibration"], json.dumps({"provenance": {"robot_digest": robot}}))
    assert steps_of(whole)["identify"].state is StepStatus.done
    put(whole, FILES["calibration"], json.dumps({"provenance": {"robot_digest": "other"}}))
    assert steps_of(whole)["identify"].because == ("robot",)
    put(whole, plan_of(whole.choices), "written over")
    assert (steps_of(whole)["plan"].state, steps_of(whole)["plan"].because) == (StepStatus.outdated, ())


@given(st.text(max_size=40))
def test_records_that_were_spoilt_are_no_record(tmp_path_factory: pytest.TempPathFactory, spoilt: str) -> None:
    project = Project(tmp_path_factory.mktemp("p"))
    put(project, FILES["calibration"], spoilt)
    put(project, LAYOUT.made, spoilt)
    project.choose(robot="ur5", calibration=FILES["calibration"])
    assert steps_of(project)["result"].because == ("robot",)


class Begun(Studio):
    """A studio whose runs end as a test has them end."""

    def start(self, kind: str, arguments: Sequence[str], then: Any = None) -> CommandRun:
        self.run, self.then = CommandRun(arguments, self.project.folder, kind), then
        return self.run

    def end(self, output: str) -> None:
        self.run.lines = [output]
        asyncio.run(self.then(self.run))


@pytest.mark.parametrize("meanwhile", [False, True])
def test_a_run_records_what_it_made_and_from_what(
    whole: Project, monkeypatch: pytest.MonkeyPatch, meanwhile: bool
) -> None:
    """Moves what it wrote to its place, and makes it the choice unless another was taken meanwhile; all in one change."""
    monkeypatch.setattr(ui, "navigate", SimpleNamespace(to=lambda _: None, reload=lambda: None))
    studio, now = Begun(whole), contents(whole)
    new = f"{LAYOUT.calibrations}/new.json"
    begin(
        studio,
        "identify",
        ["identify"],
        outputs=[new],
        chosen={"calibration": new},
        moves={FILES["header"]: "tasks/written"},
    )
    put(whole, new, "{}")
    put(whole, "tasks/written", "moved")
    put(whole, FILES["campaign"], "changed since")
    if meanwhile:
        put(whole, f"{LAYOUT.calibrations}/other.json", "{}")
        whole.choose(calibration=f"{LAYOUT.calibrations}/other.json")
    past = len(whole.history())
    studio.end('{"written": []}')
    assert (whole.folder / result_of(new)).read_text() == '{"written": []}'
    assert (whole.folder / FILES["header"]).read_text() == "moved"
    assert not (whole.folder / "tasks/written").exists()
    assert changed_since(whole, new, now) == ()
    assert changed_since(whole, new, contents(whole)) == ("campaign",)
    assert whole.choices.calibration == (f"{LAYOUT.calibrations}/other.json" if meanwhile else new)
    assert len(whole.history()) == past + 1
    whole.undo()
    assert not (whole.folder / new).exists()
    assert (whole.folder / FILES["header"]).read_text() == ""

"""Undo puts back every byte that a change of the project touched, and a run that was killed is named."""

import asyncio
from collections.abc import Callable
from pathlib import Path
from shutil import copytree

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taskcal.errors import TaskcalError
from taskcal_studio import files
from taskcal_studio.pages.cell_editor import save_section
from taskcal_studio.pages.report_page import save_head
from taskcal_studio.project import JOINED_S, LAYOUT, MAX_UNDO, Project
from taskcal_studio.runs import Studio


def tree(project: Project) -> dict[str, bytes]:
    """Files of a project but for its history."""
    return {
        str(path.relative_to(project.folder)): path.read_bytes()
        for path in project.folder.rglob("*")
        if path.is_file() and LAYOUT.history not in path.relative_to(project.folder).parts
    }


def drop(project: Project) -> None:
    files.take_file(project, "campaign", "new.csv", b"a,b\n1,2\n", "")


def rewrite(project: Project) -> None:
    with project.change("campaigns/a.csv"):
        (project.folder / "campaigns/a.csv").write_text("other")


ACTIONS: list[Callable[[Project], object]] = [
    drop,
    rewrite,
    lambda project: project.choose(robot="ur10", fit_name="third"),
    lambda project: project.state("identify", "holdout", "0.1"),
    lambda project: project.annotate("calibrations/a.json", "a note"),
    lambda project: save_head(project, "operator", "A. Tester"),
    lambda project: save_section(project, "axis", {"number": 1, "carries": "nothing"}),
]


@pytest.fixture
def project(tmp_path: Path) -> Project:
    (tmp_path / "campaigns").mkdir()
    (tmp_path / "campaigns" / "a.csv").write_bytes(b"a\r\n\xff")
    return Project(tmp_path)


@settings(max_examples=15, deadline=None)
@given(done=st.lists(st.sampled_from(ACTIONS), min_size=1, max_size=5))
def test_undo_takes_back_every_action_byte_for_byte(tmp_path_factory: pytest.TempPathFactory, done) -> None:
    folder = tmp_path_factory.mktemp("p")
    (folder / "campaigns").mkdir()
    (folder / "campaigns" / "a.csv").write_bytes(b"a\r\n\xff")
    project = Project(folder)
    states = [tree(project)]
    for act in done:
        act(project)
        states.append(tree(project))
    while project.history():
        project = Project(project.folder)  # as after a start
        while states[-1] == tree(project):
            states.pop()
        project.undo()
        assert tree(project) in states
    assert tree(project) == states[0]
    assert list((project.folder / LAYOUT.history).glob("*.old")) == []


def test_every_action_of_the_list_changes_something(project: Project) -> None:
    for number, act in enumerate(ACTIONS, 1):
        act(project)
        assert len(project.history()) == number


def test_a_change_that_is_cut_off_by_a_kill_is_undone(project: Project) -> None:
    """As far as it came; a copy of the folder, taken in the middle of the change, is what a kill leaves."""
    before, cut = tree(project), project.folder.parent / "cut"
    with project.change():  # as of many commands, which name their files one by one
        rewrite(project)
        with project.change("campaigns/b.csv"):
            (project.folder / "campaigns/b.csv").write_text("new")
            copytree(project.folder, cut)
    assert len(project.history()) == 1
    again = Project(cut)
    assert tree(again) == tree(project)
    again.undo()
    assert tree(again) == before
    assert Project(cut).history() == []
    assert list((cut / LAYOUT.history).glob("*.old")) == []


def test_undo_refuses_to_lose_what_another_program_wrote(project: Project) -> None:
    rewrite(project)
    (project.folder / "campaigns/a.csv").write_text("by hand")
    with pytest.raises(TaskcalError, match=r"campaigns/a\.csv"):
        project.undo()
    assert (project.folder / "campaigns/a.csv").read_text() == "by hand"


def test_moves_of_a_slider_are_undone_together_unless_apart(project: Project, monkeypatch: pytest.MonkeyPatch) -> None:
    now = 1000.0
    monkeypatch.setattr("taskcal_studio.project.time.time", lambda: now)
    for later in (0.0, 0.9 * JOINED_S, 1.1 * JOINED_S):
        now += later
        with project.change("campaigns/a.csv", joins=True):
            (project.folder / "campaigns/a.csv").write_text(f"{now}")
    assert len(project.history()) == 2
    for _ in range(2):
        project.undo()
    assert (project.folder / "campaigns/a.csv").read_bytes() == b"a\r\n\xff"


def test_as_many_changes_are_kept_as_stated_and_no_more(project: Project) -> None:
    for seed in range(MAX_UNDO + 3):
        project.state("plan", "seed", str(seed + 1))
    assert len(project.history()) == MAX_UNDO
    assert len(list((project.folder / LAYOUT.history).glob("*.old"))) == MAX_UNDO


def test_a_record_that_leads_elsewhere_or_was_spoilt_puts_nothing_back(project: Project) -> None:
    outside = project.folder.parent / "outside.txt"
    outside.write_text("mine")
    rewrite(project)
    record = project.folder / LAYOUT.history / "changes.json"
    record.write_text(record.read_text().replace("campaigns/a.csv", "../outside.txt"))
    with pytest.raises(TaskcalError):
        project.undo()
    assert outside.read_text() == "mine"
    record.write_text('[{"what": 1}]')
    assert project.history() == []


def test_a_run_that_was_killed_is_named_until_it_is_dropped(
    project: Project,
) -> None:
    async def begin_and_die() -> Studio:
        studio = Studio(project)
        studio.start("identify", ["version", "--json"])
        assert studio.interrupted() == {}  # it runs
        await studio.close()
        await asyncio.sleep(0.1)
        return studio

    asyncio.run(begin_and_die())
    after = Studio(project)
    assert after.interrupted() == {"identify": "taskcal version"}
    after.forget("identify")
    assert after.interrupted() == {}


def test_a_run_that_ended_is_not_named(project: Project) -> None:
    async def run() -> None:
        studio = Studio(project)
        begun = studio.start("identify", ["--version"])
        while begun.status == "running":
            await asyncio.sleep(0.05)
        await asyncio.sleep(0.1)

    asyncio.run(run())
    assert Studio(project).interrupted() == {}

"""What the studio asks of tools, parts and external axes, and what the library reads of what it writes."""

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robot_programs.reading import read_program
from taskcal.correction.cell import Cell, ExternalAxis, load_cell, mount
from taskcal.errors import TaskcalError
from taskcal.robot.catalogue import load_robot
from taskcal_studio.pages.cell_editor import (
    HELD,
    POSES,
    STANDING,
    WAYS,
    as_lines,
    asked_axes,
    measured_section,
    named_in,
    rows_of,
    save_section,
    stated_axis,
    with_section,
)
from taskcal_studio.project import Project

RAPID = """MODULE m
  CONST robtarget p:=[[900,0,900],[0,0,1,0],[0,0,0,0],[9E9,250,9E9,9E9,0,9E9]];
  PROC main()
    MoveL p,v100,fine,tool0;
  ENDPROC
ENDMODULE
"""


def test_studio_asks_for_axes_needed_by_rejected_motions(tmp_path: Path) -> None:
    """The external axes asked for are those without which the correction rejects motions."""
    program = tmp_path / "m.mod"
    program.write_text(RAPID)
    read = read_program(program, robot=load_robot("abb-irb120"))
    refused = mount(read, Cell()).refused
    assert len(refused) == 1
    assert asked_axes(["out of reach", *refused.values(), *refused.values()]) == [2]
    told = mount(read, Cell(axes=(ExternalAxis(number=2, carries="nothing"),)))
    assert told.refused == {}


def read_back(folder: Path, written: str) -> Cell:
    file = folder / "cell.toml"
    file.write_text(written)
    return load_cell(file)


@pytest.mark.parametrize("carries", ["robot", "part"])
@pytest.mark.parametrize("way", WAYS)
def test_an_axis_moves_as_was_chosen(tmp_path: Path, carries: str, way: str) -> None:
    section = stated_axis({"number": 3}, carries, way)
    assert section is not None
    (axis,) = read_back(tmp_path, with_section("", "axis", section)).axes
    kind, direction = way.split()
    assert (axis.number, axis.carries) == (3, carries)
    along, about = (axis.slides_along, axis.turns_about) if kind == "slides" else (axis.turns_about, axis.slides_along)
    assert along is not None
    assert about is None
    sign = -1.0 if direction.startswith("−") else 1.0
    np.testing.assert_array_equal(along, sign * np.eye(3)["xyz".index(direction[-1])])


def test_nothing_is_written_before_it_is_complete() -> None:
    assert stated_axis({"number": 1}, "robot", "") is None
    assert stated_axis({"number": 1}, "", "slides x") is None
    assert stated_axis({"number": 1}, "nothing", "") == {"number": 1, "carries": "nothing"}


SLANTED: dict[str, Any] = {
    "number": 2, "carries": "part", "turns_about": [0.0, 0.6, 0.8], "unit": "STN1",
    "frame": {"position_mm": [1800.0, 0.0, 650.0], "quaternion": [0.0, 0.0, 0.0, 1.0]},
}  # fmt: skip

TOOL = '# measured on Monday\n[[tool]]\nname = "mill"\ncontroller = { position_mm = [0, 0, 100] }\n'


def test_new_axis_is_appended_and_file_otherwise_unchanged(tmp_path: Path) -> None:
    """A new axis is appended to the file, which is otherwise unchanged."""
    written = with_section(TOOL, "axis", SLANTED)
    assert written.startswith(TOOL)
    section = stated_axis({"number": 1}, "robot", "slides y")
    assert section is not None
    again = with_section(written, "axis", section)
    assert again.startswith(written)
    cell = read_back(tmp_path, again)
    assert [axis.number for axis in cell.axes] == [1, 2]
    assert cell.axes[1].unit == "STN1"
    assert set(cell.tools) == {"mill"}


@pytest.mark.parametrize(
    "stated", [with_section(TOOL, "axis", SLANTED), f"axis = [{{ number = 2, carries = 'nothing' }}]\n{TOOL}"]
)
def test_of_an_axis_that_is_changed_nothing_is_left(tmp_path: Path, stated: str) -> None:
    for number in (2, 4):
        cell = read_back(tmp_path, with_section(stated, "axis", {"number": number, "carries": "nothing"}))
        assert [axis.number for axis in cell.axes] == sorted({2, number})
        assert cell.axes[-1].carries == "nothing"
        assert set(cell.tools) == {"mill"}


def test_axis_direction_of_file_stays_until_another_is_chosen() -> None:
    """The direction stated in the file stays until another one is chosen."""
    assert stated_axis(SLANTED, "part", "file") == SLANTED
    assert stated_axis(SLANTED, "part", "turns z") == SLANTED | {"turns_about": [0.0, 0.0, 1.0]}
    assert stated_axis(SLANTED, "robot", "file") == {"number": 2, "carries": "robot", "turns_about": [0.0, 0.6, 0.8]}


def test_a_section_goes_into_the_chosen_file_or_a_new_one(tmp_path: Path) -> None:
    """Beside what is there; one that is refused changes nothing, and each change can be undone."""
    project = Project(tmp_path)
    save_section(project, "axis", {"number": 3, "carries": "nothing"})
    chosen = project.choices.cell
    first = (tmp_path / chosen).read_text()
    save_section(project, "axis", SLANTED)
    assert project.choices.cell == chosen
    assert [axis.number for axis in load_cell(tmp_path / chosen).axes] == [2, 3]
    second = (tmp_path / chosen).read_text()
    with pytest.raises(TaskcalError):
        save_section(project, "axis", {"number": 4, "carries": "a tray"})
    assert (tmp_path / chosen).read_text() == second
    project.undo()
    assert (tmp_path / chosen).read_text() == first
    project.undo()
    assert project.choices.cell == ""


JOINTS = 6


@pytest.mark.parametrize("kind", ["tool", "part"])
@pytest.mark.parametrize("way", [*HELD, *STANDING])
def test_what_is_stated_of_a_tool_or_part_reads_back(tmp_path: Path, kind: Any, way: str) -> None:
    """Beside all else that the file says; and it is gone again where only the controller's value is left."""
    rng = np.random.default_rng(len(way))
    values = np.zeros((0, 0))
    if way in POSES:
        given: Any = {"position_mm": rng.normal(size=3).tolist(), "quaternion": [0.0, 0.0, 0.6, 0.8]}
    else:
        names = [(f"r{k}" if way == "reflectors_mm" else "") for k in range(5)]
        values = rng.normal(size=(5, 3 if way == "reflectors_mm" else JOINTS)).round(4)
        given = as_lines(zip(names, values.tolist(), strict=True))
    more = {"uncertainty_mm": 0.02, "touched_with": "probe" if way == "touched_deg" else ""}
    probe = with_section(TOOL, "tool", {"name": "probe", "controller": {"position_mm": [0.0, 0.0, 1.0]}})
    written = with_section(probe, kind, measured_section({"name": "Mine"}, way, given, JOINTS, **more))
    cell = read_back(tmp_path, written)
    measured = (cell.tool if kind == "tool" else cell.part)("mine")
    told: dict[str, Any] = {
        "flange": measured.in_flange,
        "target": measured.in_target,
        "tracker": measured.in_tracker,
        "tip_deg": measured.tip,
        "touched_deg": measured.touched,
        "reflectors_mm": np.array(list(measured.reflectors.values())) if measured.reflectors else None,
    }
    assert [key for key, value in told.items() if value is not None] == [way]
    if way not in POSES:
        scale = 1e-3 if way == "reflectors_mm" else np.pi / 180.0
        np.testing.assert_allclose(told[way], scale * values)
    assert measured.uncertainty == pytest.approx(2e-5)
    without = with_section(written, kind, measured_section(tomllib.loads(written)[kind][-1], "", "", JOINTS))
    assert tomllib.loads(without) == tomllib.loads(probe)


@pytest.mark.parametrize("line", ["1 2 3", "1;2;3", "1, 2, 3", "1\t2\t3", "1,0 2,0 3,0", "1,0;2,0;3,0", " 1 2  3 "])
def test_numbers_are_read_however_they_are_apart(line: str) -> None:
    assert rows_of(f"\n{line}\n{line}", 3) == [("", [1.0, 2.0, 3.0])] * 2


@pytest.mark.parametrize("line", ["a 1 2 3", "a\t1\t2\t3", "a; 1,0; 2,0; 3,0", "a = 1 2 3"])
def test_a_name_may_stand_before_the_numbers(line: str) -> None:
    assert rows_of(line, 3, names=True) == [("a", [1.0, 2.0, 3.0])]


@pytest.mark.parametrize("line", ["1 2", "1 2 3 4", "1 2 x", "1 2 nan", "1,2,3,4", "1 2 3°"])
def test_a_line_of_other_numbers_is_refused_by_its_place(line: str) -> None:
    with pytest.raises(TaskcalError, match="line 2"):
        rows_of(f"1 2 3\n{line}", 3)


def test_tools_and_parts_of_a_program_are_each_named_once(tmp_path: Path) -> None:
    (tmp_path / "m.mod").write_text(RAPID)
    motions = read_program(tmp_path / "m.mod", robot=load_robot("abb-irb120")).motions
    assert [(one.kind, one.name, one.held) for one in named_in([*motions, *motions])] == [
        ("tool", "tool0", True),
        ("part", "wobj0", False),
    ]

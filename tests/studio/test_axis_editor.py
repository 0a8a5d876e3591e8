"""What the studio asks of external axes, and what the library reads of what it writes."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robot_programs.reading import read_program
from taskcal.correction.cell import Cell, ExternalAxis, load_cell, mount
from taskcal.robot.catalogue import load_robot
from taskcal.studio.editors import WAYS, asked_axes, stated_axis, with_axis

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
    (axis,) = read_back(tmp_path, with_axis("", section)).axes
    kind, direction = way.split()
    assert (axis.number, axis.carries, axis.turns) == (3, carries, kind == "turns")
    assert axis.direction is not None
    sign = -1.0 if direction.startswith("−") else 1.0
    np.testing.assert_array_equal(axis.direction, sign * np.eye(3)["xyz".index(direction[-1])])


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
    written = with_axis(TOOL, SLANTED)
    assert written.startswith(TOOL)
    section = stated_axis({"number": 1}, "robot", "slides y")
    assert section is not None
    again = with_axis(written, section)
    assert again.startswith(written)
    cell = read_back(tmp_path, again)
    assert [axis.number for axis in cell.axes] == [1, 2]
    assert cell.axes[1].unit == "STN1"
    assert set(cell.tools) == {"mill"}


@pytest.mark.parametrize(
    "stated", [with_axis(TOOL, SLANTED), f"axis = [{{ number = 2, carries = 'nothing' }}]\n{TOOL}"]
)
def test_of_an_axis_that_is_changed_nothing_is_left(tmp_path: Path, stated: str) -> None:
    for number in (2, 4):
        cell = read_back(tmp_path, with_axis(stated, {"number": number, "carries": "nothing"}))
        assert [axis.number for axis in cell.axes] == sorted({2, number})
        assert cell.axes[-1].carries == "nothing"
        assert set(cell.tools) == {"mill"}


def test_axis_direction_of_file_stays_until_another_is_chosen() -> None:
    """The direction stated in the file stays until another one is chosen."""
    assert stated_axis(SLANTED, "part", "file") == SLANTED
    assert stated_axis(SLANTED, "part", "turns z") == SLANTED | {"turns_about": [0.0, 0.0, 1.0]}
    assert stated_axis(SLANTED, "robot", "file") == {"number": 2, "carries": "robot", "turns_about": [0.0, 0.6, 0.8]}

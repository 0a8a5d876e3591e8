"""Tools and parts that no file of a program declares: named once, all together, and stated in a cell file."""

from pathlib import Path

import numpy as np
import pytest

from robot_programs.core.program import Program, missing_from
from robot_programs.core.source import Source
from robot_programs.reading import parse_program
from taskcal.correction.cell import Cell, Measured, cell_to_fill_in, given_frames, load_cell, mount, write_cell
from taskcal.errors import FileError, TaskcalError
from taskcal.geometry import se3

TOOL = se3.translation(0.02, -0.01, 0.12) @ se3.rotation("y", 0.3)
PART = se3.translation(0.9, 0.1, 0.4) @ se3.rotation("z", 0.2)
RAPID = """MODULE m
{data}PROC main()
{before}MoveL [[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,fine,tMill\\WObj:=wFix;
ENDPROC
ENDMODULE
"""
KRL = "DEF P( )\n$TOOL=TOOL_DATA[3]\n$BASE=BASE_DATA[2]\nLIN {X 1,Y 2,Z 3,A 0,B 0,C 0}\nEND\n"
DECLARED = "PERS tooldata tMill:=[TRUE,[[1,2,3],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n"
NAMES = {".mod": ("tMill", "wFix"), ".src": ("TOOL_DATA[3]", "BASE_DATA[2]")}


def cell(suffix: str) -> Cell:
    (tool, part) = NAMES[suffix]
    return Cell(
        tools={tool.casefold(): Measured(name=tool, controller=TOOL)},
        parts={part.casefold(): Measured(name=part, controller=PART)},
    )


def read(suffix: str, text: str, given: Cell | None = None) -> Program:
    tools, parts = given_frames(given or Cell())
    return parse_program((Source.of(Path(f"m{suffix}"), text.encode()),), tools=tools, parts=parts)


PROGRAMS = [(".mod", RAPID.format(data="", before="")), (".src", KRL)]


@pytest.mark.parametrize(("suffix", "text"), PROGRAMS)
def test_undeclared_frames_make_a_cell_file_to_fill_in(suffix, text, tmp_path):
    program = read(suffix, text)
    assert not program.motions
    missing = missing_from(program.diagnostics)
    assert [(one.kind, one.count) for one in missing] == [("tool", 1), ("part", 1)]
    assert tuple(one.name for one in missing) == NAMES[suffix]
    path = tmp_path / "cell.toml"
    path.write_text(cell_to_fill_in(missing))
    with pytest.raises(FileError, match="position_mm"):
        load_cell(path)
    path.write_text(
        path.read_text().replace('["x", "y", "z"]', "[1, 2, 3]").replace('["qx", "qy", "qz", "qw"]', "[0, 0, 0, 1]")
    )
    (tool, part) = NAMES[suffix]
    np.testing.assert_allclose(load_cell(path).tool(tool).controller, se3.translation(1e-3, 2e-3, 3e-3))
    np.testing.assert_allclose(load_cell(path).part(part).controller, se3.translation(1e-3, 2e-3, 3e-3))


def test_other_data_are_stated_as_the_controller_shows_them(tmp_path):
    """They are read as they are written, and keep their place in a cell file that is written again."""
    missing = missing_from(read(".src", "DEF P( )\nPTP XHOME\nEND\n").diagnostics)
    path = tmp_path / "cell.toml"
    path.write_text(cell_to_fill_in(missing))
    with pytest.raises(FileError, match="'XHOME': value is empty"):
        load_cell(path)
    path.write_text(path.read_text().replace('""', '"{E6AXIS: A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}"'))
    write_cell(path, load_cell(path))
    given = load_cell(path).data
    program = parse_program((Source.of(Path("m.src"), b"DEF P( )\nPTP XHOME\nEND\n"),), data=given)
    np.testing.assert_allclose(np.degrees(program.motions[0].end.q), [0, -90, 90, 0, 0, 0])


@pytest.mark.parametrize(("suffix", "text"), PROGRAMS)
def test_frames_of_the_cell_file_are_taken_where_none_is_declared(suffix, text):
    program = read(suffix, text, cell(suffix))
    (motion,) = mount(program.reread(program.sources), cell(suffix)).program.motions
    assert (motion.tool.name, motion.part.name) == NAMES[suffix]
    np.testing.assert_allclose(motion.tool.T, TOOL, atol=1e-8)
    np.testing.assert_allclose(motion.part.T, PART, atol=1e-8)


def test_declared_frame_counts_and_another_is_refused():
    program = read(".mod", RAPID.format(data=DECLARED, before=""), cell(".mod"))
    np.testing.assert_allclose(program.motions[0].tool.T, se3.translation(1e-3, 2e-3, 3e-3))
    with pytest.raises(TaskcalError, match=r"m\.mod:4: .*tool 'tMill'"):
        mount(program, cell(".mod"))


@pytest.mark.parametrize(
    ("before", "z"),
    [("tMill:=[TRUE,[[0,0,7],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n", 0.007), ("tMill:=Found();\n", None)],
)
def test_given_tool_is_no_longer_the_one_after_an_assignment(before, z):
    program = read(".mod", RAPID.format(data="", before=before), cell(".mod"))
    assert [motion.tool.T[2, 3] for motion in program.motions] == ([] if z is None else [pytest.approx(z)])

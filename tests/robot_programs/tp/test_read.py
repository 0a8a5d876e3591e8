"""Reading listings."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot_programs.core.source import Source
from robot_programs.reading import read_program
from robot_programs.tp.listing import Listing, read_variables
from robot_programs.tp.read import read_tp, world_in_base
from taskcal.errors import FileError
from tests.robot_programs.tp.samples import POSITIONS, R2000, backup, degrees, listing


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("\0\1binary", "bad.ls: is not a TP listing: it is binary; save the program as text"),
        ("SRVO-001 Operator panel E-stop", "bad.ls: is not a TP listing: it has no line /MN"),
        ("/PROG  A\n/MN\n/END\n", "bad.ls: is not a TP listing: it has no line /POS"),
        ("/PROG  A\n/MN\n/POS\nP[1]{\n   GP1:\n", "bad.ls:4: the position that begins here is not closed"),
    ],
)
def test_what_is_no_listing_says_so(text, message):
    with pytest.raises(FileError) as caught:
        read_tp([Source.of(Path("bad.ls"), text.encode())], robot=R2000)
    assert message in str(caught.value)


def test_variables_alone_are_no_program():
    with pytest.raises(FileError, match=r"sysframe.va: holds variables only; pass the .ls with the motions, too"):
        read_tp(backup(), robot=R2000)


def test_without_a_robot_frames_count_from_the_world_frame():
    sources = [listing(["J P[1] 10% FINE", "L P[2] 10mm/sec FINE", "L P[1] 10mm/sec FINE"], POSITIONS), *backup()]
    alone, given = read_tp(sources), read_tp(sources, robot=R2000)
    said = [one.text for one in alone.diagnostics if one not in given.diagnostics]
    assert "count from FANUC's world frame" in said[0]
    assert any("give the robot" in text for text in said[1:])
    assert (len(alone.motions), len(given.motions)) == (2, 3)
    for one, other in zip(alone.motions, given.motions[:2], strict=True):
        np.testing.assert_allclose(world_in_base(R2000) @ one.part.T, other.part.T, atol=1e-12)
        for mine, its in ((one.end.T, other.end.T), (one.end.q, other.end.q)):
            assert mine is its is None or np.allclose(mine, its)


def test_files_are_known_by_their_suffix(tmp_path):
    for source in (listing(["L P[2] 10mm/sec FINE"], POSITIONS), *backup()):
        (tmp_path / source.path.name.upper()).write_bytes(source.encode())
    program = read_program(*sorted(tmp_path.iterdir()), robot=R2000)
    (move,) = program.motions
    assert move.routine == "MILL"
    assert move.place.line == 6


# The parts of a listing.


ARC = "C P[3]    \r\n    :  P[4] 500mm/sec FINE"


def test_instructions_over_several_lines_have_places():
    """Instructions are found over several lines with their places."""
    source = listing(["  UFRAME_NUM=1", ARC, "  !note"], POSITIONS)
    found = Listing(source.text)
    assert found.name == "MILL"
    assert len(found.instructions) == 3
    arc = found.instructions[1]
    assert source.text[slice(*arc.number)] == "2"
    assert source.text[arc.start : arc.end].startswith("   2:C P[3]")
    assert source.text[arc.end - 1] == ";"
    # what begins the second line is blank, so that a place in the text is one in the file
    assert arc.text.index("P[4]") + arc.body == source.text.index("P[4]")
    assert ":" not in arc.text


def test_instruction_without_semicolon_ends_at_next_number():
    """An instruction without a semicolon ends where the next number begins."""
    text = "/MN\n   1:L P[1] 10mm/sec FINE\n   2:  CALL A ;\n/POS\n/END\n"
    first, second = Listing(text).instructions
    assert first.text.strip() == "L P[1] 10mm/sec FINE"
    assert second.text == "  CALL A ;"


def test_sections_end_where_the_next_begins():
    found = Listing("/PROG  A\n/MN\n   1:  END ;\n/POS\nP[1]{\n};\n/END\n")
    assert set(found.sections) == {"PROG", "MN", "POS", "END"}
    assert list(found.positions) == [1]
    assert found.fault() is None


def test_instructions_are_those_of_their_section_alone():
    """A listing without it has none, whatever else looks like one."""
    text = "/PROG  A\n   1:L P[1] 10mm/sec FINE ;\n{}\n/POS\nP[1]{{\n   2:L P[1] 10mm/sec FINE ;\n}};\n/END\n".format
    assert Listing(text("")).instructions == ()
    (only,) = Listing(text("/MN\n   3:L P[2] 10mm/sec FINE ;")).instructions
    assert "P[2]" in only.text


def test_a_position_that_is_not_closed_or_listed_twice_is_told():
    text = "/MN\n/POS\nP[1]{\n   GP1:\nP[2]{\n};\n/END\n"
    fault = Listing(text).fault()
    assert fault is not None
    assert text[fault[0] : fault[0] + 4] == "P[2]"
    assert "not closed" in fault[1]
    fault = Listing("/MN\n/POS\nP[1]{\n};\nP[1]{\n};\n/END\n").fault()
    assert fault is not None
    assert "P[1] is listed a second time" in fault[1]


# Frames and registers of a backup.


def test_frames_and_tools_of_the_robots_group():
    variables = read_variables(backup())
    assert set(variables.frames) == {1, 2}
    assert set(variables.tools) == {1}
    np.testing.assert_allclose(variables.frames[1][:3, 3], [1.5, -0.2, -0.6])
    R = Rotation.from_euler("xyz", [0.5, -1.0, 20.0], degrees=True).as_matrix()
    np.testing.assert_allclose(variables.frames[2][:3, :3], R, atol=1e-12)
    np.testing.assert_allclose(variables.tools[1][:3, 3], [0.05, 0.0, 0.3])


def test_registers_are_poses_or_joints_and_comments_are_none():
    registers = read_variables(backup()).registers
    assert set(registers) == {1, 2, 4, 5, 6}
    np.testing.assert_allclose(registers[1].q, degrees(20, 0, 0, 0, -90, 0))
    np.testing.assert_allclose(registers[2].T[:3, 3], [0.0, 0.0, 0.05])  # its comment speaks of X: 5
    assert registers[5].configuration == "N U T, 0, 0, -1"
    assert registers[6].extended
    assert not registers[5].extended


def test_other_variables_are_left_alone():
    text = "[*SYSTEM*]$MNUFRAMENUM  Storage: CMOS  Access: RW  : ARRAY[1] OF BYTE\n     [1,1] =\n X: 1 Y: 1 Z: 1 W: 1 P: 1 R: 1\n"
    assert not read_variables([Source.of(Path("system.va"), text.encode())]).frames


def test_frame_with_a_damaged_number_is_not_read():
    """A frame with a number that runs into something else is not read."""
    system, registers = backup()
    damaged = Source.of(system.path, system.text.replace("1500.000 ", "1500.0e1 ").encode())
    assert set(read_variables([damaged, registers]).frames) == {2}

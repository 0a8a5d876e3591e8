"""Reading listings."""

from pathlib import Path

import numpy as np
import pytest

from robot_programs.core.source import Source
from robot_programs.reading import read_program
from robot_programs.tp.read import read_tp, world_in_base
from taskcal.errors import FileError
from tests.robot_programs.tp.samples import POSITIONS, R2000, backup, listing


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

"""APT: what is read, and what is said by line to stay as it is."""

from pathlib import Path

import numpy as np
import pytest

from taskcal.errors import FileError
from taskcal.programs.apt.read import read_apt
from taskcal.programs.source import Source
from tests.programs.apt.samples import CATIA, ROBOT, TOOL, axes, moved, points, read


def test_a_path_of_catia_with_tool_axes_and_an_arc():
    program = read(CATIA)
    assert not program.diagnostics
    rapid, plunge, arc = program.moves
    assert [move.kind for move in program.moves] == ["linear", "linear", "circular"]
    assert [move.speed for move in program.moves] == [None, pytest.approx(0.005), pytest.approx(0.005)]
    assert [move.follows for move in program.moves] == [None, 0, 1]
    assert [move.place.line for move in program.moves] == [12, 14, 18]
    assert rapid.end.free_spin
    np.testing.assert_allclose(points(program), [[0.05, 0, 0.1], [0.05, 0, 0], [0, 0.05, 0]], atol=1e-12)
    np.testing.assert_allclose(axes(program), [[0, 0, 1], [0, 0.6, 0.8], [0, 0.6, 0.8]], atol=1e-12)
    # three quarters of the circle, clockwise: its middle lies opposite the missing quarter
    np.testing.assert_allclose(arc.via.T[:3, 3], 0.05 * np.array([-1, -1, 0]) / np.sqrt(2), atol=1e-12)
    assert (plunge.tool, plunge.routine, plunge.stops) == (TOOL, "path", False)


NX = """TOOL PATH/FINISH,TOOL,MILL_D10
TLDATA/MILL,10.0000,0.0000,75.0000,0.0000,0.0000
MSYS/0.0,0.0,0.0,1.0,0.0,0.0,0.0,1.0,0.0
PAINT/PATH
FEDRAT/MMPM,250.0000
GOTO/10.0,0.0,5.0,0.0,0.6,0.8
FEDRAT/600.0000
GOTO/20.0,0.0,5.0
CIRCLE/20.0,5.0,5.0,0.0,0.0,1.0,5.0,0.06,0.5,10.0,0.0
GOTO/25.0,5.0,5.0
GOTO/30.0,5.0,5.0
END-OF-PATH
"""


def test_a_path_of_nx_whose_arcs_stay_as_they_are():
    program = read(NX)
    assert [move.place.line for move in program.moves] == [6, 8, 11]
    assert [move.speed for move in program.moves] == [
        pytest.approx(0.25 / 60),
        pytest.approx(0.01),
        pytest.approx(0.01),
    ]
    assert [move.follows for move in program.moves] == [None, 0, None]
    np.testing.assert_allclose(axes(program), np.tile([0, 0.6, 0.8], (3, 1)), atol=1e-12)
    assert [str(diagnostic) for diagnostic in program.diagnostics] == [
        "path.apt:9: CIRCLE is not read; the motion stays as it is",
        "path.apt:10: it ends an arc whose sense of rotation is not certain; the motion stays as it is",
    ]


def test_a_tool_axis_stays_until_another_one_is_stated():
    program = read("GOTO/0,0,0\nTLAXIS/1,0,0\nGOTO/1,0,0\nGOTO/2,0,0,0,1,0\nMULTAX/OFF\nGOTO/3,0,0\n")
    np.testing.assert_allclose(axes(program), [[0, 0, 1], [1, 0, 0], [0, 1, 0], [0, 1, 0]], atol=1e-15)


OTHER_TOOL = "another tool is loaded than the first, the one given"
OTHER_FRAME = "another frame is stated than the first, the part's"
UPRIGHT = "1.,0,0,0,0,1.,0,0,0,0,1.,0"

UNCERTAIN = {
    "ORIGIN/0,0,5\n{}": "ORIGIN moves the coordinates since line 1",
    "TRACUT/M1\n{}TRACUT/NOMORE\n": "TRACUT transforms the motions since line 1",
    "ROTABL/90,CLW\n{}": "ROTABL turns the table since line 1",
    "INDEX/1\n{}COPY/1,TRANSL,10,0,0,3\n": "COPY repeats motions elsewhere since line 1",
    "MACRO\n{}TERMAC\n": "a macro is run from elsewhere since line 1",
    "CYCLE/DRILL,5\n{}CYCLE/OFF\n": "a cycle adds motions that the text does not show since line 1",
    "UNITS/FEET\n{}UNITS/MM\n": "the unit of line 1 is not known",
    "TLAXIS/NORMPS\n{}TLAXIS/0,0,1\n": "the tool axis of line 1 is not stated by its components",
    "LOADTL/1\nLOADTL/2\n{}LOADTL/1\n": "another tool is loaded than the first, the one given (line 2)",
    "MSYS/0,0,0\nMSYS/0,0,1\n{}MSYS/0,0,0\n": "another frame is stated than the first, the part's (line 2)",
    "LOAD/TOOL,1\nSELECT/TOOL,2\nLOAD/TOOL,2\n{}LOAD/TOOL,1\n": f"{OTHER_TOOL} (line 3)",
    "SELECT/TOOL,1\nSELECT/TOOL,2\n{}SELECT/TOOL,1\n": f"{OTHER_TOOL} (line 2)",
    "TOOL PATH/A,TOOL,M8\nTOOL PATH/B,TOOL,M6\n{}TOOL PATH/C,TOOL,M8\n": f"{OTHER_TOOL} (line 2)",
    f"CSYS/{UPRIGHT}\nCSYS/1,0,0,5,0,1,0,0,0,0,1,0\n{{}}CSYS/{UPRIGHT}\n": f"{OTHER_FRAME} (line 2)",
    "CSYS/1,0,0,0,0,1,0,0\n{}CSYS/1,0,0,0,0,1,0,0,0,0,1,0\n": "the CSYS of line 1 is not the twelve numbers of a pose",
    "CSYS/1,0,0,0,0,1,0,0,0,0,-1,0\n{}CSYS/1,0,0,0,0,1,0,0,0,0,1,0\n": "the CSYS of line 1 is not the twelve numbers of a pose",
    "TRNTYP/WORLD,0,0,5\n{}TRNTYP/WORLD,0,0,0\n": "TRNTYP may move the coordinates since line 1",
    "FROBNI/1,2\n{}": "'FROBNI' of line 1 is not known, and its numbers may move the coordinates",
}


@pytest.mark.parametrize("text", UNCERTAIN)
def test_what_moves_coordinates_leaves_motions_as_they_are_until_it_is_cleared(text):
    program = read(text.format("GOTO/1,2,3\nGODLTA/1,0,0\n") + "GOTO/4,5,6\n")
    expected = f"{UNCERTAIN[text]}; the motion stays as it is"
    lasts = "{}" in text[-4:]
    assert [diagnostic.text for diagnostic in program.diagnostics] == [expected] * (3 if lasts else 2)
    assert len(program.moves) == (0 if lasts else 1)
    if not lasts:
        assert program.moves[0].follows is None
        np.testing.assert_allclose(points(program), [[0.004, 0.005, 0.006]])


@pytest.mark.parametrize("text", UNCERTAIN)
def test_motions_whose_frame_or_tool_is_not_known_are_refused(text):
    assert all(diagnostic.rejected for diagnostic in read(text.format("GOTO/1,2,3\nGODLTA/1,0,0\n")).diagnostics)
    assert not any(diagnostic.rejected for diagnostic in read(NX).diagnostics)


def test_a_tool_that_waits_in_the_magazine_is_not_loaded():
    program = read("LOAD/TOOL,1\nSELECT/TOOL,2\nGOTO/1,2,3\nLOAD/TOOL,2\nGOTO/4,5,6\n")
    assert [move.place.line for move in program.moves] == [3]
    assert [diagnostic.place.line for diagnostic in program.diagnostics] == [5]


TURNED_SETUP = """TRNTYP/WORLD,0,0,0
CSYS/1.,0,0,0,0,1.,0,0,0,0,1.,0
GOTO/10.,20.,30.
TRNTYP/WORLD,0,0,0
CSYS/0,0,1.,0,0,1.,0,0,-1.,0,0,0
GOTO/78.,35.,-12.,1.,0,0
GOTO/78.,22.,-12.,1.,0,0
"""


def test_points_of_a_turned_setup_stay_in_the_first_frame_where_their_tool_axis_shows_it():
    program = read(TURNED_SETUP)
    assert not program.diagnostics
    assert [move.follows for move in program.moves] == [None, None, 1]
    np.testing.assert_allclose(points(program), [[0.01, 0.02, 0.03], [0.078, 0.035, -0.012], [0.078, 0.022, -0.012]])
    np.testing.assert_allclose(axes(program)[1:], [[1, 0, 0]] * 2, atol=1e-15)


def test_points_of_a_turned_setup_are_read_again_when_they_were_corrected():
    program = read(TURNED_SETUP)
    waypoints = {n: (moved(m, np.full(3, 1e-3), np.array([0.01, 0.0, 0.01])),) for n, m in enumerate(program.moves)}
    again = read(program.rewrite(ROBOT, waypoints)[0].encode())
    np.testing.assert_allclose(points(again), points(program) + 1e-3, atol=1e-8)


@pytest.mark.parametrize(
    "text",
    [
        TURNED_SETUP.replace("TRNTYP/WORLD,0,0,0\n", ""),  # nobody says that coordinates stay
        TURNED_SETUP.replace("CSYS/0,0,1.,0,", "CSYS/0,0,1.,5.,"),  # the origin moves
        TURNED_SETUP.replace("CSYS/0,0,1.,0,0,1.,0,0,-1.,0,0,0", "CSYS/0,-1.,0,0,1.,0,0,0,0,0,1.,0"),  # about z
        TURNED_SETUP.replace(",1.,0,0\n", ",0,0,1.\n"),  # an axis as in the turned frame
        TURNED_SETUP.replace(",1.,0,0\n", "\n"),
    ],
)
def test_points_of_a_moved_frame_are_refused_where_their_frame_cannot_be_told(text):
    program = read(text)
    assert len(program.moves) == 1
    assert len(program.diagnostics) == 2
    assert all(diagnostic.rejected for diagnostic in program.diagnostics)
    assert any(
        word in program.diagnostics[0].text for word in ("another frame is stated", "the tool axis does not tell")
    )


def test_a_file_is_refused_without_a_tool_or_where_it_is_no_text():
    source = Source.of(Path("path.apt"), b"GOTO/1,2,3\n")
    with pytest.raises(
        FileError, match=r"path\.apt: does not say what its positions are of; give the tool, or the robot"
    ):
        read_apt([source])
    np.testing.assert_array_equal(read_apt([source], robot=ROBOT).moves[0].tool.T, ROBOT.T_flange_tool)
    with pytest.raises(FileError, match=r"path\.apt: is a binary file"):
        read(b"GOTO/\0")

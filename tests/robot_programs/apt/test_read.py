"""APT: what is read, and what is said by line to stay as it is."""

from pathlib import Path

import numpy as np
import pytest

from robot_programs.apt.read import read_apt
from robot_programs.core.program import Frame
from robot_programs.core.source import Source
from taskcal.errors import FileError
from tests.robot_programs.apt.samples import CATIA, ROBOT, TOOL, axes, moved, points, read


def test_a_path_of_catia_with_tool_axes_and_an_arc():
    program = read(CATIA)
    assert not program.diagnostics
    rapid, plunge, arc = program.motions
    assert [move.kind for move in program.motions] == ["linear", "linear", "circular"]
    assert [move.speed for move in program.motions] == [None, pytest.approx(0.005), pytest.approx(0.005)]
    assert [move.follows for move in program.motions] == [None, 0, 1]
    assert [move.place.line for move in program.motions] == [12, 14, 18]
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


def test_a_path_of_nx():
    program = read(NX)
    assert [move.place.line for move in program.motions] == [6, 8, 10, 11]
    assert [move.kind for move in program.motions] == ["linear", "linear", "circular", "linear"]
    assert [move.speed for move in program.motions] == pytest.approx([0.25 / 60, 0.01, 0.01, 0.01])
    assert [move.follows for move in program.motions] == [None, 0, 1, 2]
    np.testing.assert_allclose(axes(program), np.tile([0, 0.6, 0.8], (4, 1)), atol=1e-12)
    assert not program.diagnostics
    # clockwise about its axis: three quarters of the circle from (20, 0) to (25, 5)
    np.testing.assert_allclose(program.motions[2].via.T[:3, 3], 1e-3 * np.array([20 - 12.5**0.5, 5 + 12.5**0.5, 5]))


@pytest.mark.parametrize(
    ("circle", "end", "why"),
    [
        ("20,5,5,0,0,1,5", "25,5,5", "the sense of rotation of a CIRCLE with 7 numbers is not certain"),
        ("20,5,5,0,0,2", "25,5,5", "the axis of the circle is not of length 1"),
        ("20,5,5,0,0,1", "26,5,5", "start or end does not lie on its circle"),
        ("20,5,5,0,0.6,0.8", "25,5,5", "the arc climbs along its axis"),
        ("20,5,5,0,0,1,5,0,0,10,0,TIMES,2", "20,0,5", "a circle of several turns is not read"),
        ("P1", "25,5,5", "its circle is not written as numbers"),
    ],
)
def test_a_circle_that_is_not_certain_stays_as_it_is(circle, end, why):
    program = read(f"GOTO/20,0,5\nCIRCLE/{circle}\nGOTO/{end}\nGOTO/30,5,5\n")
    assert [move.follows for move in program.motions] == [None, None]
    assert [diagnostic.place.line for diagnostic in program.diagnostics] == [3]
    assert why in program.diagnostics[0].text


def test_circle_sense_continues_the_line_before():
    """SOLIDWORKS CAM's six numbers turn by the right hand, NX's eleven against it."""
    for axis, rest in (("0,0,1", ""), ("0,0,-1", ",5,0.06,0.5,10,0")):
        program = read(f"GOTO/0,0,0\nGOTO/20,0,0\nCIRCLE/20,5,0,{axis}{rest}\nGOTO/25,5,0\n")
        via = 1e-3 * np.array([20 + 12.5**0.5, 5 - 12.5**0.5, 0])
        np.testing.assert_allclose(program.motions[2].via.T[:3, 3], via, atol=1e-12)


def test_a_full_circle_is_two_halves():
    program = read("GOTO/20,0,0\nCIRCLE/20,5,0,0,0,1\nGOTO/20,0,0\nGOTO/30,0,0\n")
    assert [move.place.line for move in program.motions] == [1, 3, 3, 4]
    np.testing.assert_allclose(points(program)[1], [0.02, 0.01, 0], atol=1e-12)
    np.testing.assert_allclose(program.motions[1].via.T[:3, 3], [0.025, 0.005, 0], atol=1e-12)
    np.testing.assert_allclose(program.motions[2].via.T[:3, 3], [0.015, 0.005, 0], atol=1e-12)


def test_cycle_points_are_read_without_their_action():
    """The points of a cycle are read and what it does there is not."""
    text = "GOTO/0,0,50\nCYCLE/INIT\nCYCLE/DRILL,FEDTO,10\nGOTO/0,0,0\nGOTO/20,0,0\nCYCLE/OFF\nGOTO/20,0,50\n"
    program = read(text)
    assert [move.kind for move in program.motions] == ["linear", "joint", "joint", "linear"]
    assert [move.follows for move in program.motions] == [None, 0, 1, None]
    assert [str(diagnostic) for diagnostic in program.diagnostics] == [
        "path.apt:3: a cycle moves the tool at each of its points, which are corrected; what it does there is not read"
    ]


def test_home_is_a_point_at_rapid_speed():
    program = read("FEDRAT/600\nGOTO/0,0,0\nGOHOME/1,2,3\n")
    assert program.motions[0].speed == pytest.approx(0.01)
    assert program.motions[1].speed is None


def test_tools_are_told_by_the_names_by_which_they_are_loaded():
    text = "LOAD/TOOL,1\nGOTO/1,2,3\nLOAD/TOOL,02\nGOTO/4,5,6\nLOAD/TOOL,3\nGOTO/7,8,9\nLOAD/TOOL,1\nGOTO/1,2,3\n"
    second = Frame(name="2", T=np.eye(4))
    program = read_apt([Source.of(Path("path.apt"), text.encode())], tool=TOOL, tools={"2": second})
    assert program.motions[1].tool is second
    assert [(move.tool.name, move.tool.stated) for move in program.motions] == [
        ("mill", True), ("2", True), ("3", False), ("mill", True)
    ]  # fmt: skip
    assert [move.follows for move in program.motions] == [None] * 4


def test_a_tool_axis_stays_until_another_one_is_stated():
    program = read("GOTO/0,0,0\nTLAXIS/1,0,0\nGOTO/1,0,0\nGOTO/2,0,0,0,1,0\nMULTAX/OFF\nGOTO/3,0,0\n")
    np.testing.assert_allclose(axes(program), [[0, 0, 1], [1, 0, 0], [0, 1, 0], [0, 1, 0]], atol=1e-15)


OTHER_FRAME = "another frame is stated than the first, the part's"
UPRIGHT = "1.,0,0,0,0,1.,0,0,0,0,1.,0"

UNCERTAIN = {
    "ORIGIN/0,0,5\n{}": "ORIGIN moves the coordinates since line 1",
    "TRACUT/M1\n{}TRACUT/NOMORE\n": "TRACUT transforms the motions since line 1",
    "ROTABL/90,CLW\n{}": "ROTABL turns the table since line 1",
    "INDEX/1\n{}COPY/1,TRANSL,10,0,0,3\n": "COPY repeats motions elsewhere since line 1",
    "MACRO\n{}TERMAC\n": "a macro is run from elsewhere since line 1",
    "UNITS/FEET\n{}UNITS/MM\n": "the unit of line 1 is not known",
    "TLAXIS/NORMPS\n{}TLAXIS/0,0,1\n": "the tool axis of line 1 is not stated by its components",
    "MSYS/0,0,0\nMSYS/0,0,1\n{}MSYS/0,0,0\n": "another frame is stated than the first, the part's (line 2)",
    f"CSYS/{UPRIGHT}\nCSYS/1,0,0,5,0,1,0,0,0,0,1,0\n{{}}CSYS/{UPRIGHT}\n": f"{OTHER_FRAME} (line 2)",
    "CSYS/1,0,0,0,0,1,0,0\n{}CSYS/1,0,0,0,0,1,0,0,0,0,1,0\n": "the CSYS of line 1 is not the twelve numbers of a pose",
    "CSYS/1,0,0,0,0,1,0,0,0,0,-1,0\n{}CSYS/1,0,0,0,0,1,0,0,0,0,1,0\n": "the CSYS of line 1 is not the twelve numbers of a pose",
    "TRNTYP/WORLD,0,0,5\n{}TRNTYP/WORLD,0,0,0\n": "TRNTYP may move the coordinates since line 1",
    "FROBNI/1,2\n{}": "'FROBNI' of line 1 is not known, and its numbers may move the coordinates",
}


@pytest.mark.parametrize("text", UNCERTAIN)
def test_moved_coordinates_leave_motions_until_cleared(text):
    """What moves coordinates leaves motions as they are until it is cleared."""
    program = read(text.format("GOTO/1,2,3\nGODLTA/1,0,0\n") + "GOTO/4,5,6\n")
    expected = f"{UNCERTAIN[text]}; the motion stays as it is"
    lasts = "{}" in text[-4:]
    assert [diagnostic.text for diagnostic in program.diagnostics] == [expected] * (3 if lasts else 2)
    assert len(program.motions) == (0 if lasts else 1)
    if not lasts:
        assert program.motions[0].follows is None
        np.testing.assert_allclose(points(program), [[0.004, 0.005, 0.006]])


@pytest.mark.parametrize("text", UNCERTAIN)
def test_motions_whose_frame_or_tool_is_not_known_are_refused(text):
    assert all(diagnostic.rejected for diagnostic in read(text.format("GOTO/1,2,3\nGODLTA/1,0,0\n")).diagnostics)
    assert not any(diagnostic.rejected for diagnostic in read(NX).diagnostics)


def test_a_tool_that_waits_in_the_magazine_is_not_loaded():
    program = read("LOAD/TOOL,1\nSELECT/TOOL,2\nGOTO/1,2,3\nLOAD/TOOL,2\nGOTO/4,5,6\n")
    assert [move.tool.stated for move in program.motions] == [True, False]


@pytest.mark.parametrize(
    "text",
    [
        "LOADTL/1\nLOADTL/2\n{}LOADTL/1\n",
        "LOAD/TOOL,1\nSELECT/TOOL,2\nLOAD/TOOL,2\n{}LOAD/TOOL,1\n",
        "SELECT/TOOL,1\nSELECT/TOOL,2\n{}SELECT/TOOL,1\n",
        "TOOL PATH/A,TOOL,M8\nTOOL PATH/B,TOOL,M6\n{}TOOL PATH/C,TOOL,M8\n",
    ],
)
def test_every_way_to_load_a_tool(text):
    program = read(text.format("GOTO/1,2,3\n") + "GOTO/4,5,6\n")
    assert [move.tool.stated for move in program.motions] == [False, True]
    assert [move.follows for move in program.motions] == [None, None]


TURNED_SETUP = """TRNTYP/WORLD,0,0,0
CSYS/1.,0,0,0,0,1.,0,0,0,0,1.,0
GOTO/10.,20.,30.
TRNTYP/WORLD,0,0,0
CSYS/0,0,1.,0,0,1.,0,0,-1.,0,0,0
GOTO/78.,35.,-12.,1.,0,0
GOTO/78.,22.,-12.,1.,0,0
"""


def test_turned_setup_stays_in_the_first_frame_by_tool_axis():
    """Points of a turned setup stay in the first frame where their tool axis shows it."""
    program = read(TURNED_SETUP)
    assert not program.diagnostics
    assert [move.follows for move in program.motions] == [None, None, 1]
    np.testing.assert_allclose(points(program), [[0.01, 0.02, 0.03], [0.078, 0.035, -0.012], [0.078, 0.022, -0.012]])
    np.testing.assert_allclose(axes(program)[1:], [[1, 0, 0]] * 2, atol=1e-15)


def test_turned_setup_is_read_again_after_correction():
    """Points of a turned setup are read again when they were corrected."""
    program = read(TURNED_SETUP)
    waypoints = {n: (moved(m, np.full(3, 1e-3), np.array([0.01, 0.0, 0.01])),) for n, m in enumerate(program.motions)}
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
def test_moved_frame_is_refused_if_it_is_ambiguous(text):
    """Points of a moved frame are refused where their frame cannot be told."""
    program = read(text)
    assert len(program.motions) == 1
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
    np.testing.assert_array_equal(read_apt([source], robot=ROBOT).motions[0].tool.T, ROBOT.T_flange_tool)
    with pytest.raises(FileError, match=r"path\.apt: is a binary file"):
        read(b"GOTO/\0")


# What statements set and do.


def test_inches_feeds_and_increments_by_hand():
    program = read(
        "UNITS/INCH\nFEDRAT/30,IPM\nFROM/0,0,1\nGODLTA/1,0,0\nUNITS/MM\nFEDRAT/60\nGODLTA/0,0,-25.4\nGODLTA/-2\n"
    )
    np.testing.assert_allclose(
        points(program), 0.0254 * np.array([[1, 0, 1], [1, 0, 0], [1, 0, -2 / 25.4]]), atol=1e-15
    )
    np.testing.assert_allclose(
        [m.speed for m in program.motions], [0.0127, 0.0254, 0.0254]
    )  # 60 in the unit stated: IPM
    assert [m.follows for m in program.motions] == [None, 0, 1]
    assert read("FEDRAT/0.2,MMPR\nGOTO/0,0,0").motions[0].speed is None
    assert read("FEDRAT/PERMIN,120\nGOTO/0,0,0").motions[0].speed == pytest.approx(0.002)
    assert read("UNITS/INCH\nFEDRAT/6\nGOTO/0,0,0").motions[0].speed == pytest.approx(0.00254)


@pytest.mark.parametrize("word", ["UNIT", "UNITS"])
def test_either_word_sets_the_unit(word):
    np.testing.assert_allclose(points(read(f"{word}/INCH\nGOTO/1,2,3\n")), [[0.0254, 0.0508, 0.0762]], atol=1e-15)
    np.testing.assert_allclose(points(read(f"{word}/MM\nGOTO/1,2,3\n")), [[0.001, 0.002, 0.003]], atol=1e-15)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("GOTO/P1", "path.apt:1: GOTO has not three or six numbers"),
        ("GOTO/1,2,3,0,0,1,0,0,1", "GOTO has not three or six numbers"),
        ("GOTO/1,,3", "GOTO has not three or six numbers"),
        ("GOTO/1,2,1E999", "GOTO has not three or six numbers"),
        ("GOTO", "GOTO has not three or six numbers"),
        ("GOTO/1,2,3,0,0,0", "the tool axis has length 0 instead of 1"),
        ("GODLTA/1,2,3", "GODLTA counts from a place that is not known"),
        ("TLLFT,GOFWD/L1,PAST,L2", "TLLFT is not read"),
        ("GOTO/1,2,3\nCLEARP/XYPLAN,30\nGOCLER\nGODLTA/1", "GOCLER is not read; the motion stays as it is"),
        ("INDIRV/0,1,0\nTLON,GOFWD/(CIRCLE/0,0,0,5),ON,(LINE/0,0,0,0,5,0)", "begins at a place that is not known"),
        ("GOTO/5,0,0\nINDIRV/0,1,0\nTLON,GOFWD/(CIRCLE/0,0,0,6),ON,(LINE/0,0,0,0,6,0)", "does not lie on its circle"),
        ("GOTO/5,0,0\nINDIRV/1,0,0\nTLON,GOFWD/(CIRCLE/0,0,0,5),ON,(LINE/0,0,0,0,5,0)", "do not lie on one circle"),
        ("GOTO/5,0,0\nINDIRV/0,1,0\nTLON,GOFWD/(CIRCLE/0,0,0,5),ON,2,INTOF,(LINE/0,0,0,0,5,0)", "another meeting"),
        ("GOTO/5,0,0\nINDIRV/0,1,0\nTLON,GOFWD/(CIRCLE/0,0,0,5),ON,2,INTOF,(LINE/0,0,0,5,0,0)", "a full circle"),
        ("GOTO/5,0,0\nINDIRV/0,1,0\nTLON,GOFWD/(CIRCLE/0,0,0,5),TANTO,(LINE/0,0,0,5,0,0)", "only arcs between points"),
        ("FROBNI/ON\nFROBNI/OFF", "path.apt:1: 'FROBNI' is not known; it is taken to move nothing"),
    ],
)
def test_what_is_not_read_is_said_by_line(text, said):
    assert said in str(read(text).diagnostics[0])
    assert len(read(text).diagnostics) == 1 + ("GODLTA/1\n" in f"{text}\n")


@pytest.mark.parametrize(
    ("text", "refused", "moves"),
    [
        ("GOTO/1,2,3,$\nGOTO/4,5,6\nGOTO/7,8,9,0,0,1", [1, 2], [3]),
        ("PAINT/COLOR,$\nGOHOME/4,5,6\nGOTO/7,8,9", [2], [3]),
        ("RAPID,GOTO/4,5,6\nGOTO/7,8,9", [1], [2]),
        ("GOTO/1,2,3,$\nCIRCLE/0,0,0,0,0,1\nGOTO/7,8,9", [1, 2, 3], []),
        ("GOTO 1,2,3", [1], []),
    ],
)
def test_every_line_that_may_be_a_motion_is_said(text, refused, moves):
    """A dollar sign too many, or a slash too few, hides no motion."""
    program = read(text)
    assert [d.place.line for d in program.diagnostics if d.unread] == refused
    assert [m.place.line for m in program.motions] == moves


@pytest.mark.parametrize("text", ["GOTO/1,2,3,0.6,0,0.7", "FROM/1,2,3,0.6,0,O.8", "GOTO/1,2,3,0.6,0"])
def test_a_tool_axis_that_is_not_understood_holds_for_no_other_point(text):
    """A point without an axis has that of the statement before, or none that is known."""
    program = read(f"{text}\nGOTO/4,5,6\nGOTO/4,5,6,0,1,0\nGOTO/7,8,9\n")
    assert [m.place.line for m in program.motions] == [3, 4]
    np.testing.assert_allclose(axes(program), [[0, 1, 0]] * 2, atol=1e-12)
    assert "the tool axis of line 1 is not stated by its components" in str(program.diagnostics[-1])


def test_a_circle_inside_another_statement_is_none():
    """Definitions of geometry in brackets, or behind a name, move nothing."""
    assert not read("PSIS/(CIRCLE/0,0,0,5)\nC1=CIRCLE/0,0,0,5\n").diagnostics


def test_a_clearance_surface_moves_nothing():
    """CLRSRF defines where a later RETRCT goes (ICAM, the CLRSRF command)."""
    program = read("CLRSRF/0,0,1,50\nGOTO/1,2,3")
    np.testing.assert_allclose(points(program), [[0.001, 0.002, 0.003]])
    assert not program.diagnostics

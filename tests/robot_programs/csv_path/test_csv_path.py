"""Paths in CSV: what is read or refused, and that rewriting touches nothing but the numbers it owns."""

import numpy as np
import pytest
from hypothesis import given
from scipy.spatial.transform import Rotation

from robot_programs.core.program import Waypoint
from robot_programs.core.source import Source
from robot_programs.csv_path.read import parse_table
from taskcal.errors import FileError, TaskcalError
from tests.laws.robots import generators
from tests.robot_programs.csv_path.generator import generate
from tests.robot_programs.csv_path.texts import ARC, ROBOT, TOOL, read

paths = generators.map(generate)


def cells(source: Source) -> list[list[str]]:
    table = parse_table(source)
    return [list(table.header), *(list(row.texts) for row in table.rows)]


def to(T: np.ndarray, kind: str = "linear", via: Waypoint | None = None) -> Waypoint:
    return Waypoint(kind=kind, q=np.zeros(6), T=T, via=via)


def shifted(T: np.ndarray, x: float) -> np.ndarray:
    out = T.copy()
    out[0, 3] += x
    return out


POSES = """name,x_mm,y_mm,z_mm,qx,qy,qz,qw,speed_mm_s,stop
start,100,200,300.5,0,0,0,1,,yes
next,110,200,300.5,0,0,0.7071068,0.7071068,50,
"""


def test_poses_are_read_in_metres_and_follow_each_other():
    program = read(POSES)
    first, second = program.motions
    assert (first.kind, first.end.name, first.stops, first.speed, first.follows) == (
        "linear",
        "start",
        True,
        None,
        None,
    )
    assert (second.stops, second.speed, second.follows, second.routine) == (False, 0.05, 0, "path")
    assert (second.place.line, second.tool, second.end.free_spin) == (3, TOOL, False)
    np.testing.assert_allclose(second.end.T[:3, 3], [0.11, 0.2, 0.3005], atol=1e-15)
    np.testing.assert_allclose(second.end.T[:3, :3], Rotation.from_euler("z", 90, degrees=True).as_matrix(), atol=1e-7)


@given(generators)
def test_tool_axis_points_into_the_holder_and_leaves_spin_open(rng):
    """A tool axis points back into the holder and leaves the spin open."""
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    program = read("x_mm,y_mm,z_mm,i,j,k\n1,2,3," + ",".join(map(repr, map(float, axis))))
    R = program.motions[0].end.T[:3, :3]
    assert program.motions[0].end.free_spin
    np.testing.assert_allclose(R[:, 2], -axis, atol=1e-12)
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)


def test_without_a_tool_the_robots_own_one_moves():
    program = read(POSES, tool=None, robot=ROBOT)
    np.testing.assert_array_equal(program.motions[0].tool.T, ROBOT.T_flange_tool)
    with pytest.raises(
        FileError, match=r"path\.csv: does not say what its positions are of; give the tool, or the robot"
    ):
        read(POSES, tool=None)


def test_an_arc_becomes_lines_or_stays_an_arc():
    program = read(ARC)
    via, end = program.motions[1].via.T, program.motions[1].end.T
    (lines,) = program.rewrite(ROBOT, {1: (to(shifted(via, 0.001)), to(shifted(end, 0.002)))})
    assert [row[:3] for row in cells(lines)[2:4]] == [
        ["linear", "11.000000", "10.000000"],
        ["linear", "22.000000", "0"],
    ]
    assert len(cells(lines)) == len(cells(program.sources[0]))
    way = to(shifted(end, 0.002), "circular", to(shifted(via, 0.001), "circular"))
    (arc,) = program.rewrite(ROBOT, {1: (way,)})
    assert arc.text == ARC.replace("via;10;", "via;11.000000;").replace("circular;20;", "circular;22.000000;")


def test_more_waypoints_become_rows_before_the_motions_own():
    program = read(POSES)
    end = program.motions[1].end.T
    (source,) = program.rewrite(ROBOT, {1: (to(shifted(end, -0.005)), to(end))})
    head, start, *more = POSES.splitlines()
    assert source.text.splitlines() == [head, start, more[0].replace("110", "105.000000"), more[0]]


def test_what_the_columns_cannot_hold_is_refused():
    program = read(POSES)
    T = program.motions[0].end.T
    for waypoint in (Waypoint(kind="axes", q=np.zeros(6), T=None), to(T, "circular", to(T)), to(T, "joint")):
        with pytest.raises(TaskcalError, match=r"path\.csv:2: .*; write the program in another language"):
            program.rewrite(ROBOT, {0: (waypoint,)})


# What the rows of a path mean.


def test_an_arc_has_a_row_for_the_point_on_its_way():
    program = read(ARC)
    assert [move.kind for move in program.motions] == ["joint", "circular", "linear"]
    assert [move.follows for move in program.motions] == [None, 0, 1]
    arc = program.motions[1]
    np.testing.assert_allclose(arc.via.T[:3, 3], [0.01, 0.01, 0.0])
    assert (arc.place.line, arc.via.place.line) == (4, 3)


def test_rows_of_another_tool_stay_as_they_are():
    program = read("tool,x_mm,y_mm,z_mm,i,j,k\nmill,1,2,3,0,0,1\nsaw,1,2,3,0,0,1\nmill,1,2,4,0,0,1\n")
    assert [move.place.line for move in program.motions] == [2, 4]
    assert program.motions[1].follows is None
    assert str(program.diagnostics[0]).startswith("path.csv:3: tool 'saw' is not known; only 'mill' was given")


# What the columns of a path mean.


def test_joints_are_read_by_number_or_by_the_robots_own_names():
    numbered = read("id,J1_deg,J2_deg,J3_deg,J4_deg,J5_deg,J6_deg\n0,90,0,0,0,45,-180\n")
    own = read("id,j1_deg,q2_deg,J3_rad,J4_deg,J5_deg,J6_deg\n0,90,0,0,0,45,-180\n", robot=ROBOT)
    for program in (numbered, own):
        (move,) = program.motions
        assert (move.kind, move.end.T) == ("axes", None)
        np.testing.assert_allclose(move.end.q, np.radians([90, 0, 0, 0, 45, -180]), atol=1e-15)
    assert read("J1_deg\n5\n").motions[0].end.q.shape == (1,)


def test_a_joint_that_the_robot_lacks_is_named():
    with pytest.raises(FileError, match=r"path\.csv:1: has 'J1_deg' but no column 'J6_deg' of abb-irb120"):
        read("J1_deg,J2_deg,J3_deg,J4_deg,J5_deg\n", robot=ROBOT)
    with pytest.raises(FileError, match=r"has 'J2_deg' but no column 'J1_deg' of abb-irb120"):
        read("J2_deg,J3_deg,J4_deg\n", robot=ROBOT)
    with pytest.raises(FileError, match=r"joint J1 is given twice, by 'J1_deg' and 'q1_rad'; keep one"):
        read("J1_deg,q1_rad\n", robot=ROBOT)


# What is not a path.


WRONG = {
    "id,x_mm,y_mm,z_mm\n0,1,2,3\n": r"path\.csv:1: has positions without the tool's orientation",
    "x_mm,y_mm,i,j,k\n": r"path\.csv:1: has 'x_mm' but no column 'z_mm'",
    "x,y,z,i,j,k\n": r"path\.csv:1: column 'x': the unit is not stated; name the column x_mm",
    "x_mm,y_mm,z_mm,i,j,k,feed\n": r"path\.csv:1: unknown column 'feed'; a path has",
    "x_mm,y_mm,z_mm,i,j,k,X_MM\n": r"path\.csv:1: two columns are named 'x_mm' but",
    "x_mm,y_mm,z_mm,i,j,k,qx,qy,qz,qw\n": r"path\.csv:1: has both a quaternion and a tool axis",
    "qx,qy,qz,qw,J1_deg\n": r"path\.csv:1: has orientations without positions",
    "id\n1\n": r"path\.csv:1: has neither positions x_mm y_mm z_mm nor joints",
    "J2_deg\n1\n": r"path\.csv:1: has no column for joint 1, such as J1_deg",
    "x_mm,y_mm,z_mm,i,j,k\n1,2,,0,0,1\n": r"path\.csv:2: column 'z_mm': the cell is empty while its others are not",
    "x_mm,y_mm,z_mm,i,j,k\n\n1,2,3,0,0,2\n": r"path\.csv:3: column 'i': the tool axis has length 2\.0000",
    "x_mm,y_mm,z_mm,qx,qy,qz,qw\n1,2,3,0,0,0,0\n": r"path\.csv:2: column 'qx': the quaternion has length 0\.0000",
    "x_mm,y_mm,z_mm,i,j,k\n1,2,3,0,0,one\n": r"path\.csv:2: column 'k': 'one' is not a number",
    "x_mm,y_mm,z_mm,i,j,k,J1_deg\n1,2,3,0,0,1,5\n": r"path\.csv:2: the row has a pose and joint positions",
    "x_mm,y_mm,z_mm,i,j,k,J1_deg\n,,,,,,\n1,2,3,0,0,1,\n,,,,,,5\nx,,,,,,\n": r"path\.csv:5: column 'x_mm': 'x' is not a number",
    "id,J1_deg\n7,\n": r"path\.csv:2: the row has no target",
    "x_mm,y_mm,z_mm,i,j,k,move\n1,2,3,0,0,1,hop\n": r"path\.csv:2: column 'move': 'hop' is not a motion to a pose; write joint,",
    "x_mm,y_mm,z_mm,i,j,k,move\n1,2,3,0,0,1,via\n": r"path\.csv:2: a via point must be followed",
    "x_mm,y_mm,z_mm,i,j,k,move\n1,2,3,0,0,1,circular\n": r"path\.csv:2: column 'move': a row 'via' .* before the end",
    "J1_deg,move\n1,linear\n": r"path\.csv:2: column 'move': 'linear' needs a pose",
    "J1_deg,speed_mm_s\n1,-5\n": r"path\.csv:2: column 'speed_mm_s': -5 is not a speed",
    "J1_deg,stop\n1,maybe\n": r"path\.csv:2: column 'stop': 'maybe' is neither yes nor no",
    'J1_deg,name\n1,"a ""b"""\n': r"path\.csv: has quotes inside cells",
    'J1_deg,J2_deg\n1,2\n1,"2': r"path\.csv:3: has a quote that does not end",
    "J1_deg\r1\r2": r"path\.csv:1: has a carriage return alone",
    "": r"path\.csv: is empty; its first line must name the columns",
    "x_mm,y_mm\n" + 30_000 * "1,": r"path\.csv:2: has more than 20000 columns",
    "J1_deg,J1_deg\n": r"path\.csv:1: two columns are named 'J1_deg'; names must differ",
    "J1_deg\n1,5\n2\n3,5\n": r"path\.csv:2: the line has 2 fields, the header 1; is it written with decimal commas\?\n.*:4",
    "J1_deg\na\n1\nnan\n1e7\n": r"(?s)path\.csv:2: .*'a' is not a.*:4: .*'nan' is not a finite.*:5: .*beyond ±1e\+06",
}


@pytest.mark.parametrize("text", WRONG)
def test_what_is_no_path_is_refused_with_its_place(text):
    with pytest.raises(FileError, match=WRONG[text]):
        read(text)

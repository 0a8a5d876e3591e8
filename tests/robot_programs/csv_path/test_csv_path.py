"""Paths in CSV: what is read, and that rewriting touches nothing but the numbers it owns."""

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


@given(paths, generators)
def test_rewriting_changes_only_the_numbers_of_the_motions_named(data, rng):
    program = read(data)
    n = int(rng.integers(len(program.motions)))
    move = program.motions[n]
    if move.end.T is None:
        wanted = Waypoint(kind="axes", q=move.end.q + rng.uniform(1e-3, 0.1, 6), T=None)
    else:
        T = move.end.T.copy()
        T[:3, :3] = Rotation.from_rotvec(rng.uniform(1e-3, 0.1, 3)).as_matrix() @ T[:3, :3]
        T[:3, 3] += rng.uniform(1e-5, 0.01, 3)
        wanted = to(T)
    (source,) = program.rewrite(ROBOT, {n: (wanted,)})
    again = read(source.encode())
    assert len(again.motions) == len(program.motions)
    if wanted.T is None:
        np.testing.assert_allclose(again.motions[n].end.q, wanted.q, atol=1e-11)
    else:
        np.testing.assert_allclose(again.motions[n].end.T[:3, 3], wanted.T[:3, 3], atol=1e-9)
        np.testing.assert_allclose(again.motions[n].end.T[:3, 2], wanted.T[:3, 2], atol=1e-8)
        if not move.end.free_spin:
            np.testing.assert_allclose(again.motions[n].end.T[:3, :3], wanted.T[:3, :3], atol=1e-8)
    before, after = data.splitlines(), source.encode().splitlines()
    assert [i for i in range(len(before)) if before[i] != after[i]] == [move.place.line - 1]

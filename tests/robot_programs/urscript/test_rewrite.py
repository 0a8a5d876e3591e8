"""Rewriting touches nothing but the numbers of the motions that change."""

import numpy as np
import pytest
from hypothesis import given
from scipy.spatial.transform import Rotation

from robot_programs.core.program import Composition, Waypoint
from robot_programs.urscript.read import read_urscript
from robot_programs.urscript.rewrite import compose_urscript
from robot_programs.urscript.values import matrix, six_of
from taskcal.geometry import se3
from tests.laws.robots import generators
from tests.robot_programs.urscript.samples import UR5, read

SHIFT = se3.translation(1e-4, 0, 0)


def shifted(program, *numbers, by=SHIFT):
    """Waypoints of motions, their ends shifted in the part's frame."""
    numbers = numbers or range(len(program.motions))
    motions = program.motions
    return {i: (Waypoint(kind=motions[i].kind, q=np.zeros(6), T=by @ motions[i].end.T),) for i in numbers}


def changes(program, waypoints):
    """Lines that differ, before and after."""
    (source,) = program.rewrite(UR5, waypoints)
    pairs = zip(program.sources[0].text.split("\n"), source.text.split("\n"), strict=True)
    return [(a.strip(), b.strip()) for a, b in pairs if a != b]


@given(generators)
def test_numbers_of_a_pose_stay_near_those_before(rng):
    """The same rotation gives the same vector back, also beyond half a turn and by whole turns."""
    values = (*rng.uniform(-1, 1, 3), *(Rotation.random(rng=rng).as_rotvec() * rng.uniform(0.1, 4.0)))
    np.testing.assert_allclose(six_of(matrix(values), values), values, atol=1e-9)


def test_only_the_numbers_that_change_are_written_where_they_stand():
    program = read("movel(p[.1, -0.2000, 0.3, 0, d2r(90), 0.0], a=1.2, v=0.25) # there")
    assert changes(program, shifted(program)) == [(
        "movel(p[.1, -0.2000, 0.3, 0, d2r(90), 0.0], a=1.2, v=0.25) # there",
        "movel(p[0.1001000, -0.2000, 0.3, 0, d2r(90), 0.0], a=1.2, v=0.25) # there",
    )]  # fmt: skip


def test_a_waypoint_gets_its_numbers_where_it_is_set():
    program = read("movej(get_inverse_kin(Waypoint_1_p, qnear=Waypoint_1_q))", "movel(Waypoint_1_p, v=0.1)")
    ((before, after),) = changes(program, shifted(program))
    assert before.replace("-.143968656714", "-0.143868656714") == after


def test_a_waypoint_that_is_read_for_something_else_stays():
    program = read("movel(Waypoint_1_p)", "textmsg(Waypoint_1_p)")
    ((before, after),) = changes(program, shifted(program))
    assert before == "movel(Waypoint_1_p)"
    assert after.startswith("movel(p[")


def test_a_point_in_a_feature_stays_in_it():
    program = read("movel(pose_trans(Plane_1, p[.1, 0, .2, 0, 3, 0]))")
    assert changes(program, shifted(program)) == [(
        "movel(pose_trans(Plane_1, p[.1, 0, .2, 0, 3, 0]))", "movel(pose_trans(Plane_1, p[0.1001000, 0, .2, 0, 3, 0]))"
    )]  # fmt: skip


def test_a_motion_that_states_its_own_point_stays_in_the_feature():
    """And is refused where the feature's variable is not that of the motion."""
    program = read("target = pose_trans(Plane_1, p[.1, 0, .2, 0, 3, 0])", "textmsg(target)", "movel(target)")
    assert changes(program, shifted(program)) == [(
        "movel(target)", "movel(pose_trans(Plane_1, p[0.1001000, 0.0000000, 0.2000000, 0.00000000, 3.00000000, 0.00000000]))"
    )]  # fmt: skip
    lines = (
        "def f(plane):",
        "return pose_trans(plane, p[.1, 0, .2, 0, 3, 0])",
        "end",
        "textmsg(f(Plane_1))",
        "movel(f(Plane_1))",
    )
    program = read(*lines)
    assert "its feature plane is not known" in program.unwritable(UR5, shifted(program), 1e-6)[0]
    program = read(*(line for line in lines if "textmsg" not in line))
    assert len(changes(program, shifted(program))) == 1
    divided = {0: shifted(program)[0] * 2}
    assert "its feature plane is not known" in program.unwritable(UR5, divided, 1e-6)[0]


def test_what_a_function_is_given_is_written_at_its_calls():
    lines = ("def goto(target):", "movel(target)", "end", "goto(p[.1,.2,.3,0,0,0])", "goto(p[.2,.2,.3,0,0,0])")
    program = read(*lines)
    found = changes(program, shifted(program))
    assert [after for _, after in found] == ["goto(p[0.1001000,.2,.3,0,0,0])", "goto(p[0.2001000,.2,.3,0,0,0])"]


def test_elements_of_a_list_get_numbers_of_their_own():
    program = read("list = [p[.1,.2,.3,0,0,0], p[.2,.2,.3,0,0,0]]", "i = 0", "while i < 2:", "movel(list[i])", "i = i + 1",
                   "end")  # fmt: skip
    ((_, after),) = changes(program, shifted(program, 1))
    assert after == "list = [p[.1,.2,.3,0,0,0], p[0.2001000,.2,.3,0,0,0]]"


def test_joints_of_a_line_are_written_as_joints():
    program = read("movel([0.1, -1.2, 1.5, -1.8, -1.4, 0.3])")
    waypoint = Waypoint(kind="linear", q=np.full(6, 0.5), T=SHIFT @ program.motions[0].end.T)
    ((_, after),) = changes(program, {0: (waypoint,)})
    assert after == f"movel([{', '.join(['0.50000000'] * 6)}])"


@pytest.mark.parametrize("blend", ["", ", r=0.05", ", r=0.0002"])
def test_points_between_are_passed_by(blend):
    program = read(f"movel(Waypoint_1_p, 1.2, 0.2{blend})")
    (move,) = program.motions
    path = [shifted(program, by=se3.translation(x, 0, 0))[0][0] for x in (-0.02, -0.002, 0.0)]
    again = program.reread(program.rewrite(UR5, {0: tuple(path)}))
    assert [m.stops for m in again.motions] == [False, False, move.stops]
    assert [m.speed for m in again.motions] == [0.2] * 3
    assert all(0 < m.zone.distance < 0.5 * 0.002 for m in again.motions[:2])  # the blends of two points do not overlap
    assert again.motions[2].zone == move.zone


def test_motions_to_one_waypoint_and_beside_it_are_corrected_together():
    program = read(
        "movel(Waypoint_1_p)", "above = pose_add(Waypoint_1_p, p[0,0,.1,0,0,0])", "movel(above)",
        "movel(pose_trans(Plane_1, Plane_1))",
        "servoj(Waypoint_1_p)", "movel(p[0,0,0,0,0,0])",
    )  # fmt: skip
    targets = [{v.target for v in program.visits() if v.number == number} for number in (0, 1, 2, 3, None)]
    assert targets[0] & targets[1] & targets[4]
    assert not (targets[2] | targets[3]) & (targets[0] | targets[4])


def test_blends_of_a_new_program_do_not_overlap():
    """Points of a dense path are passed by within less than half of the way between them."""
    x = [0.0, 0.1, 0.1003, 0.2]
    lines = [f"movel(p[{value}, 0.2, 0.3, 0, 3, 0], v=0.1, r=0.01)" for value in x]
    motions = read(*lines).motions
    again = read_urscript((compose_urscript(Composition(name="dense", robot=UR5, motions=motions)),), robot=UR5).motions
    np.testing.assert_allclose([move.end.T for move in again], [move.end.T for move in motions], atol=1e-9)
    np.testing.assert_allclose([m.tool.T for m in again], [m.tool.T for m in motions], atol=1e-9)
    radii = [move.zone.distance for move in again]
    assert all(a + b < way for a, b, way in zip(radii, radii[1:], np.diff(x), strict=False))
    assert min(radii) > 0


def test_what_is_read_of_one_point_leaves_others_of_the_same_function():
    """Points that go through one function are written where they stand, but for those of which more is read."""
    lines = ("def goto(q):", "movel(q)", "end", "def up(wp):", "goto(p[wp[0], wp[1], wp[2] + 0.1, 0, 0, 0])", "end")
    program = read(*lines, "one = p[.1,.2,.3,0,0,0]", "two = p[.2,.2,.3,0,0,0]", "goto(one)", "goto(two)", "up(two)")
    waypoints = shifted(program)
    assert set(program.unwritable(UR5, waypoints, 1e-6)) == {1}
    del waypoints[1]
    before = {line for line, _ in changes(program, waypoints)}
    assert before == {"one = p[.1,.2,.3,0,0,0]", "goto(p[wp[0], wp[1], wp[2] + 0.1, 0, 0, 0])"}


@pytest.mark.parametrize("leaves", ["if get_digital_in(1):\nbreak\nend", "thread t():\nsync()\nend"])
def test_loop_that_is_left_or_declares_is_not_written_out(leaves):
    program = read(
        "i = 0", "while i < 3:", "movel(pose_trans(Plane_1, p[i * 0.05, 0, 0, 0, 0, 0]))", "i = i + 1", leaves, "end"
    )
    assert len(program.motions) > 0
    assert program.written_out(range(len(program.motions))) is None

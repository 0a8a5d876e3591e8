"""Helpers that correct at run time, computed from their text, against the correction in Python."""

import re
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from robot_programs.core.source import Source
from robot_programs.krl.points import StatusTurn
from robot_programs.rapid.read import read_rapid
from taskcal.correction.cell import Cell, ExternalAxis
from taskcal.correction.frames import _flange_in_tool
from taskcal.correction.options import Bounds
from taskcal.correction.run_time import FUNCTION, krl_helper, rapid_helper, urscript_helper
from taskcal.geometry import se3
from taskcal.kinematics.inverse import conditioning, solve_near
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Part
from tests.correction.controller_language import (
    F,
    RapidCell,
    Record,
    Stopped,
    UrCell,
    krl_frame,
    krl_functions,
    krl_pose,
    matrix,
    rapid_functions,
    ur_matrix,
    ur_pose,
    urscript_functions,
)

BASE = se3.pose(se3.exp(np.array([0.0, 0.0, 0.7])), np.array([0.4, -0.3, 0.6]))
TABLE = se3.pose(se3.exp(np.array([0.1, -0.2, 1.2])), np.array([1.1, 0.5, 0.3]))
SPINDLE = se3.pose(se3.exp(np.array([0.3, 1.1, -0.4])), np.array([0.05, -0.03, 0.25]))


def needed_joints(calibration, q):
    """Joints at which the calibrated robot is where the nominal one is at q."""
    target = ErrorModel(calibration.model.robot).poses(q) @ se3.inverse(calibration.model.robot.T_flange_tool)
    needed = solve_near(calibration.model, target @ se3.inverse(_flange_in_tool(calibration)), q, calibration.estimate)
    assert needed.reached.all()
    return needed.q


def wanted_targets(calibration, q):
    """Targets that the nominal robot meets at q, and what the calibrated one needs instead: both in the table's frame."""
    robot, own = calibration.model.robot, se3.inverse(calibration.model.robot.T_flange_tool)
    nominal = ErrorModel(robot)
    target = nominal.poses(q) @ own @ SPINDLE
    corrected = nominal.poses(needed_joints(calibration, q)) @ own @ SPINDLE
    in_table = se3.inverse(TABLE) @ BASE
    return in_table @ target, in_table @ corrected


def postures(robot, count):
    rng = np.random.default_rng(1)
    q = rng.uniform(*(0.5 * np.clip(robot.limits, -3.0, 3.0)).T, size=(6 * count, 6))
    model = ErrorModel(robot)
    good = robot.inside_limits(q)
    return q[good][conditioning(model, q[good]) > 0.03][:count]


def program(text="MODULE a\nPROC main()\nENDPROC\nENDMODULE\n"):
    return read_rapid([Source.of(Path("a.mod"), text.encode())])


def errors_of_rapid(calibration, q):
    """Distance at the tool between what the module's text gives and what is needed, metres and radians."""
    robot = calibration.model.robot
    text = rapid_helper(
        calibration, program(), Cell(T_world_base=BASE), Bounds(shift=0.05, turn=0.2, joint=1.0)
    ).source.text
    cell = RapidCell(robot, BASE, TABLE, SPINDLE)
    off = []
    corrected = rapid_functions(text, cell.calc_joint_t)[FUNCTION]
    for cell.seed, target, wanted in zip(q, *wanted_targets(calibration, q), strict=True):
        moved = corrected(cell.target(target), cell.tooldata, cell.wobj)
        off.append(se3.inverse(wanted) @ matrix(moved.trans, moved.rot))
    off = np.array(off)
    return np.linalg.norm(off[:, :3, 3], axis=1), np.linalg.norm(se3.log(off[:, :3, :3]), axis=1)


def test_rapid_computes_the_correction_in_single_precision(calibration):
    """Of a robot with a closed loop and drives that yield."""
    distance, turn = errors_of_rapid(calibration, postures(calibration.model.robot, 60))
    assert distance.max() < 1e-5
    assert turn.max() < 1e-5


def errors_of_krl(calibration, q, begin, keyword):
    """Distance at the tool between what the module's functions give and what is needed, metres and radians.

    Args:
        calibration: of the robot.
        q: joints of the targets.
        begin: joints where each motion begins.
        keyword: of the motions, and what the target is: PTP and LIN to an E6POS, FRAME.
    """
    robot = calibration.model.robot
    functions, off = at_table(calibration), []
    for at, first, target, wanted in zip(q, begin, *wanted_targets(calibration, q), strict=True):
        stated, here = StatusTurn(S=0, T=0).of(robot, at), StatusTurn(S=0, T=0).of(robot, first)
        functions["S_AXIS_ACT"] = Record(**{f"A{k}": F(angle) for k, angle in enumerate(np.degrees(first), start=1)})
        functions["S_POS_ACT"] = Record(S=here.S, T=here.T)
        point = krl_frame(target)
        if keyword != "FRAME":
            point.S, point.T = (stated.S, stated.T) if keyword == "PTP" else (7 - stated.S, 63 - stated.T)
        moved = functions[FUNCTION + {"PTP": "", "LIN": "Path", "FRAME": "Frame"}[keyword]](point)
        off.append(se3.inverse(wanted) @ krl_pose(moved))
        if keyword == "PTP":
            assert moved.S == stated.S
            assert abs(moved.T - stated.T) in (0, 1, 2, 4, 8, 16, 32)
    off = np.array(off)
    return np.linalg.norm(off[:, :3, 3], axis=1), np.linalg.norm(se3.log(off[:, :3, :3]), axis=1)


@pytest.mark.parametrize("keyword", ["PTP", "LIN", "FRAME"])
def test_krl_computes_the_correction_in_single_precision(krl_calibration, keyword):
    """Of a PTP by the status and turn of its point; of all else by those with which the motion begins."""
    robot = krl_calibration.model.robot
    q = postures(robot, 40)
    begin = np.roll(q, 1, axis=0)
    if keyword != "PTP":
        status = np.array([StatusTurn(S=0, T=None).of(robot, one).S for one in q])
        same = status == np.roll(status, 1)
        q, begin = q[same], begin[same]
    distance, turn = errors_of_krl(krl_calibration, q, begin, keyword)
    assert len(q) > 5
    assert distance.max() < 1e-5
    assert turn.max() < 1e-5


def test_krl_tells_where_the_tool_truly_is(krl_calibration):
    """From the nominal robot's place, of which motions by a distance begin; unless that is of another tool."""
    off = []
    for functions, target in corrected_places(krl_calibration):
        off.append(se3.inverse(target) @ krl_pose(functions[f"{FUNCTION}Here"]()))
    off = np.array(off)
    assert np.linalg.norm(off[:, :3, 3], axis=1).max() < 1e-5
    assert np.linalg.norm(se3.log(off[:, :3, :3]), axis=1).max() < 1e-5
    functions["S_TOOL"] = krl_frame(se3.translation(z=1e-3) @ SPINDLE)
    with pytest.raises(Stopped):
        functions[f"{FUNCTION}Here"]()


def test_krl_finds_the_end_of_an_arc_from_where_the_tool_truly_is(krl_calibration):
    """On random circles; and stops where single precision would not tell the end to 0.01 mm."""
    rng, off, stops = np.random.default_rng(4), [], 0
    for functions, start in corrected_places(krl_calibration):
        axes = np.linalg.qr(rng.normal(size=(3, 3)))[0][:2] * rng.uniform(0.01, 0.2)
        centre = start[:3, 3] - axes[0]
        via, last = np.cumsum(rng.uniform(4.0, 170.0, size=2))
        angle = rng.uniform(-340.0, 340.0)
        x, y = np.cos(np.radians([via, last, angle])), np.sin(np.radians([via, last, angle]))
        points = centre + np.stack([x, y], axis=1) @ axes
        frames = [krl_frame(se3.pose(start[:3, :3], point)) for point in points[:2]]
        try:
            off.append(krl_pose(functions[f"{FUNCTION}Arc"](*frames, F(angle)))[:3, 3] - points[2])
        except Stopped:
            stops += 1
    assert np.linalg.norm(off, axis=1).max() < 1e-5
    assert 0 < stops < len(off)


def corrected_places(calibration):
    """Functions of the helper where the tool truly is at a target, each with that."""
    robot, functions = calibration.model.robot, at_table(calibration)
    q = postures(robot, 40)
    for at, target, corrected in zip(needed_joints(calibration, q), *wanted_targets(calibration, q), strict=True):
        functions["S_AXIS_ACT"] = Record(**{f"A{k}": F(angle) for k, angle in enumerate(np.degrees(at), start=1)})
        functions["S_POS_ACT"] = krl_frame(corrected)
        functions["S_POS_ACT"].S = StatusTurn(S=0, T=0).of(robot, at).S
        yield functions, target


def at_table(calibration):
    """Functions of the helper in KRL, with the spindle and the table active."""
    text = krl_helper(
        calibration, program(), Cell(T_world_base=BASE), Bounds(shift=0.05, turn=0.2, joint=1.0)
    ).source.text
    return krl_functions(text, S_BASE=krl_frame(TABLE), S_TOOL=krl_frame(SPINDLE))


def urscript(calibration, cell):
    """The functions of the helper."""
    text = urscript_helper(calibration, program(), Cell(T_world_base=BASE), Bounds(shift=0.05, turn=0.2, joint=1.0))
    return urscript_functions(text.source.text, cell)


def errors_of_urscript(calibration, q):
    """The same of URScript, of poses in the robot's base, and of joint positions."""
    cell = UrCell(calibration.model.robot, SPINDLE)
    functions, off = urscript(calibration, cell), []
    in_base = se3.inverse(BASE) @ TABLE
    for near, target, wanted in zip(q, *wanted_targets(calibration, q), strict=True):
        moved = functions["taskcal_corrected"](ur_pose(in_base @ target), [np.float32(angle) for angle in near])
        driven = functions["taskcal_corrected_joints"]([np.float32(angle) for angle in near])
        off += [se3.inverse(in_base @ wanted) @ ur_matrix(pose) for pose in (moved, cell.forward(driven))]
    off = np.array(off)
    return np.linalg.norm(off[:, :3, 3], axis=1), np.linalg.norm(se3.log(off[:, :3, :3]), axis=1)


def test_urscript_computes_the_correction_in_single_precision(calibration):
    distance, turn = errors_of_urscript(calibration, postures(calibration.model.robot, 60))
    assert distance.max() < 1e-5
    assert turn.max() < 1e-5


def test_urscript_stops_on_a_controller_of_another_arm(calibration, robot):
    """Its own factory calibration, for example: a tenth of a millimetre in one length."""
    joints = [replace(robot.joints[0], after=(Part(transform=se3.translation(x=1e-4)), *robot.joints[0].after))]
    cell = UrCell(replace(robot, joints=(*joints, *robot.joints[1:])), SPINDLE)
    (near,) = postures(robot, 1)
    with pytest.raises(Stopped, match="kinematics are not those of the robot file"):
        urscript(calibration, cell)["taskcal_corrected_joints"]([np.float32(angle) for angle in near])


@pytest.mark.parametrize(
    ("helper", "line", "name"), [(rapid_helper, 120, 32), (krl_helper, 140, 24), (urscript_helper, 400, 32)]
)
def test_helpers_keep_to_lengths_of_lines_and_names(krl_calibration, helper, line, name):
    text = helper(krl_calibration, program(), Cell(), Bounds()).source.text
    assert max(map(len, text.splitlines())) <= line
    assert max(map(len, re.findall(r"\w+", text))) <= name
    assert "@" not in text


def stops(calibration, cell, tooldata=(), wobj=(), extax=()):
    """Whether the module's text stops at once, with other data of a tool, a work object and external axes."""
    robot = calibration.model.robot
    bounds = Bounds(shift=0.05, turn=0.2, joint=1.0)
    module = rapid_helper(calibration, program(), replace(cell, T_world_base=BASE), bounds)
    on = RapidCell(robot, BASE, TABLE, SPINDLE)
    (on.seed,) = q = postures(robot, 1)
    target = on.target(wanted_targets(calibration, q)[0][0])
    for record, given in ((on.tooldata, tooldata), (on.wobj, wobj), (target.extax, extax)):
        for name, value in dict(given).items():
            setattr(record, name, value)
    try:
        rapid_functions(module.source.text, on.calc_joint_t)[FUNCTION](target, on.tooldata, on.wobj)
    except Stopped:
        return True, module
    return False, module


def declared(value):
    return str(value).upper()


@pytest.mark.parametrize(
    ("held", "in_hand", "fixed", "unit"), [*product((True, False), (True, False), (True, False), ("CNV1", ""))]
)
def test_rapid_is_wrapped_where_the_module_does_not_stop_at_once(held, in_hand, fixed, unit, calibration):
    """By the flags of tool and work object: with a conveyor's, one in the hand, or a tool that stands still, it only stops."""
    stopped, module = stops(calibration, Cell(), {"robhold": held}, {"robhold": in_hand, "ufprog": fixed})
    text = f"""MODULE a
PERS tooldata t:=[{declared(held)},[[0,0,120],[1,0,0,0]],[1,[0,0,50],[1,0,0,0],0,0,0]];
PERS wobjdata w:=[{declared(in_hand)},{declared(fixed)},"{unit}",[[300,0,50],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
PROC main()
VAR robtarget p;
Ask p;
MoveL p,v100,fine,t\\WObj:=w;
ENDPROC
ENDMODULE
"""
    wrapping = module.wrap(program(text))
    assert bool(wrapping.wrapped) is not stopped
    assert any("would only stop the program" in one.text for one in wrapping.left) is stopped


@pytest.mark.parametrize("given", [{}, {1: 0.0}, {1: 250.0}, {2: 250.0}, {1: 250.0, 3: 1.0}, {6: -1.0}])
@pytest.mark.parametrize("nothing", [(), (1,), (1, 3), (2, 6)])
def test_so_are_motions_whose_text_others_have(given, nothing, calibration, make_moves, middle):
    """By the places of their external axes, of which some carry nothing."""
    cell = Cell(axes=tuple(ExternalAxis(number=number, carries="nothing") for number in nothing))
    stopped, module = stops(calibration, cell, extax={f"eax_{'abcdef'[k - 1]}": F(v) for k, v in given.items()})
    move = replace(make_moves([middle])[0], external=tuple(given.get(k, np.nan) for k in range(1, 7)))
    assert module._stops_at(move) is stopped
    assert module._stops_at(replace(move, carrier="CNV1"))
    assert module._stops_at(replace(move, part_in_hand=True))

"""A posture is never guessed: what is corrected is right in every posture in which a controller may drive there.

The robots' joints are Pinocchio's; the postures of a pose are found from random ones.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robot_programs.core.source import Source
from robot_programs.reading import parse_program
from taskcal.correction.cell import Cell, Measured
from taskcal.correction.correct import correct
from taskcal.correction.options import Bounds
from taskcal.geometry import se3
from tests.correction.by_pinocchio import TOOL, defective, true_tool
from tests.robot_programs.written import krl_frame, krl_joints, urscript_joints, urscript_pose

FINE = Bounds(tolerance=1e-5, shift=0.05, turn=0.2)
UNTOLD = "the text does not tell in which posture the robot reaches it"


STARTS = {"ur5": [10.0, -70.0, 90.0, -100.0, -80.0, 20.0], "kuka-kr16-2": [10.0, -70.0, 80.0, 20.0, 50.0, 30.0]}
"""Joint positions, degrees."""


@pytest.fixture(scope="module", params=STARTS)
def true_robot(request):
    return defective(request.param, np.radians(STARTS[request.param]))


class Written:
    """A program in the robot's language."""

    def __init__(self, robot):
        self.is_krl = robot.name.startswith("kuka")

    def joints(self, q):
        if self.is_krl:
            return f"PTP {krl_joints(q)}"
        return f"movej({urscript_joints(q)})"

    def move(self, kind, *T):
        if self.is_krl:
            return f"{ {'joint': 'PTP', 'line': 'LIN', 'arc': 'CIRC'}[kind] } {', '.join(map(krl_frame, T))}"
        return f"{ {'joint': 'movej', 'line': 'movel', 'arc': 'movec'}[kind] }({', '.join(map(urscript_pose, T))})"

    @property
    def strange(self):
        return "GRIP ( )" if self.is_krl else "gripper_close(40)"

    def loop(self, *lines):
        return ["LOOP", *lines, "ENDLOOP"] if self.is_krl else ["while True:", *lines, "end"]

    def branch(self, *lines):
        return ["IF $IN[1] THEN", *lines, "ENDIF"] if self.is_krl else ["if get_standard_digital_in(1):", *lines, "end"]

    def routine(self, lines, inside):
        """A program that calls a routine."""
        if self.is_krl:
            return [*lines, "END", "DEF GO ( )", *inside]
        return ["def go():", *inside, "end", *lines]

    @property
    def call(self):
        return "GO ( )" if self.is_krl else "go()"

    def read(self, lines, robot):
        if self.is_krl:
            text = ["DEF P ( )", f"$TOOL={krl_frame(TOOL)}", "$BASE=$NULLFRAME", "$VEL.CP=0.1", *lines, "END", ""]
            return parse_program((Source.of(Path("p.src"), "\n".join(text).encode()),), robot=robot)
        text = ["def p():", f"set_tcp({urscript_pose(TOOL)})", *lines, "end", ""]
        return parse_program((Source.of(Path("p.script"), "\n".join(text).encode()),), robot=robot)


def postures(chain, robot, flange, rng):
    """Joint positions inside the limits at a pose of the flange, one for each posture."""
    found = []
    for seed in rng.uniform(-np.pi, np.pi, (300, 6)):
        q = chain.joints(flange @ robot.T_flange_tool, seed)
        q = (q + np.pi) % (2.0 * np.pi) - np.pi
        inside = robot.inside_limits(q[None])[0] or robot.inside_limits((q + 2 * np.pi * (q < 0))[None])[0]
        met = np.abs(chain.pose(q) - flange @ robot.T_flange_tool).max() < 1e-9
        if inside and met and not any(np.abs(np.angle(np.exp(1j * (q - one)))).max() < 1e-4 for one in found):
            found.append(q)
    return found


def corrected(true_robot, lines, cell=None):
    calibration, robot = true_robot[0], true_robot[0].model.robot
    program = Written(robot).read(lines, robot)
    found = correct(calibration, program, cell=cell, bounds=FINE, accept_uncertain=True)
    return program, found, program.reread(found.sources)


def errors(true_robot, move, wanted, near):
    """Distance of the true tool from where it is wanted, from some joint positions."""
    calibration, chain, _ = true_robot
    got = true_tool(calibration, chain, move.part.T @ move.end.T @ np.linalg.inv(TOOL), near, TOOL)
    return float(np.linalg.norm(got[:3, 3] - wanted[:3, 3]))


def near_start(true_robot, rng):
    """A pose near that of the start, and one half of the way there, for an arc."""
    _, chain, q = true_robot
    start = chain.pose(q) @ np.linalg.inv(true_robot[0].model.robot.T_flange_tool) @ TOOL
    turn, way = rng.uniform(-0.1, 0.1, 3), rng.uniform(0.02, 0.04, 3)
    aside = 0.3 * np.cross(way, [0.0, 0.0, 1.0])
    return [start @ se3.pose(se3.exp(turn), way), start @ se3.pose(se3.exp(0.5 * turn), 0.5 * way + aside)]


KNOWN = ["joint", "line", "after arc", "called", "loop", "branch", "two calls"]
NOT_KNOWN = [
    "at start",
    "after strange",
    "line at start",
    "in loop after strange",
    "called after strange",
    "after what stays",
]


def program_of(kind, written, q, T, via):
    home, line, arc = written.joints(q), written.move("line", T), written.move("arc", via, T)
    match kind:
        case "joint":
            return [home, written.move("joint", T)]
        case "line":
            return [home, line]
        case "after arc":
            return [home, arc, line]
        case "called":
            return written.routine([home, written.move("line", via), written.call], [line])
        case "two calls":
            return written.routine([home, written.call, written.move("line", via), written.call], [line])
        case "loop":
            return [home, *written.loop(line, written.move("line", via))]
        case "branch":
            return [home, *written.branch(written.move("line", via)), line]
        case "at start":
            return [written.move("joint", T), home]
        case "line at start":
            return [line, home]
        case "after strange":
            return [home, written.strange, line]
        case "in loop after strange":
            return [home, *written.loop(line, written.strange)]
        case "after what stays":
            return [home, written.move("line", se3.translation(9.0) @ T), line]
        case _:
            return written.routine([home, written.strange, written.call], [line])


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", KNOWN)
def test_a_posture_that_the_text_tells_is_corrected_for(kind, seed, true_robot):
    calibration, chain, q = true_robot
    T, via = near_start(true_robot, np.random.default_rng(seed))
    program, found, again = corrected(true_robot, program_of(kind, Written(calibration.model.robot), q, T, via))
    assert not found.rejected
    assert len(found.corrected) == len(program.motions)
    near = chain.joints(T @ np.linalg.inv(TOOL) @ calibration.model.robot.T_flange_tool, q)
    at = [k for k, move in enumerate(program.motions) if move.end.T is not None and np.abs(move.end.T - T).max() < 1e-6]
    assert at
    for k in at:
        written = again.motions[int(np.cumsum(found.pieces)[k]) - 1]
        assert errors(true_robot, written, T, near) < 2e-6


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", NOT_KNOWN)
def test_a_posture_that_the_text_does_not_tell_is_not_guessed(kind, seed, true_robot):
    """The motion stays, where two postures need corrections that differ."""
    calibration, chain, q = true_robot
    robot, rng = calibration.model.robot, np.random.default_rng(seed)
    T, via = near_start(true_robot, rng)
    program, found, _ = corrected(true_robot, program_of(kind, Written(robot), q, T, via))
    possible = postures(chain, robot, T @ np.linalg.inv(TOOL), rng)
    assert len(possible) > 1
    at = [move.end.T is not None and np.abs(move.end.T - T).max() < 1e-6 for move in program.motions]
    (k,) = np.flatnonzero(at)
    off = [errors(true_robot, program.motions[k], T, q) for q in possible]
    assert max(off) > 1e-4
    assert found.rejected[k].startswith(UNTOLD)
    line = program.motions[k].place.line - 1
    was, now = (one.sources[0].text.split("\n")[line] for one in (program, found))
    assert now == was


@pytest.mark.parametrize(("share", "alike"), [(0.0, True), (0.003, True), (0.3, False)])
def test_postures_that_are_corrected_alike_are_corrected_and_what_they_differ_by_is_an_error(share, alike):
    """Of a part that was measured elsewhere, and a robot with a share of its defects."""
    q = np.radians([10.0, -70.0, 90.0, -100.0, -80.0, 20.0])
    calibration, chain, _ = defective("ur5", q)
    rng, robot = np.random.default_rng(3), calibration.model.robot
    base, targets = calibration.layout.frames(share * calibration.z)
    calibration = replace(calibration, z=share * calibration.z, T_tracker_base=base, T_tool_target=targets)
    own = (calibration, chain, q)
    T, _ = near_start(own, rng)
    moved = se3.translation(4e-4, -3e-4, 2e-4)
    cell = Cell(
        tools={"tcp": Measured(name="TCP", in_flange=TOOL, uncertainty=1e-6)},
        parts={"base": Measured(name="Base", in_tracker=calibration.T_tracker_base @ moved, uncertainty=1e-6)},
    )
    _, found, again = corrected(own, [Written(robot).move("line", T)], cell)
    worst = 0.0
    for at in postures(chain, robot, T @ np.linalg.inv(TOOL), rng):
        move = again.motions[0]
        driven = chain.joints(move.end.T @ np.linalg.inv(TOOL) @ robot.T_flange_tool, at)
        true = (
            se3.inverse(moved) @ calibration.tool_in_base(driven[None])[0] @ np.linalg.inv(robot.T_flange_tool) @ TOOL
        )
        worst = max(worst, float(np.linalg.norm(true[:3, 3] - T[:3, 3])))
    if not alike:
        assert found.rejected[0].startswith(UNTOLD)
        return
    assert not found.rejected
    assert worst < 2e-5 + 1e-7
    assert abs(found.after.length[-1] - worst) < 1e-7
    assert (worst > 1e-6) == (share > 0.0)


@pytest.mark.parametrize("kind", ["line", "joint"])
def test_a_loop_that_comes_back_in_another_posture_is_not_corrected_for_one(kind, true_robot):
    calibration, chain, _ = true_robot
    robot, rng = calibration.model.robot, np.random.default_rng(5)
    written, (T, _) = Written(robot), near_start(true_robot, rng)
    first, *others = postures(chain, robot, T @ np.linalg.inv(TOOL), rng)
    for back, known in ((first, True), (next(one for one in others if np.abs(one - first).max() > 0.5), False)):
        lines = [written.joints(first), *written.loop(written.move(kind, T), written.joints(back))]
        program, found, _ = corrected(true_robot, lines)
        (k,) = [k for k, move in enumerate(program.motions) if move.end.T is not None]
        assert program.motions[k].begins_at_motion
        assert (k not in found.rejected) == known
        if not known:
            assert (
                "begins in several places" in found.rejected[k] or "corrections of those possible" in found.rejected[k]
            )

"""What the user of a corrected program is told."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robot_programs.core.program import Program
from robot_programs.core.source import Source
from taskcal.correction.cell import Cell, Measured
from taskcal.correction.controller import TURN_SPEED_RAD_S, JointMotion
from taskcal.correction.correct import diagnose, diagnose_unchanged_files, diagnose_unused_frames


class Motions(Program):
    """A program that is nothing but its motions: to say what is wrong with it, nothing is written or read again."""

    def rewrite(self, robot, waypoints):
        pytest.fail("a diagnosis rewrites no program")

    def reread(self, sources):
        pytest.fail("a diagnosis reads no program again")


@pytest.fixture
def program(make_moves, shifted):
    motions = tuple(make_moves([shifted(20 * k, 0, 0) for k in range(3)]))
    source = Source.of(motions[0].place.path, b"")
    return Motions(sources=(source,), motions=motions, diagnostics=())


def test_diagnose_unchanged_files_names_them(program):
    """A file of motions whose points stand in another one, as in KRL, keeps its text and is not named."""
    two = replace(program, sources=(*program.sources, Source.of(Path("points.dat"), b"")))
    assert diagnose_unchanged_files(two, {0, 1}) == []
    (named,) = diagnose_unchanged_files(two, {0, 1, 2})
    assert named.place.path == program.sources[0].path
    assert diagnose_unchanged_files(program, {0, 1, 2}) == []


def calm(robot, **changes):
    """Joints that hardly move."""
    still = np.zeros(len(robot.joints))
    motion = JointMotion(robot=robot, speed=still, acceleration=still, conditioning=0.5, nearest_singular=None)
    return replace(motion, **changes)


def said(program, corrected, motion, deviation=(0.0, 0.0, 0.0), tolerance=2e-5):
    trajectory, subdivision = corrected([0.0] * 3, [0.0] * 3, [0.0] * 3)
    subdivision = replace(subdivision, deviation=np.array(deviation), tolerance=tolerance)
    origin = [(i, 0.0, 1.0) for i in range(3)]
    return diagnose(program, trajectory, trajectory, origin, program.motions, subdivision, motion)


def test_nothing_is_said_where_there_is_nothing_to_say(robot, program, corrected):
    assert said(program, corrected, calm(robot)) == ()


def test_a_motion_that_leaves_its_path_is_named_by_its_line(robot, program, corrected):
    (diagnostic,) = said(program, corrected, calm(robot), deviation=(0.0, 3e-5, 1e-5))
    assert diagnostic.place == program.motions[1].place
    assert "leaves its path by 0.030 mm" in diagnostic.text
    assert said(program, corrected, calm(robot), deviation=(0.0, 3e-5, 1e-5), tolerance=1e-4) == ()


def test_too_fast_joints_are_named_with_their_ratio(robot, program, corrected):
    """Joints that would have to be too fast are named with how much."""
    speed = np.zeros(len(robot.joints))
    speed[2] = 1.5 * robot.speed_limits[2]
    (diagnostic,) = said(program, corrected, calm(robot, speed=speed))
    assert diagnostic.text.startswith(f"{robot.joint_names[2]} would have to turn 1.50 times as fast as it can")


def test_singular_posture_is_named_by_its_motion(robot, program, corrected):
    """A singular posture is named by the motion that passes it."""
    (diagnostic,) = said(program, corrected, calm(robot, conditioning=0.01, nearest_singular=2))
    assert diagnostic.place == program.motions[2].place
    assert "passes near a singular posture (ratio 0.010)" in diagnostic.text


def test_an_assumed_turning_speed_is_said_in_degrees_per_second(robot, program, corrected):
    (diagnostic,) = said(program, corrected, calm(robot, turn_speed_assumed=1))
    assert diagnostic.place == program.motions[1].place
    assert f"those at {round(180.0 / np.pi * TURN_SPEED_RAD_S)}°/s from here on" in diagnostic.text


def test_unused_frames_are_named_with_the_used_ones(program):
    """Tools and parts that no motion has are named with those that it has."""
    cell = Cell(tools={"spindle": Measured(name="spindle"), "spidnle": Measured(name="spidnle")})
    (diagnostic,) = diagnose_unused_frames(cell, program)
    assert diagnostic.text == "no motion has the cell's tool 'spidnle'; the program's: spindle"
    probe = Measured(name="part", touched=np.zeros((3, 6)), touched_with="spidnle")
    touching = replace(cell, parts={"base": replace(probe, name="base")})
    assert diagnose_unused_frames(touching, program) == []


def test_corners_of_unknown_size_are_said_once_with_how_many(robot, program, corrected):
    unknown = replace(program, motions=tuple(replace(move, zone=None) for move in program.motions))
    (diagnostic,) = said(unknown, corrected, calm(robot))
    assert diagnostic.place == program.motions[0].place
    assert "in a corner whose size is not known, as 2 others do" in diagnostic.text
    stopping = replace(unknown, motions=tuple(replace(move, stops=True) for move in unknown.motions))
    assert said(stopping, corrected, calm(robot)) == ()

"""Frames and registers of a backup."""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from robot_programs.core.source import Source
from robot_programs.tp.listing import read_variables
from tests.robot_programs.tp.samples import backup, degrees


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


def test_a_frame_with_a_number_that_runs_into_something_else_is_not_read():
    system, registers = backup()
    damaged = Source.of(system.path, system.text.replace("1500.000 ", "1500.0e1 ").encode())
    assert set(read_variables([damaged, registers]).frames) == {2}

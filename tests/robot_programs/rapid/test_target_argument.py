"""Targets with Offs and RelTool around them."""

import numpy as np

from robot_programs.rapid.read import read_rapid
from taskcal.geometry import se3
from tests.robot_programs.rapid.diagnosed import pose
from tests.robot_programs.rapid.samples import module


def test_offs_shifts_by_work_object_and_reltool_by_tool():
    """Offs goes along the work object and reltool along the tool."""
    declarations = (
        "CONST robtarget p:=[[10,20,30],[0.5,0.5,0.5,0.5],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];CONST num h:=7;"
    )
    body = "MoveL Offs(p,1,-2,h+1),v100,fine,tool0;MoveL RelTool(p,1,2,h\\Rx:=10\\Ry:=-20\\Rz:=30),v100,fine,tool0;"
    a, b = read_rapid([module(body, declarations)]).motions
    np.testing.assert_allclose(a.end.T, pose([11, 18, 38], [0.5, 0.5, 0.5, 0.5]), atol=1e-12)
    turned = pose([10, 20, 30], [0.5, 0.5, 0.5, 0.5]) @ pose([1, 2, 7], [1, 0, 0, 0])
    for axis, angle in zip("xyz", (10, -20, 30), strict=True):
        turned = turned @ se3.rotation(axis, np.radians(angle))
    np.testing.assert_allclose(b.end.T, turned, atol=1e-12)

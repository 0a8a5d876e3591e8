"""FANUC's world frame, and frames by number."""

import numpy as np
import pytest

from robot_programs.core.program import Frame, Unresolved
from robot_programs.tp.listing import read_variables
from robot_programs.tp.read import Frames, world_in_base
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.robot.catalogue import load_robot
from tests.robot_programs.tp.samples import R2000, backup


@pytest.mark.parametrize(
    ("name", "height_mm"),
    [("fanuc-r2000ic-165f", 670.0), ("abb-irb120", 290.0), ("fanuc-lrmate-200id", 0.0), ("fanuc-m20ia", 0.0)],
)
def test_the_world_lies_on_axis_1_at_the_height_of_axis_2(name, height_mm):
    np.testing.assert_allclose(world_in_base(load_robot(name)), se3.translation(z=height_mm * 1e-3), atol=1e-9)


def test_an_arm_of_parallel_axes_has_none():
    with pytest.raises(TaskcalError, match=r"has no two turning axes|are parallel"):
        world_in_base(load_robot("denso-hsr065a1"))


def frames(**given: Frame | None) -> Frames:
    return Frames(
        variables=read_variables(backup()),
        T_base_world=world_in_base(R2000),
        changed_frames=frozenset({2}),
        changed_tools=frozenset({None}),
        tool=given.get("tool"),
        part=given.get("part"),
    )


def test_user_frames_are_counted_in_the_world():
    known = frames()
    np.testing.assert_allclose(known.user_frame(1).T[:3, 3], [1.5, -0.2, 0.07])
    np.testing.assert_allclose(known.user_frame(0).T, se3.translation(z=0.67), atol=1e-12)
    assert known.user_frame(1) is known.user_frame(1)
    given = frames(part=Frame(name="table", T=se3.translation(1.0))).user_frame(7)
    assert given.name == "table"
    np.testing.assert_allclose(given.T[:3, 3], [1.0, 0.0, 0.67])


def test_frames_that_are_not_known_say_what_would_work():
    with pytest.raises(Unresolved, match=r"UFRAME 7 is not known; pass the backup's sysframe.va .* \(--part\)"):
        frames().user_frame(7)
    with pytest.raises(Unresolved, match=r"UFRAME\[2\] is set in the program"):
        frames().user_frame(2)
    with pytest.raises(Unresolved, match=r"UTOOL\[1\] is set in the program"):
        frames().tool_frame(1)

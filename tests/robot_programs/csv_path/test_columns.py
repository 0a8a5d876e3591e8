"""What the columns of a path mean."""

import numpy as np
import pytest

from taskcal.errors import FileError
from tests.robot_programs.csv_path.texts import ROBOT, read


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

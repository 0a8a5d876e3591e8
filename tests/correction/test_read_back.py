import numpy as np
import pytest

from robot_programs.core.program import Waypoint
from robot_programs.rapid.read import read_rapid
from taskcal.correction.correct import check_reading
from taskcal.errors import TaskcalError
from tests.robot_programs.rapid.samples import POINTS, module


@pytest.mark.parametrize(("off_mm", "fine"), [(0.0, True), (0.02, True), (0.05, False)])
def test_read_back_beside_the_target_is_an_error(off_mm, fine):
    """A target that reads beside what was to be written is an error."""
    motions = read_rapid(
        [module("MoveL p1,v5,fine,tool0;MoveL p2,v5,fine,tool0;MoveL p3,v5,fine,tool0;", POINTS)]
    ).motions
    T = motions[2].end.T.copy()
    T[0, 3] += off_mm * 1e-3
    path = (
        Waypoint(kind="linear", q=np.zeros(6), T=motions[1].end.T),
        Waypoint(kind="linear", q=np.zeros(6), T=T),
    )
    pieces = np.array([1, 2])
    if fine:
        check_reading(motions, pieces, {1: path}, 2e-5)
    else:
        with pytest.raises(TaskcalError, match=r"part.mod:13: the corrected program reads 0.050 mm beside"):
            check_reading(motions, pieces, {1: path}, 2e-5)

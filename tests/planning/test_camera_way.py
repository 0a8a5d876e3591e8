from dataclasses import replace

import numpy as np
import pytest

from taskcal.errors import ReachError
from taskcal.geometry import se3
from taskcal.kinematics.clearance import Box
from taskcal.observations.instrument import find_measurable
from tests.planning.without_tracker import MODEL, TASK, TIP, plan_of, way_of

WAY = way_of("camera")


def test_landmarks_are_in_view_in_range_and_not_oblique():
    """Every landmark is in the image, within range and not too oblique."""
    made = plan_of("camera")
    camera = MODEL.poses(made.q) @ TIP
    seen = se3.apply(se3.inverse(camera), WAY.fixtures.position[made.of])
    distance = np.linalg.norm(seen, axis=1)
    assert WAY.nearest - 1e-6 <= distance.min() <= distance.max() <= WAY.farthest + 1e-6
    assert np.arccos(seen[:, 2] / distance).max() <= 0.5 * WAY.field_of_view + 1e-6
    sight = camera[:, :3, 3] - WAY.fixtures.position[made.of]
    tilt = np.arccos((sight * WAY.fixtures.direction[made.of]).sum(axis=1) / distance)
    assert tilt.max() <= WAY.tilt + 1e-6


def test_a_landmark_behind_a_box_is_not_seen():
    middle = WAY.fixtures.position[0] + [0.0, 0.0, 0.1]
    box = Box(pose=se3.translation(*middle), size=np.array([0.5, 0.5, 0.02]))
    with pytest.raises(ReachError, match=r"landmark 'a' cannot be measured"):
        find_measurable(MODEL, TASK, replace(WAY, keep_out=(box,)), 60, 0)


def test_a_board_is_predicted_as_the_camera_turns():
    way, made = way_of("board"), plan_of("camera")
    camera = MODEL.poses(made.q) @ TIP
    R = way.rotations(camera, made.of)
    assert R is not None
    back = camera[:, :3, :3] @ R
    np.testing.assert_allclose(back[:, :, 2], way.fixtures.direction[made.of], atol=1e-9)
    assert WAY.rotations(camera, made.of) is None

from dataclasses import replace

import numpy as np
import pytest

from taskcal.errors import ReachError
from taskcal.geometry import se3
from taskcal.kinematics.clearance import Box
from taskcal.observations.instrument import find_measurable
from tests.planning.without_tracker import MODEL, TASK, TIP, instrument_of, plan_of

INSTRUMENT = instrument_of("camera")


def test_landmarks_are_in_view_in_range_and_not_oblique():
    """Every landmark is in the image, within range and not too oblique."""
    made = plan_of("camera")
    camera = MODEL.poses(made.q) @ TIP
    seen = se3.apply(se3.inverse(camera), INSTRUMENT.fixtures.position[made.of])
    distance = np.linalg.norm(seen, axis=1)
    assert INSTRUMENT.depths[0] - 1e-6 <= distance.min() <= distance.max() <= INSTRUMENT.depths[1] + 1e-6
    assert np.arccos(seen[:, 2] / distance).max() <= 0.5 * INSTRUMENT.field_of_view + 1e-6
    sight = camera[:, :3, 3] - INSTRUMENT.fixtures.position[made.of]
    tilt = np.arccos((sight * INSTRUMENT.fixtures.direction[made.of]).sum(axis=1) / distance)
    assert tilt.max() <= INSTRUMENT.tilt + 1e-6


def test_a_landmark_behind_a_box_is_not_seen():
    middle = INSTRUMENT.fixtures.position[0] + [0.0, 0.0, 0.1]
    box = Box(pose=se3.translation(*middle), size=np.array([0.5, 0.5, 0.02]))
    with pytest.raises(ReachError, match=r"landmark 'a' cannot be measured"):
        find_measurable(MODEL, TASK, replace(INSTRUMENT, keep_out=(box,)), 60, 0)


def test_a_board_is_predicted_as_the_camera_turns():
    way, made = instrument_of("board"), plan_of("camera")
    camera = MODEL.poses(made.q) @ TIP
    R = way.rotations(camera, made.of)
    assert R is not None
    back = camera[:, :3, :3] @ R
    np.testing.assert_allclose(back[:, :, 2], way.fixtures.direction[made.of], atol=1e-9)
    assert INSTRUMENT.rotations(camera, made.of) is None

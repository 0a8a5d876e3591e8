"""A task and a measuring cell that plans are made for."""

import numpy as np

from taskcal.geometry import se3
from taskcal.kinematics.clearance import Box
from taskcal.observations.point import Reflector, Station
from taskcal_demo.procedure import reference_task

TASK = reference_task()


def cell(**changed) -> Station:
    """A tracker in front of the robot; a box beside its workspace; two reflectors, one seen from one side only."""
    given = {
        "position": np.array([4.5, -1.5, 0.8]),
        "reach": 20.0,
        "nearest": 0.5,
        "reflectors": (
            Reflector(name="ball", position=np.array([0.0, 0.05, 0.0]), axis=None, acceptance=0.5),
            Reflector(name="smr", position=np.array([0.1, 0.0, 0.0]), axis=np.array([0, 0, 1.0]), acceptance=0.6),
        ),
        "keep_out": (Box(pose=se3.translation(1.9, 0.75, 1.2), size=np.array([0.6, 0.6, 1.5])),),
    }
    return Station(**{**given, **changed})

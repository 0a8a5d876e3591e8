"""A small arm before a box in which its tool may turn, for virtual campaigns."""

import numpy as np

from taskcal.geometry import se3
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task, reach_task
from taskcal.task.workspace import Orientation, Workspace

MODEL = ErrorModel(load_robot("abb-irb120"))


def box_before_the_robot(name: str, center: list[float], size: list[float], down: Orientation) -> Task:
    """A box in which the tool may turn."""
    return Task(
        name=name,
        workspace=Workspace(
            T_base_frame=np.eye(4),
            shape="box",
            center=np.array(center),
            size=np.array(size),
            turned=np.eye(3),
            orientations=(down,),
        ),
    )


TASK = box_before_the_robot(
    "box before the robot",
    [0.35, 0.0, 0.35],
    [0.25, 0.5, 0.3],
    Orientation(rotation=se3.rotation("y", np.pi)[:3, :3], cone=np.radians(45.0), spin=np.radians(45.0)),
)


def postures(count: int, seed: int = 0) -> np.ndarray:
    """Joints in the box, radians."""
    reached = reach_task(MODEL, TASK, count + 60, seed).q
    assert len(reached) >= count
    return reached[np.random.default_rng(seed).permutation(len(reached))[:count]]

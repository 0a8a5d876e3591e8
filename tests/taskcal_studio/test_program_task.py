"""A task of a program's targets: the robot's own tool where the program's flange is."""

from pathlib import Path

import numpy as np
import pytest

from robot_programs.reading import read_program
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import load_task, reach_task
from taskcal_studio.task_box import program_poses, task_files

ROBOT = "abb-irb6660-205-1.9"


def rapid(*targets: str) -> str:
    moves = "\n".join(f"    MoveL [{target},[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,fine,tool0;" for target in targets)
    return f"MODULE M\n  PROC main()\n{moves}\n  ENDPROC\nENDMODULE\n"


def test_program_task_places_flange_as_programmed(tmp_path: Path) -> None:
    """The poses of the task place the flange as the program does."""
    robot = load_robot(ROBOT)
    model = ErrorModel(robot)
    flange = model.poses(np.radians([[5.0, 10.0, 20.0, 10.0, 40.0, 0.0], [0.0, 15.0, 20.0, 0.0, 50.0, 10.0]]))
    flange = flange @ se3.inverse(robot.T_flange_tool)
    targets = [
        f"[{','.join(f'{v:.6f}' for v in T[:3, 3] * 1e3)}],[{','.join(f'{v:.9f}' for v in np.roll(q, 1))}]"
        for T, q in zip(flange, se3.to_quaternion(flange[:, :3, :3]), strict=True)
    ]
    (tmp_path / "m.mod").write_text(rapid(*targets))
    task, table = task_files(program_poses(read_program(tmp_path / "m.mod", robot=robot), robot), "m")
    (tmp_path / "m.toml").write_text(task)
    (tmp_path / "m.csv").write_text(table)
    read = load_task(tmp_path / "m.toml")
    assert read.poses is not None
    np.testing.assert_allclose(read.poses @ se3.inverse(robot.T_flange_tool), flange, atol=1e-6)
    assert not reach_task(model, read).unreachable.any()


def test_a_program_without_poses_is_no_task(tmp_path: Path) -> None:
    (tmp_path / "m.mod").write_text(rapid())
    robot = load_robot(ROBOT)
    with pytest.raises(TaskcalError, match="no motions to poses"):
        program_poses(read_program(tmp_path / "m.mod", robot=robot), robot)

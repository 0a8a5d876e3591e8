"""Another convention of the robot's table, or another robot of the same number of joints."""

from collections.abc import Iterator, Mapping
from typing import Any

from taskcal.diagnosis.supposition import Case, Supposition
from taskcal.errors import TaskcalError
from taskcal.robot.catalogue import catalogue_names, load_robot
from taskcal.robot.file import robot_from
from taskcal.robot.robot import Robot

_OTHER = {"dh": "mdh", "mdh": "dh"}
_LONG = {"dh": "standard", "mdh": "modified"}


def robot_mistakes(case: Case) -> Iterator[Supposition]:
    """Other robots that the campaign may belong to, one at a time."""
    yield from _conventions(case)
    own = case.robot
    for name in catalogue_names():
        robot = load_robot(name)
        if name == own.name or robot.prismatic != own.prismatic or robot.description == own.description:
            continue
        yield Supposition(
            id="other-robot",
            subject=(name,),
            robot=robot,
            fix=f"--robot {name}: the campaign fits this robot, not {own.name}",
            cost=0.3,
        )


def _conventions(case: Case) -> Iterator[Supposition]:
    exchanged = other_convention(case.robot)
    if exchanged is None:
        return
    robot, other = exchanged
    yield Supposition(
        id="dh-convention",
        subject=case.robot.joint_names,
        robot=robot,
        fix=f"the table is a {_LONG[other]} Denavit-Hartenberg table: import it with --convention {other}",
        cost=0.05,
    )


def other_convention(robot: Robot) -> tuple[Robot, str] | None:
    """The robot with its table read by the other Denavit-Hartenberg convention, and which that is; None without such a table."""
    joints = robot.description.get("joint", [])
    stated = {key for joint in joints for key in _OTHER if joint.get(key) is not None}
    if len(stated) != 1:
        return None
    (convention,) = stated
    try:
        return robot_from(_exchanged(robot.description, convention)), _OTHER[convention]
    except TaskcalError:
        return None


def _exchanged(description: Mapping[str, Any], convention: str) -> dict[str, Any]:
    def joint(section: Mapping[str, Any]) -> dict[str, Any]:
        return {_OTHER[convention] if key == convention else key: value for key, value in section.items()}

    # what hangs on parameter names of the other convention says nothing of this one
    kept = {
        key: value
        for key, value in description.items()
        if key in ("name", "title", "source", "joint", "tool", "four_bar")
    }
    return {**kept, "joint": [joint(section) for section in description["joint"]]}

"""Where a robot's chain has error frames, and which of their slots are parameters."""

from taskcal.geometry.chain import ErrorFrame, Joint, Step
from taskcal.robot.robot import Part, Robot

COMPONENTS = ("tx", "ty", "tz", "rx", "ry", "rz")


def defect_steps(robot: Robot) -> tuple[list[Step], list[list[str]]]:
    """Steps with an error frame behind every joint, driven ones included, and the tool, and the names of each frame's six slots."""
    steps: list[Step] = []
    slots: list[list[str]] = []

    def defect(name: str) -> None:
        steps.append(ErrorFrame())
        slots.append([f"{name}.{c}" for c in COMPONENTS])

    def add(parts: tuple[Part, ...]) -> None:
        for part in parts:
            steps.append(part.step)
            if part.driven is not None:
                defect(part.driven.name)

    for joint in robot.joints:
        add(joint.before)
        steps.append(Joint(joint.kind))
        defect(joint.name)
        add(joint.after)
    add(robot.tool)
    defect("tool")
    return steps, slots


def length_steps(robot: Robot) -> tuple[list[Step], list[list[str]]]:
    """Steps with an error frame at every nominal length, of which only the length's own slot has a name."""
    steps: list[Step] = []
    slots: list[list[str]] = []

    def add(parts: tuple[Part, ...]) -> None:
        for part in parts:
            steps.append(part.step)
            if part.symbol:
                steps.append(ErrorFrame())
                slots.append([part.symbol if c == part.axis else "" for c in range(6)])

    for joint in robot.joints:
        add(joint.before)
        steps.append(Joint(joint.kind))
        add(joint.after)
    steps += [part.step for part in robot.tool]
    return steps, slots

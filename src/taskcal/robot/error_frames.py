"""Where a robot's chain has error frames, and which of their slots are parameters."""

from taskcal.geometry.chain import ErrorFrame, Fixed, Joint, Step
from taskcal.robot.robot import Part, Robot

COMPONENTS = ("tx", "ty", "tz", "rx", "ry", "rz")


def defect_steps(robot: Robot) -> tuple[list[Step], list[list[str]]]:
    """Steps with an error frame behind every joint and the tool, and the names of each frame's six slots."""
    steps: list[Step] = []
    slots: list[list[str]] = []
    for joint in robot.joints:
        steps += [Fixed(part.transform) for part in joint.before]
        steps += [Joint(joint.kind), ErrorFrame()]
        steps += [Fixed(part.transform) for part in joint.after]
        slots.append([f"{joint.name}.{c}" for c in COMPONENTS])
    steps += [Fixed(part.transform) for part in robot.tool] + [ErrorFrame()]
    slots.append([f"tool.{c}" for c in COMPONENTS])
    return steps, slots


def length_steps(robot: Robot) -> tuple[list[Step], list[list[str]]]:
    """Steps with an error frame at every nominal length, of which only the length's own slot has a name."""
    steps: list[Step] = []
    slots: list[list[str]] = []

    def add(parts: tuple[Part, ...]) -> None:
        for part in parts:
            steps.append(Fixed(part.transform))
            if part.symbol:
                steps.append(ErrorFrame())
                slots.append([part.symbol if c == part.axis else "" for c in range(6)])

    for joint in robot.joints:
        add(joint.before)
        steps.append(Joint(joint.kind))
        add(joint.after)
    steps += [Fixed(part.transform) for part in robot.tool]
    return steps, slots

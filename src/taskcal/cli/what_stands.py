"""What ``taskcal plan`` says of a plan without a tracker: what stands where, what to check, what to write down."""

from typing import TYPE_CHECKING, Any

from taskcal.cli.output import info, show_table

if TYPE_CHECKING:
    from taskcal.adaptation.planned import Plan
    from taskcal.measurement.standing import Standing
    from taskcal.robot.robot import Robot

FILLED_IN = {
    "socket": "the rows name the sockets; the joints are those of the plan: before identifying, overwrite them by what the "
    "controller shows with the ball seated",
    "wire": "fill in d_mm in the plan's file, row by row; identify then reads it",
    "camera": "fill in what the camera measures in the plan's file, row by row; identify then reads it",
    "board": "fill in what the camera measures in the plan's file, row by row; identify then reads it",
}
"""What is to be done with the file."""

MOST_NAMED = 12
"""Poses that a message names."""


def describe_standing(standing: "Standing") -> list[dict[str, Any]]:
    """What stands where, in millimetres."""
    return [
        {"name": name, "position_mm": (position * 1e3).tolist(), "direction": direction.tolist()}
        for name, position, direction in zip(standing.names, standing.position, standing.direction, strict=True)
    ]


def tell_how_to_measure(plan: "Plan", robot: "Robot", *, stated: bool) -> None:
    """Show what stands where with its number of poses, and say what to check and to write down.

    Args:
        plan: without a tracker.
        robot: the robot.
        stated: whether a file says what stands where.
    """
    import numpy as np

    way = plan.way
    assert way is not None
    whose = "as stated" if stated else "assumed"
    turned = way.way != "wire"
    rows: list[tuple[str, ...]] = []
    for name, position, direction in zip(
        way.standing.names, way.standing.position, way.standing.direction, strict=True
    ):
        number = str(plan.names.count(name))
        facing = [f"{value + 0.0:.2f}" for value in np.round(direction, 2)] if turned else []
        rows.append((name, *(f"{value * 1e3:.0f}" for value in position), *facing, number))
    show_table(
        f"Where every {way.label} stands in the base, {whose}: mm{', and its direction' if turned else ''}",
        (way.label, "x_mm", "y_mm", "z_mm", *(("i", "j", "k") if turned else ()), "poses"),
        rows,
    )
    info(FILLED_IN[way.way])
    if not stated:
        info(f"nobody said where the {way.label}s stand: put them there, or say where they do and plan anew")
    x, y, z = way.T_tool_tip[:3, 3] * 1e3
    info(f"what the tool carries is taken to be at {x:g}, {y:g}, {z:g} mm in its frame (--mounted-mm)")
    if robot.link_radii is None:
        info("the robot's file states no link radii, so that nothing was checked for collisions: drive the plan slowly")
    else:
        info(
            "the links were checked against each other, blocks and keep-out boxes, on the ways between poses too; cables, tool "
            "and cell were not: drive slowly"
        )
    round_about, none = ([one.pose for one in plan.tight if (one.via is not None) == found] for found in (True, False))
    if round_about:
        info(f"not clear from the pose before if all joints turn at once: {_some(round_about)}; a program goes round")
    if none:
        info(
            f"not clear from the pose before, and no way round was found: {_some(none)}; drive there by hand, not by a program"
        )


def _some(poses: list[int]) -> str:
    return ", ".join(map(str, poses[:MOST_NAMED])) + (" …" if len(poses) > MOST_NAMED else "")

"""A robot in three dimensions: its chain as bars, its joints as drums about their axes, its loop, its base and its tool."""

from collections.abc import Mapping
from pathlib import Path
from urllib.parse import quote

import numpy as np
from jaxtyping import Float
from nicegui import ui

from taskcal.robot.robot import Robot
from taskcal.robot.skeleton import Skeleton, trace_skeleton
from taskcal.studio.robot_meshes import RobotMeshes

LINK, JOINT, LOOP, BOX = "#6b7e91", "#8f4e00", "#007a58", "#0072B2"
"""Colours that stand out from the ground in grey, too; links and joints differ in luminance, not in hue alone."""

BACKGROUND = "#dfe5ea"

SHORTEST = 1e-4
"""Metres; shorter parts of a chain are not drawn."""

WIDENED = 0.8
"""Of the distance of what is shown beside the robot."""

VIEWS: Mapping[str, tuple[float, float, float]] = {
    "oblique": (0.75, -0.75, 0.45),
    "front": (1.1, 0.0, 0.0),
    "side": (0.0, -1.1, 0.0),
    "top": (0.0, -0.01, 1.1),
}
"""Directions from which a scene is seen, and how far off in its sizes."""


class RobotView:
    """A scene with a robot in it."""

    def __init__(
        self, robot: Robot, q: Float[np.ndarray, " joints"], meshes: RobotMeshes | None = None, file: str = ""
    ) -> None:
        """Show a robot.

        Args:
            robot: the robot.
            q: its joint positions, radians or metres.
            meshes: of its links, drawn in place of bars where none of them is missing.
            file: the robot's, that they belong to.
        """
        self._robot, self._meshes = robot, meshes
        looks = [] if meshes is None else [(number, visual.scale) for number, visual in meshes.drawn]
        skeleton = trace_skeleton(robot, q[None])
        strokes = _strokes(skeleton)
        self.size = float(max(np.linalg.norm(strokes, axis=1).max(), 0.3))
        """Metres from the base to its farthest part."""
        self._seen = self.size
        """What views show, metres."""
        metres = 2 * int(np.ceil(2.0 * self.size))
        self.scene = ui.scene(width=800, height=460, grid=(metres, 2 * metres), background_color=BACKGROUND).classes(
            "view"
        )
        thickness = 0.03 * self.size
        self._drum_length = 4.0 * thickness
        with self.scene:
            self._bars = [self._bar(thickness, LINK) for _ in range(len(strokes) // 2)]
            self._drums = [self._bar(1.8 * thickness, JOINT) for _ in robot.joints]
            self._loop = [self._bar(0.6 * thickness, LOOP) for _ in skeleton.loop]
            self._shells = [
                self.scene.stl(f"/mesh/{quote(Path(file).name)}/{number}").material(LINK).scale(*scale)
                for number, scale in looks
            ]
            self._tool = self.scene.axes_helper(0.2 * self.size)
            self._tool_letters = [self.scene.text(letter) for letter in "xyz"]
            self.scene.axes_helper(0.4 * self.size)
            for letter, place in zip("XYZ", 0.45 * self.size * np.eye(3), strict=True):
                self.scene.text(letter).move(*place)
        self.look("oblique")
        self._place(skeleton, q)
        if meshes is not None and meshes.drawn and not meshes.missing:
            for bar in (*self._bars, *self._drums):
                bar.material(LINK, opacity=0.0)

    def move(self, q: Float[np.ndarray, " joints"]) -> None:
        """Bring the robot to joint positions q, radians or metres.

        Raises:
            ClosureError: its loop does not close there.
        """
        self._place(trace_skeleton(self._robot, q[None]), q)

    def look(self, view: str) -> None:
        """See it from one of `VIEWS`."""
        middle = 0.4 * self.size
        x, y, z = (1.25 * self._seen * share for share in VIEWS[view])
        self.scene.move_camera(
            x, y, z + middle, look_at_x=0.25 * self._seen, look_at_y=0.0, look_at_z=middle, duration=0.0
        )

    def widen(self, distance: float) -> None:
        """Show what is so far from the base, metres, as well."""
        self._seen = max(self.size, WIDENED * distance)
        self.look("oblique")

    def _place(self, skeleton: Skeleton, q: Float[np.ndarray, " joints"]) -> None:
        with self.scene._batch_calls():  # pyright: ignore[reportPrivateUsage]  # a message a pose, not one a bar
            for bar, (start, end) in zip(self._bars, _strokes(skeleton).reshape(-1, 2, 3), strict=True):
                stretch_cylinder(bar, start, end)
            for drum, at, axis in zip(self._drums, skeleton.origins[0], skeleton.axes[0], strict=True):
                half = 0.5 * self._drum_length * axis
                stretch_cylinder(drum, at - half, at + half)
            for bar, (start, end) in zip(self._loop, (ends[0] for ends in skeleton.loop), strict=True):
                stretch_cylinder(bar, start, end)
            if self._meshes is not None:
                poses = self._meshes.poses(self._robot.joint_names, q)
                for shell, T in zip(self._shells, poses, strict=True):
                    shell.move(*T[:3, 3].tolist()).rotate_R(T[:3, :3].tolist())
            tool = skeleton.tool[0]
            self._tool.move(*tool[:3, 3]).rotate_R(tool[:3, :3].tolist())
            for letter, place in zip(self._tool_letters, tool[:3, 3] + 0.23 * self.size * tool[:3, :3].T, strict=True):
                letter.move(*place)

    def _bar(self, radius: float, colour: str) -> ui.scene.cylinder:
        return self.scene.cylinder(radius, radius, 1.0, 16).material(colour)


def _strokes(skeleton: Skeleton) -> Float[np.ndarray, "ends 3"]:
    """Both ends of every straight part, one part behind the other."""
    return np.concatenate([np.stack([link[0, :-1], link[0, 1:]], axis=1).reshape(-1, 3) for link in skeleton.links])


def stretch_cylinder(
    bar: ui.scene.cylinder, start: Float[np.ndarray, " 3"], end: Float[np.ndarray, " 3"], radius: float = 1.0
) -> None:
    """Lay a cylinder, whose own axis is y and whose length is one, from one point to another; metres, radius in its own."""
    length = float(np.linalg.norm(end - start))
    if length < SHORTEST:
        bar.visible(False)
        return
    along = (end - start) / length
    other = np.cross(along, [0.0, 0.0, 1.0] if abs(along[2]) < 0.9 else [1.0, 0.0, 0.0])
    other /= np.linalg.norm(other)
    turn = np.column_stack([np.cross(along, other), along, other])
    bar.visible(True).scale(radius, length, radius).rotate_R(turn.tolist()).move(*(0.5 * (start + end)))

"""A tracker in a scene, its beams to the reflectors that it sees, and the boxes that neither robot nor beam may enter."""

import numpy as np
from jaxtyping import Float
from nicegui import ui

from taskcal.geometry import se3
from taskcal.kinematics.clearance import place_links
from taskcal.measurement.station import Station
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal.studio.robot_view import stretch_cylinder

TRACKER, SEEN, KEEP_OUT = "#1f2933", "#a33c00", "#5b3a8c"


class BeamView:
    """The tracker, a beam for every reflector, and the boxes."""

    def __init__(self, scene: ui.scene, size: float, robot: Robot, station: Station) -> None:
        """Put a station into a scene.

        Args:
            scene: the robot's.
            size: of the robot, metres.
            robot: that is measured.
            station: where and what the tracker measures.
        """
        self._scene, self._station, self._model = scene, station, ErrorModel(robot)
        x, y, z = station.position
        with scene:
            scene.cylinder(0.02 * size, 0.05 * size, 0.16 * size, 16).material(TRACKER).rotate(np.pi / 2, 0, 0).move(
                x, y, z
            )
            scene.sphere(0.035 * size).material(TRACKER).move(x, y, z + 0.1 * size)
            self._beams = [
                scene.cylinder(0.004 * size, 0.004 * size, 1.0, 6).material(SEEN) for _ in station.reflectors
            ]
            for box in station.keep_out:
                drawn = scene.box(*box.size.tolist()).material(KEEP_OUT, opacity=0.35)
                drawn.rotate_R(box.pose[:3, :3].tolist()).move(*box.pose[:3, 3].tolist())

    def move(self, q: Float[np.ndarray, " joints"]) -> None:
        """Show the beams to what the tracker sees with the robot at q, radians or metres."""
        T = self._model.nominal.poses(q[None])
        seen = self._station.visible(T, place_links(self._model, q[None]))[0]
        ends = se3.apply(T[0], self._station.offsets)
        with self._scene._batch_calls():  # pyright: ignore[reportPrivateUsage]
            for beam, end, sees in zip(self._beams, ends, seen, strict=True):
                if sees:
                    stretch_cylinder(beam, self._station.position, end)
                else:
                    beam.visible(False)

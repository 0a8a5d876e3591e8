"""The measuring station of a plan: chosen, dropped or begun, and where its tracker stands."""

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from jaxtyping import Float
from nicegui import ui

from taskcal.errors import TaskcalError
from taskcal.files import write_whole
from taskcal.measurement.station import Station, load_station
from taskcal.robot.robot import Robot
from taskcal.studio.controls import button, choice, drop_zone, facts, message, number, text
from taskcal.studio.project import LAYOUT, STATION_ENDINGS, Project
from taskcal.studio.texts import Texts

FARTHEST_MM = 1e5
"""That a tracker is put from the base, to each side."""

AWAY = 1.5
"""Of the robot's reach, how far before it a tracker is put that nobody has placed yet."""


class StationEditor:
    """A list of the station files, a place to drop one, and numbers for where the tracker stands."""

    def __init__(
        self, project: Project, robot: Robot, texts: Texts, show_message: Callable[[TaskcalError], str]
    ) -> None:
        """Show it; a change is saved at once.

        Args:
            project: whose stations they are.
            robot: that is measured.
            texts: of the page.
            show_message: words of what is wrong with a file.
        """
        self._project, self._texts = project, texts
        self.station: Station | None = None
        """As the chosen file has it."""
        chosen = project.choices.station
        files = {path: path for path in project.files(LAYOUT.stations, STATION_ENDINGS)}
        text("h2", texts("station.title"))
        text("p", texts("station.how")).classes("quiet")
        choice(texts("station.choose"), {"-": texts("station.none"), **files}, chosen or "-", self._take)
        if chosen:
            try:
                self.station = load_station(project.path(chosen))
            except TaskcalError as error:
                message(show_message(error))
            else:
                self._place(chosen, self.station)
        with ui.element("details"):
            text("summary", texts("station.another"))
            drop_zone(texts, "station", texts("station.drop"), STATION_ENDINGS)
            button(texts("station.begin"), lambda: self._begin(robot), plain=True)

    def _take(self, path: str) -> None:
        self._project.choose(station="" if path == "-" else path)
        ui.navigate.reload()

    def _begin(self, robot: Robot) -> None:
        """Begin with a tracker before the robot, and one reflector at the tool point."""
        path = self._project.put(LAYOUT.stations, "station.toml", first_station(robot).encode(), STATION_ENDINGS)
        self._take(path)

    def _place(self, path: str, station: Station) -> None:
        texts = self._texts
        place = station.position * 1e3
        with ui.element("div").classes("row"):
            for axis, letter in enumerate("xyz"):

                def put(value: float, axis: int = axis) -> None:
                    place[axis] = value
                    move_tracker(self._project.path(path), place)

                number(
                    texts("station.at", axis=letter), place[axis], put, low=-FARTHEST_MM, high=FARTHEST_MM, step="any"
                )
        names = ", ".join(reflector.name for reflector in station.reflectors)
        facts([(texts("station.reflectors"), names), (texts("station.keep_out"), str(len(station.keep_out)))])


def first_station(robot: Robot) -> str:
    """A station file to begin with: a tracker before the robot, and a reflector at the tool point that is seen from everywhere."""
    away = float(np.ceil(AWAY * robot.reach * 10.0) * 100.0)
    content: dict[str, Any] = {
        "position_mm": [away, -0.5 * away, 0.25 * away],
        "reflector": [{"name": "smr1", "position_mm": [0.0, 0.0, 0.0]}],
    }
    return tomli_w.dumps(content)


def move_tracker(path: Path, place: Float[np.ndarray, " 3"]) -> None:
    """Write into a station file where its tracker stands, millimetres in the base; comments are lost, all else stays."""
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    content["position_mm"] = place.tolist()
    write_whole(path, tomli_w.dumps(content))

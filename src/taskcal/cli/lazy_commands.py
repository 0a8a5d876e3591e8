"""The commands by name, each imported when it is first wanted: a list of them costs nothing but their names."""

from collections.abc import Iterator, MutableMapping
from importlib import import_module
from typing import Any

import typer

from taskcal.cli.command import Command
from taskcal.cli.option_groups import trusting

SUMMARIES = {
    "demo": "Run the published procedure on a virtual robot.",
    "robots": "Robots: list, look at, import from a table or URDF.",
    "sensitivity": "Influence of each parameter on the tool point, and which parameters the poses can tell apart.",
    "select": "Choose the smallest set of parameters that serves a task.",
    "plan": "Choose the poses whose measurement makes a robot accurate over a task.",
    "study": "See what error to expect over a task, from many virtual robots.",
    "simulate": "Measure a virtual robot: defects drawn from its tolerances, a tracker or what --observe names with its noise.",
    "convert": "Write a file of measurements as plain CSV: one row a pose, units in the names, shots of one pose averaged.",
    "register": "Find the tracker's frame and the targets with the nominal robot, and what it leaves of the measurements.",
    "identify": "Identify a robot's parameters from a campaign, with tracker frame and targets.",
    "validate": "Compare a campaign with a calibration's predictions, and decide whether it keeps a limit.",
    "compare": "Say what changed between calibrations of one robot: has it been hit, is it due again?",
    "fleet": "Look after many robots: their calibrations in one table, what changed, and which robot is unlike the others.",
    "performance": "Accuracy and repeatability of measured poses or paths (ISO 9283).",
    "correct": "Correct a robot program, so that the true tool goes where the program says.",
    "place": "Find where to put a part: the error to be expected of a program or a task over placements of its part.",
    "poses": "Compute tool poses from joint positions, nominal and calibrated, or joint positions from tool poses.",
    "export": "Write a calibrated robot as URDF, YAML or table, or fit what a controller can hold.",
    "report": "Make a page of a calibration, for a person who was not there.",
    "studio": "Work through pages in the browser, on a project's folder.",
    "doctor": "Find what is wrong with a campaign; without one, check the installation.",
    "warm": "Compile all kernels now, so that no later command has to.",
}
"""Each command's name and the first line of its help, in the order in which a user needs them: from a robot to its report, and
then what keeps the installation in order."""


class LazyCommands(MutableMapping[str, Any]):
    """Commands by name; a value is imported as it is asked for."""

    def __init__(self) -> None:
        self._loaded: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in SUMMARIES:
            raise KeyError(name)
        if name not in self._loaded:
            self._loaded[name] = _load(name)
        return self._loaded[name]

    def __setitem__(self, name: str, command: Any) -> None:
        self._loaded[name] = command

    def __delitem__(self, name: str) -> None:
        del self._loaded[name]

    def __iter__(self) -> Iterator[str]:
        return iter(SUMMARIES)

    def __len__(self) -> int:
        return len(SUMMARIES)


def _load(name: str) -> Any:
    """The command of a name, from its module."""
    module = import_module(f"taskcal.cli.commands.{name}")
    app = getattr(module, "app", None)
    if app is None:
        app = typer.Typer(add_completion=False, rich_markup_mode=None)
        app.command(name, cls=Command)(trusting(module.command))
    command: Any = typer.main.get_command(app)  # pyright: ignore
    command.name = name
    return command

"""The commands by name, each imported when it is first wanted: a list of them costs nothing but their names."""

import os
import signal
import socket
import sys
import threading
from collections.abc import Callable, Generator, Iterator, MutableMapping
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

import typer

from taskcal.cli.command import Command, trusting

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


# Ctrl-C ends the program within a second, whatever it is doing.

INTERRUPTED = 130
"""Exit status after Ctrl-C."""

GRACE = 0.5
"""Seconds that the main thread has to end by itself."""


@contextmanager
def prompt(say: Callable[[], None]) -> Generator[threading.Event, None, None]:
    """Watch for an interrupt beside the main thread, which may be in a library that does not return or swallows it.

    Yields an event: once set, the end is no longer said. An interrupt that a library's callback loses is not shown either.
    """
    said = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield said
        return
    reader, writer = socket.socketpair()
    writer.setblocking(False)
    earlier = signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)
    threading.Thread(target=_wait, args=(reader, say, said), daemon=True).start()
    shown = sys.unraisablehook
    sys.unraisablehook = lambda lost: None if issubclass(lost.exc_type, KeyboardInterrupt) else shown(lost)
    try:
        yield said
    finally:
        sys.unraisablehook = shown
        said.set()  # by whoever called: this thread is on its way out
        signal.set_wakeup_fd(earlier)
        writer.close()


def leave() -> NoReturn:
    """End the process without what libraries do at its end: they wait for processes and threads of theirs."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(INTERRUPTED)


def _wait(reader: socket.socket, say: Callable[[], None], said: threading.Event) -> None:
    while number := reader.recv(1):
        if number[0] == signal.SIGINT:
            break
    else:
        return
    threading.Event().wait(GRACE)  # not in vain where the program has ended: it may wait for threads of a library
    if not said.is_set():
        with suppress(OSError):
            say()
    os._exit(INTERRUPTED)


# Modules that bring effects of one's own, named before the command: ``taskcal --import my_effects identify …``.

OPTION = "--import"


def import_modules(names: list[str]) -> None:
    """Import modules by name, or files that end in ``.py``.

    Only what the user names is run, never what a calibration names. A file's folder is searched last, so that nothing in it
    stands in for a module that Python knows.

    Raises:
        typer.BadParameter: there is no such module or file, another module has its name, or it fails.
    """
    for name in names:
        path = Path(name) if name.endswith(".py") else None
        if path is not None:
            if not path.is_file():
                raise typer.BadParameter(f"there is no file {name}", param_hint=OPTION)
            sys.path.append(str(path.resolve().parent))
        module_name = name if path is None else path.stem
        try:
            module = import_module(module_name)
        except ModuleNotFoundError as error:
            if error.name != module_name:
                raise typer.BadParameter(
                    f"{name} imports {error.name}, which is not installed", param_hint=OPTION
                ) from error
            raise typer.BadParameter(
                f"there is no module {name}; install it, or give its file, such as {name}.py", param_hint=OPTION
            ) from error
        except Exception as error:
            raise typer.BadParameter(f"{name} fails: {type(error).__name__}: {error}", param_hint=OPTION) from error
        if path is not None and not _is(module.__file__, path):
            raise typer.BadParameter(
                f"another module is called {path.stem} ({module.__file__ or 'built in'}); rename the file",
                param_hint=OPTION,
            )


def _is(file: str | None, path: Path) -> bool:
    return file is not None and Path(file).resolve() == path.resolve()

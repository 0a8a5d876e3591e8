"""Options of commands that pages state: texts by their names, as the command line takes them."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from typer.main import get_command

from taskcal.cli.app import app
from taskcal.correction.options import Bounds
from taskcal.identification.options import EffectSearch, FitOptions, GeometryOptions, Holdout
from taskcal.live.options import Driving, RowOptions
from taskcal.observations.pixels import PixelInstrument
from taskcal.planning.options import Mounting, PlannedPoses, PlanOptions
from taskcal.reading.options import ReadOptions
from taskcal.tables.options import TableForm
from taskcal_groundwork.options import OptionError, StatedOption, arguments_of, options_of, read

GROUPS: Mapping[str, tuple[type, ...]] = {
    "identify": (EffectSearch, Holdout, GeometryOptions, FitOptions),
    "convert": (TableForm, ReadOptions),
    "plan": (PlannedPoses, PlanOptions, Mounting, PixelInstrument),
    "measure": (RowOptions, Driving),
    "correct": (Bounds,),
}
"""Options of each command."""

BEGUN: Mapping[str, Mapping[str, str]] = {
    "identify": {"effects": "none", "holdout": "0.3"},
    "convert": {},
    "plan": {"count": "60", "seed": "0"},
    "measure": {},
    "correct": {},
}
"""That a page begins with, where that is not what the options begin with."""

KEPT = ("identify", "plan", "measure", "correct")
"""Commands whose options a project keeps; those of others are of one file, and go with the page."""

OF_TRACKER = ("kept-out", "stations")
OF_IMAGES = tuple(
    one.name for group in (Mounting, PixelInstrument) for one in options_of(group) if one.option.named != "landmarks"
)
"""Options of a plan that are of one way to measure alone."""

_HANDED_ON = "what the pages of the road choose, and files that a page names by itself"
_TRUSTED = "a project may be somebody else's: nothing that it names is trusted, or replaced unasked"
_IMPORTED = "of a file as it was exported, which is imported once and then read as it is"
_IMAGES = "of images, which the page of measurements asks for together"
_EVERYWHERE = "it would have to hold on every page that reads the campaign, and none asks for it yet"
_TABLE = ("columns", "decimal", "sheet", "hidden-rows", "angles", "points")
_PICTURES = ("images", "board", "image-times", "camera", "camera-exact", "lens")
_ROWS = ("rows", "targets", "reference-points", "drift", "distances", "wire-scale")

NO_FIELDS: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "identify": {
        _HANDED_ON: ("campaign", "robot", "output", "json"),
        _TRUSTED: ("trust-xacro", "unsealed", "force"),
        _IMPORTED: _TABLE,
        _IMAGES: _PICTURES,
        _EVERYWHERE: _ROWS,
        "the page of the result lists them": ("parameters",),
    },
    "convert": {
        _HANDED_ON: ("file", "robot", "output", "json"),
        _TRUSTED: ("trust-xacro", "force"),
        "a file that is dropped beside the first, and joined with it": ("points",),
        _IMAGES: _PICTURES,
        "of a fit, which writes no such file": ("distances", "wire-scale"),
    },
    "plan": {
        _HANDED_ON: (
            *("robot", "task", "station", "observe", "landmarks", "board", "camera"),
            *("output", "program", "report", "json"),
        ),
        _TRUSTED: ("trust-xacro", "unsealed", "force"),
        "plans of the studio begin anew, by the robot alone": (
            *("campaign", "calibration", "effects", *_TABLE, *_ROWS),
            *("images", "image-times", "camera-exact", "lens"),
        ),
        "of instruments that the page does not plan for": ("sockets", "approach-mm", "anchors", "fov-deg"),
        "programs of the studio have the usual speeds and waits": (
            *("wait-s", "wait-input", "speed-mm-s", "speed-percent"),
        ),
        "the page of reports has the head; its files are for other programs": (
            *("header", "figures", "figure-format"),
        ),
    },
    "measure": {
        _HANDED_ON: ("robot", "task", "station", "output", "resume", "seed", "json"),
        _TRUSTED: ("trust-xacro",),
        "devices, and what each of them needs, which the page asks for by their own words": (
            *("controller", "controller-address", "instrument", "instrument-address", "columns", "program"),
        ),
        "confirmed for each start anew": ("drive",),
        "the page measures by a tracker": (
            *("observe", *OF_IMAGES, "landmarks", "fov-deg", "sockets", "approach-mm", "anchors"),
            *("distances", "wire-scale", "board", "camera"),
        ),
        "of slow networks; the usual limit is taken": ("timeout-s",),
    },
    "correct": {
        _HANDED_ON: (
            *("programs", "calibration", "output", "cell", "tool", "part", "missing", "task", "report", "json"),
            *("controller-kinematics", "nominal-controller", "helper", "all-rows"),
        ),
        _TRUSTED: ("unsealed", "force"),
        "confirmed for each correction anew": ("accept-uncertain",),
        "the page always writes what can be written": ("dry-run",),
        "a program is dropped as it was before a correction": ("again",),
        "joint positions are corrected with the rest": ("keep-joints",),
        "the page of reports has the head; its files are for other programs": (
            *("header", "figures", "figure-format"),
        ),
    },
}
"""Options and arguments of the command that its form lacks, by the reason."""


def offered(command: str) -> dict[str, StatedOption]:
    """Options that a page has, by name."""
    left_out = {name for names in NO_FIELDS[command].values() for name in names}
    every = [one for group in GROUPS[command] for one in options_of(group)]
    return {one.name: one for one in every if one.name not in left_out}


@dataclass(frozen=True, kw_only=True)
class Statements:
    """What a page states of a command's options, wherever that is kept."""

    command: str
    now: Callable[[], Mapping[str, str]]
    """Texts by the names of the options."""
    keep: Callable[[str, str], object]
    """Keeps one by its name."""


def name_of(command: str, field: str) -> str:
    """Name of an option by its field; the field's own where no page has it."""
    known = offered(command) if command in GROUPS else {}
    return next((one.name for one in known.values() if one.field == field), field)


def stated_or_begun(command: str, options: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    """What a project states of a command's options, or begins with.

    Args:
        command: whose options they are.
        options: texts that the project states, by command and by their names.
    """
    known = offered(command)
    texts = options.get(command, {})
    return {**BEGUN[command], **{name: text for name, text in texts.items() if text or not known[name].always}}


def check_stated(command: str, texts: Mapping[str, str], *, shown: bool = False) -> None:
    """Check what a project states of a command's options.

    Args:
        command: whose options they are, one of `GROUPS`.
        texts: that are stated, by their names.
        shown: whether a refusal has the units that a page shows.

    Raises:
        OptionError: there is none of this name, one is not of its kind, or they do not go together.
    """
    known = offered(command)
    if unknown := texts.keys() - known.keys():
        raise OptionError("taskcal {command} has no such option that a page states", min(unknown), command=command)
    for group in GROUPS[command]:
        read(group, {**BEGUN[command], **texts}, shown=shown)


def arguments(command: str, options: Mapping[str, Mapping[str, str]], without: Collection[str] = ()) -> list[str]:
    """Arguments of the command line for what a project states: the texts themselves, for its defaults are not the studio's.

    Args:
        command: whose options they are.
        options: texts that the project states, by command and by their names.
        without: options that do not count now.
    """
    texts = {name: text for name, text in stated_or_begun(command, options).items() if name not in without}
    return arguments_of(GROUPS[command], texts)


@cache
def described(command: str) -> Mapping[str, StatedOption]:
    """Options and arguments of a command by their names, files among them, as it declares them itself."""
    found: Any = get_command(app)
    for word in command.split():
        found = found.commands[word]
    return {one.name: one for one in found.callback.options}


def asked(command: str, stated: Sequence[str] = (), **given: str | bool | Sequence[str]) -> list[str]:
    """Arguments of ``taskcal`` for a command that prints its result as JSON.

    Args:
        command: the command.
        stated: arguments for what a project states of its options.
        given: texts, or truths of flags, by the names of options and arguments; an empty one, and a flag that is not set, are
            left out.

    Raises:
        KeyError: the command has no such option.
    """
    known, arguments, options = described(command), list[str](), list[str]()
    for name, value in ({**given, "json": True}).items():
        one = known[name.replace("_", "-")]
        values = [value] if isinstance(value, str) else [] if isinstance(value, bool) else value
        if one.kind is bool:
            options += [f"--{one.name}"] if value else []
        elif one.option.argument:
            arguments += values
        else:
            options += [f"--{one.name}={text}" for text in values if text]
    return [*command.split(), *arguments, *stated, *options]


def files_named(command: str, texts: Mapping[str, str]) -> list[str]:
    """Texts that name a file."""
    files = {name: one.option.suggested for name, one in offered(command).items() if one.names_file}
    return [text for name, text in texts.items() if name in files and text and text not in files[name]]

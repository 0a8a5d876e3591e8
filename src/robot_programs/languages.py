"""The languages of robot programs, in one table, with those of other packages that name a `Language` as an entry point."""

import warnings
from collections.abc import Callable
from functools import cache, partial
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from robot_programs.core.program import NUMBER, LiteralForm, Program
from robot_programs.core.program import Composition as Composition
from robot_programs.core.program import Language as Language
from robot_programs.core.program import Surroundings as Surroundings
from robot_programs.core.source import Source
from taskcal_groundwork.errors import FileError

# A language is imported when a file of it is met.


def _called(function: str, *given: Any, **named: Any) -> Any:
    """What a function gives that is named by its module and name."""
    module, _, name = function.partition(":")
    return getattr(import_module(f"robot_programs.{module}"), name)(*given, **named)


def _reader(function: str, *given: str) -> Callable[[tuple[Source, ...], Surroundings], Program]:
    """The reader of a language, which takes some fields of the surroundings."""
    return lambda sources, around: _called(function, sources, **{name: getattr(around, name) for name in given})


def _composer(function: str) -> Callable[[Composition], Source]:
    return partial(_called, function)


def _form(poses: str, pattern: str, unless: str = "") -> LiteralForm:
    """The commonest form of a motion in a language; ``(#)`` stands for a number of its target."""
    text = pattern.replace("(#)", f"({NUMBER})").replace(" ", r"[ \t]*")
    return LiteralForm(pattern=text, poses=partial(_called, poses), unless=unless)


_OWN = (
    Language(
        name="RAPID",
        suffixes=(".mod", ".sys", ".prg", ".modx", ".sysx", ".cfg"),
        read=_reader("rapid.read:read_rapid", "tools", "parts"),
        compose=_composer("rapid.rewrite:compose_rapid"),
        composed=(".mod", ".prg", ".modx"),
        declares_frames=True,
        has_logic=True,
        marks=r"^[^\S\n]*+MODULE\b|\A\ufeff?\s*MOC:CFG_",
        base_file="MOC.cfg",
        form=_form(
            "rapid.resolve:literal_poses",
            r"Move[JL] \[ \[ (#) , (#) , (#) \] , \[ (#) , (#) , (#) , (#) \] ,[-+.,\[\]\deE\t\x20]*\] ,[\w\\:=,\t\x20]*;",
        ),
    ),
    Language(
        name="KRL",
        suffixes=(".src", ".dat", ".sub"),
        read=_reader("krl.read:read_krl", "tools", "parts", "data"),
        compose=_composer("krl.rewrite:compose_krl"),
        composed=(".src",),
        declares_frames=True,
        has_logic=True,
        marks=r"^[^\S\n]*+(GLOBAL\s+)?DEF(FCT|DAT)?\b",
        base_file="$machine.dat",
        takes_data=True,
        form=_form(
            "krl.values:literal_poses",
            r"S?(?:LIN|PTP) \{ X (#) , Y (#) , Z (#) , A (#) , B (#) , C (#) (?:,[-+.,\w\t\x20]*)?\}[\w\t\x20]*",
        ),
    ),
    Language(
        name="TP",
        suffixes=(".ls", ".va"),
        read=_reader("tp.read:read_tp", "robot", "tool", "part", "tools", "parts"),
        compose=_composer("tp.rewrite:compose_tp"),
        composed=(".ls",),
        marks=r"^[^\S\n]*+/POS\b|^[^\S\n]*+\[\*",
        declares_frames=False,
        has_logic=True,
    ),
    Language(
        name="URScript",
        suffixes=(".script", ".urscript"),
        read=_reader("urscript.read:read_urscript", "robot", "tool", "part"),
        compose=_composer("urscript.rewrite:compose_urscript"),
        composed=(".script",),
        marks=r"^[^\S\n]*+(def|sec)\s+\w+\s*\(|^[^\S\n]*+move[jlpc]\s*\(",
        declares_frames=False,
        has_logic=True,
        controller_kinematics="calibration.conf of the controller, or a program saved on it (.urp)",
        form=_form(
            "urscript.values:literal_poses",
            r"move[jlp] \( p \[ (#) , (#) , (#) , (#) , (#) , (#) \][\w.,=\t\x20-]*\)",
        ),
    ),
    Language(
        name="APT",
        suffixes=(".apt", ".aptsource", ".cls", ".clsf", ".cl", ".ncl"),
        read=_reader("apt.read:read_apt", "robot", "tool", "part", "tools"),
        compose=None,
        marks=r"^[^\S\n]*+(GOTO|TLON|LOADTL|LOAD|FEDRAT|RAPID|PARTNO|TOOL PATH|MULTAX|CUTTER)\b",
        declares_frames=False,
        # with other frames the tool's axis tells in which a point is counted
        form=_form("apt.read:literal_poses", "GOTO / (#) , (#) , (#)(?: , (#) , (#) , (#))?", unless=r"^[^\S\n]*+CSYS"),
    ),
    Language(
        name="CSV",
        suffixes=(".csv",),
        read=_reader("csv_path.read:read_csv_path", "robot", "tool", "part"),
        compose=_composer("csv_path.read:compose_csv_path"),
        composed=(".csv",),
        declares_frames=False,
    ),
)

POLYSCOPE = ".urp"
"""Suffix of compressed programs of Universal Robots' panel, which holds their URScript in a file beside each."""

GROUP = "robot_programs.languages"
"""Entry points of other packages, a `Language` each."""


@cache
def languages() -> tuple[Language, ...]:
    """All of them, in the order in which messages name them; those of other packages last.

    A package whose language cannot be loaded, or has a name or suffix of another, is named in a warning and left out.
    """
    found = dict.fromkeys(_OWN, "robot_programs")
    for point in sorted(entry_points(group=GROUP), key=lambda point: (point.value, point.name)):
        package = point.dist.name if point.dist is not None else point.value.partition(".")[0]
        try:
            language = point.load()
            if not isinstance(language, Language):
                raise TypeError(f"{point.value} is not a Language")
            for other, owner in found.items():
                if taken := {language.name, *language.suffixes} & {other.name, *other.suffixes}:
                    raise ValueError(f"the package '{owner}' has '{min(taken)}' already")
            found[language] = package
        except Exception as error:
            fault = f"the package '{package}' cannot add the language '{point.name}': {type(error).__name__}: {error}"
            _FAULTS.append(fault)
            warnings.warn(f"{fault}; mend the package or uninstall it", stacklevel=2)
    return tuple(found)


_FAULTS: list[str] = []
"""What is wrong with packages that add languages."""


def __getattr__(name: str) -> Any:
    if name == "LANGUAGES":
        return languages()
    if name == "COMPOSED":  # suffixes of files that a new program can be written to
        return tuple(suffix for language in languages() for suffix in language.composed)
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")


def language_of(path: Path) -> Language:
    """The language that a file's suffix stands for.

    Raises:
        FileError: the suffix is not known.
    """
    for language in languages():
        if path.suffix.lower() in language.suffixes:
            return language
    if path.suffix.lower() == POLYSCOPE:
        beside = [text for suffix in (".script", ".txt") if (text := path.with_suffix(suffix)).is_file()]
        name = beside[0].name if beside else path.with_suffix(".script").name
        where = "which stands beside it" if beside else "which PolyScope writes beside it when the program is saved"
        renamed = ", renamed to .script" if name.endswith(".txt") else ""
        raise FileError(path, f"is PolyScope's own form of a program; pass its text, {name}, {where}{renamed}")
    known = "; ".join([*(f"{language.name}: {' '.join(language.suffixes)}" for language in languages()), *_FAULTS])
    raise FileError(path, f"has no suffix of a robot program; known are {known}")

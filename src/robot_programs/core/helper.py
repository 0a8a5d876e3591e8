"""Modules that correct targets while a program runs: what is computed there, and how languages write it."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import NamedTuple

from robot_programs.core.source import Source


class Dialect(NamedTuple):
    """How a language writes arithmetic."""

    number: Callable[[float], str]
    functions: Mapping[str, str]
    """By name of the expression; a format of the arguments."""
    variable: str
    """A format of its number, from 1 on."""
    assignment: str
    """A format of variable and value."""
    degrees: Mapping[str, str] | None = None
    """Where functions take and give degrees: inputs that are angles in radians, and what they are called in degrees."""


def single(value: float) -> str:
    """A number in the digits that single precision has."""
    text = f"{value:.9g}".upper()
    return text if any(mark in text for mark in ".E") else f"{text}.0"


def indented(lines: Iterable[str], by: int) -> str:
    """Lines behind so many blanks."""
    return "\n".join(" " * by + line for line in lines)


@dataclass(frozen=True, kw_only=True)
class Computed:
    """Lines of a language that compute something."""

    lines: Sequence[str]
    variables: int
    operations: int
    """Sums, products, quotients and functions."""


@dataclass(frozen=True, eq=False, kw_only=True)
class HelperModule:
    """A module that moves a target until the robot's joint positions there no longer change by it."""

    name: str
    function: str
    title: str
    robot: str
    shift: float
    """By which a target may be moved at most, metres."""
    turn: float
    """The same of its orientation, radians."""
    joint: float
    """By which a joint may move at most, radians."""
    usual_rounds: int
    rounds: int
    """Of the repetition, at most."""
    settled: float
    """Change of the shift, with that of half the turn on a lever, metres, at which it ends."""
    lever: float
    """Metres."""
    correction: Computed
    """Of the shift and the turn at joint positions."""

    def written(self, language: str, suffix: str, first: Source, words: Mapping[str, str], *, inside: bool) -> Source:
        """The module, as a file beside the first one of a program, or to be written into that.

        Args:
            language: whose folder has the text.
            suffix: of its file.
            first: file of the program.
            words: of the text, and what stands for them.
            inside: whether it has no file of its own.
        """
        known = {
            "MODULE": self.name, "FUNCTION": self.function, "TITLE": self.title, "OPERATIONS": str(self.correction.operations),
            "USUAL": str(self.usual_rounds), "ROUNDS": str(self.rounds), "VARIABLES": str(max(self.correction.variables, 1)),
            **words,
        }  # fmt: skip
        text = resources.files(f"robot_programs.{language}").joinpath(f"helper{suffix}").read_text(encoding="utf-8")
        for name, value in known.items():
            text = text.replace(f"@{name}@", value)
        path = first.path if inside else first.path.with_name(f"{self.name}{suffix}")
        return Source(path=path, text=text.replace("\n", first.newline), encoding="utf-8")

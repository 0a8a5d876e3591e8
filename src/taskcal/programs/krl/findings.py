"""What was found while a KRL program was read: its motions, and what is to be said of it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from taskcal.programs.krl.data_lists import File
from taskcal.programs.krl.rewrite import Site
from taskcal.programs.program import Move


@dataclass(frozen=True, eq=False, kw_only=True)
class Found:
    """A motion that was resolved."""

    move: Move
    site: Site
    follows: tuple[int, int] | None
    """The motion that ends where it begins, by file and first character."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Findings:
    """What was found so far."""

    found: dict[tuple[int, int], Found] = field(default_factory=dict[tuple[int, int], Found])
    """By file and first character."""
    beside: Mapping[tuple[int, int], "Found"] = field(default_factory=dict[tuple[int, int], Found])
    """Motions of routines that were gone through only for what they leave behind."""
    diagnostics: list[tuple[int, int, str]] = field(default_factory=list[tuple[int, int, str]])
    """Number of the file, position and text."""

    def diagnose(self, file: File, position: int, text: str) -> None:
        """Note something about a place."""
        self.diagnostics.append((file.number, position, text))

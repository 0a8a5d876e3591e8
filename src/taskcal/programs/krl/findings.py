"""What was found while a KRL program was read: its motions, and what is to be said of it."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from taskcal.programs.krl.data_lists import File
from taskcal.programs.krl.rewrite import Site
from taskcal.programs.krl.syntax import Motion
from taskcal.programs.program import Move

Text = tuple[int, int]
"""A line of the program, by number of the file and first character."""


@dataclass(eq=False, kw_only=True)
class Occurrence:
    """A motion that was resolved, with all ways that lead to it."""

    move: Move
    site: Site
    before: set[int | None]
    """Numbers of the motions that may have been the last one; None for any."""


@dataclass(eq=False, kw_only=True)
class Findings:
    """What was found so far."""

    occurrences: list[Occurrence] = field(default_factory=list[Occurrence])
    by_meaning: dict[tuple[object, ...], int] = field(default_factory=dict[tuple[object, ...], int])
    """Numbers of motions by their text, where they go, and how."""
    reasons: dict[Text, tuple[File, str]] = field(default_factory=dict[Text, tuple[File, str]])
    """Why motions are not understood, on some way that leads to them."""
    diagnostics: list[tuple[int, int, str]] = field(default_factory=list[tuple[int, int, str]])
    """Number of the file, position and text."""
    seen: set[Text] = field(default_factory=set[Text])
    """Motions to which some way led before the ways that are never taken were gone through."""

    def diagnose(self, file: File, position: int, text: str) -> None:
        """Note something about a place."""
        self.diagnostics.append((file.number, position, text))

    def fail(self, file: File, line: Motion, reason: str) -> None:
        """Note why a motion is not understood."""
        self.reasons.setdefault((file.number, line.start), (file, f"{line.keyword} stays as it is: {reason}"))

    def note(self, move: Move, site: Site, before: int | None) -> int:
        """The number of a motion."""
        meaning = (
            site.text, *_target(move.end.T, move.end.q), *_target(None if move.via is None else move.via.T, None),
            move.end.posture, *(None if w.datum is None else (w.datum.file.number, w.datum.start) for w in site.written),
            id(move.tool), id(move.part), move.part_in_hand, move.carrier, move.speed, move.turn_speed, move.stops,
            move.zone, repr(move.external), move.divisible,
        )  # fmt: skip
        number = self.by_meaning.setdefault(meaning, len(self.occurrences))
        if number == len(self.occurrences):
            self.occurrences.append(Occurrence(move=move, site=site, before={before}))
        else:
            self.occurrences[number].before.add(before)
        return number

    def finished(self) -> Iterator[tuple[Move, Site]]:
        """The motions that are understood on all ways that lead to them, in the order of the text."""
        kept = [i for i, found in enumerate(self.occurrences) if found.site.text not in self.reasons]
        kept.sort(key=lambda i: (self.occurrences[i].site.text, i))
        number = {old: new for new, old in enumerate(kept)}
        many: dict[Text, int] = {}
        for i in kept:
            text = self.occurrences[i].site.text
            many[text] = many.get(text, 0) + 1
        for i in kept:
            found = self.occurrences[i]
            before = {None if old is None else number.get(old) for old in found.before}
            count = many[found.site.text]
            (first, *others) = before
            move = replace(
                found.move,
                follows=None if others else first,
                texts_motions=count,
                divisible=found.move.divisible and count == 1,
            )
            yield move, replace(found.site, before=tuple(sorted(old for old in before if old is not None)))


def _target(T: Float[np.ndarray, "4 4"] | None, q: Float[np.ndarray, " joints"] | None) -> tuple[object, ...]:
    return (None if T is None else T.tobytes(), None if q is None else q.tobytes())

"""Long programs of a post-processor, read from a few of their lines: motions of one text but for the numbers of their targets.

Of each run of such lines the language reads the first two and the last one. What lies between goes where its own numbers say, and
is in all else as the last one, if these two are alike. Whatever needs more than motions reads the whole text.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cache, cached_property, wraps
from itertools import chain, pairwise
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from jaxtyping import Float

from robot_programs.core.program import (
    NUMBER,
    LiteralForm,
    Motion,
    Paths,
    Program,
    Target,
)
from robot_programs.core.robot import Robot
from robot_programs.core.source import Place, Source, uncollected

MIN_RUN = 20
"""Lines of a run; of fewer, reading all of them takes less time than to compare those that are read."""
MIN_FOLDED = 500
"""Lines that have to be left out in all; shorter programs are read in half a second."""

SAME_T = 1e-12
"""By which a pose that the language computes differs less, metres and parts of a rotation."""


_BLANK = re.compile(r"(?:\\[ \t])+")


@dataclass(frozen=True, eq=False, kw_only=True)
class _Run:
    """Lines one after the other that differ in numbers alone."""

    source: Source
    first: int
    """Line, counted from 1."""
    ends: tuple[int, int, int]
    """Behind the second line, behind the last but one, and behind the last one."""
    rows: Float[np.ndarray, "n k"]

    @property
    def last(self) -> int:
        """Line of the last one."""
        return self.first + len(self.rows) - 1


def read_folded(
    sources: tuple[Source, ...], form: LiteralForm | None, read: Callable[[tuple[Source, ...]], Program]
) -> Program:
    """A program as `read` reads it, from as few of its lines as it can be.

    Args:
        sources: the files.
        form: of the language; None where it has none.
        read: reads all of the files.
    """
    if form is None or any(source.lines is not None for source in sources):
        return read(sources)
    if form.unless and any(re.search(form.unless, source.text, re.IGNORECASE | re.MULTILINE) for source in sources):
        return read(sources)
    with uncollected():
        runs = [run for source in sources for run in _runs(source, form)]
        while True:
            if sum(len(run.rows) - 3 for run in runs) < MIN_FOLDED:
                return read(sources)
            few = read(tuple(_shortened(source, [run for run in runs if run.source is source]) for source in sources))
            inside = _inside(few, runs, form)
            if len(inside) == len(runs):
                break
            runs = list(inside)  # of the others all lines are read

    def again(sources: tuple[Source, ...]) -> Program:
        return read_folded(sources, form, read)

    @cache
    def whole() -> Program:
        return replace(read(sources), motions=())

    return FoldedProgram(
        sources=sources, motions=_numbered(few.motions, dict(inside.values())), diagnostics=few.diagnostics,
        T_world_base=few.T_world_base, base_from=few.base_from, read=again, whole=whole,
        give_back=whole.cache_clear,
    )  # fmt: skip


def _runs(source: Source, form: LiteralForm) -> Iterator[_Run]:
    """Runs of a text that are worth it."""
    text, at, line, counted = source.text, 0, 1, 0
    found = re.compile(rf"^[ \t]*{form.pattern}[ \t]*\r?\n", re.IGNORECASE | re.MULTILINE)
    while (first := found.search(text, at)) is not None:
        alike, at = _alike(first), first.start()
        numbers, ends = list[str](), list[int]()
        while (one := alike.match(text, at)) is not None:
            numbers += one.groups()
            at = one.end()
            ends.append(at)
        at = max(at, first.end())
        if len(ends) < MIN_RUN:
            continue
        line += text.count("\n", counted, first.start())
        counted = first.start()
        rows = np.array([*map(float, numbers)]).reshape(len(ends), -1)
        yield _Run(source=source, first=line, ends=(ends[1], ends[-2], ends[-1]), rows=rows)


def _alike(line: re.Match[str]) -> re.Pattern[str]:
    """The pattern of lines that have other numbers."""
    stated = [span for span in line.regs[1:] if span != (-1, -1)]
    spans = [(line.start(), line.start()), *stated, (line.end(), line.end())]
    texts = [re.escape(line.string[a[1] : b[0]]) for a, b in pairwise(spans)]
    return re.compile(f"({NUMBER})".join(_BLANK.sub(r"[ \\t]+", text) for text in texts))


def _shortened(source: Source, runs: Sequence[_Run]) -> Source:
    """The text without what lies inside runs; its lines count as before."""
    parts, lines = list[str](), list[range]()
    at, line = 0, 1
    for run in runs:
        parts.append(source.text[at : run.ends[0]])
        lines.append(range(line, run.first + 2))
        at, line = run.ends[1], run.last
    parts.append(source.text[at:])
    lines.append(range(line, line + parts[-1].count("\n") + 1))
    return replace(source, text="".join(parts), lines=tuple(chain.from_iterable(lines)))


def _inside(few: Program, runs: Sequence[_Run], form: LiteralForm) -> dict[_Run, tuple[int, list[Motion]]]:
    """Motions inside of runs, with the number of that of the last line; of runs whose lines that were read tell them."""
    at: dict[tuple[Path, int], int] = {}
    for number, motion in enumerate(few.motions):
        place = (motion.place.path, motion.place.line)
        at[place] = -1 if place in at else number
    said = {(one.place.path, one.place.line) for one in few.diagnostics}
    found: dict[_Run, tuple[int, list[Motion]]] = {}
    for run in runs:
        second, last = ((run.source.path, line) for line in (run.first + 1, run.last))
        number = at.get(last, -1)
        if number < 1 or at.get(second) != number - 1 or {second, last} & said:
            continue
        pair = few.motions[number - 1], few.motions[number]
        alike = _are_alike(*pair) and pair[1].follows in (None, number - 1)
        poses = form.poses(run.rows, pair[1]) if alike else None
        if poses is not None and _are_at(pair, poses[[1, -1]]):
            found[run] = number, _between(run, poses[2:-1], pair[1])
    return found


def _are_at(pair: Sequence[Motion], poses: Float[np.ndarray, "2 4 4"]) -> bool:
    """Whether motions lead to poses."""
    return all(
        one.end.T is not None and np.abs(one.end.T - T).max() <= SAME_T for one, T in zip(pair, poses, strict=True)
    )


def _are_alike(one: Motion, other: Motion) -> bool:
    """Whether two motions differ in the place where they lead alone, and in that in the text."""
    own = ({f.name: getattr(x, f.name) for f in fields(x)} for x in (one, other, one.end, other.end))
    a, b, end, to = own
    skipped = ("place", "follows", "end", "T")
    same = all(v is b[k] or v == b[k] for k, v in a.items() if k not in skipped)
    same = same and all(v is to[k] or v == to[k] for k, v in end.items() if k not in skipped)
    return same and one.via is None and one.texts_motions == 1 and not one.end.name and one.end.place == one.place


def _between(run: _Run, poses: Float[np.ndarray, "n 4 4"], like: Motion) -> list[Motion]:
    """The motions inside a run, still without their order."""
    own: dict[str, Any] = {f.name: getattr(like, f.name) for f in fields(like)}
    end: dict[str, Any] = {f.name: getattr(like.end, f.name) for f in fields(like.end)}
    made: list[Motion] = []
    for line, T in enumerate(poses, run.first + 2):
        own["place"] = end["place"] = Place(path=run.source.path, line=line)
        end["T"] = T
        own["end"] = Target(**end)
        made.append(Motion(**own))
    return made


def _numbered(few: Sequence[Motion], inside: dict[int, list[Motion]]) -> tuple[Motion, ...]:
    """All motions, each with the number of the one before.

    Args:
        few: those that were read.
        inside: those before some of them, by number.
    """
    new, number = list[int](), 0
    for old in range(len(few)):
        number += len(inside.get(old, ()))
        new.append(number)
        number += 1
    all_motions: list[Motion] = []
    for old, motion in enumerate(few):
        chained = motion.follows is not None
        for one in inside.get(old, ()):
            if chained:
                object.__setattr__(one, "follows", len(all_motions) - 1)
            all_motions.append(one)
        follows = motion.follows
        if follows is not None:
            follows = new[old] - 1 if old in inside else new[follows]
        all_motions.append(motion if follows == motion.follows else replace(motion, follows=follows))
    return tuple(all_motions)


Method = TypeVar("Method", bound=Callable[..., Any])


def _of_whole(method: Method) -> Method:
    """A method of `Program`, as the whole program has it."""

    @wraps(method, updated=())  # not its being abstract
    def forwarded(program: Any, *arguments: Any, **named: Any) -> Any:
        return getattr(program.unfolded, method.__name__)(*arguments, **named)

    return cast("Method", forwarded)


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class FoldedProgram(Program):
    """A program that was read from a few of its lines."""

    whole: Callable[[], Program]
    """The same, of all its lines and without motions; read once, until it is given back."""
    give_back: Callable[[], None]
    """Forget it."""

    @cached_property
    def unfolded(self) -> Program:
        """The whole program, with what is known of this one."""
        return replace(
            self.whole(), motions=self.motions, diagnostics=self.diagnostics, T_world_base=self.T_world_base,
            base_from=self.base_from, backup=self.backup,
        )  # fmt: skip

    def rewrite(self, robot: Robot, waypoints: Paths) -> tuple[Source, ...]:
        """The program's files with some motions rewritten; see `Program.rewrite`.

        What was read of all lines takes more memory than all else, and nothing is asked of it behind that.
        """
        written = self.unfolded.rewrite(robot, waypoints)
        self.give_back()
        vars(self).pop("unfolded", None)
        return written

    speed_edit = _of_whole(Program.speed_edit)
    unwritable = _of_whole(Program.unwritable)
    least_worst = _of_whole(Program.least_worst)
    written_out = _of_whole(Program.written_out)
    tabled = _of_whole(Program.tabled)
    visits = _of_whole(Program.visits)
    wrap = _of_whole(Program.wrap)

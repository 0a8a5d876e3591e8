"""The routines of a KRL program, what each alters, and which calls which."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from taskcal.programs.krl.data import BUILT_IN, Data
from taskcal.programs.krl.data_lists import File
from taskcal.programs.krl.lexer import Word, lines_of_words
from taskcal.programs.krl.parameters import handed_over
from taskcal.programs.krl.state import EVERYTHING
from taskcal.programs.krl.syntax import Assignment, Begin, Call, Control, Declaration, End, Motion, Statement
from taskcal.programs.krl.variables import Names


@dataclass(frozen=True, eq=False, kw_only=True)
class Routine:
    """A routine, local or global."""

    file: File
    name: str
    """In capitals."""
    parameters: tuple[str, ...]
    """In capitals."""
    lines: tuple[Statement, ...]

    @property
    def prefix(self) -> str:
        """Of the keys of its own variables."""
        return f"{self.name}@{self.file.number}:"

    def names(self, data: Data, volatile: frozenset[str] = frozenset()) -> Names:
        """What names of variables mean in it."""
        declared = [line for line in self.lines if isinstance(line, Declaration)]
        own = {variable.name for line in declared for variable in line.variables}
        return Names(
            prefix=self.prefix,
            routine=self.name,
            module=self.file.module,
            own=frozenset(own | set(self.parameters)),
            listed=data.listed(self.file.module),
            whole_numbers=data.whole_numbers,
            volatile=volatile,
        )


def routines_of(files: tuple[File, ...]) -> dict[str, list[Routine]]:
    """The routines of some files by name, which routines of several files may share."""
    out: dict[str, list[Routine]] = {}
    for file in files:
        if file.holds_data or file.module == BUILT_IN:
            continue
        start, head = 0, None
        for i, line in enumerate((*file.statements, None)):
            if line is None or isinstance(line, Begin | End):
                if head is not None:
                    lines = file.statements[start:i]
                    routine = Routine(file=file, name=head.name, parameters=head.parameters, lines=lines)
                    out.setdefault(head.name, []).append(routine)
                start, head = i + 1, line if isinstance(line, Begin) else None
    return out


_VARIABLES = {"$TOOL": "tool", "$BASE": "base", "$IPO_MODE": "mode", "FDAT_ACT": "parameters", "$VEL": "speed"}
_COMMANDS = {
    "#INITMOV": EVERYTHING - {"motion"},
    "#PTP_PARAMS": frozenset({"tool", "base", "mode"}),
    "#PTP_DAT": frozenset({"tool", "base", "mode"}),
    "#FRAMES": frozenset({"tool", "base", "mode"}),
    "#CP_PARAMS": frozenset({"tool", "base", "mode", "speed"}),
    "#CP_DAT": frozenset({"tool", "base", "mode"}),
    "#VEL_CP": frozenset({"speed"}),
    "#TOOL": frozenset({"tool"}),
    "#BASE": frozenset({"base"}),
    "#EX_BASE": frozenset({"base"}),
}


def altered_by(line: Statement, routines: Mapping[str, frozenset[str]]) -> frozenset[str]:
    """What of `EVERYTHING` a line alters, given what routines alter."""
    match line:
        case Motion():
            return frozenset({"motion"})
        case Assignment() if line.variable in _VARIABLES:
            own = frozenset({_VARIABLES[line.variable]})
        case Call(name="BAS"):
            own = _COMMANDS.get(line.command, frozenset[str]())
        case _:
            own = frozenset[str]()
    return own.union(*(routines.get(name, frozenset()) for name in calls_of(line)))


def keys_changed_by(
    line: Statement, names: Names, by_value: Mapping[str, tuple[bool, ...]], routines: Mapping[str, frozenset[str]]
) -> frozenset[str]:
    """Keys of the variables that a line assigns or hands over, given those that routines assign."""
    match line:
        case Assignment():
            own = {line.variable, *line.changed}
        case Call(name="BAS"):
            own = set[str]()
        case Call():
            own = {*handed_over(line, by_value)}
        case Control():
            own = {*line.changed, *(word.upper for word in line.words[:1] if line.keyword == "FOR")}
        case _:
            own = set[str]()
    return frozenset(map(names.key, own)).union(*(routines.get(name, frozenset()) for name in calls_of(line)))


def calls_of(line: Statement) -> tuple[str, ...]:
    """Names that a line calls: of a routine, or of functions in its expressions."""
    match line:
        case Call():
            words = (word for argument in line.arguments for word in (*argument, None))
            return (line.name, *_before_parentheses(tuple(words)))
        case Assignment() | Control():
            return _before_parentheses(line.words)
        case _:
            return ()


def _before_parentheses(words: Sequence[Word | None]) -> tuple[str, ...]:
    return tuple(
        a.upper for a, b in pairwise(words) if a is not None and b is not None and a.kind == "name" and b.text == "("
    )


def altering(routines: dict[str, list[Routine]]) -> dict[str, frozenset[str]]:
    """What the routines of each name alter, by themselves or by those that they call."""
    own = {
        name: (
            frozenset[str]().union(*(altered_by(line, {}) for r in same for line in r.lines)),
            _called(same, routines),
        )
        for name, same in routines.items()
    }
    return _closed(own)


def changing(routines: dict[str, list[Routine]], data: Data) -> dict[str, frozenset[str]]:
    """Keys of the variables that the routines of each name change, by themselves or by those that they call."""
    own = {
        name: (
            frozenset[str]().union(
                *(
                    keys_changed_by(line, names, data.by_value, {})
                    for r in same
                    for names in [r.names(data)]
                    for line in r.lines
                )
            ),
            _called(same, routines),
        )
        for name, same in routines.items()
    }
    return _closed(own)


def _called(same: Sequence[Routine], routines: Mapping[str, object]) -> frozenset[str]:
    return frozenset(name for r in same for line in r.lines for name in calls_of(line) if name in routines)


def _closed(own: Mapping[str, tuple[frozenset[str], frozenset[str]]]) -> dict[str, frozenset[str]]:
    """What each has, by itself or by those that it calls."""
    total = {name: has for name, (has, _) in own.items()}
    while True:
        wider = {name: has.union(*(total[other] for other in calls)) for name, (has, calls) in own.items()}
        if wider == total:
            return total
        total = wider


def callers_of(routines: dict[str, list[Routine]]) -> dict[str, set[str]]:
    """By name of routines: names of those that call them."""
    out: dict[str, set[str]] = {name: set() for name in routines}
    for name, same in routines.items():
        for called in _called(same, routines):
            out[called].add(name)
    return out


def roots_of(callers: Mapping[str, set[str]]) -> dict[str, frozenset[str]]:
    """By name of routines: those that nothing calls, from which they are reached; themselves where nothing calls them."""
    own = {name: frozenset() if others else frozenset({name}) for name, others in callers.items()}
    return _closed({name: (own[name], frozenset(others)) for name, others in callers.items()})


def unasked(files: Iterable[File]) -> frozenset[str]:
    """Routines that are not called from the line before: by interrupts, beside a motion, or in the submit interpreter."""
    out: set[str] = set()
    for file in files:
        if file.source.path.suffix.lower() == ".sub":
            out |= {line.name for line in file.statements if isinstance(line, Begin)}
        for words in lines_of_words(file.source.text) if not file.holds_data else ():
            out |= set(_behind_do([word.upper for word in words]))
    return frozenset(out)


def _behind_do(words: Sequence[str]) -> Iterator[str]:
    if {"INTERRUPT", "TRIGGER"} & set(words) and "DO" in words[:-1]:
        yield words[words.index("DO") + 1]


def callers_first(callers: dict[str, set[str]]) -> list[str]:
    """Names of routines, each behind those that call it as far as they do not call each other."""
    order: list[str] = []
    left = dict(callers)
    while left:
        free = [name for name, others in left.items() if not (others - {name}) & left.keys()]
        for name in free or list(left)[:1]:
            order.append(name)
            del left[name]
    return order

"""The routines of a KRL program, what each alters, and which calls which."""

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from robot_programs.core.flow import with_called
from robot_programs.krl.data import BUILT_IN, Data, File
from robot_programs.krl.parse import handed_in_motion, handed_over
from robot_programs.krl.state import EVERYTHING
from robot_programs.krl.syntax import (
    Assignment,
    Begin,
    Beside,
    Call,
    Control,
    Declaration,
    End,
    Motion,
    Statement,
    Word,
    lines_of_words,
)
from robot_programs.krl.values import Names


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
            real_numbers=data.real_numbers,
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


_VARIABLES = {
    "$TOOL": "tool",
    "$BASE": "base",
    "$IPO_MODE": "mode",
    "FDAT_ACT": "parameters",
    "$VEL": "speed",
    "$APO": "approximation",
}
_COMMANDS = {
    "#INITMOV": EVERYTHING - {"motion"},
    "#PTP_PARAMS": frozenset({"tool", "base", "mode", "approximation"}),
    "#PTP_DAT": frozenset({"tool", "base", "mode", "approximation"}),
    "#FRAMES": frozenset({"tool", "base", "mode"}),
    "#CP_PARAMS": frozenset({"tool", "base", "mode", "speed", "approximation"}),
    "#CP_DAT": frozenset({"tool", "base", "mode", "approximation"}),
    "#VEL_CP": frozenset({"speed"}),
    "#TOOL": frozenset({"tool"}),
    "#BASE": frozenset({"base"}),
    "#EX_BASE": frozenset({"base"}),
}


def altered_by(line: Statement, routines: Mapping[str, frozenset[str]]) -> frozenset[str]:
    """What of `EVERYTHING` a line alters, given what routines alter."""
    match line:
        case Motion():
            own = frozenset({"motion"})
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
            altered = _COMMANDS.get(line.command, frozenset[str]()) - {"parameters"}
            own = {variable for variable, what in _VARIABLES.items() if what in altered}
        case Call():
            own = {*handed_over(line, by_value)}
        case Motion():
            own = {*handed_in_motion(line, by_value)}
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
        case Assignment() | Control() | Motion():
            return _before_parentheses(line.words)
        case _:
            return ()


def _before_parentheses(words: Sequence[Word | None]) -> tuple[str, ...]:
    return tuple(
        a.upper for a, b in pairwise(words) if a is not None and b is not None and a.kind == "name" and b.text == "("
    )


def only_computes(routine: Routine, routines: Container[str]) -> bool:
    """Whether a call of a routine can be left out, once its value is known: it sets variables of its own and nothing else."""
    own = {v.name for line in routine.lines if isinstance(line, Declaration) for v in line.variables}
    for line in routine.lines:
        match line:
            case Begin() | End() | Declaration():
                continue
            case Assignment() if line.variable in own:
                pass
            case Control():
                pass
            case _:
                return False
        if any(name in routines for name in calls_of(line)):
            return False
    return True


def altering(routines: Mapping[str, Sequence[Routine]]) -> dict[str, frozenset[str]]:
    """What the routines of each name alter, by themselves or by those that they call."""
    own = {
        name: (
            frozenset[str]().union(*(altered_by(line, {}) for r in same for line in r.lines)),
            _called(same, routines),
        )
        for name, same in routines.items()
    }
    return with_called(own)


def changing(routines: Mapping[str, Sequence[Routine]], data: Data) -> dict[str, frozenset[str]]:
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
    return with_called(own)


def _called(same: Sequence[Routine], routines: Mapping[str, object]) -> frozenset[str]:
    return frozenset(name for r in same for line in r.lines for name in calls_of(line) if name in routines)


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
    return with_called({name: (own[name], frozenset(others)) for name, others in callers.items()})


_BY_BAS = frozenset({"LDAT_ACT", "PDAT_ACT", "TOOL_DATA", "BASE_DATA", *_VARIABLES})
"""Variables that the controller's own routine reads."""


def read_names(files: Iterable[File]) -> frozenset[str]:
    """Variables, and other names, that code reads anywhere."""
    out = set(_BY_BAS)
    for file in files:
        for words in lines_of_words(file.source.text) if not file.holds_data else ():
            assigns = len(words) > 1 and words[1].text in ("=", "[", ".") and words[0].kind == "name"
            out |= {word.upper for word in words[assigns:] if word.kind == "name"}
    return frozenset(out)


def matters(line: Statement, read: frozenset[str], routines: Container[str]) -> bool:
    """Whether a line is of any consequence for motions: not what sets a variable that nothing reads.

    Args:
        line: the line.
        read: names that code reads.
        routines: names of the routines of the files.
    """
    match line:
        case Assignment():
            asks = line.changed or any(name in routines for name in calls_of(line))
            return bool(asks) or line.variable in read
        case Motion() | Call() | Control() | Beside():
            return True
        case _:
            return False


def resuming(files: Iterable[File], routines: Mapping[str, Sequence[Routine]]) -> frozenset[str]:
    """Routines that declare an interrupt whose routine resumes, which leaves those that they call."""
    resumes = with_called(
        {
            name: (
                frozenset({"RESUME"} if any(_resumes(line) for r in same for line in r.lines) else ()),
                _called(same, routines),
            )
            for name, same in routines.items()
        }
    )
    out: set[str] = set()
    for file in files:
        current = ""
        for words in lines_of_words(file.source.text) if not file.holds_data else ():
            upper = [word.upper for word in words]
            head = next((i for i, word in enumerate(upper) if word in ("DEF", "DEFFCT")), None)
            if head is not None and head < 2:
                names = [word.upper for word in words[head + 1 :] if word.kind == "name"]
                current = next((name for name in names if name in routines), "")
            elif "INTERRUPT" in upper and any(resumes.get(name) for name in _behind_do(upper)):
                out.add(current)
    return frozenset(out)


def _resumes(line: Statement) -> bool:
    return isinstance(line, Control) and line.keyword == "RESUME"


def unasked(files: Iterable[File]) -> frozenset[str]:
    """Routines that are not called from the line before: by interrupts, beside a motion, or in the submit interpreter."""
    out: set[str] = set()
    for file in files:
        if file.submits:
            out |= {line.name for line in file.heads}
        for words in lines_of_words(file.source.text) if not file.holds_data else ():
            out |= set(_behind_do([word.upper for word in words]))
    return frozenset(out)


def _behind_do(words: Sequence[str]) -> Iterator[str]:
    if {"INTERRUPT", "TRIGGER"} & set(words) and "DO" in words[:-1]:
        yield words[words.index("DO") + 1]

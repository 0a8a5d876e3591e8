"""The routines of a KRL program, what each alters, and which calls which."""

from dataclasses import dataclass

from taskcal.programs.krl.data import BUILT_IN, File
from taskcal.programs.krl.frames import EVERYTHING
from taskcal.programs.krl.syntax import Assignment, Begin, Call, End, Motion, Statement


@dataclass(frozen=True, eq=False, kw_only=True)
class Routine:
    """A routine, local or global."""

    file: File
    name: str
    """In capitals."""
    lines: tuple[Statement, ...]


def routines_of(files: tuple[File, ...]) -> dict[str, list[Routine]]:
    """The routines of some files by name, which routines of several files may share."""
    out: dict[str, list[Routine]] = {}
    for file in files:
        if file.holds_data or file.module == BUILT_IN:
            continue
        start, name = 0, ""
        for i, line in enumerate((*file.statements, None)):
            if line is None or isinstance(line, Begin | End):
                if name:
                    out.setdefault(name, []).append(Routine(file=file, name=name, lines=file.statements[start:i]))
                start, name = i + 1, line.name if isinstance(line, Begin) else ""
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


def altered_by(line: Statement, routines: dict[str, frozenset[str]]) -> frozenset[str]:
    """What of `EVERYTHING` a line alters, given what routines alter."""
    match line:
        case Motion():
            return frozenset({"motion"})
        case Assignment() if line.variable in _VARIABLES:
            return frozenset({_VARIABLES[line.variable]})
        case Call(name="BAS"):
            return _COMMANDS.get(line.command, frozenset())
        case Call() if line.name in routines:
            return routines[line.name]
        case _:
            return frozenset()


def altering(routines: dict[str, list[Routine]]) -> dict[str, frozenset[str]]:
    """What the routines of each name alter, by themselves or by those that they call."""
    alters = dict.fromkeys(routines, frozenset[str]())
    while True:
        wider = {
            name: frozenset[str]().union(*(altered_by(line, alters) for r in same for line in r.lines))
            for name, same in routines.items()
        }
        if wider == alters:
            return alters
        alters = wider


def callers_of(routines: dict[str, list[Routine]]) -> dict[str, set[str]]:
    """By name of routines: names of those that call them."""
    out: dict[str, set[str]] = {name: set() for name in routines}
    for name, same in routines.items():
        for line in (line for routine in same for line in routine.lines):
            if isinstance(line, Call) and line.name in routines:
                out[line.name].add(name)
    return out


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

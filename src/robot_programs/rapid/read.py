"""From the files of a RAPID program to its motions."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

from robot_programs.core.errors import FileError
from robot_programs.core.program import Diagnostic, Program, Visit, Waypoint
from robot_programs.core.robot import Robot
from robot_programs.core.source import Source
from robot_programs.rapid.changes import Use, changes, effects_of, is_late, is_strange, nested, uses
from robot_programs.rapid.flow import Findings, follow_program
from robot_programs.rapid.names import (
    BY_NAME,
    LATE,
    MOTIONLESS,
    MOVING,
    OFFSETTING,
    SHIFTING,
    SOFTENING,
    TURNING,
    Context,
    File,
    Symbol,
    contexts,
)
from robot_programs.rapid.parse import parse
from robot_programs.rapid.resolve import SUFFIX, Motion, Settings, base_frame
from robot_programs.rapid.rewrite import Sharing, rewrite_files, visits_of
from robot_programs.rapid.syntax import Instruction, Module, Problem, Token, TooMuch, Unparsed
from robot_programs.rapid.values import Values


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class RapidProgram(Program):
    """A program of one or several RAPID modules."""

    motions: tuple[Motion, ...]
    """The moves with their text, in the same order."""
    uses: Mapping[Symbol, tuple[Use, ...]]
    """All references to declared data."""
    everywhere: tuple[Context, ...] = ()
    """Modules and routines."""
    unresolved: frozenset[Instruction] = frozenset()
    """Motions that were not resolved, on no way that leads to them."""

    def rewrite(self, robot: Robot, waypoints: Mapping[int, tuple[Waypoint, ...]]) -> tuple[Source, ...]:
        """The program's files with some motions rewritten.

        Args:
            robot: the robot, whose joint positions decide the configuration data that are written.
            waypoints: by number of the motion.

        Raises:
            InputError: the robot has not six joints.
        """
        return rewrite_files(self.sources, self.motions, self.uses, robot, waypoints)

    def unwritable(
        self, robot: Robot, waypoints: Mapping[int, tuple[Waypoint, ...]], tolerance: float
    ) -> dict[int, str]:
        """Motions that cannot be rewritten as they should; see `Program.unwritable`."""
        return Sharing(motions=self.motions, uses=self.uses, robot=robot, tolerance=tolerance).unwritable(waypoints)

    def visits(self) -> Iterable[Visit]:
        """Motions of one routine to one target; see `Program.visits`."""
        read = ((symbol, use) for symbol, own in self.uses.items() for use in own)
        return visits_of(self.everywhere, self.motions, self.unresolved, read)

    def reread(self, sources: tuple[Source, ...]) -> "RapidProgram":
        """The program of other texts of the same files; see `Program.reread`."""
        return read_rapid(sources)


def read_rapid(sources: Sequence[Source]) -> RapidProgram:
    """Read the modules of a program: those with its routines and those with its tools, work objects and targets.

    Args:
        sources: the files.

    Raises:
        FileError: a file is no RAPID module.
    """
    diagnostics: list[Diagnostic] = []
    files: list[File] = []
    parameters = [source for source in sources if source.path.suffix.lower() == SUFFIX]
    if len(parameters) > 1:
        raise FileError(parameters[1].path, f"is motion parameters as {parameters[0].path} is; pass one MOC.cfg")
    if len(parameters) == len(sources):
        raise FileError(parameters[0].path, "holds motion parameters only; pass the modules with the motions, too")
    T_world_base = base_frame(parameters[0]) if parameters else None
    for source in sources:
        if source in parameters:
            continue
        modules, problems = _parsed(source)
        files.append(File(source=source, modules=modules))
        diagnostics += [Diagnostic(place=source.place(p.position), text=p.text) for p in problems]
    everywhere = tuple(contexts(files))
    changed = changes(everywhere)
    values = Values(assigned=changed.assigned)
    settings = replace(_settings(everywhere, values), T_world_base=T_world_base)
    findings = Findings(settings=settings, files=files)
    follow_program(everywhere, effects_of(everywhere, changed), values, findings)
    motions = findings.motions()
    diagnostics += findings.diagnostics(motions)
    for context in everywhere:
        diagnostics += _lost_motions(context)
    diagnostics += _cautions(everywhere)
    diagnostics += [Diagnostic(place=file.source.place(at), text=text) for text, (file, at) in settings.notes.items()]
    order = {source.path: i for i, source in enumerate(sources)}
    diagnostics.sort(key=lambda diagnostic: (order[diagnostic.place.path], diagnostic.place.line))
    return RapidProgram(
        sources=tuple(sources), moves=tuple(motion.move for motion in motions), diagnostics=tuple(diagnostics),
        motions=tuple(motions), uses=uses(everywhere, values), everywhere=everywhere, T_world_base=T_world_base,
        unresolved=frozenset(findings.reasons).difference(motion.instruction for motion in motions),
    )  # fmt: skip


def _parsed(source: Source) -> tuple[tuple[Module, ...], tuple[Problem, ...]]:
    if "\0" in source.text:
        raise FileError(source.path, "is a binary file; give a RAPID module as text")
    # looked for first: of a file that has none, every word would be taken apart for nothing
    try:
        modules, problems = parse(source.text) if re.search("MODULE", source.text, re.IGNORECASE) else ((), ())
    except TooMuch as much:
        raise FileError(source.path, much.text, line=source.line(much.position)) from None
    if not modules:
        raise FileError(source.path, "has no MODULE; give a RAPID module (.mod, .sys, .prg, .modx or .sysx)")
    return modules, problems


def _settings(everywhere: Iterable[Context], values: Values) -> Settings:
    """What the instructions of the program set for all of it: where they do so sometimes, they may do so always."""
    off: set[str] = set()
    shift = offset = soft = ""
    for file, name, options in _words(everywhere):
        if name.key == "confj" and "off" in options:
            off.add("joint")
        elif name.key == "confl" and "off" in options:
            off |= {"linear", "circular"}
        elif name.key in SHIFTING and not shift:
            shift = f"a program displacement may shift it ({name.text} in {file.source.place(name.start)})"
        elif name.key in OFFSETTING and not offset:
            offset = f"{name.text} in {file.source.place(name.start)}"
        elif name.key == SOFTENING and not soft:
            soft = f"{name.text} in {file.source.place(name.start)}"
    return Settings(
        values=values, postures_off=frozenset(off), shift=shift, external_offset=offset, soft=soft,
    )  # fmt: skip


def _cautions(everywhere: Sequence[Context]) -> Iterator[Diagnostic]:
    """What instructions do to motions elsewhere."""
    for file, name, options in _words(everywhere):
        if name.key in SHIFTING:
            text = f"{name.text} begins a program displacement, which may shift any motion to a pose; none is read"
        elif name.key == "singarea" and any(option in TURNING for option in options):
            text = (
                f"{name.text} lets the tool turn in another way along lines and arcs; "
                "its orientation between targets is not as predicted"
            )
        elif name.key in OFFSETTING:
            text = f"{name.text} shifts the external axes by what is not read; where one carries robot or part, no motion is"
        elif name.key in BY_NAME:
            text = f"{name.text} sets data by their names; they are taken to stay as they are declared"
        else:
            continue
        yield Diagnostic(place=file.source.place(name.start), text=text)
    for context in everywhere:
        for statement in nested(() if context.routine is None else context.routine.statements):
            if not isinstance(statement, Instruction):
                continue
            name = statement.name.text
            if is_late(statement, context.scope):
                name = "this" if name == LATE[0] else name
                text = (
                    f"{name} calls a procedure whose name is known only at run time; one that is not in the files given is "
                    "taken to leave all data as they are"
                )
            elif is_strange(statement.name.key, context.scope):
                text = (
                    f"{name} is not in the files given; it is taken to leave all data as they are that it is not given"
                )
            else:
                continue
            yield Diagnostic(place=context.file.source.place(statement.start), text=text)


def _words(everywhere: Iterable[Context]) -> Iterator[tuple[File, Token, frozenset[str]]]:
    """Names of instructions with the options they are given; all names in text that is not understood."""
    for context in everywhere:
        routine = context.routine
        blocks = (context.module.unparsed,) if routine is None else (routine.body, *routine.handlers)
        for statement in chain.from_iterable(map(nested, blocks)):
            match statement:
                case Instruction():
                    options = frozenset(a.option for a in statement.arguments if a.option)
                    yield context.file, statement.name, options
                case Unparsed():
                    options = frozenset(token.key for token in statement.tokens if token.kind == "name")
                    for token in statement.tokens:
                        if token.kind == "name":
                            yield context.file, token, options
                case _:
                    pass


def _lost_motions(context: Context) -> Iterable[Diagnostic]:
    """Motions in text that was not understood."""
    if context.routine is None:
        for unparsed in context.module.unparsed:
            yield from _motions_in(unparsed, context)
        return
    for block in (context.routine.body, *context.routine.handlers):
        for statement in nested(block):
            if isinstance(statement, Unparsed):
                yield from _motions_in(statement, context)


def _motions_in(unparsed: Unparsed, context: Context) -> Iterable[Diagnostic]:
    for token in unparsed.tokens:
        if token.kind == "name" and token.key.startswith(MOVING) and token.key not in MOTIONLESS:
            text = f"{token.text} stays as it is: the text around it is not understood ({unparsed.trouble(context.file.source)})"
            yield Diagnostic(place=context.file.source.place(token.start), text=text)

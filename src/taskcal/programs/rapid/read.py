"""From the files of a RAPID program to its motions."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

from taskcal.errors import FileError
from taskcal.programs.program import Diagnostic, Program, Waypoint
from taskcal.programs.rapid.base_frame import SUFFIX, base_frame
from taskcal.programs.rapid.flow import follow_routine, gets_target, is_motion, is_read, nested
from taskcal.programs.rapid.lexer import Token
from taskcal.programs.rapid.names import Context, File, Scope, Symbol, contexts
from taskcal.programs.rapid.parser import parse
from taskcal.programs.rapid.predefined import MOTIONLESS, MOVING, SHIFTING, TURNING
from taskcal.programs.rapid.resolve import Motion, Settings, resolve
from taskcal.programs.rapid.rewrite import rewrite_files
from taskcal.programs.rapid.syntax import Branches, Instruction, Loop, Module, Problem, Statement, Unparsed
from taskcal.programs.rapid.uses import Use, assigned, uses
from taskcal.programs.rapid.values import Values
from taskcal.programs.source import Source
from taskcal.programs.unresolved import Unresolved
from taskcal.robot.robot import Robot


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class RapidProgram(Program):
    """A program of one or several RAPID modules."""

    motions: tuple[Motion, ...]
    """The moves with their text, in the same order."""
    uses: Mapping[Symbol, tuple[Use, ...]]
    """All references to declared data."""

    def rewrite(self, robot: Robot, waypoints: Mapping[int, tuple[Waypoint, ...]]) -> tuple[Source, ...]:
        """The program's files with some motions rewritten.

        Args:
            robot: the robot, whose joint positions decide the configuration data that are written.
            waypoints: by number of the motion.

        Raises:
            TaskcalError: the robot has not six joints.
        """
        return rewrite_files(self.sources, self.motions, self.uses, robot, waypoints)

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
    values = Values(assigned=assigned(everywhere))
    settings = replace(_settings(everywhere, values), T_world_base=T_world_base)
    motions: list[Motion] = []
    for context in everywhere:
        follow_routine(context, _Resolver(context, settings, motions, diagnostics))
        diagnostics += _lost_motions(context)
    diagnostics += _cautions(everywhere)
    diagnostics += [Diagnostic(place=file.source.place(at), text=text) for text, (file, at) in settings.notes.items()]
    order = {source.path: i for i, source in enumerate(sources)}
    diagnostics.sort(key=lambda diagnostic: (order[diagnostic.place.path], diagnostic.place.line))
    return RapidProgram(
        sources=tuple(sources), moves=tuple(motion.move for motion in motions), diagnostics=tuple(diagnostics),
        motions=tuple(motions), uses=uses(everywhere, values), T_world_base=T_world_base,
    )  # fmt: skip


def _parsed(source: Source) -> tuple[tuple[Module, ...], tuple[Problem, ...]]:
    if "\0" in source.text:
        raise FileError(source.path, "is a binary file; give a RAPID module as text")
    modules, problems = parse(source.text)
    if not modules:
        raise FileError(source.path, "has no MODULE; give a RAPID module (.mod, .sys, .prg, .modx or .sysx)")
    return modules, problems


class _Resolver:
    """Resolves the motions of a routine; keeps them, and says of the others why they cannot be."""

    def __init__(self, context: Context, settings: Settings, motions: list[Motion], diagnostics: list[Diagnostic]):
        self.context, self.settings, self.motions, self.diagnostics = context, settings, motions, diagnostics

    def __call__(self, instruction: Instruction, scope: Scope, follows: int | None) -> int | None:
        file = self.context.file
        name = self.context.routine.name.text if self.context.routine else ""
        try:
            if not is_read(instruction, scope):
                raise Unresolved("this motion is not read")
            motion = resolve(instruction, scope, file, self.settings, name, follows)
        except Unresolved as reason:
            text = f"{instruction.name.text} stays as it is: {reason}"
            self.diagnostics.append(Diagnostic(place=file.source.place(instruction.start), text=text))
            return None
        self.motions.append(motion)
        return len(self.motions) - 1


def _settings(everywhere: Iterable[Context], values: Values) -> Settings:
    """What the instructions of the program set for all of it: where they do so sometimes, they may do so always."""
    off: set[str] = set()
    shift = ""
    for file, name, options in _words(everywhere):
        if name.key == "confj" and "off" in options:
            off.add("joint")
        elif name.key == "confl" and "off" in options:
            off |= {"linear", "circular"}
        elif name.key in SHIFTING and not shift:
            shift = f"a program displacement may shift it ({name.text} in {file.source.place(name.start)})"
    return Settings(values=values, postures_off=frozenset(off), shift=shift)


def _cautions(everywhere: Iterable[Context]) -> Iterator[Diagnostic]:
    """What instructions do to motions elsewhere."""
    for file, name, options in _words(everywhere):
        if name.key in SHIFTING:
            text = f"{name.text} begins a program displacement, which may shift any motion to a pose; none is read"
        elif name.key == "singarea" and any(option in TURNING for option in options):
            text = (
                f"{name.text} lets the tool turn in another way along lines and arcs; "
                "its orientation between targets is not as predicted"
            )
        else:
            continue
        yield Diagnostic(place=file.source.place(name.start), text=text)


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
    """Motions in text that was not understood, and targets that are handed to a routine."""
    if context.routine is None:
        for unparsed in context.module.unparsed:
            yield from _motions_in(unparsed, context)
        return
    for block in (context.routine.body, *context.routine.handlers):
        yield from _lost_in(block, context, context.scope)


def _lost_in(block: Iterable[Statement], context: Context, scope: Scope) -> Iterable[Diagnostic]:
    for statement in block:
        match statement:
            case Unparsed():
                yield from _motions_in(statement, context)
            case Branches():
                for branch in statement.branches:
                    yield from _lost_in(branch, context, scope)
            case Loop():
                yield from _lost_in(statement.body, context, scope.with_counter(statement.counter))
            case Instruction() if not is_read(statement, scope) and not is_motion(statement, scope):
                if statement.name.key in scope.routines and gets_target(statement, scope):
                    text = f"the target that '{statement.name.text}' is given stays as it is: motions to a routine's parameter"
                    yield Diagnostic(place=context.file.source.place(statement.start), text=f"{text} are not read")
            case _:
                pass


def _motions_in(unparsed: Unparsed, context: Context) -> Iterable[Diagnostic]:
    for token in unparsed.tokens:
        if token.kind == "name" and token.key.startswith(MOVING) and token.key not in MOTIONLESS:
            text = f"{token.text} stays as it is: the text around it is not understood ({unparsed.trouble(context.file.source)})"
            yield Diagnostic(place=context.file.source.place(token.start), text=text)

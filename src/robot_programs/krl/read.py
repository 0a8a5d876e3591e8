"""Reading KRL programs: where each motion goes, from the routines that nothing calls through all that they call."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

from robot_programs.core.flow import lines_in
from robot_programs.core.form import Lit
from robot_programs.core.interpreter import Interpreter, interpreted, known_motions
from robot_programs.core.program import Cause, Diagnostic, Frame, Motion, Unresolved
from robot_programs.core.source import Source, uncollected
from robot_programs.krl.data import (
    BUILT_IN,
    GIVEN,
    TABLES,
    KrlFile,
    Names,
    given_data,
)
from robot_programs.krl.lower import LoweredKrl, MotionStep, lowered
from robot_programs.krl.meaning import KrlMeaning
from robot_programs.krl.points import KrlSite
from robot_programs.krl.rewrite import KrlProgram
from robot_programs.krl.syntax import Begin, MotionLine
from taskcal_groundwork.errors import FileError, InputError


@uncollected()
def read_krl(
    sources: Sequence[Source],
    tools: Mapping[str, Frame] | None = None,
    parts: Mapping[str, Frame] | None = None,
    data: Mapping[str, str] | None = None,
) -> KrlProgram:
    """Read a KRL program.

    Args:
        sources: its ``.src`` files, with their ``.dat`` and, for tools and bases by number, ``$config.dat``.
        tools: those that no file states, by name: ``TOOL_DATA[3]``.
        parts: bases that no file states, in the world, the same.
        data: points, parameter sets and numbers that no file states, by name, as KRL writes them.

    Raises:
        FileError: a file is no KRL, or none holds a program.
        InputError: a value that is given is none.
    """
    files = tuple(KrlFile.of(i, source) for i, source in enumerate(sources))
    for file in files:
        if not any(isinstance(line, Begin) for line in file.statements):
            raise FileError(file.source.path, f"is not a KRL file: no {'DEFDAT' if file.holds_data else 'DEF'} line")
    if sources and all(file.holds_data for file in files):
        raise FileError(sources[0].path, "holds data only; pass the .src with the motions, too")
    given = {name.upper(): frame for name, frame in {**(tools or {}), **(parts or {})}.items()}
    if data:
        beside = given_data(len(files), data)
        for datum in (datum for file in files for datum in file.stated if datum.shared):
            if any(datum.name == other.name for other in beside.stated):
                raise InputError(f"{datum.name} is stated in {datum.place}; leave it out beside the files")
        files = (*files, beside)
    names = Names(files=files)
    form = lowered(names)
    meaning = KrlMeaning(lowered=form, given_frames=given)
    found = interpreted([*form.routines.values(), *form.stray], meaning)
    motions, sites = list[Motion](), list[KrlSite]()
    for move, one in known_motions(found.findings):
        motions.append(move)
        sites.append(replace(one.motion.written, before=one.before) if one.before else one.motion.written)
    said = {
        *_left(found),
        *_not_run(form),
        *_of_motions(found),
        *((*at, False) for at in form.said),
        *_elsewhere(found, form, motions),
        *_warned(files),
    }
    try:
        T_world_base = meaning.robroot
    except Unresolved:  # the motions to poses say so
        T_world_base = None
    del meaning.flow  # the two would keep each other
    return KrlProgram(
        sources=tuple(sources),
        motions=tuple(motions),
        diagnostics=(
            *_taken(files, names),
            *(
                Diagnostic(place=files[file].source.place(position), text=text, unread=unread)
                for file, position, text, unread in sorted(said)
            ),
        ),
        sites=tuple(sites),
        files=files,
        T_world_base=T_world_base,
        unresolved=frozenset(line.at[:2] for line in found.findings.reasons),
        routines=tuple(form.routines.values()),
        beside=(*form.stray, *form.actions.values()),
        turns=found.turns,
        begun=found.begun,
        read=partial(read_krl, tools=tools, parts=parts, data=data),
    )


Said = tuple[int, int, str, bool]
"""Number of a file, position, what is said, and whether a motion there is left."""


def _left(found: Interpreter) -> Iterator[Said]:
    """Motions that are not understood, and why."""
    for line, (_, reason) in found.findings.reasons.items():
        assert isinstance(line, MotionStep)
        text = Cause(f"{line.statement.keyword} stays as it is: {reason}", of=[reason])
        yield (*line.at[:2], text, True)


def _not_run(form: LoweredKrl) -> Iterator[Said]:
    """Motions in lines that belong to no routine, or to no part of one that is run."""
    run = {line.at[:2] for routine in form.routines.values() for line in lines_in(routine.nodes) if line is not None}
    for file in form.files:
        for section in () if file.holds_data or file.module == BUILT_IN else file.sections:
            where = "outside of any routine" if section.head is None else "where no line is run"
            for line in section.lines:
                if isinstance(line, MotionLine) and (file.number, line.start) not in run:
                    why = f"it stands {where}; look for a line that is not understood, such as DEF or CASE"
                    yield file.number, line.start, f"{line.keyword} stays as it is: {why}", True


def _of_motions(found: Interpreter) -> Iterator[Said]:
    """Motions along which something acts."""
    for line in {one.text for one in found.findings.occurrences}:
        if isinstance(line, MotionStep) and line.triggered:
            yield (*line.at[:2], "a TRIGGER acts along this motion; check it if the motion is divided", False)


def _elsewhere(found: Interpreter, form: LoweredKrl, motions: Sequence[Motion]) -> Iterator[Said]:
    """Tools and bases that another program may change."""
    using = defaultdict[str, set[str]](set)
    for motion in motions:
        for frame in (motion.tool, motion.part):
            using[frame.name].add(motion.routine)
    said = set[str]()
    for routine, line in ((one, line) for one in form.all for line in one.lines):
        for ref in (ref for ref in found.changes.by(line) if ref.key in TABLES):
            match ref.path:
                case ((Lit(value=float(number)),), *_):
                    names = [f"{ref.key}[{number:g}]"]
                case _:
                    names = [name for name in using if name.startswith(f"{ref.key}[")]
            for name in names:
                if (
                    name not in said
                    and using[name]
                    and all(form.names.is_apart(one, routine.name) for one in using[name])
                ):
                    said.add(name)
                    text = f"{name} is changed here, in a program of its own; motions are corrected for the value in the data list"
                    yield *line.at[:2], text, False


def _warned(files: Sequence[KrlFile]) -> Iterator[Said]:
    """Where the controller may correct its geometry by itself."""
    text = "the controller's own absolute accuracy may be on; a corrected program would then correct twice"
    for file in (file for file in files if "$ABS_" in file.source.text.upper()):
        for at in (at for name in ("$ABS_ACCUR", "$ABS_CONVERT") for at in file.mentions.get(name, ())):
            yield file.number, file.source.start(file.source.line(at)), text, False


def _taken(files: Sequence[KrlFile], names: Names) -> Iterator[Diagnostic]:
    """Values that are stated once beside the files, and that several programs take."""
    beside = next((file for file in files if file.source.path == GIVEN), None)
    shared = "is stated once beside the files, and taken in {}; pass the data list of those that have their own"
    for datum in sorted(beside.stated, key=lambda one: one.name) if beside is not None else ():
        modules = {
            file.module
            for file in files
            if not file.holds_data
            and datum.variable in file.read
            and names.key_in(file.module, datum.variable) == datum.variable
        }
        if len(modules) > 1:
            text = f"{datum.name} {shared.format(', '.join(sorted(modules)))}"
            yield Diagnostic(place=files[0].source.place(0), text=text)

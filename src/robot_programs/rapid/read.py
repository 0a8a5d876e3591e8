"""From the files of a RAPID program to its motions."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

from robot_programs.core.flow import Findings
from robot_programs.core.form import MoveLine
from robot_programs.core.interpreter import FoundMotion, interpreted
from robot_programs.core.program import Cause, Diagnostic, Frame, Motion
from robot_programs.core.source import Source, uncollected
from robot_programs.rapid.lower import LoweredRapid, Unread, lowered
from robot_programs.rapid.meaning import RapidMeaning, uses
from robot_programs.rapid.names import (
    BY_NAME,
    IDENTITY,
    LATE,
    MOTIONLESS,
    MOVING,
    OFFSETTING,
    SHIFTING,
    SOFTENING,
    TURNING,
    ZERO_LOAD,
    ModuleFile,
    Symbol,
    Value,
    procedures,
)
from robot_programs.rapid.parse import Notes, parse
from robot_programs.rapid.resolve import (
    MOTION_FORMS,
    SUFFIX,
    MoveInstruction,
    RapidSite,
    Settings,
    base_frame,
    motion_of,
    poses_of,
)
from robot_programs.rapid.rewrite import RapidProgram
from robot_programs.rapid.syntax import ModuleText, words
from robot_programs.rapid.values import as_pose, plain
from taskcal_groundwork.errors import FileError


@uncollected()
def read_rapid(
    sources: Sequence[Source], tools: Mapping[str, Frame] | None = None, parts: Mapping[str, Frame] | None = None
) -> RapidProgram:
    """Read the modules of a program: those with its routines and those with its tools, work objects and targets.

    Args:
        sources: the files.
        tools: those that the files do not declare, held by the robot, by name.
        parts: work objects that the files do not declare, which stand still in the world, by name.

    Raises:
        FileError: a file is no RAPID module.
    """
    diagnostics: list[Diagnostic] = []
    texts: dict[ModuleFile, Sequence[ModuleText]] = {}
    notes: dict[ModuleFile, Notes] = {}
    parameters = [source for source in sources if source.path.suffix.lower() == SUFFIX]
    if len(parameters) > 1:
        raise FileError(parameters[1].path, f"is motion parameters as {parameters[0].path} is; pass one MOC.cfg")
    if len(parameters) == len(sources):
        raise FileError(parameters[0].path, "holds motion parameters only; pass the modules with the motions, too")
    T_world_base = base_frame(parameters[0]) if parameters else None
    for source in sources:
        if source in parameters:
            continue
        file = ModuleFile(source=source, number=len(texts))
        texts[file], notes[file] = _parsed(source)
        diagnostics += _outside(file, texts[file])
    form = lowered(notes, procedures(texts, _given(tools or {}, parts or {})))
    texts.clear()
    for file, own in notes.items():
        diagnostics += [Diagnostic(place=file.source.place(one.position), text=one.text) for one in own.problems]
    settings = replace(_settings(form), T_world_base=T_world_base)
    meaning = RapidMeaning(files=form.files, lowered=form, settings=settings, softens=bool(settings.soft))
    flow = interpreted(form.all, meaning)
    sites, motions = _motions(flow.findings, settings)
    diagnostics += _left(flow.findings, sites, meaning)
    diagnostics += _lost_motions(form)
    diagnostics += _cautions(form)
    diagnostics += [Diagnostic(place=file.source.place(at), text=text) for text, (file, at) in settings.notes.items()]
    order = {source.path: i for i, source in enumerate(sources)}
    diagnostics.sort(key=lambda diagnostic: (order[diagnostic.place.path], diagnostic.place.line))
    used, frames = uses(meaning), _frames(form, meaning)
    del meaning.flow  # the two would keep each other
    return RapidProgram(
        sources=tuple(sources), motions=tuple(motions), diagnostics=tuple(diagnostics),
        sites=tuple(sites), uses=used, form=form, files=tuple(form.files), frames=frames,
        routines=tuple(form.procedures), turns=flow.turns, begun=flow.begun, read=partial(read_rapid, tools=tools, parts=parts),
        T_world_base=T_world_base,
        shift=settings.shift,
        unresolved=frozenset(map(_motion, flow.findings.reasons)).difference(site.line for site in sites),
    )  # fmt: skip


def _frames(form: LoweredRapid, meaning: RapidMeaning) -> dict[Symbol, Value]:
    """What tools and work objects are declared as."""
    return {one: plain(meaning.declared(one)) for one in form.declared if one.type in ("tooldata", "wobjdata")}


def _motion(line: MoveLine) -> MoveInstruction:
    assert isinstance(line, MoveInstruction)
    return line


def _motions(findings: Findings[MoveLine, FoundMotion], settings: Settings) -> tuple[list[RapidSite], list[Motion]]:
    """All that can be rewritten, in the order of the text."""
    found = list(findings.ordered(lambda one: not _is_torn(one.motion.written, findings), lambda line: line.at[:2]))
    sites: list[RapidSite] = [one.motion.written for one in found]
    ends, vias = poses_of([site.end for site in sites]), poses_of([site.via for site in sites])
    # those of calls that nobody could follow count, too
    return sites, [
        motion_of(one, end, via, settings, one.same_text + (site.line in findings.reasons))
        for one, site, end, via in zip(found, sites, ends, vias, strict=True)
    ]


def _is_torn(site: RapidSite, findings: Findings[MoveLine, FoundMotion]) -> bool:
    """Whether a motion's own text would have to change, while on other ways nobody knows where it leads."""
    if site.line not in findings.reasons:
        return False
    return any(target.passed is None for target in (site.end, site.via) if target is not None)


def _left(
    findings: Findings[MoveLine, FoundMotion], sites: Iterable[RapidSite], meaning: RapidMeaning
) -> Iterator[Diagnostic]:
    """Why motions stay as they are, on all ways or on some."""
    partly, files = {site.line for site in sites}, meaning.files
    for line, (_, reason) in findings.reasons.items():
        where = " in some calls" if line in partly else ""
        text = Cause(f"{_motion(line).name} stays as it is{where}: {reason}", of=[reason])
        yield Diagnostic(place=files[line.at[0]].source.place(line.at[1]), text=text, unread=True)
    found = {one.text for one in findings.occurrences}
    for routine in meaning.lowered.all:
        for line in routine.lines:
            if isinstance(line, MoveInstruction) and line not in found and line not in findings.reasons:
                text = f"{line.name} stays as it is: no way through the program leads to it"
                yield Diagnostic(place=files[line.at[0]].source.place(line.at[1]), text=text, unread=True)
    for line in meaning.soft:
        text = (
            f"a servo may be soft here ({meaning.settings.soft}): the robot gives way, and the tool is not where the program "
            "says; corrected as if it were stiff"
        )
        yield Diagnostic(place=files[line.at[0]].source.place(line.at[1]), text=text)


def _given(tools: Mapping[str, Frame], parts: Mapping[str, Frame]) -> Iterator[Symbol]:
    """Tools and work objects as data of the program."""
    for name, frame in tools.items():
        yield Symbol(name=name, type="tooldata", value=(True, as_pose(frame.T), ZERO_LOAD))
    for name, frame in parts.items():
        yield Symbol(name=name, type="wobjdata", value=(False, True, "", as_pose(frame.T), IDENTITY))


def _parsed(source: Source) -> tuple[Sequence[ModuleText], Notes]:
    if "\0" in source.text:
        raise FileError(source.path, "is a binary file; give a RAPID module as text")
    # looked for first: of a file that has none, every word would be taken apart for nothing
    notes = Notes(source)
    modules = parse(notes) if re.search("MODULE", source.text, re.IGNORECASE) else ()
    if not modules:
        raise FileError(source.path, "has no MODULE; give a RAPID module (.mod, .sys, .prg, .modx or .sysx)")
    return modules, notes


def _settings(form: LoweredRapid) -> Settings:
    """Settings of the program's instructions for all of it: where they do so sometimes, they may do so always."""
    off: set[str] = set()
    shift = offset = soft = ""
    for one in form.instructions:
        key, where = one.key, f"{one.word.text} in {one.file.source.place(one.word.start)}"
        if key == "confj" and "off" in one.options:
            off.add("joint")
        elif key == "confl" and "off" in one.options:
            off |= {"linear", "circular"}
        elif key in SHIFTING:
            shift = shift or f"a program displacement may shift it ({where})"
        elif key in OFFSETTING:
            offset = offset or where
        elif key == SOFTENING:
            soft = soft or where
    return Settings(postures_off=frozenset(off), shift=shift, external_offset=offset, soft=soft)


def _cautions(form: LoweredRapid) -> Iterator[Diagnostic]:
    """Warnings of instructions that act on motions elsewhere, or of which nothing is known."""
    for one in form.instructions:
        name = one.word.text
        if one.key in SHIFTING:
            text = f"{name} begins a program displacement, which may shift any motion to a pose; none is read"
        elif one.key == "singarea" and any(option in TURNING for option in one.options):
            text = (
                f"{name} lets the tool turn in another way along lines and arcs; "
                "its orientation between targets is not as predicted"
            )
        elif one.key in OFFSETTING:
            text = f"{name} shifts the external axes by what is not read; where one carries robot or part, no motion is"
        elif one.key in BY_NAME:
            text = f"{name} sets data by their names; they are taken to stay as they are declared"
        elif one.kind == "late":
            text = (
                f"{'this' if name == LATE[0] else name} calls a procedure whose name is known only at run time; one that is not "
                "in the files given is taken to leave all data as they are"
            )
        elif one.kind == "strange":
            text = Cause(
                f"{name} is not in the files given; it is taken to leave all data as they are that it is not given",
                (name, "other"),
            )
        else:
            continue
        yield Diagnostic(place=one.file.source.place(one.word.start), text=text)


def _outside(file: ModuleFile, modules: Iterable[ModuleText]) -> Iterator[Diagnostic]:
    """Motions that stand in no module."""
    text, at = file.source.text, 0
    for start, end in (*((one.start, one.end) for one in modules), (len(text), len(text))):
        for word in words(text, at, start):
            if word.kind == "name" and word.text.lower() in MOTION_FORMS:
                why = f"{word.text} stays as it is: it stands outside any MODULE"
                yield Diagnostic(place=file.source.place(word.start), text=why, unread=True)
        at = end


def _lost_motions(form: LoweredRapid) -> Iterator[Diagnostic]:
    """Motions in text that was not understood."""
    for routine in form.all:
        source = routine.file.source
        for line in routine.lines:
            if not isinstance(line, Unread):
                continue
            # what follows a quotation mark that is one too many may be meant as statements
            open_texts = (one for one in line.words if one.kind == "text" and not one.text[1:].endswith('"'))
            inner = (word for one in open_texts for word in words(source.text, one.start + 1, one.end))
            for word in (*line.words, *inner):
                key = word.text.lower()
                if word.kind == "name" and key.startswith(MOVING) and key not in MOTIONLESS:
                    why = line.problem.trouble(source)
                    text = f"{word.text} stays as it is: the text around it is not understood ({why})"
                    yield Diagnostic(place=source.place(word.start), text=text, unread=True)

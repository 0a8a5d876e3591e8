"""Reading KRL programs: from the routines that nothing calls through all that they call."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from robot_programs.core.errors import FileError, InputError
from robot_programs.core.flow import MIN_LINES
from robot_programs.core.program import Diagnostic, Frame, Program, Unresolved, Visit, Waypoint
from robot_programs.core.robot import Robot
from robot_programs.core.source import Source
from robot_programs.krl.data import Data, File, Text
from robot_programs.krl.flow import Flow
from robot_programs.krl.frames import Frames
from robot_programs.krl.parse import parse, tree_of
from robot_programs.krl.resolve import Findings
from robot_programs.krl.rewrite import Sharing, Site, in_data_list, rewrite, visits_of
from robot_programs.krl.routines import (
    Routine,
    actions_of,
    altering,
    callers_of,
    calls_of,
    changing,
    declared_in,
    matters,
    read_names,
    resuming,
    roots_of,
    routines_of,
    unasked,
)
from robot_programs.krl.syntax import Begin, lines_of_words

MAX_PASSES = 30
"""As many lines as the program has, so many times, are gone through again for calls and the turns of loops; behind that, what
routines set is taken as not known, and loops are not taken turn by turn."""


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class KrlProgram(Program):
    """What was read from ``.src`` and ``.dat`` files."""

    sites: tuple[Site, ...]
    """Of the moves, in their order."""
    files: tuple[File, ...] = ()

    def rewrite(self, robot: Robot, waypoints: Mapping[int, tuple[Waypoint, ...]]) -> tuple[Source, ...]:
        """The program's files with some motions rewritten.

        Points of the program's own data list get new numbers there, or a copy beside them where other motions still need the old
        ones; all others are written into the motion itself. Waypoints before the last become motions of their own in the
        lines before.

        Args:
            robot: the robot, whose joint positions decide status and turn.
            waypoints: by number of the motion.

        Raises:
            InputError: a motion is to be rewritten that cannot be, because others share its text.
        """
        shared = Sharing(sites=self.sites, moves=self.moves, robot=robot).unwritable(waypoints)
        for number, why in shared.items():
            raise InputError(f"motion {number} of {self.moves[number].place} cannot be rewritten: {why}; leave it out")
        elements = in_data_list(self.sites, self.moves, waypoints)
        return rewrite(self.sources, self.sites, self.moves, robot, waypoints, elements)

    def unwritable(
        self, robot: Robot, waypoints: Mapping[int, tuple[Waypoint, ...]], tolerance: float
    ) -> dict[int, str]:
        """Motions that cannot be rewritten as they should; see `Program.unwritable`."""
        return Sharing(sites=self.sites, moves=self.moves, robot=robot).unwritable(waypoints)

    def visits(self) -> Iterable[Visit]:
        """Motions of one routine that name one point; see `Program.visits`."""
        return visits_of(self.sites, self.moves, self.files)

    def reread(self, sources: tuple[Source, ...]) -> "KrlProgram":
        """The program of other texts of the same files; see `Program.reread`."""
        return read_krl(sources)


def read_krl(sources: Sequence[Source]) -> KrlProgram:
    """Read a KRL program.

    Args:
        sources: its ``.src`` files, with their ``.dat`` and, for tools and bases by number, ``$config.dat``.

    Raises:
        FileError: a file is no KRL, or none holds a program.
    """
    files = tuple(
        File(number=i, source=source, statements=tuple(parse(source.text))) for i, source in enumerate(sources)
    )
    for file in files:
        if not any(isinstance(line, Begin) for line in file.statements):
            raise FileError(
                file.source.path, f"is no KRL file: it has no line {'DEFDAT' if file.holds_data else 'DEF'}"
            )
    if sources and all(file.holds_data for file in files):
        raise FileError(sources[0].path, "holds data only; pass the .src with the motions, too")
    return _Reading(files=files).program()


@dataclass(frozen=True, eq=False, kw_only=True)
class _Reading:
    files: tuple[File, ...]
    findings: Findings = field(default_factory=Findings)
    elements: Mapping[Text, frozenset[str]] = field(default_factory=dict[Text, frozenset[str]])
    """What assignments by a computed index set, where that is known already."""

    def program(self) -> KrlProgram:
        """Follow the program from all routines that nothing calls."""
        routines = routines_of(self.files)
        callers = callers_of(routines)
        for routine, line in declared_in(routines).values():
            for name in calls_of(line.action) if line.action is not None else ():
                callers.get(name, set()).add(routine.name)
        always = frozenset(line.name for file in self.files if file.submits for line in file.heads)
        data = Data(files=self.files, roots=roots_of(callers), always=always, elements=self.elements)
        flow = self._flow(routines, data)
        beside = unasked(self.files)
        roots = [name for name in routines if not callers[name] - {name} or name in beside]
        everywhere = [routine for same in routines.values() for routine in same]
        begin = {routine for routine in everywhere if routine.name in roots}
        flow.follow(everywhere, begin)
        known = {text: frozenset(names) for text, names in flow.elements.items() if names is not None}
        if not self.elements and data.refused & {name.partition("[")[0] for names in known.values() for name in names}:
            return _Reading(files=self.files, elements=known).program()
        self.findings.close()
        flow.follow_rest(everywhere, begin)
        self._warn()
        self._say_set_elsewhere(data)
        return self._ordered(data)

    def _flow(self, routines: Mapping[str, list[Routine]], data: Data) -> Flow:
        changes = changing(routines, data)
        volatile = frozenset[str]().union(*(changes[name] for name in unasked(self.files).intersection(routines)))
        made: dict[tuple[str, bytes], Frame] = {}
        frames: dict[Routine, Frames] = {}

        def frames_of(routine: Routine) -> Frames:
            if routine not in frames:
                frames[routine] = Frames(data=data, names=routine.names(data, volatile), made=made)
            return frames[routine]

        read, alters = read_names(self.files), altering(routines)
        followed = lambda key: key not in volatile and key.rpartition(":")[2] in read  # noqa: E731
        size = sum(len(file.statements) for file in self.files)
        return Flow(
            findings=self.findings,
            routines=routines,
            trees={
                r: tree_of(r.lines, lambda x: matters(x, read, routines)) for same in routines.values() for r in same
            },
            frames=frames_of,
            alters=alters,
            changes=changes,
            by_value=data.by_value,
            actions=actions_of(routines, data, alters, changes, followed),
            resuming=resuming(self.files, routines),
            left=MIN_LINES + MAX_PASSES * size,
        )

    def _say_set_elsewhere(self, data: Data) -> None:
        """Say which tools and bases another program may change."""
        for name, place in data.set_elsewhere.items():
            number = next(i for i, file in enumerate(self.files) if file.source.path == place.path)
            text = (
                f"{name} is changed here, in a program of its own; motions are corrected for the value in the data list"
            )
            lines = self.files[number].source.text.split("\n")
            position = sum(len(line) + 1 for line in lines[: place.line - 1])
            self.findings.diagnose(self.files[number], position, text)

    def _warn(self) -> None:
        """Say where the controller may correct its geometry by itself."""
        for file in self.files:
            for words in lines_of_words(file.source.text) if "$ABS_" in file.source.text.upper() else ():
                if any(word.upper in ("$ABS_ACCUR", "$ABS_CONVERT") for word in words):
                    self.findings.diagnose(
                        file,
                        words[0].start,
                        "the controller's own absolute accuracy may be on; a corrected program would then correct twice",
                    )

    def _ordered(self, data: Data) -> KrlProgram:
        """Moves in the order of the text."""
        try:
            T_world_base = data.robroot
        except Unresolved:  # the motions to poses say so
            T_world_base = None
        found = list(self.findings.finished())
        failed = ((number, start, text) for (number, start), (_, text) in self.findings.reasons.items())
        return KrlProgram(
            sources=tuple(file.source for file in self.files),
            moves=tuple(move for move, _ in found),
            diagnostics=tuple(
                Diagnostic(place=self.files[file].source.place(position), text=text)
                for file, position, text in sorted({*self.findings.diagnostics, *failed})
            ),
            sites=tuple(site for _, site in found),
            files=self.files,
            T_world_base=T_world_base,
        )

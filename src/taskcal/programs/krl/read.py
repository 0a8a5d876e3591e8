"""Reading KRL programs, callers before what they call, so that tool and base pass from one to the other."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from taskcal.errors import FileError
from taskcal.programs.krl.calls import MOST_PASSES, Calls
from taskcal.programs.krl.data import Data
from taskcal.programs.krl.data_lists import File
from taskcal.programs.krl.findings import Findings, Found
from taskcal.programs.krl.frames import Frames
from taskcal.programs.krl.lexer import lines_of_words
from taskcal.programs.krl.parser import parse
from taskcal.programs.krl.resolve import Walk
from taskcal.programs.krl.rewrite import Site, rewrite
from taskcal.programs.krl.routines import (
    Routine,
    altering,
    callers_first,
    callers_of,
    changing,
    roots_of,
    routines_of,
    unasked,
)
from taskcal.programs.krl.state import State, merged
from taskcal.programs.krl.syntax import Begin
from taskcal.programs.program import Diagnostic, Frame, Program, Waypoint
from taskcal.programs.source import Source
from taskcal.programs.unresolved import Unresolved
from taskcal.robot.robot import Robot


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class KrlProgram(Program):
    """What was read from ``.src`` and ``.dat`` files."""

    sites: tuple[Site, ...]
    """Of the moves, in their order."""

    def rewrite(self, robot: Robot, waypoints: Mapping[int, tuple[Waypoint, ...]]) -> tuple[Source, ...]:
        """The program's files with some motions rewritten.

        Points of the program's own data list get new numbers there, or a copy beside them where other motions still need the old
        ones; all others are written into the motion itself. Waypoints before the last become motions of their own in the
        lines before.

        Args:
            robot: the robot, whose joint positions decide status and turn.
            waypoints: by number of the motion.
        """
        return rewrite(self.sources, self.sites, self.moves, robot, waypoints)

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

    def program(self) -> KrlProgram:
        """Read all routines, callers before those they call, so that tool and base pass from one to the other."""
        routines = routines_of(self.files)
        callers = callers_of(routines)
        data = Data(files=self.files, roots=roots_of(callers))
        changes = changing(routines, data)
        beside = unasked(self.files).intersection(routines)
        volatile = frozenset[str]().union(*(changes[name] for name in beside))
        frames: dict[Routine, Frames] = {}
        made: dict[tuple[str, bytes], Frame] = {}

        def frames_of(routine: Routine) -> Frames:
            if routine not in frames:
                frames[routine] = Frames(data=data, names=routine.names(data, volatile), made=made)
            return frames[routine]

        passing: dict[tuple[int, int], Found] = {}
        quiet = Findings(found=passing, beside=self.findings.found)

        def follow(routine: Routine, state: State, calls: Calls) -> State:
            return Walk(findings=quiet, routine=routine, frames=frames_of(routine), calls=calls).run(state)

        calls = Calls(
            routines=routines,
            alters=altering(routines),
            changes=changes,
            names=lambda routine: frames_of(routine).names,
            follow=follow,
            called_at={name: [] for name in routines},
            left=[MOST_PASSES * sum(len(file.statements) for file in self.files)],
        )
        findings = replace(self.findings, beside=passing)
        done: set[str] = set()
        for name in callers_first(callers):
            entry = self._entry(name, calls.called_at[name], beside)
            if not callers[name] <= done:
                entry = replace(entry.forgotten(f"{name} is called in a circle"), variables={})
            done.add(name)
            for routine in routines[name]:
                walk = Walk(findings=findings, routine=routine, frames=frames_of(routine), calls=calls)
                walk.run(entry)
        self._warn()
        self._say_set_elsewhere(data)
        return self._ordered(data)

    @staticmethod
    def _entry(name: str, states: list[State], beside: frozenset[str]) -> State:
        """What holds at the start of the routines of a name."""
        if name in beside or not states:
            states = [*states, State.unset()]
        return merged(states, f"{name} is called with different ones")

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
        keys = sorted(self.findings.found)
        motions = [self.findings.found[key] for key in keys]
        number = {key: i for i, key in enumerate(keys)}
        return KrlProgram(
            sources=tuple(file.source for file in self.files),
            moves=tuple(replace(f.move, follows=None if f.follows is None else number.get(f.follows)) for f in motions),
            diagnostics=tuple(
                Diagnostic(place=self.files[file].source.place(position), text=text)
                for file, position, text in sorted(set(self.findings.diagnostics))
            ),
            sites=tuple(f.site for f in motions),
            T_world_base=T_world_base,
        )

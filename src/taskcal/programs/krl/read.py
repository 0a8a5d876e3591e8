"""Reading KRL programs, callers before what they call, so that tool and base pass from one to the other."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from taskcal.errors import FileError
from taskcal.programs.krl.data import Data, File
from taskcal.programs.krl.frames import Frames, State, merged
from taskcal.programs.krl.lexer import lines_of_words
from taskcal.programs.krl.parser import parse
from taskcal.programs.krl.resolve import Findings, Walk
from taskcal.programs.krl.rewrite import Site, rewrite
from taskcal.programs.krl.routines import altering, callers_first, callers_of, routines_of
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
        data = Data(files=self.files)
        routines = routines_of(self.files)
        alters = altering(routines)
        callers = callers_of(routines)
        called_at: dict[str, list[State]] = {name: [] for name in routines}
        made: dict[tuple[str, bytes], Frame] = {}
        done: set[str] = set()
        for name in callers_first(callers):
            states = called_at[name]
            entry = merged(states, f"{name} is called with different ones") if states else State.unset()
            if not callers[name] <= done:
                entry = entry.forgotten(f"{name} is called in a circle")
            done.add(name)
            for routine in routines[name]:
                frames = Frames(data=data, module=routine.file.module, made=made)
                walk = Walk(findings=self.findings, routine=routine, frames=frames, alters=alters, called_at=called_at)
                walk.run(replace(entry, last=None))
        self._warn()
        return self._ordered(data)

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
        motions = sorted(self.findings.found, key=lambda f: (f.site.file.number, f.site.motion.start))
        number = {f.number: i for i, f in enumerate(motions)}
        return KrlProgram(
            sources=tuple(file.source for file in self.files),
            moves=tuple(
                replace(f.move, follows=None if f.move.follows is None else number[f.move.follows]) for f in motions
            ),
            diagnostics=tuple(
                Diagnostic(place=self.files[file].source.place(position), text=text)
                for file, position, text in sorted(set(self.findings.diagnostics))
            ),
            sites=tuple(f.site for f in motions),
            T_world_base=T_world_base,
        )

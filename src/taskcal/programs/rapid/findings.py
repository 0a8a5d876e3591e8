"""The motions that were found in a RAPID program, each with all the ways that lead to it."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace

from taskcal.programs.program import Diagnostic
from taskcal.programs.rapid.effects import SOFT
from taskcal.programs.rapid.held import ANY, Before, State
from taskcal.programs.rapid.moving import is_read
from taskcal.programs.rapid.names import Context, File, Scope
from taskcal.programs.rapid.resolve import Motion, Settings, following, resolve
from taskcal.programs.rapid.syntax import Instruction
from taskcal.programs.rapid.target_argument import TargetArgument
from taskcal.programs.unresolved import Unresolved


@dataclass(eq=False, kw_only=True)
class _Occurrence:
    """A motion that some ways through the program lead to."""

    motion: Motion
    before: Before


@dataclass(eq=False, kw_only=True)
class Findings:
    """Resolves motions, and keeps what comes of it."""

    settings: Settings
    files: Sequence[File]
    seldom: bool = False
    """Only motions are resolved that no way led to so far, reached or not."""
    found: list[_Occurrence] = field(default_factory=list[_Occurrence])
    by_meaning: dict[tuple[object, ...], int] = field(default_factory=dict[tuple[object, ...], int])
    reasons: dict[Instruction, tuple[File, str]] = field(default_factory=dict[Instruction, tuple[File, str]])
    """Why motions could not be resolved on some way, the first reason of each."""
    soft: dict[Instruction, File] = field(default_factory=dict[Instruction, File])
    """Motions in which a servo may give way."""
    seen: set[Instruction] = field(default_factory=set[Instruction])
    """Motions that some way led to."""
    late: set[Instruction] = field(default_factory=set[Instruction])
    """Those of them that were found when all others were."""

    def __call__(self, instruction: Instruction, scope: Scope, context: Context, state: State) -> int | None:
        """Resolve a motion; says its number, or None where that could not be done."""
        if self.seldom and instruction in self.seen and instruction not in self.late:
            return None
        if not self.seldom and not state.reached:
            return None
        if instruction not in self.seen:
            self.seen.add(instruction)
            if self.seldom:
                self.late.add(instruction)
        name = context.routine.name.text if context.routine else ""
        settings = replace(self.settings, values=self.settings.values.at(state.variables))
        try:
            if not is_read(instruction, scope):
                raise Unresolved("this motion is not read")
            motion = resolve(instruction, scope, context.file, settings, name)
        except Unresolved as reason:
            self.reasons.setdefault(instruction, (context.file, str(reason)))
            return None
        if settings.soft and (SOFT not in state.variables or state.variables[SOFT].value is True):
            self.soft[instruction] = context.file
        return self._number(motion, state.before)

    def _number(self, motion: Motion, before: Before) -> int:
        move = motion.move
        meaning = (
            motion.instruction, *_meaning(motion.end), *(_meaning(motion.via) if motion.via else ()), move.tool.name,
            move.tool.T.tobytes(), move.part.name, move.part.T.tobytes(), move.part_in_hand, move.carrier, move.speed,
            move.turn_speed, move.stops, move.zone,
        )  # fmt: skip
        number = self.by_meaning.setdefault(meaning, len(self.found))
        if number == len(self.found):
            self.found.append(_Occurrence(motion=motion, before=before))
        else:
            self.found[number].before |= before
        return number

    def motions(self) -> list[Motion]:
        """All that can be rewritten, in the order of the text."""
        order = {id(file): i for i, file in enumerate(self.files)}
        kept = [i for i, found in enumerate(self.found) if not self._is_torn(found.motion)]
        kept.sort(key=lambda i: (order[id(self.found[i].motion.file)], self.found[i].motion.instruction.start, i))
        number = {old: new for new, old in enumerate(kept)}
        many: dict[Instruction, int] = {}
        for i in kept:
            instruction = self.found[i].motion.instruction
            many[instruction] = many.get(instruction, 0) + 1
        out: list[Motion] = []
        for i in kept:
            found = self.found[i]
            (first, *others) = found.before or ANY
            follows = None if others or first is None else number.get(first)
            instruction = found.motion.instruction
            texts_motions = many[instruction] + (
                instruction in self.reasons
            )  # those of calls that nobody could follow, too
            out.append(following(found.motion, follows, self.settings, texts_motions))
        return out

    def _is_torn(self, motion: Motion) -> bool:
        """Whether a motion's own text would have to change, while on other ways nobody knows where it leads."""
        if motion.instruction not in self.reasons:
            return False
        return any(target.handed is None for target in (motion.end, motion.via) if target is not None)

    def diagnostics(self, motions: Iterable[Motion]) -> Iterator[Diagnostic]:
        """Why motions stay as they are, on all ways or on some."""
        partly = {motion.instruction for motion in motions}
        for instruction, (file, reason) in self.reasons.items():
            where = " in some calls" if instruction in partly else ""
            text = f"{instruction.name.text} stays as it is{where}: {reason}"
            yield Diagnostic(place=file.source.place(instruction.start), text=text)
        for instruction, file in self.soft.items():
            text = (
                f"a servo may be soft here ({self.settings.soft}): the robot gives way, and the tool is not where the program "
                "says; corrected as if it were stiff"
            )
            yield Diagnostic(place=file.source.place(instruction.start), text=text)


def _meaning(target: TargetArgument) -> tuple[object, ...]:
    origin = None if target.origin is None else (target.origin.symbol, target.origin.path)
    return (target.argument, origin, target.shifted, target.meant, target.external, target.read_at)

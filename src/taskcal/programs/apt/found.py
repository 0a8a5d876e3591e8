"""What was read of an APT program."""

from dataclasses import dataclass, field

from taskcal.programs.apt.instruction import Instruction
from taskcal.programs.program import Diagnostic, Frame, Move


@dataclass(kw_only=True)
class Reading:
    """What was read so far of all files."""

    part: Frame
    moves: list[Move] = field(default_factory=list[Move])
    instructions: list[Instruction] = field(default_factory=list[Instruction])
    diagnostics: list[Diagnostic] = field(default_factory=list[Diagnostic])

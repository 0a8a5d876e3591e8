"""Where a motion of an APT program stands."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.programs.apt.circle import CircleTokens
from taskcal.programs.apt.circle_record import CircleRecord
from taskcal.programs.apt.lexer import Token


@dataclass(frozen=True, eq=False, kw_only=True)
class Instruction:
    """The statements of a motion."""

    source: int
    """Number of its file."""
    start: int
    """First character of its first statement."""
    end: int
    """Behind the last character of its last statement."""
    body: int
    """First character of the statement that moves; of an arc the one with the circle."""
    numbers: tuple[Token, ...]
    """Of a point, and of the end behind a circle: three, or six with the tool's axis. Of an arc as CATIA writes it: its
    direction."""
    circle: CircleTokens | None
    """Of an arc as CATIA writes it."""
    record: CircleRecord | None = None
    """Of an arc whose circle stands before its end."""
    half: bool = False
    """The first half of a full circle, whose second half is the next motion and has the same statements."""
    relative: bool
    """The numbers count from where the motion begins."""
    unit: float
    """Metres."""
    rapid: bool
    """``RAPID`` stands before it."""
    begin: Float[np.ndarray, " 3"] | None
    """Where it begins, metres; None where that is not known."""

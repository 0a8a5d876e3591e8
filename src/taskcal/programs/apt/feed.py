"""How fast an APT program moves: FEDRAT."""

from dataclasses import dataclass

from taskcal.programs.apt.syntax import Statement
from taskcal.programs.apt.words import FEEDS


@dataclass(kw_only=True)
class Feed:
    """The feed that holds, and the unit in which it was stated last."""

    speed: float | None = None
    """Metres per second; None where it is not known, or per revolution of the spindle."""
    unit: str = ""

    def read(self, statement: Statement, length: float) -> None:
        """Take in a FEDRAT.

        Args:
            statement: the statement.
            length: the program's unit of length, metres, per minute of which a feed without a unit counts.
        """
        words = [word for word in statement.words if word in FEEDS or word == "PERMIN"]
        values = [token.number for token in statement.arguments or () if token.number is not None]
        self.unit = words[0] if words else self.unit
        scale = FEEDS.get(self.unit, length / 60.0)
        self.speed = values[0] * scale if len(values) == 1 and values[0] > 0.0 and scale is not None else None

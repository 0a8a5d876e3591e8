"""Frames that an APT program states by CSYS, and whether its points are still counted in the first one."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.programs.apt.syntax import Statement, numbers

SAME_FRAME = 1e-5
"""Entries of two statements of one frame differ by less; lengths in the program's unit."""

_ORTHONORMAL = 1e-4
"""How far the axes of a frame may be from orthonormal: files round to six digits."""

_SAME_AXIS = 0.05
"""How far a tool axis may be from the axis of a frame: a corrected program tilts it by its corrections."""


def stated_frame(statement: Statement) -> Float[np.ndarray, "3 4"] | None:
    """The pose that twelve numbers state row by row, axes as columns and the origin last; None where they are no pose."""
    values = statement.numbers
    if values is None or len(values) != 12:
        return None
    A = np.array(values).reshape(3, 4)
    R = A[:, :3]
    rigid = np.abs(R.T @ R - np.eye(3)).max() < _ORTHONORMAL and np.linalg.det(R) > 0.0
    return A if rigid else None


@dataclass(kw_only=True)
class StatedFrames:
    """What CSYS and TRNTYP have stated so far; `docs/reference/programs-apt.md` says how it is understood."""

    first: Float[np.ndarray, "3 4"] | None = None
    in_world: bool = False
    """TRNTYP/WORLD stands: frames say how the part is turned, and coordinates stay as they were."""
    moved_since: int | None = None
    """Line that stated another frame than the first."""
    tilted: Float[np.ndarray, " 3"] | None = None
    """Its z axis, where that differs from (0, 0, 1): tool axes along it are counted in the first frame."""

    matrix: list[str] | None = None
    """Comments since CATIA's mark of a frame."""

    def read_comment(self, statement: Statement) -> tuple[str, ...] | None:
        """Take in a comment: CATIA states a frame by a mark, its name, and three rows of a matrix; its numbers at the last."""
        if statement.text.strip().upper() == "*CATIA0":
            self.matrix = []
        elif self.matrix is not None:
            self.matrix.append(statement.text)
            if len(self.matrix) == 4:
                stated = tuple(word for row in self.matrix[1:] for word in row.split())
                self.matrix = None
                return stated
        return None

    def read_csys(self, statement: Statement, line: int) -> str | None:
        """Take in a CSYS; why points behind it are uncertain, if they are whatever their tool axis."""
        self.moved_since = self.tilted = None
        A = stated_frame(statement)
        if A is None:
            return f"the CSYS of line {line} is not the twelve numbers of a pose"
        if self.first is None:
            self.first = A
        change = np.abs(A - self.first)
        if change.max() < SAME_FRAME:
            return None
        self.moved_since, z = line, A[:, 2]
        upright = np.abs(z - [0.0, 0.0, 1.0]).max() < 3.0 * _SAME_AXIS  # else one axis could be either
        if self.in_world and change[:, 3].max() < SAME_FRAME and not upright:
            self.tilted = z
            return None
        return f"another frame is stated than the first, the part's (line {line})"

    def read_trntyp(self, statement: Statement, line: int) -> str | None:
        """Take in a TRNTYP; why points behind it are uncertain."""
        offset = numbers((statement.arguments or ())[1:])
        self.in_world = statement.words[:1] == ("WORLD",) and offset == (0.0, 0.0, 0.0)
        return None if self.in_world else f"TRNTYP may move the coordinates since line {line}"

    def why_uncertain(self, axis: Float[np.ndarray, " 3"]) -> str | None:
        """Why it is not certain in which frame a point with a tool axis is counted."""
        if self.tilted is None or np.abs(axis - self.tilted).max() < _SAME_AXIS:
            return None
        return f"the tool axis does not tell whether points are counted in the frame of line {self.moved_since}"

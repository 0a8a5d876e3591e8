"""Writing a new robot program in the language of a file's suffix."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from taskcal.errors import FileError
from taskcal.programs.languages import COMPOSED, Composition, language_of
from taskcal.programs.program import Frame, Move, Target
from taskcal.programs.source import Place, Source
from taskcal.robot.robot import Robot


def compose_program(
    path: str | Path,
    robot: Robot,
    moves: Sequence[Move],
    *,
    q: Float[np.ndarray, "moves joints"] | None = None,
    notes: Sequence[str] = (),
    wait_s: float = 0.0,
    speed: float = 0.25,
    joint_speed_percent: float = 10.0,
) -> Source:
    """A program of given motions, in the language of its file's suffix.

    Args:
        path: its file, whose stem becomes the program's name.
        robot: the robot.
        moves: its motions.
        q: joint positions in which each motion ends, radians; they decide the posture of motions to a pose.
        notes: a comment before each motion; in CSV the name of a target that has none.
        wait_s: seconds to wait behind each motion that stops and waits; not in CSV.
        speed: in RAPID: of the tool point, for motions that do not say theirs, metres per second.
        joint_speed_percent: in KRL: of motions of all joints, of the axes' largest speeds.

    Returns:
        The program, still to be written.

    Raises:
        FileError: the suffix is of no language in which programs are written.
        TaskcalError: the language cannot say it.
    """
    path = Path(path)
    language = language_of(path) if path.suffix.lower() in COMPOSED else None
    if language is None or language.compose is None:
        raise FileError(path, f"cannot be composed; programs are written as {', '.join(COMPOSED)}")
    program = Composition(
        name=path.stem,
        robot=robot,
        moves=moves,
        q=q,
        notes=notes,
        wait_s=wait_s,
        speed=speed,
        joint_speed_percent=joint_speed_percent,
    )
    return replace(language.compose(program), path=path)


def moves_to_joints(
    robot: Robot,
    q: Float[np.ndarray, "n joints"],
    path: str | Path,
    *,
    stops: Sequence[bool] | None = None,
    waits: Sequence[bool] | None = None,
    speeds: Sequence[float | None] | None = None,
) -> tuple[Move, ...]:
    """Motions to joint positions, such as a measuring program needs.

    Args:
        robot: the robot, which moves its own tool.
        q: joint positions, radians.
        path: file that they are meant for.
        stops: whether each stops there; all by default.
        waits: whether each waits where it stops; all by default.
        speeds: of the tool point in each, metres per second; none of their own by default.
    """
    tool, part = Frame(name="", T=robot.T_flange_tool), Frame(name="", T=np.eye(4))
    place = Place(path=Path(path), line=1)
    return tuple(
        Move(
            kind="axes",
            end=Target(name="", T=None, q=posture, posture=None, place=place),
            via=None,
            tool=tool,
            part=part,
            part_in_hand=False,
            speed=None if speeds is None else speeds[k],
            stops=stops is None or stops[k],
            follows=k - 1 if k else None,
            routine="",
            place=place,
            waits=waits is None or waits[k],
        )
        for k, posture in enumerate(q)
    )

"""Where the robot stands and what its external axes carry: a program's motions, counted in the robot's base."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from jaxtyping import Float

from robot_programs.core.program import Diagnostic, Frame, Move, Program
from robot_programs.languages import language_of
from taskcal.correction.cell import AXES, Cell, ExternalAxis, carried_part, carried_robot
from taskcal.errors import TaskcalError
from taskcal.geometry import se3

P = TypeVar("P", bound=Program)

SAME_BASE = 1e-5
"""Two statements of where the robot stands agree if they differ by no more, metres and entries of the rotation."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Mounted:
    """A program on a robot that stands somewhere."""

    program: Program
    """What stands still is counted in the robot's base, and so is what an axis carries, where that axis stands at each motion's
    end. Along a line or an arc in which such an axis moves, the start is not known."""
    refused: dict[int, str]
    """Motions for which it is not known where the robot or the part is, and what to state."""
    diagnostics: tuple[Diagnostic, ...]
    """Where an axis moves the robot or the part along a line or an arc."""


def mount(program: Program, cell: Cell) -> Mounted:
    """Count a program's motions in the robot's base, by what the cell file says of base and external axes.

    Raises:
        TaskcalError: cell file and program place the robot differently.
    """
    stated, said = program.T_world_base, cell.T_world_base
    if stated is not None and said is not None and np.abs(stated - said).max() > SAME_BASE:
        raise TaskcalError(
            f"the robot stands at {_at(said)} by the cell file and at {_at(stated)} by {program.base_from}; state [robot] base "
            "as it is there, or leave it out"
        )
    positions = _positions(program.moves)
    plain = not any(move.carrier or move.external_offset or not move.tool.stated for move in program.moves)
    if said is None and not cell.axes and not np.nan_to_num(positions).any() and plain:
        return Mounted(program=program, refused={}, diagnostics=())
    read_in = np.eye(4) if stated is None else stated
    mounting = _Mounting(cell=cell, read_in=read_in, base=read_in if said is None else said)
    moves: list[Move] = []
    refused: dict[int, str] = {}
    diagnostics: list[Diagnostic] = []
    for i, move in enumerate(program.moves):
        why = mounting.obstacle(move, positions[i])
        if why:
            refused[i] = why
            moves.append(move)
            continue
        mounted = mounting.mounted(move, positions[i])
        follows = move.follows
        if follows is not None and move.kind in ("linear", "circular"):
            relevant = mounting.relevant(move)
            if follows in refused or any(
                positions[i][a.number - 1] != positions[follows][a.number - 1] for a in relevant
            ):
                mounted = replace(mounted, follows=None)
        if mounted.follows != follows and follows not in refused:
            text = "an external axis moves robot or part along it: corrected at its points, not looked at between them"
            diagnostics.append(Diagnostic(place=move.place, text=text))
        moves.append(mounted)
    return Mounted(program=replace(program, moves=tuple(moves)), refused=refused, diagnostics=tuple(diagnostics))


def _at(T: Float[np.ndarray, "4 4"]) -> str:
    x, y, z = np.round(T[:3, 3] * 1e3, 2) + 0.0  # no minus before zero
    return f"[{x:.2f}, {y:.2f}, {z:.2f}] mm"


def _positions(moves: Sequence[Move]) -> Float[np.ndarray, "m axes"]:
    """Of the external axes at the end of each motion; those that it does not state stay where the motion before left them."""
    positions = np.full((len(moves), AXES), np.nan)
    for i, move in enumerate(moves):
        if move.follows is not None and move.follows < i:
            positions[i] = positions[move.follows]
        own = np.array(move.external[:AXES])
        stated = np.flatnonzero(~np.isnan(own))
        positions[i, stated] = own[stated]
    return positions


@dataclass(frozen=True, eq=False, kw_only=True)
class _Mounting:
    """Places frames; each place is made once, so that one frame is one object."""

    cell: Cell
    read_in: Float[np.ndarray, "4 4"]
    """Base in the world in which the program was read."""
    base: Float[np.ndarray, "4 4"]
    """Base in the world, with all axes at zero."""
    made: dict[tuple[int, tuple[float, ...]], tuple[Frame, Frame]] = field(
        default_factory=dict[tuple[int, tuple[float, ...]], tuple[Frame, Frame]]
    )
    """By the frame and the positions: the frame as it was read, and where it is."""

    def relevant(self, move: Move) -> list[ExternalAxis]:
        """Axes that move what stands still against the robot."""
        return [
            axis
            for axis in self.cell.axes
            if axis.carries == "robot" or (axis.carries == "part" and move.carrier and _is_of(axis, move.carrier))
        ]

    def obstacle(self, move: Move, positions: Float[np.ndarray, " axes"]) -> str:
        """Why it is not known where robot, part or tool is, and what to state; empty where it is."""
        if not move.tool.stated:
            return (
                f"tool {move.tool.name} is loaded, and it is not known where that is; state it in the cell file: [[tool]] "
                f'name = "{move.tool.name}", controller = {{ position_mm = …, quaternion = … }}'
            )
        known = {axis.number: axis for axis in self.cell.axes}
        for k in np.flatnonzero(np.nan_to_num(positions)):
            if int(k) + 1 not in known:
                name = ExternalAxis(number=int(k) + 1, carries="nothing").name
                return (
                    f"{name} is away from zero, and the cell file does not say what it carries; write [[axis]] number = {k + 1}, "
                    'carries = "nothing", or "robot" or "part" with slides_along or turns_about = [x, y, z]'
                )
        if move.carrier and not any(axis.carries == "part" for axis in self.relevant(move)):
            return (
                f"its part '{move.part.name}' is moved by {move.carrier}, and the cell file does not say how; write [[axis]] "
                'number = …, carries = "part", turns_about or slides_along = [x, y, z], and frame, its place at zero'
            )
        if move.external_offset:
            for k in np.flatnonzero(~np.isnan(positions)):
                axis = known.get(int(k) + 1)
                if axis is None or axis.carries != "nothing":
                    name = ExternalAxis(number=int(k) + 1, carries="nothing").name
                    return (
                        f"{name} may be shifted from where the text has it ({move.external_offset}), so that it is not known where "
                        'robot and part are; write [[axis]] carries = "nothing" if it carries neither, or write the positions '
                        "without the shift"
                    )
        missing = next((axis for axis in self.relevant(move) if np.isnan(positions[axis.number - 1])), None)
        if missing is not None:
            return f"it does not say where {missing.name} stands, which carries the {missing.carries}"
        return ""

    def mounted(self, move: Move, positions: Float[np.ndarray, " axes"]) -> Move:
        """A motion with what stands still, or is carried, in the robot's base."""
        standing = move.tool if move.part_in_hand else move.part
        axes = self.relevant(move)
        key = (id(standing), tuple(float(positions[axis.number - 1]) for axis in axes))
        if key not in self.made:
            self.made[key] = standing, self._placed(standing, axes, positions, carried=bool(move.carrier))
        placed = self.made[key][1]
        return replace(move, tool=placed) if move.part_in_hand else replace(move, part=placed)

    def _placed(
        self, frame: Frame, axes: Sequence[ExternalAxis], positions: Float[np.ndarray, " axes"], *, carried: bool
    ) -> Frame:
        robot = [axis for axis in axes if axis.carries == "robot"]
        T_world_base = carried_robot(robot, positions) @ self.base
        part = [axis for axis in axes if axis.carries == "part"]
        T_world = carried_part(part, positions) if carried else self.read_in
        T = se3.inverse(T_world_base) @ T_world @ frame.T
        return Frame(name=frame.name, T=T, moved=any(positions[axis.number - 1] != 0.0 for axis in axes))


def _base_file(program: Program) -> str:
    """The file that says where the robot stands; empty where the program is counted in the robot's base."""
    return language_of(program.sources[0].path).base_file


def _is_of(axis: ExternalAxis, unit: str) -> bool:
    return not axis.unit or axis.unit.casefold() == unit.casefold()


def base_statement(program: Program, cell: Cell) -> str:
    """Where the robot is taken to stand, in words; empty where nothing says it and the program is not counted in the world."""
    base_file = _base_file(program)
    if program.T_world_base is not None:
        return f"the robot stands at {_at(program.T_world_base)} in the world, by {program.base_from}"
    if cell.T_world_base is not None:
        return f"the robot stands at {_at(cell.T_world_base)} in the world, as the cell file says"
    return base_file and (
        f"the robot's base is taken to be the world's frame, as neither {base_file} nor [robot] base of a cell file is given"
    )


def ask_for_base(program: Program, cell: Cell, out_of_reach: Sequence[int]) -> list[Diagnostic]:
    """Ask once where the robot stands, where motions are out of reach and nothing says it."""
    base_file = _base_file(program)
    if not out_of_reach or not base_file or program.T_world_base is not None or cell.T_world_base is not None:
        return []
    count = len(out_of_reach)
    text = (
        f"{'this motion is' if count == 1 else f'{count} motions are'} out of reach of a robot in the world's origin: where does "
        f"it stand? Pass {base_file} with the program, or state [robot] base in the cell file"
    )
    return [Diagnostic(place=program.moves[out_of_reach[0]].place, text=text)]

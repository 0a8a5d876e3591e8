"""The cell: its tools and parts as measured, the robot's base, external axes, and a program's motions counted in that base."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
import tomli_w
from jaxtyping import Float
from pydantic import Field

from robot_programs.core.program import Diagnostic, Frame, MissingName, Motion, Program
from robot_programs.languages import language_of
from taskcal.arguments import checked, repeated
from taskcal.errors import FileError, TaskcalError
from taskcal.geometry import se3
from taskcal.io.codec import InFile, describe, read_brief
from taskcal.io.files import write_whole
from taskcal.io.toml_file import NotNegative
from taskcal.short_repr import short_repr
from taskcal_groundwork.said import Said

P = TypeVar("P", bound=Program)

# External axes of a cell: what they carry, and where that is at their positions.

Carries = Literal["nothing", "robot", "part"]

AXES = 6
"""External axes of a target, in RAPID (eax_a … eax_f) as in KRL (E1 … E6)."""


def axis_name(number: int) -> str:
    """Name of an external axis in RAPID and KRL."""
    return f"external axis {number} (eax_{'abcdef'[number - 1]}, E{number})"


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class ExternalAxis:
    """One external axis, as the controller counts it."""

    number: Annotated[int, Field(ge=1, le=AXES)]
    """1 for eax_a and E1."""
    carries: Carries
    slides_along: Annotated[Float[np.ndarray, " 3"], se3.DIRECTION] | None = None
    """Direction of unit length in its frame, in which it slides, by millimetres; None of another."""
    turns_about: Annotated[Float[np.ndarray, " 3"], se3.DIRECTION] | None = None
    """The same about which it turns, by degrees. Neither is of an axis that carries nothing."""
    T_frame: Annotated[Float[np.ndarray, "4 4"], replace(se3.POSE, key="frame")] | None = None
    """Where its frame is with all axes at zero: in the world, or in what the axis before it carries; None for the same place."""
    unit: str = ""
    """Name of its mechanical unit, by which RAPID's work objects call it; empty for whichever they name."""

    @property
    def name(self) -> str:
        """Name of the axis in RAPID and KRL."""
        return axis_name(self.number)

    @staticmethod
    def check_stated(stated: Mapping[str, Any]) -> None:
        """See that it moves in one way, if it carries anything."""
        number, carries, unit = stated["number"], stated["carries"], stated.get("unit")
        ways = [key for key in ("slides_along", "turns_about") if key in stated]
        if carries == "nothing" and (ways or "frame" in stated or unit):
            raise ValueError(f"axis {number} carries nothing: leave out slides_along, turns_about, frame and unit")
        if carries != "nothing" and len(ways) != 1:
            raise ValueError(
                f"axis {number} carries the {carries}: state either slides_along = [x, y, z] or turns_about = [x, y, z]"
            )
        if unit and carries != "part":
            raise ValueError(f"axis {number}: unit is for axes that carry the part")

    def motion(self, position: float) -> Float[np.ndarray, "4 4"]:
        """Motion of the carried body from its place at zero, in the axis's frame."""
        if self.turns_about is not None:
            return se3.pose(se3.exp(self.turns_about * np.radians(position)), np.zeros(3))
        if self.slides_along is not None:
            return se3.pose(np.eye(3), self.slides_along * position * 1e-3)
        return np.eye(4)


def carried_robot(axes: Sequence[ExternalAxis], positions: Float[np.ndarray, " axes"]) -> Float[np.ndarray, "4 4"]:
    """Motion of the robot's base in the world, against where it stands with all axes at zero."""
    T, frame = np.eye(4), np.eye(4)
    for axis in axes:
        frame = frame if axis.T_frame is None else frame @ axis.T_frame
        T = T @ frame @ axis.motion(float(positions[axis.number - 1])) @ se3.inverse(frame)
    return T


def carried_part(axes: Sequence[ExternalAxis], positions: Float[np.ndarray, " axes"]) -> Float[np.ndarray, "4 4"]:
    """Pose in the world of what axes that carry each other, in this order, carry."""
    T = np.eye(4)
    for axis in axes:
        T = (T if axis.T_frame is None else T @ axis.T_frame) @ axis.motion(float(positions[axis.number - 1]))
    return T


MIN_POINTS = 3
"""Points that locate a frame."""

MIN_TIPS = 4
"""Joint positions with a tip at one point: three would locate it and leave nothing that tells a slip."""


@checked
@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Measured:
    """Measurement of one tool or part, in at most one of the possible forms, beside the controller's value."""

    name: Annotated[str, Field(min_length=1)]
    """As programs call it."""
    controller: Annotated[Float[np.ndarray, "4 4"], se3.POSE] | None = None
    """The controller's value, where the program's files do not declare it."""
    in_tracker: Annotated[Float[np.ndarray, "4 4"], replace(se3.POSE, key="tracker")] | None = None
    """Pose in the tracker's frame of the calibration, of what stands still."""
    touched: Annotated[Float[np.ndarray, "k joints"], InFile(unit="deg"), Field(min_length=MIN_POINTS)] | None = None
    """Joint positions at which the robot touched the points from which the controller's frame was set, radians."""
    touched_with: str = ""
    """Tool that touched them."""
    tip: Annotated[Float[np.ndarray, "k joints"], InFile(unit="deg"), Field(min_length=MIN_TIPS)] | None = None
    """Joint positions at which the tip of what the robot holds was at one point, each time turned otherwise, radians."""
    in_flange: Annotated[Float[np.ndarray, "4 4"], replace(se3.POSE, key="flange")] | None = None
    """True pose in the flange, of what the robot holds."""
    in_target: Annotated[Float[np.ndarray, "4 4"], replace(se3.POSE, key="target")] | None = None
    """Pose in the frame whose poses were measured, of what the robot holds."""
    reflectors: Annotated[Mapping[str, Float[np.ndarray, " 3"]], InFile(unit="mm"), Field(min_length=MIN_POINTS)] = (
        field(default_factory=dict[str, np.ndarray])
    )
    """Centres of the calibration's reflectors in the frame of what the robot holds, metres."""
    uncertainty: Annotated[NotNegative, InFile(unit="mm")] = 0.0
    """Standard uncertainty of what was measured, per axis, metres: of each reflector's centre, of the position, or of one touch, of
    which at a tip it is at least what the touches scatter."""

    @staticmethod
    def check_stated(stated: Mapping[str, Any]) -> None:
        """See that it is measured in one way, and wholly."""
        name, ways = stated["name"], ("tracker", "touched_deg", "tip_deg", "flange", "target", "reflectors_mm")
        given = [key for key in ways if key in stated]
        if len(given) > 1:
            raise ValueError(f"'{name}' is measured in one way only: keep one of {' and '.join(given)}")
        if ("touched_deg" in stated) != bool(stated.get("touched_with")):
            raise ValueError(f"'{name}': touched_deg and touched_with, the tool that touched, belong together")
        if "uncertainty_mm" in stated and not given:
            raise ValueError(f"'{name}': uncertainty_mm is of what is measured: give one of {', '.join(ways)}")

    @property
    def is_known(self) -> bool:
        """Whether anything was measured of it; otherwise it is where the controller has it."""
        given = (self.in_tracker, self.touched, self.tip, self.in_flange, self.in_target)
        return bool(self.reflectors) or any(one is not None for one in given)


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Cell:
    """Tools and parts by name, letter case aside."""

    tools: Mapping[str, Measured] = field(default_factory=dict[str, Measured])
    parts: Mapping[str, Measured] = field(default_factory=dict[str, Measured])
    T_world_base: Float[np.ndarray, "4 4"] | None = None
    """Where the robot stands in the world, with all external axes at zero; None where it is not stated."""
    axes: tuple[ExternalAxis, ...] = ()
    """External axes, by number."""
    controller: Literal["", "nominal", "calibrated"] = ""
    """With which kinematics the controller computes: those of the calibration's robot file, or its own, as a factory measured them;
    empty where that is not stated."""
    data: Mapping[str, str] = field(default_factory=dict[str, str])
    """Other data that no file of the program declares, by name, as its language writes their values."""

    def tool(self, name: str) -> Measured:
        """Measurement of a tool; empty where there is none."""
        return self.tools.get(name.casefold(), Measured(name=name))

    def part(self, name: str) -> Measured:
        """Measurement of a part; empty where there is none."""
        return self.parts.get(name.casefold(), Measured(name=name))


# The cell file: its schema, and the cell it describes.

MAX_NAMED = 1000
"""Tools of a cell, and parts: a tool changer holds some dozen."""


@dataclass(frozen=True, eq=False, kw_only=True)
class StatedRobot:
    """Base of the robot in the world, and the kinematics with which its controller computes."""

    base: Annotated[Float[np.ndarray, "4 4"], se3.POSE] | None = None
    controller: Literal["nominal", "calibrated"] | None = None


@dataclass(frozen=True, kw_only=True)
class StatedData:
    """A point, parameter set or number of the program that none of its files declares."""

    name: Annotated[str, Field(min_length=1)]
    value: str

    @staticmethod
    def check_stated(stated: Mapping[str, Any]) -> None:
        """See that there is a value."""
        if not stated["value"].strip():
            raise ValueError(f"'{stated['name']}': value is empty; state it as the controller shows it")


@dataclass(frozen=True, eq=False, kw_only=True)
class CellFile:
    """A cell as its file has it."""

    robot: StatedRobot | None = None
    axis: tuple[ExternalAxis, ...] = ()
    data: Annotated[tuple[StatedData, ...], Field(max_length=MAX_NAMED)] = ()
    tool: Annotated[tuple[Measured, ...], Field(max_length=MAX_NAMED)] = ()
    part: Annotated[tuple[Measured, ...], Field(max_length=MAX_NAMED)] = ()

    @staticmethod
    def check_stated(stated: Mapping[str, Any]) -> None:
        """See that nothing is stated twice."""
        for key, kind in (("tool", "tools"), ("part", "parts"), ("data", "data")):
            if twice := repeated(one.name.casefold() for one in stated.get(key, ())):
                raise ValueError(f"two {kind} are named '{twice[0]}'")
        if twice := repeated(one.number for one in stated.get("axis", ())):
            raise ValueError(f"axis {twice[0]} is stated twice")


@checked
def load_cell(path: str | Path) -> Cell:
    """Read a cell file (TOML).

    Raises:
        FileError: it is missing, no TOML, or not a cell file; or a tool that touched is not in it.
    """
    path = Path(path)
    content = read_brief(path, CellFile)
    robot = content.robot or StatedRobot()
    cell = Cell(
        tools={one.name.casefold(): one for one in content.tool},
        parts={one.name.casefold(): one for one in content.part},
        T_world_base=robot.base,
        controller=robot.controller or "",
        axes=tuple(sorted(content.axis, key=lambda axis: axis.number)),
        data={one.name: one.value for one in content.data},
    )
    for part in cell.parts.values():
        toucher = part.touched_with.casefold()
        tool = cell.tools.get(toucher)
        if toucher and (tool is None or (tool.controller is None and tool.in_flange is None)):
            raise FileError(
                path,
                f"part '{part.name}' was touched with '{part.touched_with}', of which the file does not say where the controller "
                "has it; add a [[tool]] of that name with controller = { position_mm = …, quaternion = … }",
            )
    return cell


def write_cell(path: str | Path, cell: Cell) -> None:
    """Write a cell file that `load_cell` reads back.

    Raises:
        FileError: the folder is missing or not writable.
    """
    write_whole(path, cell_text(cell))


def cell_text(cell: Cell) -> str:
    """Text of a cell file."""
    robot = StatedRobot(base=cell.T_world_base, controller=cell.controller or None)
    content = CellFile(
        robot=None if cell.T_world_base is None and not cell.controller else robot,
        axis=cell.axes,
        data=tuple(StatedData(name=name, value=value) for name, value in cell.data.items()),
        tool=tuple(cell.tools.values()),
        part=tuple(cell.parts.values()),
    )
    return tomli_w.dumps(describe(content, brief=True))


UNFILLED = 'controller = { position_mm = ["x", "y", "z"], quaternion = ["qx", "qy", "qz", "qw"] }'
"""Of a tool or part that is still to be stated; refused until numbers stand there."""


UNFILLED_DATA = 'value = ""  # as the controller shows it: "{E6POS: X 1,Y 2,Z 3,A 0,B 0,C 0,S 2,T 35}", "12.5"'
"""The same of other data."""


def cell_to_fill_in(missing: Iterable[MissingName]) -> str:
    """Sections of a cell file for what no file of a program declares; empty where there is nothing."""
    return "\n".join(
        f"# {one.count} of the program's motions, first in {one.place}\n[[{one.kind}]]\n"
        f"{tomli_w.dumps({'name': one.name})}{UNFILLED_DATA if one.kind == 'data' else UNFILLED}\n"
        for one in missing
        if one.kind != "other"
    )


def given_frames(cell: Cell) -> tuple[dict[str, Frame], dict[str, Frame]]:
    """Tools and parts with the controller's value, by name, for the reader of a program."""
    tools, parts = (
        {m.name: Frame(name=m.name, T=m.controller) for m in among.values() if m.controller is not None}
        for among in (cell.tools, cell.parts)
    )
    return tools, parts


# A program's motions, counted in the robot's base.

MAX_BASE_DIFFERENCE = 1e-5
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
        TaskcalError: cell file and program place the robot differently, or the program was read without the robot that it needs.
    """
    if program.base_missing:
        raise TaskcalError(
            f"{program.sources[0].path} counts from {program.base_missing} and was read without its robot; "
            "read it with read_program(…, robot=calibration.model.robot)"
        )
    stated, said = program.T_world_base, cell.T_world_base
    if stated is not None and said is not None and np.abs(stated - said).max() > MAX_BASE_DIFFERENCE:
        raise TaskcalError(
            f"the robot stands at {_at(said)} by the cell file and at {_at(stated)} by {program.base_from}; state [robot] base "
            "as it is there, or leave it out"
        )
    _check_frames(program, cell)
    positions = _positions(program.motions)
    plain = not any(move.carrier or move.external_offset or not move.tool.stated for move in program.motions)
    if said is None and not cell.axes and not np.nan_to_num(positions).any() and plain:
        return Mounted(program=program, refused={}, diagnostics=())
    read_in = np.eye(4) if stated is None else stated
    mounting = _Mounting(cell=cell, read_in=read_in, base=read_in if said is None else said)
    motions: list[Motion] = []
    refused: dict[int, str] = {}
    diagnostics: list[Diagnostic] = []
    for i, move in enumerate(program.motions):
        why = mounting.obstacle(move, positions[i])
        if why:
            refused[i] = why
            motions.append(move)
            continue
        mounted = mounting.mounted(move, positions[i])
        follows = move.follows
        if follows is not None and move.kind in ("linear", "circular"):
            relevant = mounting.relevant(move)
            if follows in refused or any(
                positions[i][a.number - 1] != positions[follows][a.number - 1] for a in relevant
            ):
                mounted = replace(mounted, follows=None, begins_at_motion=follows not in refused)
        if mounted.follows != follows and follows not in refused:
            text = "an external axis moves robot or part along it: corrected at its points, not looked at between them"
            diagnostics.append(Diagnostic(place=move.place, text=text))
        motions.append(mounted)
    return Mounted(program=replace(program, motions=tuple(motions)), refused=refused, diagnostics=tuple(diagnostics))


def _at(T: Float[np.ndarray, "4 4"]) -> str:
    x, y, z = np.round(T[:3, 3] * 1e3, 2) + 0.0  # no minus before zero
    return f"[{x:.2f}, {y:.2f}, {z:.2f}] mm"


def _check_frames(program: Program, cell: Cell) -> None:
    """See that the cell file has tools and parts where the program's files have them, which count.

    Raises:
        TaskcalError: one is elsewhere.
    """
    if not language_of(program.sources[0].path).declares_frames:
        return
    to_base = np.eye(4) if program.T_world_base is None else se3.inverse(program.T_world_base)
    seen: set[tuple[int, int, bool]] = set()
    for motion in program.motions:
        objects = (id(motion.tool), id(motion.part), motion.part_in_hand)
        if objects in seen:
            continue
        seen.add(objects)
        standing, held = (motion.tool, motion.part) if motion.part_in_hand else (motion.part, motion.tool)
        for frame, T in ((held, np.eye(4)), (standing, np.eye(4) if motion.carrier else to_base)):
            kind, measured = (
                ("tool", cell.tool(frame.name)) if frame is motion.tool else ("part", cell.part(frame.name))
            )
            if measured.controller is None:
                continue
            off = frame.T - T @ measured.controller
            if np.abs(off).max() > MAX_BASE_DIFFERENCE:
                raise TaskcalError(
                    f"{motion.place}: the files have {kind} '{frame.name}' {np.linalg.norm(off[:3, 3]) * 1e3:.3f} mm from where "
                    f"controller of the cell file has it, or turned otherwise; leave controller out there, as the files declare it"
                )


def _positions(motions: Sequence[Motion]) -> Float[np.ndarray, "m axes"]:
    """Positions of the external axes at the end of each motion; unstated ones stay as the motion before left them."""
    positions = np.full((len(motions), AXES), np.nan)
    if all(np.isnan(external).all() for external in {move.external for move in motions}):
        return positions
    for i, move in enumerate(motions):
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

    def relevant(self, move: Motion) -> list[ExternalAxis]:
        """Axes that move what stands still against the robot."""
        return [
            axis
            for axis in self.cell.axes
            if axis.carries == "robot" or (axis.carries == "part" and move.carrier and _is_of(axis, move.carrier))
        ]

    def obstacle(self, move: Motion, positions: Float[np.ndarray, " axes"]) -> str:
        """Why it is not known where robot, part or tool is, and what to state; empty where it is."""
        if not move.tool.stated:
            return (
                f"tool {move.tool.name} is loaded, and it is not known where that is; state it in the cell file: [[tool]] "
                f'name = "{move.tool.name}", controller = {{ position_mm = …, quaternion = … }}'
            )
        known = {axis.number: axis for axis in self.cell.axes}
        for k in np.flatnonzero(np.nan_to_num(positions)).tolist():
            if k + 1 not in known:
                name = axis_name(k + 1)
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
            for k in np.flatnonzero(~np.isnan(positions)).tolist():
                axis = known.get(k + 1)
                if axis is None or axis.carries != "nothing":
                    name = axis_name(k + 1)
                    return (
                        f"{name} may be shifted from where the text has it ({move.external_offset}), so that it is not known where "
                        'robot and part are; write [[axis]] carries = "nothing" if it carries neither, or write the positions '
                        "without the shift"
                    )
        missing = next((axis for axis in self.relevant(move) if np.isnan(positions[axis.number - 1])), None)
        if missing is not None:
            return f"it does not say where {missing.name} stands, which carries the {missing.carries}"
        return ""

    def mounted(self, move: Motion, positions: Float[np.ndarray, " axes"]) -> Motion:
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
    """Assumed place of the robot in words; empty where none is stated and the program is not counted in the world."""
    base_file = _base_file(program)
    if program.T_world_base is not None:
        return Said(
            "the robot stands at {place} in the world, by {source}",
            place=_at(program.T_world_base),
            source=str(program.base_from),
        )
    if cell.T_world_base is not None:
        return Said("the robot stands at {place} in the world, as the cell file says", place=_at(cell.T_world_base))
    return base_file and Said(
        "the robot's base is taken to be the world's frame, as neither {file} nor [robot] base of a cell file is given",
        file=base_file,
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
    return [Diagnostic(place=program.motions[out_of_reach[0]].place, text=text)]

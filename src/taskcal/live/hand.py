"""``hand``: a person moves the robot, and types or pastes the joints that its pendant shows, or what an instrument shows."""

import time
from collections.abc import Callable, Mapping
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from taskcal.errors import TaskcalError, shown
from taskcal.live.devices import Controller, DeviceError, Instrument, JointReading, Shot
from taskcal.live.lines import KindColumns
from taskcal.live.stillness import MissedError, Rules
from taskcal.observations.instrument import Instrument as CellInstrument
from taskcal.robot.robot import Robot
from taskcal.tables.table import number_of
from taskcal_groundwork.said import Said


class Hand(Controller):
    """Joints as a person enters them, in degrees, millimetres where a joint slides."""

    name: ClassVar[str] = "hand"
    streams: ClassVar[bool] = False

    def __init__(self, robot: Robot, ask: Callable[[str], str] | None = None):
        self._robot, self._ask, self._within = robot, ask, Rules.arrived
        slides = robot.prismatic
        self._shown, self._pose = "", np.full(len(slides), np.nan)
        self._names = [f"{name}_{'mm' if s else 'deg'}" for name, s in zip(robot.joint_names, slides, strict=True)]
        self._units = np.where(slides, 1e-3, np.pi / 180.0)

    @classmethod
    def open(cls, address: str | None, robot: Robot, timeout_s: float) -> "Hand":
        """Ask whoever is asked (`asks`).

        Raises:
            DeviceError: an address, which it does not have.
        """
        if address is not None:
            raise DeviceError(f"the controller 'hand' has no address, and '{shown(address)}' is given; leave it out")
        return cls(robot)

    def asks(self, ask: Callable[[str], str], within: float) -> None:
        """Ask by this, and take joints within so much of the pose shown."""
        self._ask, self._within = ask, within

    def show(self, joints: Float[np.ndarray, " joints"]) -> None:
        """Remember the pose, to show it with the question."""
        self._pose = joints
        self._shown = " ".join(
            f"{name}={value:.3f}" for name, value in zip(self._names, joints / self._units, strict=True)
        )

    def read(self, timeout_s: float) -> JointReading:
        """Ask until joints are entered; a person takes what time it takes.

        Raises:
            DeviceError: the input has ended, or nobody is asked.
        """
        if self._ask is None:
            raise DeviceError("the controller 'hand' asks for joints, and nobody is there to answer")
        pose = Said("Move to {pose}\nand enter the joints as they are:", pose=self._shown)
        asked = pose
        while True:
            read = self._parse(self._ask(asked))
            if not isinstance(read, Said):
                return JointReading(time_s=time.monotonic(), joints=read, moving=False)
            asked = Said("{wrong}\n{pose}", wrong=read, pose=pose)

    def close(self) -> None:
        """Nothing is open."""

    def _parse(self, text: str) -> Float[np.ndarray, " joints"] | Said:
        """Joints of a line, in order or as ``NAME=VALUE``; or what is wrong with it."""
        cells = text.replace(";", " ").replace("\t", " ").replace(", ", " ").split()
        if len(cells) == 1:
            cells = text.strip().split(",")
        named = dict(cell.split("=", 1) for cell in cells if "=" in cell)
        if named:
            if missing := [name for name in self._names if name not in named]:
                return Said("{joint} is missing, or is called otherwise.", joint=missing[0])
            cells = [named[name] for name in self._names]
        if len(cells) != len(self._names):
            return Said(
                "{count} values; {needed} are needed, in this order.", count=len(cells), needed=len(self._names)
            )
        typed = np.array([number_of(cell.strip().replace(",", ".")) for cell in cells])
        if not np.isfinite(typed).all():
            return Said("'{text}' are not numbers alone.", text=shown(text.strip()))
        joints = typed * self._units
        if not self._robot.inside_limits(joints[None])[0]:
            return Said("beyond the robot's limits; see the order of the joints and their signs.")
        off = np.abs(joints - self._pose) / self._units
        if (off * self._units > self._within).any():
            in_radians = np.where(self._robot.prismatic, joints, typed)
            if (np.abs(in_radians - self._pose) <= self._within).all():
                return Said("these are the joints of the pose in radians; enter them in degrees.")
            far = int(off.argmax())
            return Said(
                "{joint} is {off:.1f} from the pose; go nearer, or mend what was typed.",
                joint=self._names[far],
                off=float(off[far]),
            )
        return joints


class HandReadings(Instrument):
    """What a person reads off an instrument, and types; where something touches, that it does."""

    name: ClassVar[str] = "hand"
    streams: ClassVar[bool] = False
    asked: ClassVar[bool] = True

    def __init__(self) -> None:
        self._ask: Callable[[str], str] | None = None
        self._observed: CellInstrument | None = None
        self._at = 0

    @classmethod
    def open(cls, address: str | None, timeout_s: float, columns: str = "") -> "HandReadings":
        """Ask whoever is asked (`asks`).

        Raises:
            DeviceError: an address or columns, which it does not have.
        """
        if address is not None or columns:
            given = shown(columns or address or "")
            raise DeviceError(
                f"the instrument 'hand' has no address and no columns, and '{given}' is given; leave it out"
            )
        return cls()

    def asks(self, ask: Callable[[str], str]) -> None:
        """Ask by this."""
        self._ask = ask

    def observes(self, observed: CellInstrument) -> None:
        """Readings of this.

        Raises:
            DeviceError: of a tracker, whose points nobody types.
        """
        if observed.looked_for is not None:
            super().observes(observed)
        if observed.kind.in_tracker:
            raise DeviceError(
                "the instrument 'hand' asks for readings without a tracker; state what they are of (--observe socket, wire, …)"
            )
        self._observed = observed

    def show(self, fixture: str) -> None:
        """Remember what is measured next, to name it with the question."""
        assert self._observed is not None
        self._at = self._observed.fixtures.names.index(fixture)

    def read(self, timeout_s: float) -> Shot | None:
        """Ask until a reading is entered; a person takes what time it takes.

        Raises:
            MissedError: the person leaves it out.
            DeviceError: the input has ended, or nobody is asked.
        """
        observed = self._observed
        if self._ask is None or observed is None:
            raise DeviceError("the instrument 'hand' asks for readings, and nobody is there to answer")
        blank = {name: cells[0] for name, cells in observed.columns(np.array([self._at])).items()}
        asked = [name for name, cell in blank.items() if not cell]
        name = observed.fixtures.names[self._at]
        where = f"{observed.label} '{name}'" if name else observed.name
        what = (
            Said("{fixture}: enter {columns} as read, or no to leave it out:", fixture=where, columns=" ".join(asked))
            if asked
            else Said("{fixture}: press Enter once it is seated, or enter no to leave it out:", fixture=where)
        )
        question = what
        while True:
            text = self._ask(question).strip()
            if text.casefold() in ("n", "no"):
                raise MissedError("{fixture} was not measured", fixture=where)
            read = self._parse(text, {**blank, **dict(zip(asked, text.split(), strict=False))}, len(asked))
            if not isinstance(read, Said):
                return read
            question = Said("{wrong}\n{pose}", wrong=read, pose=what)

    def close(self) -> None:
        """Nothing is open."""

    def _parse(self, text: str, cells: Mapping[str, str], count: int) -> Shot | Said:
        """The reading of what was typed; or what is wrong with it."""
        assert self._observed is not None
        kind, given = self._observed.kind, len(text.split())
        if given != count:
            return Said("{count} values; {needed} are needed.", count=given, needed=count)
        try:
            found = KindColumns.of(kind, tuple(cells)).read(tuple(cells.values()), "typed")
        except TaskcalError:
            found = None
        if found is None:
            return Said("'{text}' are not numbers alone.", text=shown(text))
        return Shot(time_s=time.monotonic(), point=found.points[0], kind=kind.key)

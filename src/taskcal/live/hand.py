"""The controller ``hand``: a person moves the robot, and types or pastes the joints that its pendant shows."""

import time
from collections.abc import Callable
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from taskcal.errors import shown
from taskcal.live.devices import Controller, DeviceError, JointReading, Said
from taskcal.live.stillness import Rules
from taskcal.robot.robot import Robot


class Hand(Controller):
    """Joints as a person enters them, in degrees, millimetres where a joint slides."""

    name: ClassVar[str] = "hand"
    streams: ClassVar[bool] = False

    def __init__(self, robot: Robot, ask: Callable[[str], str] | None = None):
        self._robot, self._ask = robot, ask
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

    def asks(self, ask: Callable[[str], str]) -> None:
        """Ask by this."""
        self._ask = ask

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
        try:
            joints = np.array([float(cell.replace(",", ".")) for cell in cells]) * self._units
        except ValueError:
            return Said("'{text}' are not numbers alone.", text=shown(text.strip()))
        if not np.isfinite(joints).all() or not self._robot.inside_limits(joints[None])[0]:
            return Said("beyond the robot's limits; see the order of the joints and their signs.")
        off = np.abs(joints - self._pose) / self._units
        if (off * self._units > Rules.arrived).any():
            far = int(off.argmax())
            return Said(
                "{joint} is {off:.1f} from the pose; go nearer, or mend what was typed.",
                joint=self._names[far],
                off=float(off[far]),
            )
        return joints

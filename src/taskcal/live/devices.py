"""What is read while measuring: a controller's joints, and an instrument's points, each a class that enters a registry."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from inspect import isabstract
from typing import Any, ClassVar, TypeVar

import numpy as np
from jaxtyping import Float

from taskcal.errors import TaskcalError, UnknownName
from taskcal.observations.base import kinds
from taskcal.observations.instrument import Instrument as CellInstrument
from taskcal.observations.point import Point
from taskcal.reading.pictures import Corners
from taskcal.robot.robot import Robot
from taskcal_groundwork.plugins import load_plugins, state_faults
from taskcal_groundwork.said import Said


class DeviceError(TaskcalError):
    """A controller or an instrument that cannot be reached, or was lost; the message has its address and what would work."""


@dataclass(frozen=True, eq=False, kw_only=True)
class JointReading:
    """Joints as the controller states them."""

    time_s: float
    """Monotonic, of this computer, when they arrived (`time.monotonic`)."""
    joints: Float[np.ndarray, " joints"]
    """In the controller's own order, as the robot file has it: radians, metres where a joint slides."""
    moving: bool | None = None
    """What the controller itself says; None where it says nothing."""

    def __post_init__(self) -> None:
        """Check that there is a position of every joint.

        Raises:
            DeviceError: one is none, at which the robot would be waited for.
        """
        if not np.isfinite(self.joints).all():
            k = int(np.flatnonzero(~np.isfinite(self.joints))[0])
            raise DeviceError(
                f"the controller states joint {k + 1} as {self.joints[k]}, which is no position; see its messages, and that its "
                "encoders are read"
            )


@dataclass(frozen=True, eq=False, kw_only=True)
class Shot:
    """A measurement of the target."""

    time_s: float
    """Monotonic, of this computer, when it arrived (`time.monotonic`)."""
    point: Float[np.ndarray, " 3"]
    """Centre of the target in the instrument's frame, metres; of another kind of observation its numbers. NaN where it is not
    valid."""
    kind: str = Point.key
    """Key of the kind of observation."""
    fixture: str = ""
    """At which it was measured, where the instrument says."""
    reason: str = ""
    """Why it is not valid, such as ``beam lost``; empty where it is."""
    corners: Corners | None = None
    """Of an image, what it shows."""
    wrong: Said | None = None
    """Why a person has to make it again, which is asked for."""

    @property
    def valid(self) -> bool:
        """Whether the target was seen."""
        return not self.reason


_Kind = TypeVar("_Kind", bound="Device")


class Device(ABC):
    """What controllers and instruments have in common: a name, and a connection that is closed."""

    name: ClassVar[str] = ""
    """By which the command line knows it. A class that states one enters the registry of its kind as it is defined."""
    reached: ClassVar[str] = ""
    """Its address, as help and messages show it, such as ``HOST[:PORT]``; empty for none."""
    streams: ClassVar[bool] = True
    """Whether readings come by themselves, again and again. If not, each is made by a person, and counts as standing."""
    extra: ClassVar[str] = ""
    """Optional package that it needs, such as ``taskcal[live]``; it is imported when a connection is opened, not before."""

    @abstractmethod
    def close(self) -> None:
        """End the connection; again does nothing."""

    def __enter__(self: _Kind) -> _Kind:
        """Use it in a `with` statement, which closes it."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self.close()


class Controller(Device):
    """A robot's controller."""

    can_move: ClassVar[bool] = False
    """Whether `move` works."""

    def __init_subclass__(cls, **more: Any) -> None:
        """Enter the registry."""
        super().__init_subclass__(**more)
        _enter(_CONTROLLERS, cls)

    @classmethod
    @abstractmethod
    def open(cls, address: str | None, robot: Robot, timeout_s: float) -> "Controller":
        """Connect.

        Args:
            address: as the command line has it; None for its usual one.
            robot: whose joints are read.
            timeout_s: how long to wait for it, seconds.

        Raises:
            DeviceError: it cannot be reached there.
        """

    @abstractmethod
    def read(self, timeout_s: float) -> JointReading:
        """The newest joints, which arrived after the call before.

        Raises:
            DeviceError: none arrived in time, or the connection is lost.
        """

    def show(self, joints: Float[np.ndarray, " joints"]) -> None:
        """The pose to be measured next, in radians, for what shows it to a person who moves the robot; does nothing by default."""

    def asks(self, ask: Callable[[str], str], within: float) -> None:
        """How to ask the person who moves the robot for a line; does nothing where the joints are read.

        Args:
            ask: gives the line that answers a text.
            within: of the pose shown, in which joints are taken, radians or metres.
        """

    def visits(self, joints: Float[np.ndarray, "n joints"]) -> None:
        """The poses of a program that moves the robot, in radians, for what simulates one; does nothing by default."""

    def move(self, joints: Float[np.ndarray, " joints"], speed_fraction: float) -> None:
        """Begin a motion to joints, all joints at once; it ends when they are read there.

        Args:
            joints: radians, in the order of `JointReading`.
            speed_fraction: of the joints' largest speeds, above 0 and at most 1.

        Raises:
            DeviceError: it refuses, or cannot move a robot.
        """
        raise DeviceError(f"the controller '{self.name}' is only read; move the robot by its own means")


class Instrument(Device):
    """An instrument that measures points of one target, or what another kind of observation reads."""

    asked: ClassVar[bool] = False
    """Whether a person is asked for each reading, who then says when the robot stands."""
    on_request: ClassVar[bool] = False
    """Whether each reading is made when it is asked for, so that it is never of an earlier time."""
    unbidden: bool = False
    """Whether readings that do not stream may still come on the way to a pose, as images of a camera that takes one after another:
    of a person who types the joints, those before do not count."""

    def __init_subclass__(cls, **more: Any) -> None:
        """Enter the registry."""
        super().__init_subclass__(**more)
        _enter(_INSTRUMENTS, cls)

    @classmethod
    @abstractmethod
    def open(cls, address: str | None, timeout_s: float, columns: str = "") -> "Instrument":
        """Connect.

        Args:
            address: as the command line has it; None for its usual one.
            timeout_s: how long to wait for it, seconds.
            columns: names of the columns of its lines, such as ``x_mm,y_mm,z_mm``, where it sends lines (`lines.Columns`); empty
                where their header states them, or where it sends none.

        Raises:
            DeviceError: it cannot be reached there.
        """

    def observes(self, observed: CellInstrument) -> None:
        """What is measured from here on; by default nothing but a tracker's points.

        Args:
            observed: the instrument in the robot's cell, with its fixtures.

        Raises:
            DeviceError: it does not measure that.
        """
        if not observed.kind.in_tracker:
            others = "hand, folder or tcp" if observed.looked_for is None else "folder"
            raise DeviceError(
                f"the instrument '{self.name}' does not measure by {observed.name}; choose {others}, or plan the rows "
                f"(taskcal plan --observe {observed.name}) and measure them as its file says"
            )

    def show(self, fixture: str) -> None:
        """What is measured next, for what asks a person or simulates one; does nothing by default."""

    def asks(self, ask: Callable[[str], str]) -> None:
        """How to ask the person for a line; does nothing where readings come by themselves."""

    def knows(self, images: Sequence[str]) -> None:
        """Names of the images that the campaign has already, which no other may have; does nothing by default."""

    @abstractmethod
    def read(self, timeout_s: float) -> Shot | None:
        """The next shot, in the order in which they arrived; None if none arrived in time.

        Raises:
            DeviceError: the connection is lost.
        """


# The registries. A module of Taskcal's own is named here, and is imported when the registry is first asked.

CONTROLLERS_GROUP, INSTRUMENTS_GROUP = "taskcal.controllers", "taskcal.instruments"
"""Entry points of other packages: subclasses of `Controller` and `Instrument`."""

OWN_MODULES = (
    "taskcal_devices.abb", "taskcal_devices.folder", "taskcal.live.hand", "taskcal_devices.natnet", "taskcal_devices.opcua",
    "taskcal_devices.ros", "taskcal_devices.rsi", "taskcal_devices.rtde", "taskcal_devices.tcp", "taskcal.live.virtual",
)  # fmt: skip
"""Modules that define controllers and instruments."""

_CONTROLLERS: dict[str, type[Controller]] = {}
_INSTRUMENTS: dict[str, type[Instrument]] = {}


def _enter(registry: dict[str, type[_Kind]], kind: type[_Kind]) -> None:
    """Take a class up under its name; the same class of the same module may be defined again.

    Raises:
        TaskcalError: another class has its name.
    """
    if not kind.name or isabstract(kind):
        return
    other = registry.get(kind.name)
    if other is not None and (other.__module__, other.__qualname__) != (kind.__module__, kind.__qualname__):
        raise TaskcalError(
            f"the class {kind.__name__} of the module {kind.__module__} cannot be called '{kind.name}': {other.__name__} of "
            f"{other.__module__} is; choose another name"
        )
    registry[kind.name] = kind


def controllers() -> Mapping[str, type[Controller]]:
    """All controllers by name, those of other packages behind Taskcal's own."""
    return _loaded(_CONTROLLERS, Controller, CONTROLLERS_GROUP)


def instruments() -> Mapping[str, type[Instrument]]:
    """All instruments by name, those of other packages behind Taskcal's own."""
    return _loaded(_INSTRUMENTS, Instrument, INSTRUMENTS_GROUP)


def _loaded(registry: dict[str, type[_Kind]], kind: type[_Kind], group: str) -> Mapping[str, type[_Kind]]:
    for module in OWN_MODULES:
        import_module(module)
    load_plugins(group, kind, registry)
    return registry


def controller_of(name: str) -> type[Controller]:
    """The controller of a name.

    Raises:
        UnknownName: there is none.
    """
    return _found("controller", name, controllers(), CONTROLLERS_GROUP)


def instrument_of(name: str) -> type[Instrument]:
    """The instrument of a name.

    Raises:
        UnknownName: there is none; what is observed without a tracker is stated beside it.
    """
    if name not in instruments() and any(kind.needed and name == kind.instrument for kind in kinds()):
        raise UnknownName(
            "instrument", name, instruments(), f"of readings; state what they are of beside it (--observe {name})"
        )
    return _found("instrument", name, instruments(), INSTRUMENTS_GROUP)


def _found(kind: str, name: str, known: Mapping[str, type[_Kind]], group: str) -> type[_Kind]:
    if name not in known:
        raise UnknownName(kind, name, known, state_faults(group))
    return known[name]

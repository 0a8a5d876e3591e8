"""What devices on a network share: addresses, items that arrive by themselves, the device's clock, and the names of its joints.

Taskcal connects to the address that it is given, this computer's own where none is. Where a protocol has the device send datagrams
to whoever is configured there (`listen`), it takes those that come to the address that it is given, and answers none.
"""

import re
import socket
from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain
from math import inf, isfinite
from pathlib import Path
from threading import Condition, Thread
from time import monotonic
from typing import ClassVar, Generic, TypeVar
from urllib.parse import parse_qsl, unquote, urlsplit

import numpy as np
from jaxtyping import Float

from taskcal.errors import FileError, shown
from taskcal.io.xml_file import Element, parse_xml
from taskcal.live.devices import Controller, Device, DeviceError, JointReading
from taskcal.robot.robot import Robot

LOOPBACK = "127.0.0.1"

MAX_WAITING = 100_000
"""Items that wait to be read, 100 s of 1 kHz; the oldest are dropped, which a loop that was away so long would not use."""

CLOSING_S = 2.0
"""Longest wait for a thread to end after its connection was closed, seconds."""

MAX_LINE_BYTES = 1 << 12
"""Of a line of numbers, which has some hundred."""

RECEIVED_BYTES = 1 << 16
"""At most taken from a socket at a time; no datagram has more."""

LISTENING_S = 0.2
"""Between two looks at whether a socket that is listened to was closed, seconds."""

OVERTAKEN_S = 1.0
"""By which a stamp may be behind the last one and be of a message that was overtaken; more is a clock that was set back."""

MOVED = 0.05
"""Of an axis that is not the robot's, mm or degrees: more than a standing axis' encoder shows, less than a target needs to be
elsewhere by what robots repeat (0.05 mm at half a metre from a turntable's axis is 0.006°)."""


@dataclass(frozen=True, kw_only=True)
class Address:
    """Where a device is: ``[SCHEME://]HOST[:PORT][/PATH][?OPTION=VALUE&…]``."""

    device: type[Device]
    scheme: str
    host: str
    port: int
    path: tuple[str, ...]
    """Its parts between slashes."""
    options: Mapping[str, str]

    def __str__(self) -> str:
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"

    @classmethod
    def parse(
        cls,
        text: str | None,
        device: type[Device],
        port: int | None = None,
        schemes: Sequence[str] = ("",),
        options: Sequence[str] = (),
    ) -> "Address":
        """Understand an address.

        Args:
            text: as the command line has it; None for this computer.
            device: that it is the address of.
            port: the usual one; None if it has none.
            schemes: that it may begin with; the first where it begins with none.
            options: that it may have.

        Raises:
            DeviceError: it is not the address of such a device; the message says what one looks like.
        """

        def wrong(reason: str) -> DeviceError:
            address = shown((text or "").rpartition("@")[2])  # without a password
            return DeviceError(f"the address '{address}' of {_called(device)} {reason}; write {device.reached}")

        if text is None and port is None:
            raise DeviceError(f"{_called(device)} needs an address: {device.reached}")
        given = LOOPBACK if text is None else text.strip()
        try:
            parts = urlsplit(given if "://" in given else f"{schemes[0]}://{given}" if schemes[0] else f"//{given}")
            found = parts.port or port
        except ValueError:
            raise wrong("is not one; a port is a number up to 65535, and an IPv6 address stands in brackets") from None
        if parts.scheme not in schemes:
            raise wrong(f"begins with {parts.scheme}://")
        if not parts.hostname:
            raise wrong("has no host")
        if found is None:
            raise wrong("has no port")
        if parts.username is not None:
            raise wrong("has a user, and none is told to a device")
        stated = dict(parse_qsl(parts.query, keep_blank_values=True))
        if unknown := [option for option in stated if option not in options]:
            raise wrong(f"has an unknown option '{shown(unknown[0])}'")
        path = tuple(unquote(part) for part in parts.path.split("/") if part)
        return cls(device=device, scheme=parts.scheme, host=parts.hostname, port=found, path=path, options=stated)

    @property
    def called(self) -> str:
        """The device and its address, as messages begin."""
        return f"{_called(self.device)} at {self}"

    def unreachable(
        self, error: Exception, hint: str = "see that it is switched on, and try the address by ping"
    ) -> DeviceError:
        """Error of a connection that was not made."""
        return DeviceError(f"{self.called} cannot be reached ({_reason(error)}); {hint}")

    def lost(self, error: Exception | None = None) -> DeviceError:
        """Error of a connection that ended."""
        reason = _reason(error) if error is not None else "it was closed at the other end"
        return DeviceError(f"{self.called} was lost ({reason}); see that it still runs, and its cable")

    def silent(self, what: str, timeout_s: float, hint: str = "see that it still runs, and its cable") -> DeviceError:
        """Error of a connection that is there, over which nothing comes."""
        return DeviceError(f"{self.called} sent no {what} for {timeout_s:g} s; {hint}")

    def misunderstood(self, what: str) -> DeviceError:
        """Error of what arrived and is not what the protocol has there."""
        return DeviceError(
            f"{self.called} {what}; see that the address is that of {_called(self.device)}: {self.device.reached}"
        )

    def connect(
        self, timeout_s: float, hint: str = "see that it is switched on, and try the address by ping"
    ) -> socket.socket:
        """Connect by TCP.

        Raises:
            DeviceError: nothing answers there in time.
        """
        try:
            connection = socket.create_connection((self.host, self.port), timeout_s)
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        except OSError as error:
            raise self.unreachable(error, hint) from error
        return connection


def _called(device: type[Device]) -> str:
    return f"the {'controller' if issubclass(device, Controller) else 'instrument'} '{device.name}'"


def _reason(error: Exception) -> str:
    if isinstance(error, TimeoutError):
        return "no answer in time"
    return shown(getattr(error, "strerror", None) or str(error) or type(error).__name__)


def received(connection: socket.socket, address: Address) -> Iterator[bytes]:
    """What arrives over TCP, piece by piece, until the connection ends.

    Raises:
        DeviceError: it ended.
    """
    while True:
        try:
            piece = connection.recv(RECEIVED_BYTES)
        except OSError as error:
            raise address.lost(error) from error
        if not piece:
            raise address.lost()
        yield piece


def listen(address: Address) -> socket.socket:
    """A UDP socket at an address of this computer, for a device that sends datagrams there.

    Raises:
        DeviceError: it is no address of this computer, or another program has the port.
    """
    try:
        family, kind, protocol, _, at = socket.getaddrinfo(address.host, address.port, type=socket.SOCK_DGRAM)[0]
        connection = socket.socket(family, kind, protocol)
        try:
            connection.bind(at)
        except OSError:
            connection.close()
            raise
    except OSError as error:
        raise DeviceError(
            f"{address.called} cannot be listened to ({_reason(error)}); name an address of this computer, such as "
            f"0.0.0.0:{address.port} for all that it has, and see that no other program has the port"
        ) from error
    connection.settimeout(LISTENING_S)
    return connection


def datagrams(
    connection: socket.socket,
    address: Address,
    timeout_s: float,
    hint: str,
    chosen: str | None = None,
    meanwhile: Callable[[], None] = lambda: None,
) -> Iterator[tuple[float, bytes]]:
    """What one sender sends, each with when it arrived (`time.monotonic`), until the socket is closed.

    Args:
        connection: bound, with a time limit.
        address: of the device.
        timeout_s: longest wait for the first one, seconds.
        hint: what to look at where none comes.
        chosen: whose datagrams count; None for whoever is the first.
        meanwhile: called again and again.

    Raises:
        DeviceError: none came in time, the sender is unknown, there are two, or the socket was closed.
    """
    try:
        sender = None if chosen is None else socket.getaddrinfo(chosen, None, connection.family)[0][4][0]
    except OSError as error:
        raise DeviceError(f"{address.called}: 'from={shown(chosen or '')}' is no host ({_reason(error)})") from error
    begun, until = False, monotonic() + timeout_s
    while begun or monotonic() < until:
        try:
            meanwhile()
            content, (host, *_) = connection.recvfrom(RECEIVED_BYTES)
        except TimeoutError:
            continue
        except OSError as error:
            raise address.lost(error) from error
        arrived_s = monotonic()
        sender = host if sender is None else sender
        if host == sender:
            begun = True
            yield arrived_s, content
        elif chosen is None:
            raise DeviceError(
                f"{address.called} gets packets from {sender} and from {host}; name one: '…?from={sender}'"
            )
    raise address.silent("packet", timeout_s, hint)


def xml_of(content: bytes) -> Element:
    """The root of a message in XML.

    Raises:
        ValueError: it is none, or declares a document type.
    """
    try:
        return parse_xml(Path("message"), content)
    except FileError as error:
        raise ValueError(str(error)) from error


def received_lines(pieces: Iterator[bytes], address: Address) -> Iterator[tuple[float, str]]:
    """Whole lines, each with when its first byte arrived (`time.monotonic`); the beginning of one waits for its end.

    Raises:
        DeviceError: no end comes.
    """
    waiting, began = b"", 0.0
    for piece in pieces:
        arrived = monotonic()
        began = began if waiting else arrived
        *whole, waiting = (waiting + piece).split(b"\n")
        for line in whole:
            yield began, line.decode("utf-8", "replace").strip()
            began = arrived
        if len(waiting) > MAX_LINE_BYTES:
            raise address.misunderstood(f"sends {len(waiting)} bytes without an end of line")


def hang_up(connection: socket.socket) -> None:
    """Close a socket, so that a thread that waits for it goes on."""
    with suppress(OSError):  # it may be lost already
        connection.shutdown(socket.SHUT_RDWR)
    connection.close()


Item = TypeVar("Item")


class Feed(Generic[Item]):
    """What a device sends by itself, taken by a thread, so that each item is stamped when it arrives, not when it is asked for."""

    def __init__(self, items: Iterator[Item], hang_up: Callable[[], None]):
        """Begin.

        Args:
            items: waits for each, and raises DeviceError where the connection ends.
            hang_up: closes the connection, at which `items` ends.
        """
        self._items, self._hang_up = items, hang_up
        self._waiting: deque[Item] = deque(maxlen=MAX_WAITING)
        self._fault: Exception | None = None
        self._news = Condition()
        self._thread = Thread(target=self._collect, name="taskcal live", daemon=True)
        self._thread.start()

    def _collect(self) -> None:
        try:
            for item in self._items:
                with self._news:
                    self._waiting.append(item)
                    self._news.notify_all()
        except Exception as error:  # whatever it is, it is raised where items are asked for
            with self._news:
                self._fault = error
                self._news.notify_all()

    def next(self, timeout_s: float) -> Item | None:
        """The next item in the order of arrival; None if none arrived in time.

        Raises:
            DeviceError: the connection has ended, and what had arrived was given.
        """
        return self._taken(timeout_s, newest=False)

    def newest(self, timeout_s: float) -> Item | None:
        """The newest item that was not given yet; None if none arrived in time.

        Raises:
            DeviceError: the connection has ended, and what had arrived was given.
        """
        return self._taken(timeout_s, newest=True)

    def _taken(self, timeout_s: float, newest: bool) -> Item | None:
        with self._news:
            self._news.wait_for(lambda: self._waiting or self._fault, timeout_s)
            if self._waiting:
                item = self._waiting.pop() if newest else self._waiting.popleft()
                if newest:
                    self._waiting.clear()
                return item
            if self._fault is not None:
                raise self._fault
            return None

    def close(self) -> None:
        """End the connection; again does nothing."""
        self._hang_up()
        self._thread.join(CLOSING_S)


def answered(ask: Callable[[], Item], timeout_s: float, late: DeviceError, hang_up: Callable[[], None]) -> Item:
    """What a device answers within a time, whatever it sends meanwhile: a limit of each read alone has no end.

    Args:
        ask: asks, and returns the answer.
        timeout_s: for all of it, seconds.
        late: raised where that is over.
        hang_up: closes the connection then, at which `ask` ends.

    Raises:
        DeviceError: `late`, or what `ask` raises.
    """
    feed = Feed((ask() for _ in range(1)), hang_up)
    answer = feed.next(timeout_s)
    if answer is None:
        feed.close()
        raise late
    return answer


CLOCK_WINDOW_S = 60.0
"""Clocks of computers differ by some 50 ppm (RFC 5905: at most 500): 3 ms in this time, less than a network's delays."""


RATE_WITHIN = 5e-3
"""Of the rate of a device's clock from this computer's, ten times what clocks differ by at most (RFC 5905): over `CLOCK_WINDOW_S`
it moves a stamp by 0.3 s, less than a robot is given to settle."""

DELAYS_WITHIN_S = 0.1
"""Of the smallest delays of two spans from each other: connections hold single messages back for longer, not all of a span."""

SPANS, SPAN_MESSAGES, SPAN_S = 4, 10, 1.0
"""Spans of one length whose smallest delays have to change alike where it is the rate, with so many messages and seconds each at
least. A step of the delay changes one of them, and what the network does changes them differently."""


class DeviceClock:
    """A device's own clock, read on this computer's monotonic one.

    A message never arrives before it was sent, so the smallest difference of arrival and stamp is nearest to the offset of the
    clocks (the clock filter of RFC 5905, section 10, for messages of one direction). What is left is the smallest delay itself.
    """

    def __init__(self, called: str) -> None:
        """Begin.

        Args:
            called: the device and its address, as messages begin.
        """
        self._called = called
        self._spans: list[tuple[float, tuple[float, float], int]] = []
        """When each span of the last window began; its smallest difference, and when that arrived; its messages."""
        self._differences: deque[tuple[float, float]] = deque()
        """(arrival, arrival less stamp), seconds; ascending in both, so that the first is the smallest of the window."""
        self._last = -inf

    def advanced(self, stamp_s: float) -> bool:
        """Whether a stamp is of another measurement than those before; much earlier than the last, the clock was set back.

        The same is of a measurement that is sent again, one a little earlier of a message that was overtaken.
        """
        return not self._last - OVERTAKEN_S < stamp_s <= self._last

    def local(self, stamp_s: float, arrived_s: float) -> float:
        """When it was measured, on this computer's clock, and not later than it arrived.

        Args:
            stamp_s: of the device, seconds.
            arrived_s: `time.monotonic`.

        Raises:
            DeviceError: the device's clock does not run at the rate of this computer's.
        """
        if not isfinite(stamp_s):
            return arrived_s
        if stamp_s < self._last:  # it was set back: what was seen before is of another clock
            self._differences.clear()
            self._spans.clear()
        self._last = stamp_s
        difference = arrived_s - stamp_s
        self._compare(arrived_s, difference)
        while self._differences and self._differences[-1][1] >= difference:
            self._differences.pop()
        self._differences.append((arrived_s, difference))
        while self._differences[0][0] < arrived_s - CLOCK_WINDOW_S:
            self._differences.popleft()
        return min(stamp_s + self._differences[0][1], arrived_s)

    def _compare(self, arrived_s: float, difference: float) -> None:
        """See that stamps advance as this computer's clock does, from the first ones on that tell.

        Raises:
            DeviceError: they do not.
        """
        smallest = (difference, arrived_s)
        if self._spans and arrived_s < self._spans[-1][0] + SPAN_S:
            begun, least, count = self._spans[-1]
            self._spans[-1] = begun, min(least, smallest), count + 1
            return
        whole = self._spans
        self._spans = [*(one for one in whole if one[0] > arrived_s - CLOCK_WINDOW_S), (arrived_s, smallest, 1)]
        each = len(whole) // SPANS
        parts = [whole[len(whole) - k * each :][:each] for k in range(SPANS, 0, -1)]
        if not each or min(sum(count for *_, count in part) for part in parts) < SPAN_MESSAGES:
            return
        least = np.array([min(one for _, one, _ in part) for part in parts])
        changes, seconds = np.diff(least, axis=0).T
        rates, off = 1.0 - changes / seconds, np.abs(changes / seconds)
        alike = abs(np.sign(changes).sum()) == len(changes) and off.max() <= 2.0 * off.min()
        if alike and off.min() > RATE_WITHIN and np.abs(changes).min() > DELAYS_WITHIN_S:
            raise DeviceError(
                f"{self._called}: its time stamps advance by {rates.mean():.3f} s in each second of this computer's clock, over "
                f"{arrived_s - parts[0][0][0]:.0f} s, so that they do not tell when something was measured; let its clock, or the "
                "simulation that gives the time, run at the rate of real time, and go on (--resume)"
            )


def missing_package(device: type[Device], package: str) -> DeviceError:
    """Error of a device whose optional package is not installed."""
    return DeviceError(f'{_called(device)} needs the package {package}; install it: pip install "{device.extra}"')


def match_joints(robot: Robot, names: Sequence[str], address: Address) -> tuple[int, ...]:
    """Where each joint of a robot is among a device's joints: by its name, or by the number that the names end in.

    Args:
        robot: whose joints are looked for.
        names: the device's.
        address: its option ``joints`` has the device's names in the order of the robot's joints.

    Raises:
        DeviceError: not every joint is found, or not surely.
    """
    chosen = [name.strip() for name in address.options.get("joints", "").split(",") if name.strip()]
    wanted = chosen or list(robot.joint_names)
    if len(wanted) == len(robot.joints) and all(names.count(name) == 1 for name in wanted):
        return tuple(names.index(name) for name in wanted)
    numbers = [_number(name) for name in names]
    if not chosen and None not in numbers and len(set(numbers)) == len(names):
        asked = [_number(name) for name in wanted]
        if sorted(map(str, asked)) == sorted(map(str, numbers)):
            return tuple(numbers.index(number) for number in asked)
    enough = f"name the device's joints in the robot's order: '…?joints={','.join([*names][: len(robot.joints)])}'"
    raise DeviceError(
        f"{address.called} has the joints {shown(', '.join(names) or 'of no name')}, and {robot.name} has "
        f"{', '.join(robot.joint_names)}{f', named as {shown(str(chosen))}' if chosen else ''}; "
        f"{enough if len(names) >= len(robot.joints) else 'see that it is this robot'}"
    )


def _number(name: str) -> int | None:
    found = re.search(r"(\d+)$", name)
    return int(found[1]) if found else None


class Axes:
    """A robot's joints among the axes that a controller states, in degrees, in millimetres where one slides.

    Axes beside these, as of a track or a positioner, have to stay where they were at first: robot or target might be moved by them.
    """

    def __init__(self, robot: Robot, address: Address):
        self._robot, self._address = robot, address
        self._units = np.where(robot.prismatic, 1e-3, np.pi / 180.0)
        self._names: tuple[str, ...] = ()
        self._order: list[int] = []
        self._first: Float[np.ndarray, " axes"] = np.zeros(0)

    def joints(self, own: Mapping[str, float], external: Mapping[str, float]) -> Float[np.ndarray, " joints"]:
        """Joints in the robot's order, radians or metres.

        Args:
            own: values of the manipulator's axes by their names.
            external: those of axes beside it, which count where the address names them (``joints=``).

        Raises:
            DeviceError: they are not surely the robot's, a value is none, or another axis has moved.
        """
        values = {**own, **external}
        names, numbers = tuple(values), np.array([*values.values()], dtype=float)
        if not self._names:
            all_of_them = "joints" in self._address.options or len(self._robot.joints) > len(own)
            self._order = list(match_joints(self._robot, names if all_of_them else [*own], self._address))
            self._names, self._first = names, numbers
        if names != self._names:
            raise self._address.misunderstood(f"states {shown(', '.join(names))} after {shown(', '.join(self._names))}")
        if not np.isfinite(numbers).all():
            wrong = int(np.flatnonzero(~np.isfinite(numbers))[0])
            raise DeviceError(
                f"{self._address.called} states {shown(names[wrong])} as {numbers[wrong]}, which is no position; see the "
                "controller's messages"
            )
        off = np.abs(numbers - self._first)
        off[self._order] = 0.0
        if len(off) and off.max() > MOVED:
            k = int(off.argmax())
            raise DeviceError(
                f"{self._address.called} has moved the axis {names[k]} from {self._first[k]:g} to {numbers[k]:g}, which is no "
                f"joint of {self._robot.name}: robot or target may stand elsewhere; bring it back and go on, or describe it as a "
                "joint of the robot and name it ('…?joints=')"
            )
        return numbers[self._order] * self._units


class DatagramJoints(Controller):
    """A controller that sends its axes by itself, in a UDP datagram each, to an address of this computer; nothing is sent to it."""

    port: ClassVar[int]
    """Its usual one."""
    hint: ClassVar[str]
    """What to look at where nothing comes."""

    def __init__(self, address: Address, feed: "Feed[JointReading]"):
        self._address, self._feed = address, feed

    @staticmethod
    @abstractmethod
    def parse(content: bytes) -> tuple[float, Mapping[str, float], Mapping[str, float]]:
        """When a datagram was made by the controller's clock, seconds; its manipulator's axes, and those beside it (`Axes`).

        Raises:
            ValueError: it is not one of the protocol.
        """

    @classmethod
    def open(cls, address: str | None, robot: Robot, timeout_s: float) -> "DatagramJoints":
        """Listen, until the first datagram is there.

        Raises:
            DeviceError: none comes, it is not of the protocol, or its axes are not surely the robot's.
        """
        where = Address.parse(address, cls, cls.port, options=("from", "joints"))
        connection = listen(where)
        try:
            arriving = datagrams(connection, where, timeout_s, cls.hint, where.options.get("from"))
            readings = cls._readings(arriving, Axes(robot, where), where)
            first = next(readings)
        except DeviceError:
            connection.close()
            raise
        return cls(where, Feed(chain([first], readings), connection.close))

    @classmethod
    def _readings(cls, arriving: Iterator[tuple[float, bytes]], axes: Axes, where: Address) -> Iterator[JointReading]:
        clock = DeviceClock(where.called)
        for arrived_s, content in arriving:
            try:
                stamp_s, own, external = cls.parse(content)
            except ValueError as error:
                raise where.misunderstood(
                    f"gets a packet of {len(content)} bytes that is not understood ({shown(str(error))}): "
                    f"{shown(repr(content[:32]))}"
                ) from error
            if clock.advanced(stamp_s):
                joints = axes.joints(own, external)
                yield JointReading(time_s=clock.local(stamp_s, arrived_s), joints=joints)

    def read(self, timeout_s: float) -> JointReading:
        """The newest joints.

        Raises:
            DeviceError: none arrived in time, or a datagram was refused.
        """
        reading = self._feed.newest(timeout_s)
        if reading is None:
            raise self._address.silent("joints", timeout_s, self.hint)
        return reading

    def close(self) -> None:
        """Stop listening."""
        self._feed.close()

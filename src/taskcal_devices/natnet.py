"""Points of OptiTrack's Motive by NatNet, in unicast: a rigid body, or a marker of one.

NaturalPoint, *NatNet SDK* and its sample that unpacks datagrams by itself (little-endian throughout): a client asks the server for
a connection, and with it for a version of its stream; the server states its own, and sends a frame for each picture of the cameras.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from math import inf
from socket import AF_INET, SOCK_DGRAM, getaddrinfo, socket
from time import monotonic
from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.errors import shown
from taskcal.live.devices import DeviceError, Instrument, Shot
from taskcal_devices.network import LISTENING_S, Address, DeviceClock, Feed, datagrams

PORT = 1510
"""Of the server's commands."""

CONNECT, SERVER_INFO, FRAME, KEEP_ALIVE = 0, 1, 7, 10
"""Kinds of messages."""

MESSAGE = struct.Struct("<HH")
"""Kind, and how long what follows is."""

SIZED = (4, 1)
"""Version of the stream that is asked for, the first that states how long each part of a frame is."""

UNSIZED = ((3, 0), (3, 1), (4, 0))
"""Versions of servers that stream without that, as Motive 2 and 3.0."""

SENDER = struct.Struct("<256s4B4B")
"""Name of the program, its version, and that of NatNet."""

UNICAST = struct.Struct("<QH?")
"""After these: frequency of the server's clock, port of the data, and whether it multicasts."""

KEEP_ALIVE_S = 1.0
"""Between two messages that tell the server that someone still listens. A convention; the SDK's sample sends one a frame."""

HINT = "see that Motive streams (Settings, Streaming: Enable, Transmission Type Unicast), and that its firewall lets NatNet pass"

TRACKED = 1
"""Flag of a rigid body whose position is measured in this frame."""

OCCLUDED, FILLED = 1, 4
"""Flags of a marker that no camera sees, and of one whose position is that of its rigid body's model."""


class NatNet(Instrument):
    """A rigid body or a marker that Motive streams."""

    name = "natnet"
    reached = "HOST[:1510]/RIGID BODY[/MARKER]"

    def __init__(self, feed: Feed[Shot]):
        self._feed = feed

    @classmethod
    def open(cls, address: str | None, timeout_s: float, columns: str = "") -> "NatNet":
        """Connect, and see that what is named is streamed.

        Raises:
            DeviceError: nothing answers there, it streams by multicast or in an unknown version, or does not stream that.
        """
        where = Address.parse(address, cls, PORT)
        if columns:
            raise DeviceError(f"{where.called} sends no lines, so it has no columns; its points are in metres")
        if len(where.path) not in (1, 2) or not all(part.isdecimal() for part in where.path):
            raise DeviceError(
                f"{where.called} needs the streaming ID of a rigid body, and for a marker of it the marker's: {cls.reached}"
            )
        wanted = tuple(int(part) for part in where.path)
        connection = socket(AF_INET, SOCK_DGRAM)
        try:
            shots = _shots(connection, where, wanted, timeout_s)
            first = next(shots)
        except OSError as error:
            connection.close()
            raise where.unreachable(error, HINT) from error
        except DeviceError:
            connection.close()
            raise
        return cls(Feed(chain([first], shots), connection.close))

    def read(self, timeout_s: float) -> Shot | None:
        """The next shot.

        Raises:
            DeviceError: a frame is not understood.
        """
        return self._feed.next(timeout_s)

    def close(self) -> None:
        """Stop listening; the server then stops sending."""
        self._feed.close()


def _shots(connection: socket, where: Address, wanted: tuple[int, ...], timeout_s: float) -> Iterator[Shot]:
    """What the server measures of a rigid body or a marker.

    Raises:
        DeviceError: see `NatNet.open`.
    """
    server = getaddrinfo(where.host, where.port, AF_INET, SOCK_DGRAM)[0][4]
    with socket(AF_INET, SOCK_DGRAM) as probe:
        probe.connect(server)  # sends nothing, and tells which of this computer's addresses the server sees
        connection.bind((probe.getsockname()[0], 0))
    connection.settimeout(LISTENING_S)
    asked = struct.pack("<264s?4B2x", b"Ping", False, *SIZED, 0, 0)
    connection.sendto(MESSAGE.pack(CONNECT, len(asked)) + asked, server)
    version: tuple[int, int] | None = None
    clock, known, told_s, until = DeviceClock(where.called), False, -inf, monotonic() + timeout_s

    def meanwhile() -> None:
        nonlocal told_s
        if not known and monotonic() > until:
            raise where.silent("frame", timeout_s, HINT)
        if monotonic() >= told_s + KEEP_ALIVE_S:
            told_s = monotonic()
            connection.sendto(MESSAGE.pack(KEEP_ALIVE, 0), server)

    for arrived_s, content in datagrams(connection, where, timeout_s, HINT, str(server[0]), meanwhile):
        try:
            kind, _ = MESSAGE.unpack_from(content)
            body = content[MESSAGE.size :]
            if kind == SERVER_INFO:
                version = _version(body, where)
            if kind != FRAME or version is None:
                continue
            frame = Frame.parse(body, sized=version >= SIZED)
        except (struct.error, ValueError) as error:
            raise where.misunderstood(
                f"sends {len(content)} bytes that are not NatNet's ({shown(str(error))}): {shown(repr(content[:32]))}"
            ) from error
        if not known and wanted not in frame.points:
            there = shown(", ".join("/".join(map(str, one)) for one in sorted(frame.points)) or "nothing")
            raise DeviceError(
                f"{where.called} streams {there}, and not {'/'.join(where.path)}; see the streaming ID in Motive"
            )
        known = True
        if clock.advanced(frame.stamp_s):
            point, reason = frame.points.get(wanted, (np.full(3, np.nan), "not streamed"))
            yield Shot(time_s=clock.local(frame.stamp_s, arrived_s), point=point, reason=reason)


def _version(body: bytes, where: Address) -> tuple[int, int]:
    """Version of what the server streams: its own, or the one that was asked for.

    Raises:
        DeviceError: it is not known, or the server multicasts.
    """
    *_, major, minor, _, _ = SENDER.unpack_from(body)
    if (major, minor) not in UNSIZED and not (major == SIZED[0] and minor >= SIZED[1]):
        raise DeviceError(
            f"{where.called} speaks NatNet {major}.{minor}; 3.0, 3.1 and 4 are read: take another version of Motive, or have its "
            "points written to a file (the instrument 'folder')"
        )
    if UNICAST.unpack_from(body, SENDER.size)[2]:
        raise DeviceError(f"{where.called} multicasts; set Transmission Type to Unicast (Settings, Streaming)")
    return min((major, minor), SIZED)


@dataclass(frozen=True, eq=False, kw_only=True)
class Frame:
    """What is read of a frame."""

    stamp_s: float
    """By the server's clock."""
    points: dict[tuple[int, ...], tuple[Float[np.ndarray, " 3"], str]]
    """Positions of rigid bodies by their streaming IDs and of markers by the body's and their own, metres; and why one is NaN."""

    @classmethod
    def parse(cls, body: bytes, *, sized: bool) -> "Frame":
        """Understand a frame.

        Raises:
            ValueError: it is none; `struct.error` where it ends too early.
        """
        parts = _Parts(body, sized)
        parts.number()  # of the frame
        points: dict[tuple[int, ...], tuple[np.ndarray, str]] = {}
        for _ in parts.part():  # sets of markers
            parts.text()
            parts.skip(12 * parts.number())
        for _ in parts.part():  # markers without a name
            parts.skip(12)
        for _ in parts.part():
            body_id, x, y, z, *_, flags = parts.take("<i3f4ffh")
            points[(body_id,)] = _seen((x, y, z), "" if flags & TRACKED else "not tracked")
        for _ in parts.part():  # skeletons
            parts.number()
            parts.skip(38 * parts.number())
        if sized:
            parts.number()  # of assets
            parts.skip(parts.number())
        for _ in parts.part():
            marker, body_id, x, y, z, _, flags, _ = parts.take("<2H3ffhf")
            hidden = "occluded" if flags & OCCLUDED else "filled in by the model" if flags & FILLED else ""
            points[(body_id, marker)] = _seen((x, y, z), hidden)
        for _ in range(2):  # force plates and other devices, with their channels
            for _ in parts.part():
                parts.number()
                for _ in range(parts.number()):
                    parts.skip(4 * parts.number())
        _, _, stamp_s = parts.take("<2Id")
        return cls(stamp_s=stamp_s, points=points)


def _seen(point: tuple[float, float, float], reason: str) -> tuple[Float[np.ndarray, " 3"], str]:
    at = np.array(point)
    reason = reason or ("" if np.isfinite(at).all() and at.any() else "no point")
    return (np.full(3, np.nan) if reason else at), reason


class _Parts:
    """A frame, read from its beginning."""

    def __init__(self, body: bytes, sized: bool):
        self._body, self._at, self._sized = body, 0, sized

    def take(self, layout: str) -> tuple[Any, ...]:
        """Numbers of a layout."""
        values = struct.unpack_from(layout, self._body, self._at)
        self._at += struct.calcsize(layout)
        return values

    def number(self) -> int:
        """A whole number, which is none below zero."""
        return int(self.take("<I")[0])

    def skip(self, count: int) -> None:
        """Pass over bytes."""
        self._at += count
        if self._at > len(self._body):
            raise ValueError("it ends too early")

    def text(self) -> None:
        """Pass over a text, which a zero ends."""
        self._at = self._body.index(b"\0", self._at) + 1

    def part(self) -> Iterator[int]:
        """One turn for each thing of a part; where it states its length, it has to be that."""
        count, size = self.number(), self.number() if self._sized else None
        begin = self._at
        yield from range(count)
        if size is not None and self._at != begin + size:
            raise ValueError(f"a part of {size} bytes has {self._at - begin}")

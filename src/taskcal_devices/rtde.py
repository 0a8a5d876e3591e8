"""Joints of Universal Robots' controllers by RTDE, the Real-Time Data Exchange of CB3 (from 3.4) and e-Series.

Universal Robots, *Real-Time Data Exchange (RTDE)*: packages of a big-endian size (uint16, of the whole package) and a type (uint8),
protocol version 2. Only read: nothing is sent but what to send back.
"""

import struct
from collections.abc import Iterator
from socket import socket
from time import monotonic

import numpy as np

from taskcal.errors import shown
from taskcal.live.devices import Controller, DeviceError, JointReading
from taskcal.robot.robot import Robot
from taskcal_devices.network import Address, DeviceClock, Feed, answered, hang_up, received

PORT = 30004

VERSION = 2
"""Of the protocol; 1 does not state a recipe's number and frequency."""

FREQUENCY_HZ = 50.0
"""Of readings; a controller gives up to 125 or 500 per second, and a robot that has to stand still needs no more."""

HEADER = struct.Struct(">HB")

REQUEST_VERSION, SETUP_OUTPUTS, START, DATA = b"V", b"O", b"S", b"U"
"""Types of packages."""

OUTPUTS = {"timestamp": "DOUBLE", "actual_q": "VECTOR6D", "target_qd": "VECTOR6D", "robot_mode": "INT32"}
"""Asked for, with their types: seconds since the controller started, rad, rad/s."""

RECORD = struct.Struct(">B d 6d 6d i")

JOINTS = 6

UNPOWERED = {
    -1: "has no controller",
    0: "is disconnected",
    1: "waits for a confirmation of its safety",
    2: "is booting",
    3: "is off",
    4: "is on, and not initialised",
}
"""Of `robot_mode`: joints are measured from mode 5, idle with its brakes on."""

HINT = "see that the robot is on, and its RTDE service enabled (Settings, Security, Services)"

STANDING_RAD_S = 1e-6
"""Of the target speed, which is exactly zero where the controller commands no motion."""


class Rtde(Controller):
    """A controller of Universal Robots, read by RTDE."""

    name = "rtde"
    reached = "HOST[:30004]"

    def __init__(self, address: Address, feed: Feed[JointReading]):
        self._address, self._feed = address, feed

    @classmethod
    def open(cls, address: str | None, robot: Robot, timeout_s: float) -> "Rtde":
        """Connect, and ask for readings.

        Raises:
            DeviceError: nothing answers there, it is not RTDE, or the robot does not have six turning joints.
        """
        where = Address.parse(address, cls, PORT)
        if len(robot.joints) != JOINTS or any(robot.prismatic):
            raise DeviceError(
                f"{robot.name} does not have the {JOINTS} turning joints of a Universal Robot; take another controller"
            )
        connection = where.connect(timeout_s, HINT)
        try:
            packages = _packages(received(connection, where), where)
            late = where.silent("answer to its handshake", timeout_s, HINT)
            recipe = answered(lambda: _ask(connection, packages, where), timeout_s, late, lambda: hang_up(connection))
        except DeviceError:
            connection.close()
            raise
        connection.settimeout(None)  # its thread waits; who asks for a reading has a limit
        return cls(where, Feed(_readings(packages, recipe, where), lambda: hang_up(connection)))

    def read(self, timeout_s: float) -> JointReading:
        """The newest joints.

        Raises:
            DeviceError: none arrived in time, the connection was lost, or the robot is not powered.
        """
        reading = self._feed.newest(timeout_s)
        if reading is None:
            raise self._address.silent("joints", timeout_s)
        return reading

    def close(self) -> None:
        """End the connection."""
        self._feed.close()


def _packages(pieces: Iterator[bytes], where: Address) -> Iterator[tuple[bytes, bytes]]:
    """Type and payload of each package, however the pieces that arrive are cut."""
    waiting = b""
    for piece in pieces:
        waiting += piece
        while len(waiting) >= HEADER.size:
            size, kind = HEADER.unpack_from(waiting)
            if size < HEADER.size:
                raise where.misunderstood(f"sends {shown(repr(waiting[:16]))}, which is not RTDE")
            if len(waiting) < size:
                break
            yield bytes([kind]), waiting[HEADER.size : size]
            waiting = waiting[size:]


def _ask(connection: socket, packages: Iterator[tuple[bytes, bytes]], where: Address) -> int:
    """Ask for the outputs, and return the number of their recipe."""

    def request(kind: bytes, payload: bytes = b"") -> bytes:
        connection.sendall(HEADER.pack(HEADER.size + len(payload), kind[0]) + payload)
        return next((answer for answered, answer in packages if answered == kind), b"")  # others are texts for its log

    try:
        if request(REQUEST_VERSION, struct.pack(">H", VERSION)) != b"\x01":
            raise where.misunderstood(f"does not speak version {VERSION} of RTDE, which software 3.4 and 5.0 brought")
        answer = request(SETUP_OUTPUTS, struct.pack(">d", FREQUENCY_HZ) + ",".join(OUTPUTS).encode())
        types = answer[1:].decode("ascii", "replace").split(",")
        if types != list(OUTPUTS.values()):
            raise where.misunderstood(f"gives {shown(', '.join(types))} for {', '.join(OUTPUTS)}")
        if request(START) != b"\x01":
            raise where.misunderstood("does not start to send")
    except OSError as error:
        raise where.lost(error) from error
    return answer[0]


def _readings(packages: Iterator[tuple[bytes, bytes]], recipe: int, where: Address) -> Iterator[JointReading]:
    clock = DeviceClock(where.called)
    for kind, payload in packages:
        if kind != DATA:
            continue
        if len(payload) != RECORD.size or payload[0] != recipe:
            raise where.misunderstood(f"sends a record of {len(payload)} bytes where one has {RECORD.size}")
        _, stamp_s, *numbers, mode = RECORD.unpack(payload)
        if mode in UNPOWERED:
            raise DeviceError(
                f"{where.called} reads a robot that {UNPOWERED[mode]}; power it, release its brakes, and go on"
            )
        if clock.advanced(stamp_s):
            q, speeds = np.array(numbers[:JOINTS]), np.array(numbers[JOINTS:])
            moving = bool(np.abs(speeds).max() > STANDING_RAD_S)
            yield JointReading(time_s=clock.local(stamp_s, monotonic()), joints=q, moving=moving)

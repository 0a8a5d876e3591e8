"""Counterparts of Taskcal's connections, each written from its protocol's public document, on a port that the system chooses."""

import json
import socket
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from threading import Event, Thread
from typing import Any

import numpy as np

LOOPBACK = "127.0.0.1"
PATIENCE_S = 20.0
"""Limit of what is waited for; a test that has to wait so long has failed."""


@contextmanager
def serving(serve: Callable[[socket.socket], None]) -> Iterator[str]:
    """The address of a TCP server whose every connection is handed to a function, and closed after it."""
    listener = socket.create_server((LOOPBACK, 0))

    def accept() -> None:
        with suppress(OSError):
            while True:
                connection, _ = listener.accept()
                Thread(target=answer, args=(connection,), daemon=True).start()

    def answer(connection: socket.socket) -> None:
        with connection, suppress(OSError, struct.error):  # whoever connected has gone
            serve(connection)
            connection.shutdown(socket.SHUT_RDWR)

    Thread(target=accept, daemon=True).start()
    try:
        yield f"{LOOPBACK}:{listener.getsockname()[1]}"
    finally:
        with suppress(OSError):
            listener.shutdown(socket.SHUT_RDWR)
        listener.close()


RTDE_TYPES = {
    "timestamp": ("DOUBLE", "d"),
    "actual_q": ("VECTOR6D", "6d"),
    "target_qd": ("VECTOR6D", "6d"),
    "robot_mode": ("INT32", "i"),
}


@contextmanager
def relayed(to: str) -> Iterator[tuple[str, Callable[[], None]]]:
    """The address of a relay to another server, and what cuts all its connections."""
    host, port = to.split(":")
    ends: list[socket.socket] = []

    def relay(connection: socket.socket) -> None:
        with socket.create_connection((host, int(port))) as further:
            ends.extend((connection, further))
            Thread(target=pump, args=(further, connection), daemon=True).start()
            pump(connection, further)

    def pump(out: socket.socket, into: socket.socket) -> None:
        with suppress(OSError):
            while piece := out.recv(1 << 16):
                into.sendall(piece)

    def cut() -> None:
        for end in ends:
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
        ends.clear()

    with serving(relay) as at:
        try:
            yield at, cut
        finally:
            cut()


@dataclass
class RtdePeer:
    """A robot's RTDE service, version 2 (Universal Robots, *Real-Time Data Exchange guide*).

    Each package is its size (uint16, header included), its type (uint8), and its payload, all big-endian.
    """

    joints: Callable[[], np.ndarray] = lambda: np.zeros(6)
    speeds: Callable[[], np.ndarray] = lambda: np.zeros(6)
    mode: int = 7
    """RUNNING."""
    version: int = 2
    unknown: tuple[str, ...] = ()
    """Outputs that this controller does not have."""
    period_s: float = 0.01
    clock: Callable[[], float] = time.monotonic
    """Seconds since the controller started."""
    cut: int = 0
    """Bytes that a piece has on the wire; 0 for whole packages."""
    stop: Event = field(default_factory=Event)
    """Ends the connection."""
    pause: Event = field(default_factory=Event)
    """Nothing is sent any more, as if a cable were pulled."""

    def __call__(self, connection: socket.socket) -> None:
        def send(kind: bytes, payload: bytes) -> None:
            package = struct.pack("!Hc", 3 + len(payload), kind) + payload
            for k in range(0, len(package), self.cut or len(package)):
                connection.sendall(package[k : k + (self.cut or len(package))])

        send(b"M", bytes([5]) + b"hello" + bytes([4]) + b"test" + bytes([3]))  # a text for a log
        stream = connection.makefile("rb")
        names: list[str] = []
        while True:
            size, kind = struct.unpack("!Hc", stream.read(3))
            payload = stream.read(size - 3)
            if kind == b"V":
                send(b"V", bytes([int(struct.unpack("!H", payload)[0] <= self.version)]))
            elif kind == b"O":
                assert 1.0 <= struct.unpack("!d", payload[:8])[0] <= 125.0
                names = payload[8:].decode().split(",")
                known = [RTDE_TYPES[name][0] if name not in self.unknown else "NOT_FOUND" for name in names]
                send(b"O", bytes([4]) + ",".join(known).encode())
            elif kind == b"S":
                send(b"S", b"\x01")
                break
        while not self.stop.wait(self.period_s):
            if self.pause.is_set():
                continue
            values = {
                "timestamp": (self.clock(),),
                "actual_q": self.joints(),
                "target_qd": self.speeds(),
                "robot_mode": (self.mode,),
            }
            send(b"U", bytes([4]) + b"".join(struct.pack(f"!{RTDE_TYPES[name][1]}", *values[name]) for name in names))


@contextmanager
def rosbridge(messages: Callable[[str], Iterator[Any]]) -> Iterator[str]:
    """The address of a rosbridge (protocol 2.0): `messages` of a topic are published to whoever subscribes to it.

    What is a string is sent as it is, a dictionary with ``op`` too, everything else is published.
    """
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.server import ServerConnection, serve

    def handle(connection: ServerConnection) -> None:
        with suppress(ConnectionClosed):
            asked = json.loads(connection.recv(PATIENCE_S))
            assert asked["op"] == "subscribe"
            for message in messages(asked["topic"]):
                whole = (
                    message
                    if isinstance(message, str)
                    else json.dumps(
                        message if "op" in message else {"op": "publish", "topic": asked["topic"], "msg": message}
                    )
                )
                connection.send(whole)

    with serve(handle, LOOPBACK, 0) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield f"{LOOPBACK}:{server.socket.getsockname()[1]}"
        finally:
            server.shutdown()


def joint_state(names: list[str], q: Any, stamp_s: float, ros: int = 2) -> dict[str, Any]:
    """`sensor_msgs/JointState` as a bridge of ROS 1 or 2 writes it."""
    return {
        "header": header(stamp_s, "", ros),
        "name": names,
        "position": list(map(float, q)),
        "velocity": [],
        "effort": [],
    }


def point_stamped(point: Any, stamp_s: float, frame: str = "tracker", ros: int = 2) -> dict[str, Any]:
    """`geometry_msgs/PointStamped`; JSON has no NaN, for which the bridge writes null."""
    xyz = {axis: float(value) if np.isfinite(value) else None for axis, value in zip("xyz", point, strict=True)}
    return {"header": header(stamp_s, frame, ros), "point": xyz}


def header(stamp_s: float, frame: str, ros: int) -> dict[str, Any]:
    seconds, rest = divmod(round(stamp_s * 1e9), 10**9)
    stamp = {"secs": seconds, "nsecs": rest} if ros == 1 else {"sec": seconds, "nanosec": rest}
    return {"stamp": stamp, "frame_id": frame} | ({"seq": 1} if ros == 1 else {})


UNITS = {"deg": (17476, "°"), "rad": (4405297, "rad"), "mm": (5066068, "mm"), "inch": (4804168, "in")}
"""UNECE codes of degree, radian, millimetre and inch as numbers, and how they are shown (OPC 10000-8)."""


class OpcUaPeer:
    """An OPC UA server with the nodes of OPC 40010-1 that hold the positions of a motion device's axes."""

    def __init__(self, devices: dict[str, dict[str, str]]):
        """Devices, each with the units of its axes by their names; an empty one for an axis that states none."""
        from asyncua import ua
        from asyncua.sync import Server

        self.server = Server()
        self.server.set_endpoint(f"opc.tcp://{LOOPBACK}:0")
        self.server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
        di = self.server.register_namespace("http://opcfoundation.org/UA/DI/")
        rob = self.server.register_namespace("http://opcfoundation.org/UA/Robotics/")
        own = self.server.register_namespace("http://example.org/robots/")
        systems = self.server.nodes.objects.add_object(ua.NodeId(5001, di), f"{di}:DeviceSet")
        system = systems.add_object(own, "System")
        motion = system.add_object(rob, "MotionDevices")
        self.positions: dict[tuple[str, str], Any] = {}
        for device, axes in devices.items():
            within = motion.add_object(own, device).add_object(rob, "Axes")
            for axis, unit in axes.items():
                parameters = within.add_object(own, axis).add_object(di, "ParameterSet")
                position = parameters.add_variable(rob, "ActualPosition", 0.0)
                if unit:
                    number, shown = UNITS[unit]
                    stated = ua.EUInformation(
                        NamespaceUri="http://www.opcfoundation.org/UA/units/un/cefact",
                        UnitId=number,
                        DisplayName=ua.LocalizedText(shown),
                    )
                    position.add_property(0, "EngineeringUnits", stated)
                self.positions[device, axis] = position
        self.server.start()

    @property
    def address(self) -> str:
        sockets = self.server.aio_obj.bserver._server.sockets
        return f"{LOOPBACK}:{sockets[0].getsockname()[1]}"

    def stop(self) -> None:
        self.server.stop()

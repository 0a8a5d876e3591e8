"""Joints and points from ROS 1 and 2 through a rosbridge: JSON on a websocket (rosbridge protocol 2.0).

The bridge runs beside ROS (``ros2 launch rosbridge_server rosbridge_websocket_launch.xml``). Taskcal subscribes to one topic, and
publishes nothing. Messages are in metres and radians (ROS REP 103).
"""

import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from time import monotonic
from typing import Any, TypeVar

import numpy as np

from taskcal.errors import shown
from taskcal.live.devices import Controller, Device, DeviceError, Instrument, JointReading, Shot
from taskcal.robot.robot import Robot
from taskcal_devices.network import Address, DeviceClock, Feed, match_joints, missing_package

PORT = 9090

EXTRA = "taskcal[live]"

MAX_MESSAGE_BYTES = 1 << 20
"""Of a message; one of the joints of 50 robots has 10 kB."""

MAX_PUBLISHERS, MAX_NAMES = 50, 1000
"""Sets of joints on a topic, and joints of each: as many robots, grippers and tracks as no cell has. Each is remembered."""

CLOSING_S = 1.0
"""To say goodbye, seconds."""

HINT = "see that rosbridge_server runs there, and its port"

Item = TypeVar("Item")


class RosJoints(Controller):
    """A robot whose driver publishes `sensor_msgs/JointState`."""

    name = "ros"
    reached = "HOST[:9090][/TOPIC][?joints=NAME,…]"
    extra = EXTRA

    def __init__(self, address: Address, robot: Robot, timeout_s: float):
        self._address, self._robot, self._clock = address, robot, DeviceClock(address.called)
        self._orders: dict[tuple[str, ...], tuple[int, ...] | None] = {}
        """By the names in a message, where the robot's joints are; None where they are not, as in a gripper's messages."""
        self._unmatched: DeviceError | None = None
        self._feed = _subscribe(address, "joint_states", timeout_s, self._reading)

    @classmethod
    def open(cls, address: str | None, robot: Robot, timeout_s: float) -> "RosJoints":
        """Connect, and subscribe to the topic, ``/joint_states`` if none is named.

        Raises:
            DeviceError: nothing answers there.
        """
        return cls(Address.parse(address, cls, PORT, ("ws", "wss"), ("joints",)), robot, timeout_s)

    def _reading(self, message: dict[str, Any], arrived_s: float) -> JointReading | None:
        names, q = tuple(map(str, message["name"])), np.array(message["position"], dtype=float)
        if q.shape != (len(names),):
            raise ValueError(f"{len(names)} names and {q.size} positions")
        if names not in self._orders:
            if len(self._orders) >= MAX_PUBLISHERS or len(names) > MAX_NAMES:
                raise ValueError(f"more than {MAX_PUBLISHERS} sets of joints, or {MAX_NAMES} joints in one")
            try:
                self._orders[names] = match_joints(self._robot, names, self._address)
            except DeviceError as error:
                self._orders[names], self._unmatched = None, error
        order, stamp_s = self._orders[names], _stamp(message)
        if order is None or not self._clock.advanced(stamp_s):
            return None
        return JointReading(time_s=self._clock.local(stamp_s, arrived_s), joints=q[list(order)])

    def read(self, timeout_s: float) -> JointReading:
        """The newest joints.

        Raises:
            DeviceError: none of this robot arrived in time, or the connection was lost.
        """
        reading = self._feed.newest(timeout_s)
        if reading is None:
            raise self._unmatched or self._address.silent("new joint states", timeout_s)
        return reading

    def close(self) -> None:
        """End the connection."""
        self._feed.close()


class RosPoints(Instrument):
    """An instrument whose driver publishes `geometry_msgs/PointStamped`."""

    name = "ros"
    reached = "HOST[:9090]/TOPIC"
    extra = EXTRA

    def __init__(self, address: Address, timeout_s: float):
        self._address, self._clock, self._frame = address, DeviceClock(address.called), None
        self._feed = _subscribe(address, "", timeout_s, self._shot)

    @classmethod
    def open(cls, address: str | None, timeout_s: float, columns: str = "") -> "RosPoints":
        """Connect, and subscribe to the topic.

        Raises:
            DeviceError: nothing answers there, no topic is named, or columns are.
        """
        where = Address.parse(address, cls, PORT, ("ws", "wss"))
        if columns:
            raise DeviceError(f"{where.called} sends no lines, so it has no columns; its points are in metres")
        if not where.path:
            raise DeviceError(f"{where.called} needs a topic of geometry_msgs/PointStamped: {cls.reached}")
        return cls(where, timeout_s)

    def _shot(self, message: dict[str, Any], arrived_s: float) -> Shot | None:
        frame, at = str(message["header"]["frame_id"]), message["point"]
        self._frame = frame if self._frame is None else self._frame
        if frame != self._frame:
            raise ValueError(f"points in the frame '{frame}' after those in '{self._frame}'")
        stamp_s = _stamp(message)
        if not self._clock.advanced(stamp_s):
            return None
        # JSON has no NaN, for which rosbridge sends null
        point = np.array([np.nan if at[axis] is None else at[axis] for axis in "xyz"], dtype=float)
        seen = bool(np.isfinite(point).all())
        return Shot(
            time_s=self._clock.local(stamp_s, arrived_s),
            point=point if seen else np.full(3, np.nan),
            reason="" if seen else "no point",
        )

    def read(self, timeout_s: float) -> Shot | None:
        """The next point.

        Raises:
            DeviceError: the connection was lost, or the frame of the points changes.
        """
        return self._feed.next(timeout_s)

    def close(self) -> None:
        """End the connection."""
        self._feed.close()


def _subscribe(
    where: Address, usual_topic: str, timeout_s: float, read: Callable[[dict[str, Any], float], Item | None]
) -> Feed[Item]:
    """What the messages of the address's topic mean.

    Args:
        where: of the bridge and the topic.
        usual_topic: where the address names none.
        timeout_s: for the connection.
        read: item of a message that arrived then; None for one that says nothing new. KeyError, TypeError and ValueError are of a
            message that is of another type.
    """
    connect, closed = _websockets(where.device)
    topic = "/" + ("/".join(where.path) or usual_topic)
    opened = ExitStack()
    try:
        connection = opened.enter_context(
            connect(
                f"{where.scheme}://{where}",
                open_timeout=timeout_s,
                close_timeout=CLOSING_S,
                max_size=MAX_MESSAGE_BYTES,
                proxy=None,
            )
        )
        connection.send(json.dumps({"op": "subscribe", "topic": topic}))
    except (OSError, closed) as error:
        raise where.unreachable(error, HINT) from error

    def items() -> Iterator[Item]:
        while True:
            try:
                text, arrived_s = connection.recv(), monotonic()
            except (OSError, closed) as error:
                raise where.lost(error) from error
            try:
                message = json.loads(text)
                if message["op"] == "status" and message.get("level") == "error":
                    raise where.misunderstood(f"refuses {topic}: {shown(str(message.get('msg')))}")
                mine = message["op"] == "publish" and message["topic"] == topic
                item = read(message["msg"], arrived_s) if mine else None
            except (KeyError, TypeError, ValueError) as error:
                raise where.misunderstood(
                    f"sends on {topic} what is not understood ({error!r}): {shown(str(text))}"
                ) from error
            if item is not None:
                yield item

    return Feed(items(), opened.close)


def _stamp(message: dict[str, Any]) -> float:
    """Of a message's header, seconds; NaN where it is not set. ROS 1 has `secs` and `nsecs`, ROS 2 `sec` and `nanosec`."""
    stamp = message["header"]["stamp"]
    seconds = float(stamp.get("sec", stamp.get("secs"))) + 1e-9 * float(stamp.get("nanosec", stamp.get("nsecs")))
    return seconds or float("nan")


def _websockets(device: type[Device]) -> tuple[Any, type[Exception]]:
    """The client of the package websockets, and what it raises."""
    try:
        from websockets.exceptions import WebSocketException
        from websockets.sync.client import connect
    except ModuleNotFoundError:
        raise missing_package(device, "websockets") from None
    return connect, WebSocketException

"""Joints of any maker's controller by OPC UA for Robotics (OPC 40010-1): the actual positions of a motion device's axes.

The server states the unit of each axis (OPC 10000-8, 5.6.3: `EngineeringUnits`); an axis without one is refused. Only read.
"""

import logging
from contextlib import suppress
from time import monotonic
from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.errors import shown
from taskcal.live.devices import Controller, DeviceError, JointReading
from taskcal.robot.robot import Robot
from taskcal_devices.network import Address, answered, match_joints, missing_package

PORT = 4840

ROBOTICS = "http://opcfoundation.org/UA/Robotics/"

DEVICES = "http://opcfoundation.org/UA/DI/"

CLOSING_S = 2.0
"""To say goodbye, seconds."""

UNECE = "http://www.opcfoundation.org/UA/units/un/cefact"

UNITS: dict[int, tuple[str, float]] = {
    17476: ("angle", np.pi / 180),  # DD, degree
    4405297: ("angle", 1.0),  # C81, radian
    5067858: ("length", 1.0),  # MTR, metre
    4410708: ("length", 0.01),  # CMT, centimetre
    5066068: ("length", 0.001),  # MMT, millimetre
}
"""Quantity and factor to radians or metres, by UNECE code as a number (OPC 10000-8: each letter's ASCII code is a byte)."""

FINDING = 10.0
"""Limits of single calls that finding the axes may take, which is some fifty calls that a server answers at once."""

MAX_DEPTH = 4
"""Of motion devices below Objects: in DeviceSet, in Machines (OPC 40010-1, 6), or in a folder of the maker's."""


class OpcUa(Controller):
    """A controller with an OPC UA server that has the companion specification for robots; without a login."""

    name = "opcua"
    reached = "[opc.tcp://]HOST[:4840][/PATH][?device=NAME][&joints=NAME,…]"
    extra = "taskcal[live]"

    def __init__(self, address: Address, client: Any, axes: list[Any], factors: Float[np.ndarray, " joints"]):
        self._address, self._client, self._axes, self._factors = address, client, axes, factors
        self._closed = False

    @classmethod
    def open(cls, address: str | None, robot: Robot, timeout_s: float) -> "OpcUa":
        """Connect, and find the robot's axes and their units.

        Raises:
            DeviceError: nothing answers there, or it has no motion device whose axes are the robot's.
        """
        where = Address.parse(address, cls, PORT, ("opc.tcp",), ("device", "joints"))
        try:
            from asyncua.sync import Client, ThreadLoop
        except ModuleNotFoundError:
            raise missing_package(cls, "asyncua") from None
        logging.getLogger("asyncua").addHandler(logging.NullHandler())  # what it logs is raised as well
        loop = ThreadLoop(timeout_s)
        loop.daemon = True
        loop.start()
        try:
            client = Client(f"opc.tcp://{where}/{'/'.join(where.path)}", timeout_s, loop)
            client.connect()
        except Exception as error:  # asyncua raises errors of many kinds, none of which says more than that
            loop.stop()
            raise where.unreachable(
                error, "see that its OPC UA server is on and lets in clients without a login"
            ) from error
        try:
            late = where.silent("description of its axes", FINDING * timeout_s)
            axes, factors = answered(lambda: _find_axes(client, where, robot), FINDING * timeout_s, late, lambda: None)
        except DeviceError:
            _disconnect(client)
            raise
        except Exception as error:
            _disconnect(client)
            raise where.lost(error) from error
        return cls(where, client, axes, factors)

    def read(self, timeout_s: float) -> JointReading:
        """The joints now: all axes in one call.

        Raises:
            DeviceError: no answer in time, a position that the server itself does not call good, or the connection was lost.
        """
        self._client.tloop.timeout = timeout_s
        try:
            values = self._client.read_attributes(self._axes)
        except Exception as error:
            raise self._address.lost(error) from error
        if bad := [value.StatusCode for value in values if value.Value is None or not value.StatusCode.is_good()]:
            raise DeviceError(
                f"{self._address.called} has no good position of an axis ({bad[0].name}); see the controller's messages"
            )
        joints = np.array([value.Value.Value for value in values], dtype=float) * self._factors
        return JointReading(time_s=monotonic(), joints=joints)

    def close(self) -> None:
        """End the connection."""
        if not self._closed:
            self._closed = True
            _disconnect(self._client)


def _disconnect(client: Any) -> None:
    client.tloop.timeout = CLOSING_S
    with suppress(Exception):  # it may be gone already
        client.disconnect()
    client.tloop.stop()


def _find_axes(client: Any, where: Address, robot: Robot) -> tuple[list[Any], Float[np.ndarray, " joints"]]:
    """Variables of the robot's joints, and factors from their units to radians and metres."""
    uris = client.get_namespace_array()
    if ROBOTICS not in uris or DEVICES not in uris:
        raise DeviceError(
            f"{where.called} does not have OPC UA for Robotics (OPC 40010); see whether the maker offers it as an option"
        )
    robotics, devices = uris.index(ROBOTICS), uris.index(DEVICES)
    found = _motion_devices(client, robotics)
    wanted = where.options.get("device")
    if wanted not in found and (wanted is not None or len(found) != 1):
        names = shown(", ".join(found)) or "none"
        raise DeviceError(f"{where.called} has these motion devices: {names}; name one of them: '…?device=NAME'")
    device = found[wanted] if wanted is not None else next(iter(found.values()))
    axes = {at.BrowseName.Name: client.get_node(at.NodeId) for at in _children(device.get_child(f"{robotics}:Axes"))}
    names = list(axes)
    order = match_joints(robot, names, where)
    variables = [axes[names[i]].get_child([f"{devices}:ParameterSet", f"{robotics}:ActualPosition"]) for i in order]
    factors = [
        _factor(variable, names[i], slides, where)
        for variable, i, slides in zip(variables, order, robot.prismatic, strict=True)
    ]
    return variables, np.array(factors)


def _motion_devices(client: Any, robotics: int) -> dict[str, Any]:
    """The motion devices of all systems, by name, breadth first."""
    found: dict[str, Any] = {}
    level = [client.nodes.objects]
    for _ in range(MAX_DEPTH):
        below = [at for node in level for at in _children(node) if at.NodeId.NamespaceIndex]  # not of the server itself
        for at in below:
            if (at.BrowseName.NamespaceIndex, at.BrowseName.Name) == (robotics, "MotionDevices"):
                found |= {
                    of.BrowseName.Name: client.get_node(of.NodeId) for of in _children(client.get_node(at.NodeId))
                }
        if found:
            break
        level = [client.get_node(at.NodeId) for at in below]
    return found


def _children(node: Any) -> list[Any]:
    """Descriptions of the objects below a node."""
    return [at for at in node.get_children_descriptions() if at.NodeClass.name == "Object"]


def _factor(variable: Any, axis: str, slides: bool, where: Address) -> float:
    """From an axis' stated unit to radians or metres."""
    from asyncua.ua.uaerrors import UaError

    try:
        unit = variable.get_child("0:EngineeringUnits").read_value()
    except UaError as error:
        raise DeviceError(
            f"{where.called} does not state the unit of '{shown(axis)}'; it cannot be taken for degrees"
        ) from error
    quantity, factor = UNITS.get(unit.UnitId, ("", 1.0)) if unit.NamespaceUri == UNECE else ("", 1.0)
    if quantity != ("length" if slides else "angle"):
        stated = shown(unit.DisplayName.Text or unit.UnitId)
        needed = "a sliding joint in m, cm or mm" if slides else "a turning joint in degrees or radians"
        raise DeviceError(
            f"{where.called} states '{shown(axis)}' in '{stated}', and the robot has {needed}; see '…?joints='"
        )
    return factor

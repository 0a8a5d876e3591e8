"""Points over TCP: lines of numbers that an instrument's software sends, and those of SpatialAnalyzer, which measures on demand."""

import re
from socket import socket
from time import monotonic

import numpy as np

from taskcal.errors import shown
from taskcal.live.devices import DeviceError, Instrument, Shot
from taskcal.live.lines import Lines, PointColumns, columns_of, shot_at
from taskcal.observations.instrument import Instrument as CellInstrument
from taskcal_devices.network import Address, Feed, hang_up, received, received_lines


class TcpLines(Instrument):
    """Software that sends a line for each measurement to whoever connects."""

    name = "tcp"
    reached = "HOST:PORT"

    def __init__(self, feed: Feed[Shot]):
        self._feed = feed

    @classmethod
    def open(cls, address: str | None, timeout_s: float, columns: str = "") -> "TcpLines":
        """Connect.

        Raises:
            DeviceError: nothing answers there.
            TaskcalError: columns that name no point with its unit.
        """
        where = Address.parse(address, cls)
        lines = Lines(columns_of(columns) if columns else None, where.called)
        connection = where.connect(timeout_s)
        connection.settimeout(None)  # its thread waits; who asks for a shot has a limit
        arriving = received_lines(received(connection, where), where)
        shots = (shot for arrived_s, line in arriving if (shot := lines.shot(line, arrived_s)))
        return cls(Feed(shots, lambda: hang_up(connection)))

    def observes(self, observed: CellInstrument) -> None:
        """Lines of any kind, but no images."""
        if observed.looked_for is not None:
            super().observes(observed)

    def read(self, timeout_s: float) -> Shot | None:
        """The next line's point.

        Raises:
            DeviceError: the connection was lost, or a line is not what was stated.
        """
        return self._feed.next(timeout_s)

    def close(self) -> None:
        """End the connection."""
        self._feed.close()


REPLY = re.compile(r"(ACK|ERR)-(\d{3})\s*(.*)")

MEASURED = re.compile(r"Single Point Measurement .* result ([^,\s]+),([^,\s]+),([^,\s]+)(?:\s|$)")

UNSEEN = {"201", "305", "338", "340"}
"""Codes of what may succeed when tried again: busy, point not measured, instrument not ready, group not measured."""


class T2sa(Instrument):
    """SpatialAnalyzer behind T2SA, which measures the point of a name when it is asked to.

    Commands and replies are lines, as github.com/lsst-ts/ts_lasertracker has them, which measures by them. They state no unit:
    it is that of the SpatialAnalyzer job, and named by `columns`.
    """

    name = "t2sa"
    reached = "HOST:PORT/COLLECTION/GROUP/TARGET"
    on_request = True

    def __init__(self, address: Address, columns: PointColumns, connection: socket):
        self._address, self._columns, self._connection = address, columns, connection
        self._asked_s: float | None = None
        """When the measurement was asked for of which the reply has not come."""
        self._feed = Feed(received_lines(received(connection, address), address), lambda: hang_up(connection))

    @classmethod
    def open(cls, address: str | None, timeout_s: float, columns: str = "") -> "T2sa":
        """Connect.

        Raises:
            DeviceError: nothing answers there, no point is named, or no unit is stated.
            TaskcalError: columns that name no point with its unit.
        """
        where = Address.parse(address, cls)
        if len(where.path) != 3:
            raise DeviceError(f"{where.called} needs the name of the point to measure: {cls.reached}")
        if not columns or len((stated := PointColumns.of(columns)).names) != 3:
            raise DeviceError(f"{where.called} does not send the unit of its job; state it: --columns x_mm,y_mm,z_mm")
        connection = where.connect(timeout_s)
        connection.settimeout(None)
        return cls(where, stated, connection)

    def read(self, timeout_s: float) -> Shot | None:
        """Ask for a measurement, unless one is under way, and wait for it; its time is when it was asked for.

        Raises:
            DeviceError: the connection was lost, or the command is refused.
        """
        if self._asked_s is None:
            self._asked_s = monotonic()
            try:
                self._connection.sendall(f"!MEAS_SINGLE_POINT:{';'.join(self._address.path)}\r\n".encode())
            except OSError as error:
                raise self._address.lost(error) from error
        until = monotonic() + timeout_s
        while (arrived := self._feed.next(max(until - monotonic(), 0.0))) is not None:
            if not (reply := REPLY.match(arrived[1])):
                raise self._address.misunderstood(f"replies '{shown(arrived[1])}'")
            kind, code, text = reply.groups()
            measured = MEASURED.match(text)
            if kind == "ACK" and measured is None:  # of another command, as HALT
                if monotonic() < until:
                    continue
                return None
            asked_s, self._asked_s = self._asked_s, None
            if measured:
                return shot_at(self._columns.point(" ".join(measured.groups())), asked_s)
            if code in UNSEEN:
                return Shot(time_s=asked_s, point=np.full(3, np.nan), reason=shown(text) or f"error {code}")
            raise DeviceError(
                f"{self._address.called} refuses to measure {'::'.join(self._address.path)}: {code} {shown(text)}"
            )
        return None

    def close(self) -> None:
        """End the connection."""
        self._feed.close()

"""Instruments read over a network, behind counterparts that speak their protocols, and misbehave."""

import re
import time
from threading import Event

import numpy as np
import pytest

from taskcal.errors import TaskcalError
from taskcal.live.devices import DeviceError
from taskcal_devices.network import Address, received_lines
from taskcal_devices.ros import RosPoints
from taskcal_devices.tcp import T2sa, TcpLines
from tests.taskcal_devices.peers import PATIENCE_S, point_stamped, rosbridge, serving

POINTS = np.array([[1.5, -2.5, 3.5], [10.0, 20.0, 30.0], [4.0, 5.0, 6.0]])
"""Millimetres."""


def sending(*pieces, hold=True):
    """A server that sends pieces, and numbers wait that many seconds between them."""

    def serve(connection):
        for piece in pieces:
            if isinstance(piece, float):
                time.sleep(piece)
            else:
                connection.sendall(piece)
        if hold:
            connection.recv(1)  # until the other end hangs up

    return serve


class TestTcp:
    def test_each_whole_line_is_a_shot_however_it_is_cut(self):
        server = sending(
            b"# tracker 1\r\nx_mm, y_mm, z_mm\r\n1.5,-2", 0.02, b".5,3.5\r", b"\n10,20,30\r\n,,\r\n4,5,6\r\n7,8,"
        )
        with serving(server) as at, TcpLines.open(at, PATIENCE_S) as instrument:
            shots = [instrument.read(PATIENCE_S) for _ in range(4)]
            assert instrument.read(0.05) is None  # half a line waits
        assert [shot.reason for shot in shots] == ["", "", "beam lost", ""]
        assert np.allclose([shot.point for shot in shots if shot.valid], POINTS / 1e3)

    def test_a_line_counts_from_the_arrival_of_its_first_byte(self):
        cuts = []

        def pieces():
            for piece in (b"1.5 -2", b".5 3.5\n10 2", b"0 30\n"):
                yield piece
                cuts.append(time.monotonic())

        lines = list(received_lines(pieces(), Address.parse("127.0.0.1:1", TcpLines)))
        assert [line for _, line in lines] == ["1.5 -2.5 3.5", "10 20 30"]
        assert lines[0][0] <= cuts[0] <= lines[1][0] <= cuts[1]

    @pytest.mark.parametrize(
        ("sent", "columns", "reason"),
        [
            (b"1 2 3\n", "", "x_mm y_mm z_mm"),
            (b"x,y,z\n1,2,3\n", "", "no unit"),
            (b"1 2 3 4\n", "x_mm y_mm z_mm", "4 fields"),
            (b"1 2 E3x\n", "x_mm y_mm z_mm", "not a number"),
            (bytes(range(128, 256)) * 40, "x_mm y_mm z_mm", "without an end of line"),
        ],
    )
    def test_refuses_lines_without_a_unit_and_garbage(self, sent, columns, reason):
        with serving(sending(sent)) as at, TcpLines.open(at, PATIENCE_S, columns) as instrument:
            refused = pytest.raises(TaskcalError, match=rf"'tcp' at {at}.*{reason}")
            with refused:
                instrument.read(PATIENCE_S)

    def test_what_arrived_is_given_before_a_drop_is_named(self):
        server = sending(b"1.5 -2.5 3.5\n10 20 30\n4 5 ", hold=False)
        with serving(server) as at, TcpLines.open(at, PATIENCE_S, "x_mm y_mm z_mm") as instrument:
            assert np.allclose([instrument.read(PATIENCE_S).point for _ in range(2)], POINTS[:2] / 1e3)
            for _ in range(2):
                with pytest.raises(DeviceError, match=f"'tcp' at {at} was lost"):
                    instrument.read(PATIENCE_S)

    def test_refuses_to_open_without_a_port_or_a_host(self):
        with pytest.raises(DeviceError, match="needs an address: HOST:PORT"):
            TcpLines.open(None, 1.0)
        with pytest.raises(DeviceError, match="has no port"):
            TcpLines.open("tracker", 1.0)


class TestRos:
    @pytest.mark.parametrize("ros", [1, 2])
    def test_points_in_metres_and_lost_beams(self, ros):
        def messages(topic):
            assert topic == "/leica/point"
            yield point_stamped(POINTS[0] / 1e3, 5.0, ros=ros)
            yield point_stamped(POINTS[0] / 1e3, 5.0, ros=ros)  # sent again, measured once
            yield point_stamped([np.nan] * 3, 5.1, ros=ros)
            yield point_stamped(POINTS[1] / 1e3, 5.2, ros=ros)
            time.sleep(0.1)

        with rosbridge(messages) as at, RosPoints.open(f"ws://{at}/leica/point", PATIENCE_S) as instrument:
            shots = [instrument.read(PATIENCE_S) for _ in range(3)]
        assert [shot.valid for shot in shots] == [True, False, True]
        assert np.array_equal([shot.point for shot in shots if shot.valid], POINTS[:2] / 1e3)

    def test_a_late_message_has_the_time_of_its_measurement(self):
        stamps, delays_s = [], [0.0, 0.0, 0.0, 0.2]

        def messages(topic):
            for delay_s in delays_s:
                stamps.append(1e9 + time.monotonic())
                time.sleep(delay_s)
                yield point_stamped(POINTS[0], stamps[-1])

        with rosbridge(messages) as at, RosPoints.open(f"{at}/p", PATIENCE_S) as instrument:
            times = [instrument.read(PATIENCE_S).time_s for _ in delays_s]
        assert times[3] - times[2] <= stamps[3] - stamps[2] + 1e-6  # not later by its delay

    def test_refuses_another_frame_columns_and_no_topic(self):
        def messages(topic):
            yield point_stamped(POINTS[0], 1.0)
            yield point_stamped(POINTS[0], 2.0, frame="map")
            time.sleep(0.1)

        with rosbridge(messages) as at, RosPoints.open(f"{at}/p", PATIENCE_S) as instrument:
            instrument.read(PATIENCE_S)
            with pytest.raises(DeviceError, match="frame 'map' after those in 'tracker'"):
                instrument.read(PATIENCE_S)
        with pytest.raises(DeviceError, match="no columns"):
            RosPoints.open("127.0.0.1/p", 1.0, "x_mm y_mm z_mm")
        with pytest.raises(DeviceError, match="needs a topic"):
            RosPoints.open("127.0.0.1", 1.0)


class SpatialAnalyzer:
    """T2SA as github.com/lsst-ts/ts_lasertracker states its commands and replies: lines that end in CR LF."""

    def __init__(self, replies):
        self.replies, self.asked, self.measured = iter(replies), [], Event()
        self.measured.set()

    def __call__(self, connection):
        for line in connection.makefile("rb"):
            command = line.decode()
            assert command.endswith("\r\n")
            self.asked.append(command.strip())
            name = re.fullmatch(r"!MEAS_SINGLE_POINT:[^;]*;[^;]*;([^;]*)", command.strip())[1]
            assert self.measured.wait(PATIENCE_S)
            reply = next(self.replies)
            if not isinstance(reply, str):
                x, y, z = reply
                reply = f"ACK-300 Single Point Measurement {name} result {x:.6f},{y:.6f},{z:.6f} 11/27/26 10:02:01 True"
            connection.sendall(f"{reply}\r\n".encode())


class TestT2sa:
    def test_measures_when_asked_and_tells_a_failed_measurement(self):
        peer = SpatialAnalyzer([POINTS[0], "ERR-305 Measurement of point failed", POINTS[1]])
        with serving(peer) as at, T2sa.open(f"{at}/A/Robot/Tool 1", PATIENCE_S, "x_mm,y_mm,z_mm") as instrument:
            assert not peer.asked
            before = time.monotonic()
            first, failed, last = (instrument.read(PATIENCE_S) for _ in range(3))
        assert peer.asked == ["!MEAS_SINGLE_POINT:A;Robot;Tool 1"] * 3
        assert np.allclose([first.point, last.point], POINTS[:2] / 1e3)
        assert not failed.valid
        assert "point failed" in failed.reason
        assert before <= first.time_s <= failed.time_s <= last.time_s

    def test_a_measurement_that_takes_long_is_asked_for_once(self):
        peer = SpatialAnalyzer([POINTS[0]])
        peer.measured.clear()
        with serving(peer) as at, T2sa.open(f"{at}/A/Robot/Tool", PATIENCE_S, "x_m,y_m,z_m") as instrument:
            assert instrument.read(0.02) is None
            moved = time.monotonic()
            peer.measured.set()
            shot = instrument.read(PATIENCE_S)
        assert np.allclose(shot.point, POINTS[0])
        assert len(peer.asked) == 1
        assert shot.time_s < moved  # it was asked for before, so that it does not count

    @pytest.mark.parametrize(
        ("reply", "reason"), [("ERR-346 Object not found", "346 Object not found"), ("Hello", "replies 'Hello'")]
    )
    def test_refusals_of_the_other_end_are_errors(self, reply, reason):
        with (
            serving(SpatialAnalyzer([reply])) as at,
            T2sa.open(f"{at}/A/B/C", PATIENCE_S, "x_mm,y_mm,z_mm") as instrument,
        ):
            refused = pytest.raises(DeviceError, match=reason)
            with refused:
                instrument.read(PATIENCE_S)

    def test_replies_to_other_commands_without_end_are_left_in_time(self):
        def flood(connection):
            while True:
                connection.sendall(100 * b"ACK-000 halted\r\n")
                time.sleep(0.001)

        with serving(flood) as at, T2sa.open(f"{at}/A/B/C", PATIENCE_S, "x_mm,y_mm,z_mm") as instrument:
            begun = time.monotonic()
            assert instrument.read(0.2) is None
            assert time.monotonic() - begun < 5.0

    def test_refuses_to_guess_the_point_and_the_unit(self):
        with pytest.raises(DeviceError, match="COLLECTION/GROUP/TARGET"):
            T2sa.open("127.0.0.1:50000/A", 1.0, "x_mm,y_mm,z_mm")
        with pytest.raises(DeviceError, match="--columns x_mm,y_mm,z_mm"):
            T2sa.open("127.0.0.1:50000/A/B/C", 1.0)

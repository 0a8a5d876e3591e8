"""Controllers read over a network, behind counterparts that speak their protocols."""

import sys
import time
from itertools import count

import numpy as np
import pytest

from taskcal import load_robot
from taskcal.live.devices import DeviceError, JointReading
from taskcal_devices.abb import Rws
from taskcal_devices.network import Address, DeviceClock
from taskcal_devices.opcua import OpcUa
from taskcal_devices.ros import RosJoints
from taskcal_devices.rtde import Rtde
from tests.taskcal_devices.peers import PATIENCE_S, OpcUaPeer, RtdePeer, joint_state, relayed, rosbridge, serving

UR5 = load_robot("ur5")
Q = np.array([0.1, -1.2, 0.3, -1.4, 0.5, 0.6])
NAMES = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"]


def read_on(controller, timeout_s):
    for _ in range(10_000):
        controller.read(timeout_s)


class TestRtde:
    @pytest.mark.parametrize("cut", [0, 1, 7])
    def test_joints_however_packages_are_cut(self, cut):
        with serving(RtdePeer(joints=lambda: Q, cut=cut)) as at, Rtde.open(at, UR5, PATIENCE_S) as controller:
            before = time.monotonic()
            reading = controller.read(PATIENCE_S)
            assert np.array_equal(reading.joints, Q)
            assert reading.moving is False
            assert before - 1.0 < reading.time_s <= time.monotonic()

    def test_moves_while_the_controller_commands_a_speed(self):
        with serving(RtdePeer(speeds=lambda: 1e-3 * Q)) as at, Rtde.open(at, UR5, PATIENCE_S) as controller:
            assert controller.read(PATIENCE_S).moving is True

    def test_each_reading_is_newer_than_the_last(self):
        counter = count()
        peer = RtdePeer(joints=lambda: np.full(6, 1e-3 * next(counter)), period_s=0.002)
        with serving(peer) as at, Rtde.open(at, UR5, PATIENCE_S) as controller:
            first = [controller.read(PATIENCE_S) for _ in range(5)]
            time.sleep(0.1)
            after = controller.read(PATIENCE_S)
        values = [one.joints[0] for one in (*first, after)]
        times = [one.time_s for one in (*first, after)]
        assert (np.diff(values) > 0).all()
        assert (np.diff(times) > 0).all()
        assert values[-1] - values[-2] > 1.5e-3  # what arrived meanwhile is passed over

    @pytest.mark.long
    def test_a_clock_at_another_rate_is_an_error(self):
        """As of a simulated controller that is slower than real time."""
        with (
            serving(RtdePeer(clock=lambda: 0.6 * time.monotonic())) as at,
            Rtde.open(at, UR5, PATIENCE_S) as controller,
        ):
            until = time.monotonic() + PATIENCE_S

            def read_on():
                while time.monotonic() < until:
                    controller.read(PATIENCE_S)

            with pytest.raises(
                DeviceError, match=rf"'rtde' at {at}: its time stamps advance by 0\.[56]\d+ s in each second"
            ):
                read_on()

    def test_a_drop_a_pulled_cable_and_a_frozen_clock_are_errors(self):
        peer = RtdePeer()
        with serving(peer) as at, Rtde.open(at, UR5, PATIENCE_S) as controller:
            controller.read(PATIENCE_S)
            peer.pause.set()
            with pytest.raises(DeviceError, match=rf"'rtde' at {at} sent no joints for 0\.05 s"):
                read_on(controller, 0.05)
            peer.stop.set()
            with pytest.raises(DeviceError, match=rf"'rtde' at {at} was lost"):
                read_on(controller, PATIENCE_S)
        with serving(RtdePeer(clock=lambda: 5.0)) as at, Rtde.open(at, UR5, PATIENCE_S) as controller:
            controller.read(PATIENCE_S)
            with pytest.raises(DeviceError, match="sent no joints"):
                controller.read(0.1)

    @pytest.mark.parametrize(
        ("peer", "reason"),
        [
            (RtdePeer(version=1), "version 2"),
            (RtdePeer(unknown=("robot_mode",)), "NOT_FOUND"),
            (RtdePeer(mode=3), "robot that is off"),
            (lambda connection: connection.sendall(b"\0\0HTTP/1.1 400 Bad Request\r\n\r\n"), "not RTDE"),
            (lambda connection: None, "was lost"),
        ],
    )
    def test_refuses_what_it_does_not_understand(self, peer, reason):
        with (
            serving(peer) as at,
            pytest.raises(DeviceError, match=reason),
            Rtde.open(at, UR5, PATIENCE_S) as controller,
        ):
            controller.read(PATIENCE_S)

    def test_refuses_a_robot_of_other_joints(self):
        with pytest.raises(DeviceError, match="6 turning joints"):
            Rtde.open(None, load_robot("franka-panda"), 1.0)


class TestRos:
    @pytest.mark.parametrize("ros", [1, 2])
    def test_joints_by_name_whatever_their_order(self, ros):
        order = [2, 0, 4, 1, 5, 3]

        def messages(topic):
            assert topic == "/joint_states"
            for k in count(1):
                yield joint_state(["gripper"], [9.0], float(k), ros)
                yield joint_state([NAMES[i] for i in order], Q[order], float(k), ros)
                time.sleep(0.005)

        with rosbridge(messages) as at, RosJoints.open(f"{at}?joints={','.join(NAMES)}", UR5, PATIENCE_S) as controller:
            assert np.array_equal(controller.read(PATIENCE_S).joints, Q)

    def test_joints_by_the_number_that_names_end_in(self):
        def messages(topic):
            for k in count(1):
                yield joint_state([f"joint_{i}" for i in (6, 5, 4, 3, 2, 1)], Q[::-1], float(k))
                time.sleep(0.005)

        with rosbridge(messages) as at, RosJoints.open(at, UR5, PATIENCE_S) as controller:
            assert np.array_equal(controller.read(PATIENCE_S).joints, Q)

    @pytest.mark.parametrize(
        ("message", "reason"),
        [
            (joint_state(NAMES, Q, 1.0), r"shoulder_pan_joint.*joints="),
            (joint_state(["J1", "J2", "J3", "J4", "J5", "J5"], Q, 1.0), "joints="),
            ({"op": "status", "level": "error", "msg": "topic unknown"}, "topic unknown"),
            (joint_state(NAMES, Q[:5], 1.0), "6 names and 5 positions"),
            ({"data": 1}, "not understood"),
            ("half {", "not understood"),
        ],
    )
    def test_refuses_what_is_not_this_robots_joint_state(self, message, reason):
        def messages(topic):
            yield message
            time.sleep(0.8)

        with (
            rosbridge(messages) as at,
            RosJoints.open(at, UR5, PATIENCE_S) as ros,
            pytest.raises(DeviceError, match=reason),
        ):
            ros.read(0.4)

    def test_a_message_sent_again_is_not_a_new_reading(self):
        names = list(UR5.joint_names)

        def messages(topic):
            for _ in range(1000):
                yield joint_state(names, Q, 7.0)
                time.sleep(0.005)

        with rosbridge(messages) as at, RosJoints.open(at, UR5, PATIENCE_S) as controller:
            controller.read(PATIENCE_S)
            with pytest.raises(DeviceError, match="no new joint states"):
                controller.read(0.1)

    def test_names_a_bridge_that_ends(self):
        with rosbridge(lambda topic: iter(())) as at, RosJoints.open(at, UR5, PATIENCE_S) as controller:
            lost = pytest.raises(DeviceError, match=f"'ros' at {at} was lost")
            with lost:
                controller.read(PATIENCE_S)


@pytest.fixture(scope="module")
def opcua():
    peer = OpcUaPeer(
        {
            "Arm": {f"A{k}": "deg" for k in (6, 5, 4, 3, 2, 1)},
            "Mixed": {
                "one": "rad",
                "two": "rad",
                "three": "deg",
                "four": "rad",
                "five": "rad",
                "six": "deg",
                "rail": "mm",
            },
            "Silent": {f"J{k}": "" for k in range(1, 7)},
            "Imperial": {f"J{k}": "inch" for k in range(1, 7)},
        }
    )
    yield peer
    peer.stop()


class TestOpcUa:
    def test_each_axis_in_the_unit_that_the_server_states(self, opcua):
        for k, q in enumerate(Q):
            opcua.positions["Arm", f"A{k + 1}"].write_value(float(np.degrees(q)))
        with OpcUa.open(f"{opcua.address}?device=Arm", UR5, PATIENCE_S) as controller:
            assert np.allclose(controller.read(PATIENCE_S).joints, Q, rtol=0, atol=1e-12)
            opcua.positions["Arm", "A2"].write_value(90.0)
            assert controller.read(PATIENCE_S).joints[1] == np.pi / 2
        opcua.positions["Mixed", "one"].write_value(0.25)
        opcua.positions["Mixed", "three"].write_value(-90.0)
        with OpcUa.open(
            f"{opcua.address}?device=Mixed&joints=one,two,three,four,five,six", UR5, PATIENCE_S
        ) as controller:
            assert np.allclose(controller.read(PATIENCE_S).joints, [0.25, 0, -np.pi / 2, 0, 0, 0])

    @pytest.mark.parametrize(
        ("options", "reason"),
        [
            ("", "Arm, Mixed, Silent, Imperial"),
            ("?device=Leg", "Arm, Mixed, Silent, Imperial"),
            ("?device=Mixed", "joints="),
            ("?device=Mixed&joints=one,two,three,four,five,rail", "'rail' in 'mm'"),
            ("?device=Silent", "does not state the unit of 'J1'"),
            ("?device=Imperial", "in 'in'"),
        ],
    )
    def test_refuses_axes_that_are_not_surely_the_robots(self, opcua, options, reason):
        with pytest.raises(DeviceError, match=reason):
            OpcUa.open(opcua.address + options, UR5, PATIENCE_S)

    def test_a_position_that_is_not_good_and_a_cut_are_errors(self, opcua):
        from asyncua import ua

        position = opcua.positions["Arm", "A3"]
        with relayed(opcua.address) as (at, cut), OpcUa.open(f"{at}?device=Arm", UR5, PATIENCE_S) as controller:
            controller.read(PATIENCE_S)
            bad = ua.DataValue(ua.Variant(0.0, ua.VariantType.Double), ua.StatusCode(ua.StatusCodes.BadSensorFailure))
            position.write_value(bad)
            with pytest.raises(DeviceError, match="BadSensorFailure"):
                controller.read(PATIENCE_S)
            position.write_value(0.0)
            controller.read(PATIENCE_S)
            cut()
            with pytest.raises(DeviceError, match=f"'opcua' at {at} was lost"):
                controller.read(PATIENCE_S)


def _without_end(piece):
    def serve(connection):
        while True:
            connection.sendall(piece)
            time.sleep(0.01)

    return serve


HEAD = b"HTTP/1.1 200 OK\r\n"


@pytest.mark.parametrize(
    ("kind", "robot", "piece"),
    [
        (Rtde, UR5, b"\x00\x05Mab"),
        (Rtde, UR5, b"\x00\xffM"),
        (Rws, load_robot("abb-irb120"), HEAD),
        (Rws, load_robot("abb-irb120"), b"X: 1\r\n"),
    ],
)
def test_a_peer_that_never_ends_is_left_in_time(kind, robot, piece):
    """Each piece arrives in time, and the answer never does."""
    with serving(_without_end(piece)) as at:
        begun = time.monotonic()
        with pytest.raises(DeviceError, match=kind.name):
            kind.open(at, robot, 0.5)
        assert time.monotonic() - begun < 5.0


def test_a_position_that_is_none_is_refused_where_it_is_read():
    """A robot whose joints are no numbers never stands, and would be waited for."""
    peer = RtdePeer(joints=lambda: np.where(np.arange(6) == 2, np.nan, Q))
    with (
        serving(peer) as at,
        Rtde.open(at, UR5, PATIENCE_S) as controller,
        pytest.raises(DeviceError, match="joint 3 as nan"),
    ):
        controller.read(PATIENCE_S)
    for wrong in (np.nan, np.inf, -np.inf):
        with pytest.raises(DeviceError, match=f"joint 1 as {wrong}"):
            JointReading(time_s=0.0, joints=np.array([wrong, 0.0]))


def test_names_of_joints_are_remembered_of_so_many_publishers_only():
    def messages(topic):
        for k in count():
            yield joint_state([f"{name}_{k}" for name in "abcdef"], Q, 1.0 + k)

    with (
        rosbridge(messages) as at,
        RosJoints.open(at, UR5, PATIENCE_S) as controller,
        pytest.raises(DeviceError, match="more than 50 sets of joints"),
    ):
        read_on(controller, PATIENCE_S)


@pytest.mark.parametrize(("kind", "package"), [(OpcUa, "asyncua.sync"), (RosJoints, "websockets.sync.client")])
def test_a_missing_package_is_named_with_its_extra(kind, package, monkeypatch):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(DeviceError, match=r'pip install "taskcal\[live\]"'):
        kind.open(None, UR5, 1.0)


class TestAddresses:
    @pytest.mark.parametrize("kind", [Rtde, RosJoints, OpcUa])
    def test_nothing_there_is_named_soon_with_what_would_work(self, kind):
        with serving(lambda connection: None) as at:
            pass  # its port is free again
        with pytest.raises(DeviceError, match=rf"'{kind.name}' at {at} cannot be reached \(.*\); see that"):
            kind.open(at, UR5, 2.0)

    @pytest.mark.parametrize(
        ("text", "reason"),
        [
            ("", "no host"),
            ("robot:port", "not one"),
            ("robot:99999", "not one"),
            ("http://robot", "begins with http"),
            ("user:secret@robot", "has a user"),
            ("robot?speed=1", "unknown option 'speed'"),
        ],
    )
    def test_refuses_an_address_and_says_what_one_looks_like(self, text, reason):
        with pytest.raises(DeviceError, match=rf"{reason}.*write HOST") as caught:
            Address.parse(text, Rtde, 30004)
        assert "secret" not in str(caught.value)

    def test_an_address_has_host_port_path_and_options(self):
        at = Address.parse("ws://[::1]:9091/a/b?joints=x,y", RosJoints, 9090, ("ws", "wss"), ("joints",))
        assert (str(at), at.path, dict(at.options)) == ("[::1]:9091", ("a", "b"), {"joints": "x,y"})
        assert str(Address.parse(None, Rtde, 30004)) == "127.0.0.1:30004"


class TestClock:
    def test_stamps_tell_the_measurement_not_the_arrival(self):
        """Delays are random, one in ten long; the clock of the device is off by a day and 100 ppm fast."""
        rng = np.random.default_rng(1)
        clock, worst = DeviceClock("a device"), 0.0
        for k in range(3000):
            measured = 100.0 + 0.1 * k
            delay = 0.002 + rng.exponential(0.01) + (0.5 if rng.random() < 0.1 else 0.0)
            local = clock.local(86_400.0 + measured * (1 + 1e-4), measured + delay)
            assert local <= measured + delay
            if k > 100:
                worst = max(worst, abs(local - measured))
        assert (
            worst < 0.002 + 60.0 * 1e-4 + 0.004
        )  # smallest delay, drift over the window, and what of the minimum is not met

    def test_a_clock_that_is_set_back_is_a_new_clock(self):
        clock = DeviceClock("a device")
        clock.local(1000.0, 10.0)
        assert clock.local(5.0, 11.0) == 11.0

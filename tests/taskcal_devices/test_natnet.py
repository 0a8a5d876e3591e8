"""NatNet behind a server written from the SDK's sample that unpacks datagrams by itself."""

import socket
import struct
import time
from contextlib import contextmanager, suppress
from threading import Event, Thread

import numpy as np
import pytest

from taskcal.live.devices import DeviceError
from taskcal_devices.natnet import Frame, NatNet
from tests.taskcal_devices.peers import LOOPBACK, PATIENCE_S

BODY, MARKER = np.array([1.25, -0.5, 0.75]), np.array([0.125, 2.5, -3.5])
"""Metres, in numbers that 32 bits have exactly."""


def part(items, sized):
    """A part of a frame: how many things, where it is so how many bytes, and the things."""
    content = b"".join(items)
    return struct.pack("<I", len(items)) + (struct.pack("<I", len(content)) if sized else b"") + content


def body(number=7, at=BODY, flags=1):
    return struct.pack("<i3f4ffh", number, *at, 0.0, 0.0, 0.0, 1.0, 0.0002, flags)


def marker(number=3, of=7, at=MARKER, flags=2):
    return struct.pack("<I3ffhf", of << 16 | number, *at, 0.014, flags, 0.1)


def frame(k=1, *, sized=True, bodies=None, markers=None):
    """A frame, k hundredths of a second after the server began, with everything that a frame may have before its time."""
    sets = [b"all\0" + struct.pack("<I3f", 1, *MARKER), b"empty\0" + struct.pack("<I", 0)]
    device = struct.pack("<III2fI", 1, 2, 2, 0.5, 0.25, 0)
    parts = [
        part(sets, sized),
        part([struct.pack("<3f", *MARKER)], sized),
        part([body(1, -BODY), body()] if bodies is None else bodies, sized),
        part([struct.pack("<iI", 1, 2) + body(1) + body(2)], sized),
        part([b"\x07" * 20], sized) if sized else b"",
        part([marker()] if markers is None else markers, sized),
        part([device], sized),
        part([device, device], sized),
        struct.pack("<2Id3Q2IhI", 0, 0, 0.01 * k, 1, 2, 3, 4, 5, 0, 0),
    ]
    return struct.pack("<I", k) + b"".join(parts)


def message(kind, content):
    return struct.pack("<HH", kind, len(content)) + content


def server_info(version=(4, 1), multicast=False, name=b"Motive"):
    info = struct.pack("<256s4B4B", name, 3, 1, 0, 0, *version, 0, 0)
    return message(1, info + struct.pack("<QH?4B", 10_000_000, 1511, multicast, 239, 255, 42, 99))


@contextmanager
def motive(frames, info=None):
    """The address of a server that answers a connection, and sends `frames(1)`, `frames(2)`, … to whoever connected."""
    stop, heard = Event(), []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as connection:
        connection.bind((LOOPBACK, 0))
        connection.settimeout(PATIENCE_S)

        def serve():
            asked, client = connection.recvfrom(4096)
            assert struct.unpack_from("<HH", asked) == (0, len(asked) - 4)
            assert asked[4:8] == b"Ping"
            assert asked[4 + 265 : 4 + 269] == bytes([4, 1, 0, 0])
            connection.sendto(server_info() if info is None else info, client)
            connection.setblocking(False)
            k = 0
            while not stop.wait(0.005):
                k += 1
                with suppress(BlockingIOError):
                    heard.append(struct.unpack("<HH", connection.recv(4096)))
                if (content := frames(k)) is not None:
                    connection.sendto(message(7, content), client)

        thread = Thread(target=serve, daemon=True)
        thread.start()
        try:
            yield f"{LOOPBACK}:{connection.getsockname()[1]}", heard
        finally:
            stop.set()
            thread.join()


@pytest.mark.parametrize(("path", "at"), [("7", BODY), ("1", -BODY), ("7/3", MARKER)])
@pytest.mark.parametrize("version", [(3, 0), (3, 1), (4, 0), (4, 1), (4, 4)])
def test_a_body_or_a_marker_in_metres_whatever_the_version(version, path, at):
    with (
        motive(lambda k: frame(k, sized=version >= (4, 1)), server_info(version)) as (where, heard),
        NatNet.open(f"{where}/{path}", PATIENCE_S) as instrument,
    ):
        shots = [instrument.read(PATIENCE_S) for _ in range(5)]
        assert all(shot.valid and np.array_equal(shot.point, at) for shot in shots)
        times = [shot.time_s for shot in shots]
        assert (np.diff(times) > 0.0).all()
        assert times[-1] <= time.monotonic()
    assert heard[0] == (10, 0)  # that someone listens


@pytest.mark.parametrize(
    ("path", "lost", "reason"),
    [
        ("7", {"bodies": [body(flags=0)]}, "not tracked"),
        ("7", {"bodies": [body(at=(np.nan, 0.0, 0.0))]}, "no point"),
        ("7", {"bodies": []}, "not streamed"),
        ("7/3", {"markers": [marker(flags=3)]}, "occluded"),
        ("7/3", {"markers": [marker(flags=4)]}, "filled in"),
        ("7/3", {"markers": []}, "not streamed"),
    ],
)
def test_what_is_not_measured_is_a_lost_beam(path, lost, reason):
    with (
        motive(lambda k: frame(k, **({} if k < 3 else lost))) as (where, _),
        NatNet.open(f"{where}/{path}", PATIENCE_S) as instrument,
    ):
        shots = [instrument.read(PATIENCE_S) for _ in range(3)]
    assert [shot.valid for shot in shots] == [True, True, False]
    assert reason in shots[2].reason
    assert np.isnan(shots[2].point).all()


@pytest.mark.parametrize(
    ("frames", "info", "path", "reason"),
    [
        (frame, server_info((2, 10)), "7", r"NatNet 2\.10; 3\.0"),
        (frame, server_info((5, 0)), "7", r"NatNet 5\.0"),
        (frame, server_info(multicast=True), "7", "Unicast"),
        (frame, message(1, b"Motive"), "7", "not NatNet's"),
        (frame, None, "8", r"streams 1, 7, 7/3, and not 8"),
        (frame, None, "7/4", r"and not 7/4"),
        (lambda k: frame(k)[:60], None, "7", "not NatNet's"),
        (lambda k: frame(k, sized=False), None, "7", "not NatNet's"),
        (lambda k: b"\xff" * 60_000, None, "7", "not NatNet's"),
        (lambda k: None, None, "7", r"sent no frame for 0\.3 s; see that Motive streams"),
    ],
)
def test_refuses_other_versions_and_what_is_not_understood(frames, info, path, reason):
    with motive(frames, info) as (where, _), pytest.raises(DeviceError, match=reason):
        NatNet.open(f"{where}/{path}", 0.3)


@pytest.mark.parametrize("path", ["", "/Tool", "/1/2/3", "/-1"])
def test_refuses_an_address_without_a_body(path):
    with pytest.raises(DeviceError, match="streaming ID of a rigid body"):
        NatNet.open(f"{LOOPBACK}{path}", 1.0)
    with pytest.raises(DeviceError, match="no columns"):
        NatNet.open(f"{LOOPBACK}/1", 1.0, "x_mm y_mm z_mm")


def test_any_change_of_bytes_is_a_frame_or_refused():
    rng, whole = np.random.default_rng(1), frame()
    for _ in range(3000):
        changed = bytearray(whole)
        for _ in range(rng.integers(1, 4)):
            changed[rng.integers(len(changed))] = rng.integers(256)
        try:
            read = Frame.parse(bytes(changed[: rng.integers(len(changed) + 1)]), sized=True)
        except (ValueError, struct.error):
            continue
        assert all((reason == "") == bool(np.isfinite(point).all()) for point, reason in read.points.values())

"""ABB's EGM and Robot Web Services and KUKA's RSI, behind senders and a server written from their public descriptions."""

import base64
import hashlib
import re
import socket
import struct
import time
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import count
from threading import Event, Thread

import numpy as np
import pytest

from taskcal import load_robot
from taskcal.live.devices import DeviceError
from taskcal_devices.abb import LOGIN_VARIABLE, Egm, Rws
from taskcal_devices.rsi import Rsi
from tests.taskcal_devices.peers import LOOPBACK, PATIENCE_S, serving

IRB, KR = load_robot("abb-irb120"), load_robot("kuka-kr16-2")
Q = np.array([10.5, -20.25, 33.3, 0.0, 45.0, -179.99])
"""Degrees."""


def read_on(controller):
    for _ in range(1000):
        controller.read(PATIENCE_S)


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind((LOOPBACK, 0))
        return taken.getsockname()[1]


@contextmanager
def sending(message, period_s=0.004):
    """The address to which the datagrams `message(1)`, `message(2)`, … are sent; those that are None are left out."""
    port, stop = free_port(), Event()

    def send():
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as connection:
            for k in count(1):
                if stop.wait(period_s):
                    return
                if (content := message(k)) is not None:
                    connection.sendto(content, (LOOPBACK, port))

    thread = Thread(target=send, daemon=True)
    thread.start()
    try:
        yield f"{LOOPBACK}:{port}"
    finally:
        stop.set()
        thread.join()


def varint(value):
    out = b""
    while value >= 0x80:
        out, value = out + bytes([value & 0x7F | 0x80]), value >> 7
    return out + bytes([value])


def part(number, content):
    """A field of Protocol Buffers: a message or a text of bytes, a whole number, or a double."""
    if isinstance(content, bytes):
        return varint(number << 3 | 2) + varint(len(content)) + content
    if isinstance(content, int):
        return varint(number << 3) + varint(content)
    return varint(number << 3 | 1) + struct.pack("<d", content)


def doubles(values, packed=False):
    values = [float(value) for value in values]
    return part(1, struct.pack(f"<{len(values)}d", *values)) if packed else b"".join(part(1, v) for v in values)


def egm(k, q=Q, external=(), packed=False):
    """EgmRobot of egm.proto: header (1), feedBack (2), planned (3), and states that are not read."""
    header = part(1, k) + part(2, 4 * k) + part(3, 2)
    feedback = part(1, doubles(q, packed)) + part(2, part(1, part(1, 1.0))) + part(3, doubles(external))
    return (
        part(1, header) + part(2, feedback) + part(3, part(1, doubles(np.zeros(6)))) + part(4, part(1, 1)) + part(6, 1)
    )


def rsi(k, q=Q, external=(), stamp=True):
    """A message of RSI: cartesian position, axes, external ones, and the time stamp."""
    axes = " ".join(f'A{i}="{value:.6f}"' for i, value in enumerate(q, 1))
    beside = " ".join(f'E{i}="{value}"' for i, value in enumerate(external, 1))
    text = f'<Rob Type="KUKA"><RIst X="1.0" Y="2.0" Z="3.0" A="0.0" B="0.0" C="0.0" /><AIPos {axes} />'
    text += f"<EIPos {beside} />" * bool(external) + '<Delay D="0" />'
    return (text + f"<IPOC>{4 * k}</IPOC>" * stamp + "</Rob>").encode()


SENDERS = [(Egm, IRB, egm), (Rsi, KR, rsi)]


class TestDatagrams:
    @pytest.mark.parametrize(("kind", "robot", "message"), [*SENDERS, (Egm, IRB, lambda k: egm(k, packed=True))])
    def test_joints_arrive_newest_first_with_their_times(self, kind, robot, message):
        with sending(message) as at, kind.open(at, robot, PATIENCE_S) as controller:
            readings = [controller.read(PATIENCE_S) for _ in range(20)]
            assert all(np.allclose(one.joints, np.radians(Q), atol=1e-9) for one in readings)
            times = np.array([one.time_s for one in readings])
            assert (np.diff(times) > 0.0).all()
            assert times[-1] <= time.monotonic()

    @pytest.mark.parametrize(("kind", "robot", "message"), SENDERS)
    def test_what_is_sent_again_or_overtaken_counts_once(self, kind, robot, message):
        heard, rest = Event(), iter([3, 2, 3, 4])

        def send(_):
            number = next(rest, None) if heard.is_set() else 1
            return None if number is None else message(number, Q + number)

        with sending(send) as at, kind.open(at, robot, PATIENCE_S) as controller:
            heard.set()
            time.sleep(0.2)
            got = [controller._feed.next(1.0) for _ in range(3)]
            assert np.allclose([one.joints[0] for one in got], np.radians(Q[0] + [1, 3, 4]))
            with pytest.raises(DeviceError, match="sent no joints"):
                controller.read(0.05)

    @pytest.mark.parametrize(("kind", "robot", "message"), SENDERS)
    def test_an_axis_beside_the_robot_must_not_move(self, kind, robot, message):
        moved = Event()

        def track(k):
            return message(k, external=(300.0 if moved.is_set() else 100.0, 0.0))

        with sending(track) as at, kind.open(at, robot, PATIENCE_S) as controller:
            controller.read(PATIENCE_S)
            moved.set()
            with pytest.raises(DeviceError, match="axis E1 from 100 to 300"):
                read_on(controller)

    @pytest.mark.parametrize(("kind", "robot", "message"), SENDERS)
    def test_joints_are_named_where_axes_are_others(self, kind, robot, message):
        letter = "J" if kind is Egm else "A"
        names = [f"{letter}{k}" for k in (1, 2)] + ["E1"] + [f"{letter}{k}" for k in (4, 5, 6)]
        with (
            sending(lambda k: message(k, external=(7.0,))) as at,
            kind.open(f"{at}?joints={','.join(names)}", robot, PATIENCE_S) as controller,
        ):
            expected = np.radians([*Q[:2], 7.0, *Q[3:]])
            assert np.allclose(controller.read(PATIENCE_S).joints, expected, atol=1e-9)

    @pytest.mark.parametrize(
        ("kind", "content", "reason"),
        [
            (Egm, egm(1)[:40], "ends within a field"),
            (Egm, b"", "no time"),
            (Egm, b"GET / HTTP/1.1", "not understood"),
            (Egm, egm(1, Q[:0]), "no joints"),
            (Egm, egm(1, Q[:5]), "J1, J2, J3, J4, J5"),
            (Egm, egm(1, [*Q[:5], np.nan]), "J6 as nan"),
            (Egm, egm(1, [*Q[:5], np.inf]), "J6 as inf"),
            (Egm, b"\xff" * 60_000, "ends within a number"),
            (Rsi, rsi(1)[:-9], "not well-formed"),
            (Rsi, b"<Sen><IPOC>4</IPOC></Sen>", "<Sen>"),
            (Rsi, rsi(1, stamp=False), "no IPOC"),
            (Rsi, b'<Rob Type="KUKA"><RIst X="1"/><IPOC>4</IPOC></Rob>', "DEF_AIPos"),
            (Rsi, rsi(1, Q[:4]), "A1, A2, A3, A4"),
            (Rsi, rsi(1, [*Q[:5], np.nan]), "A6 as nan"),
            (Rsi, b'<!DOCTYPE Rob [<!ENTITY a "1">]><Rob/>', "document type"),
            (Rsi, b"\x00\xff" * 30_000, "not understood"),
        ],
    )
    def test_refuses_what_it_does_not_understand(self, kind, content, reason):
        robot = IRB if kind is Egm else KR
        with sending(lambda _: content) as at, pytest.raises(DeviceError, match=reason):
            kind.open(at, robot, PATIENCE_S)

    def test_nothing_sent_and_a_port_that_is_taken_are_named(self):
        with pytest.raises(DeviceError, match=r"sent no packet for 0\.1 s; see that a program streams"):
            Egm.open(f"{LOOPBACK}:{free_port()}", IRB, 0.1)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
            taken.bind((LOOPBACK, 0))
            with pytest.raises(DeviceError, match="cannot be listened to"):
                Rsi.open(f"{LOOPBACK}:{taken.getsockname()[1]}", KR, 1.0)

    def test_listens_on_this_computer_alone_and_to_one_sender(self):
        port = free_port()
        with (
            sending(egm) as at,
            Egm.open(at, IRB, PATIENCE_S) as controller,
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other,
        ):
            other.bind(("127.0.0.2", 0))
            other.sendto(egm(1), (LOOPBACK, int(at.rpartition(":")[2])))
            with pytest.raises(DeviceError, match=r"from 127\.0\.0\.1 and from 127\.0\.0\.2"):
                read_on(controller)
        with sending(egm) as at, pytest.raises(DeviceError, match="sent no packet"):
            Egm.open(f"{at}?from=127.0.0.2", IRB, 0.1)
        assert Egm.port != port  # the usual one may be in use here; the usual host is of this computer alone
        with pytest.raises(DeviceError, match=r"at 127\.0\.0\.1:6510"):
            Egm.open(None, IRB, 0.05)


PAGE = """<?xml version="1.0" encoding="UTF-8"?>
<html xmlns="http://www.w3.org/1999/xhtml"><head><title>motionsystem</title>
<base href="http://localhost/rw/motionsystem/mechunits/ROB_1/jointtarget/"/></head>
<body><div class="state"><a href="" rel="self"/><ul><li class="ms-jointtarget" title="ROB_1">{}</li></ul></div></body></html>"""


def page(q=Q, external=(9e9,) * 6):
    spans = [(f"rax_{k}", value) for k, value in enumerate(q, 1)]
    spans += [(f"eax_{letter}", value) for letter, value in zip("abcdef", external, strict=True)]
    return PAGE.format("".join(f'<span class="{name}">{value}</span>' for name, value in spans))


class Webserver(BaseHTTPRequestHandler):
    """Robot Web Services: asks for a login by digest (RFC 2617) or, as version 2.0, by basic; then a cookie is enough."""

    def do_GET(self):
        server = self.server
        server.asked.append((self.path, self.headers.get("Accept"), self.headers.get("Authorization")))
        if self.path == "/logout":
            return self.answer(204)
        if "session=7" not in self.headers.get("Cookie", "") and not self.allowed():
            challenge = (
                'Basic realm="RWS"' if server.basic else 'Digest realm="validusers@robapi.abb", nonce="n7", qop="auth"'
            )
            return self.answer(401, {"WWW-Authenticate": challenge})
        if self.path != "/rw/motionsystem/mechunits/ROB_1/jointtarget":
            return self.answer(404)
        code, headers, content = server.reply()
        return self.answer(code, {"Set-Cookie": "session=7; path=/", **headers}, content)

    def allowed(self):
        kind, _, rest = self.headers.get("Authorization", "").partition(" ")
        user, password = self.server.login
        if self.server.basic:
            return kind == "Basic" and base64.b64decode(rest).decode() == f"{user}:{password}"
        told = dict(re.findall(r'(\w+)="?([^",]+)', rest))

        def md5(text):
            return hashlib.md5(text.encode()).hexdigest()

        if kind != "Digest" or told.get("username") != user:
            return False
        secret = md5(f"{user}:{told['realm']}:{password}"), md5(f"GET:{told['uri']}")
        return told["response"] == md5(f"{secret[0]}:n7:{told['nc']}:{told['cnonce']}:auth:{secret[1]}")

    def answer(self, code, headers=None, content=""):
        self.send_response(code)
        for name, value in {"Content-Length": str(len(content)), **(headers or {})}.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(content.encode())

    def log_message(self, *_):
        pass


@contextmanager
def webserver(reply=page, login=("Default User", "robotics"), basic=False, context=None):
    """The address of such a server, and the requests that it got."""
    with ThreadingHTTPServer((LOOPBACK, 0), Webserver) as server:
        server.daemon_threads = True
        server.asked, server.login, server.basic = [], login, basic
        server.reply = lambda: (200, {}, reply()) if isinstance(reply(), str) else reply()
        if context is not None:
            server.socket = context.wrap_socket(server.socket, server_side=True)
        Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
        try:
            yield f"{LOOPBACK}:{server.server_port}", server.asked
        finally:
            server.shutdown()


@pytest.fixture(scope="module")
def certificate(tmp_path_factory):
    """A certificate that a controller made itself, for another name than its address, and the server's side of it."""
    import datetime
    import ssl

    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec

    key, name = (
        ec.generate_private_key(ec.SECP256R1()),
        x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "IRC5")]),
    )
    begin = datetime.datetime(2020, 1, 1, tzinfo=datetime.UTC)
    made = x509.CertificateBuilder().subject_name(name).issuer_name(name).public_key(key.public_key())
    made = (
        made.serial_number(7)
        .not_valid_before(begin)
        .not_valid_after(begin.replace(year=2100))
        .sign(key, hashes.SHA256())
    )
    file = tmp_path_factory.mktemp("certificate") / "robot.pem"
    file.write_bytes(made.public_bytes(serialization.Encoding.PEM))
    with_key = file.with_name("server.pem")
    own = key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    with_key.write_bytes(file.read_bytes() + own)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(with_key)
    return file, context


class TestRws:
    def test_joints_by_digest_with_one_login_for_all(self):
        with webserver() as (at, asked), Rws.open(at, IRB, PATIENCE_S) as controller:
            readings = [controller.read(PATIENCE_S) for _ in range(2)]
        assert np.allclose([one.joints for one in readings], np.radians(Q), atol=1e-12)
        assert [bool(login) for _, _, login in asked] == [False, True, False, False, False]
        assert asked[-1][0] == "/logout"

    def test_another_user_and_axes_beside_the_robot(self, monkeypatch):
        monkeypatch.setenv(LOGIN_VARIABLE, "wort")
        external = [100.0, *[9e9] * 5]
        with (
            webserver(lambda: page(external=external), ("Anna B", "wort")) as (at, _),
            Rws.open(f"{at}?user=Anna%20B&unit=ROB_1", IRB, PATIENCE_S) as controller,
        ):
            controller.read(PATIENCE_S)
            external[0] = 300.0
            with pytest.raises(DeviceError, match="axis eax_a from 100 to 300"):
                controller.read(PATIENCE_S)

    def test_a_password_goes_to_a_known_certificate_alone(self, certificate):
        file, context = certificate
        with webserver(basic=True, context=context) as (at, asked):
            with pytest.raises(DeviceError, match=r"certificate that this computer does not know.*\?certificate="):
                Rws.open(f"https://{at}", IRB, PATIENCE_S)
            assert not asked
            with Rws.open(f"https://{at}?certificate={file}", IRB, PATIENCE_S) as controller:
                assert np.allclose(controller.read(PATIENCE_S).joints, np.radians(Q), atol=1e-12)
            assert {accept for path, accept, _ in asked} == {"application/xhtml+xml;v=2.0"}
        with webserver(basic=True) as (at, asked), pytest.raises(DeviceError, match="refuses the user"):
            Rws.open(at, IRB, PATIENCE_S)  # no password without a cipher
        assert not any(login for _, _, login in asked)

    @pytest.mark.parametrize(
        ("reply", "options", "reason"),
        [
            (page, "?unit=ROB_2", r"has no .*ROB_2.*unit=ROB_1"),
            (page, "?user=Nobody", r"refuses the user 'Nobody'.*TASKCAL_RWS_PASSWORD"),
            (lambda: "{}", "", "not understood"),
            (lambda: PAGE.format(""), "", "rax_1|of no name"),
            (lambda: page([*Q[:5], "nan"]), "", "rax_6 as nan"),
            (lambda: page([*Q[:5], "much"]), "", "not understood.*much"),
            (lambda: page(Q[:5]), "", "rax_1, rax_2, rax_3, rax_4, rax_5"),
            (lambda: " " * 70_000, "", "more than 65536 bytes"),
            (lambda: (503, {}, ""), "", "503"),
            (lambda: (401, {"WWW-Authenticate": "Negotiate"}, ""), "", "neither digest nor basic"),
            (lambda: (302, {"Location": "http://127.0.0.1:9/"}, ""), "", "302"),
        ],
    )
    def test_refuses_what_it_does_not_understand(self, reply, options, reason):
        with webserver(reply) as (at, _), pytest.raises(DeviceError, match=reason):
            Rws.open(at + options, IRB, PATIENCE_S)

    def test_nothing_there_and_an_answer_that_drips_are_named(self):
        with pytest.raises(DeviceError, match=r"'rws' at .* cannot be reached"):
            Rws.open(f"{LOOPBACK}:{free_port()}", IRB, 1.0)

        def drip(connection):
            connection.recv(1 << 12)
            connection.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: 1000\r\n\r\n")
            while True:
                connection.sendall(b" ")
                time.sleep(0.02)

        with serving(drip) as at, pytest.raises(DeviceError, match=r"sent no whole answer for 0\.2 s"):
            Rws.open(at, IRB, 0.2)

"""Joints of ABB controllers: by EGM, an option, which sends them every 4 ms, or by Robot Web Services, which are asked for them.

EGM, Externally Guided Motion (3HAC073319): messages ``EgmRobot`` of ABB's *egm.proto* in UDP datagrams, which the controller sends
while a program streams positions (``EGMStreamStart``) or runs EGM. Taskcal sends none, so that nothing moves the robot.

Robot Web Services (RWS) 1.0 of IRC5 with RobotWare 6 by HTTP, and 2.0 of OmniCore with RobotWare 7 by HTTPS: the joints of a
mechanical unit, as XHTML, which both versions have.
"""

import os
import ssl
import struct
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from http.client import HTTPException
from math import isfinite
from time import monotonic
from typing import Any
from urllib.error import HTTPError, URLError
from urllib.parse import quote
from urllib.request import (
    HTTPBasicAuthHandler,
    HTTPCookieProcessor,
    HTTPDigestAuthHandler,
    HTTPPasswordMgrWithDefaultRealm,
    HTTPRedirectHandler,
    HTTPSHandler,
    OpenerDirector,
    ProxyHandler,
    build_opener,
)

from taskcal.errors import shown
from taskcal.io.xml_file import Element
from taskcal.live.devices import Controller, DeviceError, JointReading
from taskcal.robot.robot import Robot
from taskcal_devices.network import Address, Axes, DatagramJoints, answered, xml_of

# EGM. Of a message in the encoding of Protocol Buffers: its fields' numbers in egm.proto.

HEADER, FEEDBACK = 1, 2
"""Of EgmRobot."""

TIME_MS = 2
"""Of EgmHeader: when the controller sent it, ``tm``."""

JOINTS, EXTERNAL_JOINTS = 1, 3
"""Of EgmFeedBack: what the axes are measured at."""

VARINT, DOUBLE, BYTES, FLOAT = 0, 1, 2, 5
"""Kinds of fields: how long they are."""

LONGEST_VARINT = 10
"""Bytes of a whole number of 64 bits, seven in each."""


class Egm(DatagramJoints):
    """A controller of ABB that streams positions by EGM."""

    name = "egm"
    reached = "HOST[:6510][?from=HOST][&joints=NAME,…]"
    port = 6510
    hint = (
        "see that a program streams there (EGMStreamStart), with this computer's address in its UDP device (Configuration, "
        "Communication, Transmission Protocol)"
    )

    @staticmethod
    def parse(content: bytes) -> tuple[float, Mapping[str, float], Mapping[str, float]]:
        """Time stamp, joints ``J1`` … as they are measured, and external ones ``E1`` ….

        Raises:
            ValueError: it is no EgmRobot, or has no stamp or joints.
        """
        message = _merged(content)
        header, feedback = (_merged(_message(message.get(number, b""))) for number in (HEADER, FEEDBACK))
        stamp_ms = header.get(TIME_MS)
        if not isinstance(stamp_ms, int):
            raise ValueError("no time in its header")
        joints, external = (_doubles(feedback.get(number, b"")) for number in (JOINTS, EXTERNAL_JOINTS))
        if not joints:
            raise ValueError("no joints in its feedback")
        return (
            stamp_ms / 1e3,
            {f"J{k}": value for k, value in enumerate(joints, 1)},
            {f"E{k}": value for k, value in enumerate(external, 1)},
        )


def _fields(message: bytes) -> Iterator[tuple[int, int | bytes]]:
    """Number and content of each field.

    Raises:
        ValueError: it is not in that encoding, or ends too early.
    """
    at = 0
    while at < len(message):
        key, at = _varint(message, at)
        number, kind = key >> 3, key & 7
        if kind == VARINT:
            value, at = _varint(message, at)
        elif kind in (DOUBLE, BYTES, FLOAT):
            size, at = _varint(message, at) if kind == BYTES else (8 if kind == DOUBLE else 4, at)
            value, at = message[at : at + size], at + size
        else:
            raise ValueError(f"a field of kind {kind}")
        if number == 0 or at > len(message):
            raise ValueError("a field without a number" if number == 0 else "it ends within a field")
        yield number, value


def _merged(message: bytes) -> dict[int, int | bytes]:
    """Fields by their numbers; a message that comes in parts is all of them, of a number the last counts."""
    out: dict[int, int | bytes] = {}
    for number, value in _fields(message):
        before = out.get(number, b"")
        out[number] = before + value if isinstance(before, bytes) and isinstance(value, bytes) else value
    return out


def _varint(message: bytes, at: int) -> tuple[int, int]:
    """A whole number, and where it ends."""
    value = 0
    for k, byte in enumerate(message[at : at + LONGEST_VARINT]):
        value |= (byte & 0x7F) << 7 * k
        if byte < 0x80:
            return value, at + k + 1
    raise ValueError("it ends within a number")


def _message(value: int | bytes) -> bytes:
    if isinstance(value, int):
        raise ValueError("a number instead of a message")
    return value


def _doubles(value: int | bytes) -> list[float]:
    """Values of the one field of EgmJoints, each by itself, or packed."""
    out: list[float] = []
    for number, content in _fields(_message(value)):
        if number == 1:
            packed = _message(content)
            if not packed or len(packed) % 8:
                raise ValueError(f"a joint of {len(packed)} bytes")
            out += struct.unpack(f"<{len(packed) // 8}d", packed)
    return out


# Robot Web Services.

PORTS = {"http": 80, "https": 443}
"""Of RWS 1.0 and 2.0."""

USER, PASSWORD = "Default User", "robotics"
"""With which ABB ships its controllers (Robot Web Services, *Authentication*)."""

LOGIN_VARIABLE = "TASKCAL_RWS_PASSWORD"
"""Of the environment, with the password."""

ACCEPTED = {"http": "application/xhtml+xml", "https": "application/xhtml+xml;v=2.0"}

PERIOD_S = 0.1
"""Between two requests. A convention: a controller that is asked ten times a second has time for its other clients."""

MAX_ANSWER_BYTES = 1 << 16
"""Of an answer, which has 1 kB."""

CLOSING_S = 1.0
"""To end the session, seconds."""

ROBOT_AXES = tuple(f"rax_{k}" for k in range(1, 7))
EXTERNAL_AXES = tuple(f"eax_{k}" for k in "abcdef")
NOT_THERE = 9e9
"""Value of an axis that the robot does not have (RAPID, *jointtarget*)."""


class _NoRedirect(HTTPRedirectHandler):
    """A controller has no reason to send its clients elsewhere, with their password."""

    def redirect_request(self, *_: Any, **__: Any) -> None:
        return None


class Rws(Controller):
    """A controller of ABB, asked by Robot Web Services."""

    name = "rws"
    reached = "[http[s]://]HOST[:PORT][?unit=ROB_1][&user=NAME][&certificate=FILE][&joints=NAME,…]"

    def __init__(self, address: Address, robot: Robot, opener: OpenerDirector):
        self._address, self._opener, self._axes = address, opener, Axes(robot, address)
        self._path = f"rw/motionsystem/mechunits/{quote(address.options.get('unit', 'ROB_1'))}/jointtarget"
        self._asked_s = -PERIOD_S

    @classmethod
    def open(cls, address: str | None, robot: Robot, timeout_s: float) -> "Rws":
        """Log in, and ask for the joints.

        Raises:
            DeviceError: nothing answers there, it refuses the login, or its axes are not surely the robot's.
        """
        port = PORTS["https" if (address or "").strip().startswith("https://") else "http"]
        where = Address.parse(address, cls, port, tuple(PORTS), ("unit", "user", "certificate", "joints"))
        out = cls(where, robot, _opener(where))
        out.read(timeout_s)
        return out

    def read(self, timeout_s: float) -> JointReading:
        """The joints now.

        Raises:
            DeviceError: no answer in time, or one that is not understood.
        """
        time.sleep(max(self._asked_s + PERIOD_S - monotonic(), 0.0))
        self._asked_s = monotonic()
        content = self._get(self._path, timeout_s)
        try:
            own, external = _axes_of(xml_of(content))
        except ValueError as error:
            raise self._address.misunderstood(
                f"answers what is not understood ({shown(str(error))}): {shown(repr(content[:64]))}"
            ) from error
        return JointReading(time_s=monotonic(), joints=self._axes.joints(own, external))

    def _get(self, path: str, timeout_s: float) -> bytes:
        """An answer, of which every byte arrived in time, its headers too.

        Raises:
            DeviceError: there is none.
        """
        late = self._address.silent("whole answer", timeout_s)
        return answered(lambda: self._got(path, timeout_s), timeout_s, late, lambda: None)

    def _got(self, path: str, timeout_s: float) -> bytes:
        """An answer, each piece of which arrived in time."""
        where, content = self._address, b""
        try:
            with self._opener.open(f"{where.scheme}://{where}/{path}", timeout=timeout_s) as answer:
                while piece := answer.read1(MAX_ANSWER_BYTES):
                    content += piece
                    if len(content) > MAX_ANSWER_BYTES:
                        raise where.misunderstood(f"answers with more than {MAX_ANSWER_BYTES} bytes")
        except HTTPError as error:
            raise self._refused(error) from error
        except URLError as error:
            raise self._unreachable(error) from error
        except (OSError, HTTPException) as error:
            raise where.lost(error) from error
        except (ValueError, LookupError) as error:  # of a login that is asked for by another scheme, or in other words
            raise where.misunderstood(
                f"asks for a login that is neither digest nor basic ({shown(str(error))})"
            ) from error
        return content

    def _refused(self, error: HTTPError) -> DeviceError:
        error.close()
        where = self._address
        user = shown(where.options.get("user", USER))
        if error.code == 401:
            return DeviceError(
                f"{where.called} refuses the user '{user}' with the password {_stated()}; name another ('…?user=NAME'), its "
                f"password in the environment variable {LOGIN_VARIABLE}"
            )
        if error.code == 404:
            return DeviceError(f"{where.called} has no '{shown(self._path)}'; name its mechanical unit: '…?unit=ROB_1'")
        return where.misunderstood(f"answers '{error.code} {shown(str(error.reason))}'")

    def _unreachable(self, error: URLError) -> DeviceError:
        reason = error.reason if isinstance(error.reason, Exception) else error
        if isinstance(reason, ssl.SSLCertVerificationError):
            at = f"{self._address.host}:{self._address.port}"
            return DeviceError(
                f"{self._address.called} has a certificate that this computer does not know, and a password is not told to "
                f"strangers; save it (openssl s_client -connect {at} </dev/null | openssl x509 > robot.pem), compare it with the "
                "controller's, and name it: '…?certificate=robot.pem'"
            )
        return self._address.unreachable(reason)

    def close(self) -> None:
        """End the session, of which a controller has few."""
        with suppress(DeviceError):  # it may be gone already
            self._get("logout", CLOSING_S)


def _stated() -> str:
    return f"of {LOGIN_VARIABLE}" if os.environ.get(LOGIN_VARIABLE) else "that ABB ships"


def _opener(where: Address) -> OpenerDirector:
    """What asks: without a proxy, and with a login that is told to that address alone.

    Raises:
        DeviceError: the certificate cannot be read.
    """
    passwords = HTTPPasswordMgrWithDefaultRealm()
    password = os.environ.get(LOGIN_VARIABLE) or PASSWORD
    passwords.add_password(None, f"{where.scheme}://{where}/", where.options.get("user", USER), password)
    handlers = [ProxyHandler({}), _NoRedirect(), HTTPCookieProcessor(), HTTPDigestAuthHandler(passwords)]
    if where.scheme == "https":  # a password that is not hashed is told through a cipher alone
        handlers += [HTTPBasicAuthHandler(passwords), HTTPSHandler(context=_trusted(where))]
    opener = build_opener(*handlers)
    opener.addheaders = [("Accept", ACCEPTED[where.scheme])]
    return opener


def _trusted(where: Address) -> ssl.SSLContext:
    """The certificates that are trusted: the one that is named, whatever host it names, or those that this computer knows."""
    context = ssl.create_default_context()
    if (file := where.options.get("certificate")) is not None:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.check_hostname = False  # a controller's own certificate does not have its address
        context.verify_flags |= ssl.VERIFY_X509_PARTIAL_CHAIN
        try:
            context.load_verify_locations(file)
        except OSError as error:
            raise DeviceError(f"{where.called}: the certificate '{shown(file)}' cannot be read ({error})") from error
    return context


def _axes_of(page: Element) -> tuple[dict[str, float], dict[str, float]]:
    """Axes of an answer, and those beside the robot, as far as there are such.

    Raises:
        ValueError: it has none, or something else than a number.
    """
    target = next((item for item in page.within() if item.attributes.get("class") == "ms-jointtarget"), None)
    if target is None:
        raise ValueError("no joint target")
    stated = {item.attributes.get("class", ""): item.text for item in target.children}
    own, external = (
        {name: float(stated[name]) for name in names if name in stated} for names in (ROBOT_AXES, EXTERNAL_AXES)
    )
    there = {name: value for name, value in external.items() if not (isfinite(value) and abs(value) >= NOT_THERE)}
    return own, there

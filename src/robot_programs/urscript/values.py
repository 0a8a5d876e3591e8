"""Values of URScript's expressions: numbers, poses and lists, and what operators and functions make of them.

Universal Robots, *Script manual, e-Series*: modules internals and urmath.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from robot_programs.core.program import Motion, Unresolved, angled_pose
from robot_programs.core.values import Lost, Operators, Structure, operated
from taskcal_groundwork import se3

Six = tuple[float, ...]
"""Position, metres, and rotation vector, radians; or joint positions, radians."""

POSE, LIST, FEATURE, INVERSE = "pose", "list", "feature", "inverse"
"""Kinds of structures: six numbers in ``p[…]``, anything in ``[…]``, what ``pose_trans`` moved a pose by, as a further part of it,
and joint positions that reach a pose."""


class Whole(float):
    """A whole number, whose quotients may be whole, too."""

    __slots__ = ()


def matrix(values: Six) -> Float[np.ndarray, "4 4"]:
    """The transform of a pose, metres."""
    x, y, z, *w = values
    half = 0.5 * math.hypot(*w)
    scale = 0.5 * math.sin(half) / half if half else 0.5
    return se3.pose_of((x, y, z), (scale * w[0], scale * w[1], scale * w[2], math.cos(half)))


def literal_poses(rows: Float[np.ndarray, "n 6"], like: Motion) -> Float[np.ndarray, "n 4 4"] | None:
    """The same of many; see `LiteralForm.poses`."""
    return se3.pose(se3.exp(rows[:, 3:]), rows[:, :3]) if np.isfinite(rows).all() else None


def six_of(T: Float[np.ndarray, "4 4"], near: Six = (0.0,) * 6) -> Six:
    """Values of a pose: of its rotation vectors, which whole turns tell apart, the one nearest to another's."""
    w, before = se3.log(T[:3, :3]), np.array(near[3:])
    angle, turned = float(np.linalg.norm(w)), float(np.linalg.norm(before))
    axis = w / angle if angle > MIN_ANGLE_RAD else before / turned if turned > MIN_ANGLE_RAD else np.zeros(3)
    whole = 2.0 * np.pi * round((float(axis @ before) - angle) / (2.0 * np.pi))
    return tuple(float(v) for v in (*T[:3, 3], *(w + whole * axis)))


MIN_ANGLE_RAD = 1e-12
"""A rotation by less has no axis."""


def is_number(value: Any) -> bool:
    """Whether a value is a number."""
    return isinstance(value, float)


def of_kind(value: Any, kind: str) -> bool:
    """Whether a value is a structure of a kind."""
    return isinstance(value, Structure) and value.kind == kind


def elements(value: Any) -> list[Any] | None:
    """What a list or a pose has in it; None of anything else, and where it is not known how many there are."""
    if not isinstance(value, Structure) or value.kind not in (LIST, POSE) or value.rest is not None:
        return None
    return [part for name, part in value.parts.items() if name != FEATURE]


def numbers(value: Any, count: int = 6) -> Six | None:
    """The numbers of a list or of a pose, in the robot's base; None where it is anything else, or not that long.

    Raises:
        Unresolved: one of them is not known.
    """
    found = elements(value)
    if found is None or len(found) != count:
        return None
    lost = next((one for one in found if isinstance(one, Lost)), None)
    if lost is not None:
        raise Unresolved(lost.reason if lost.told else f"an element of it {lost.reason}")
    return tuple(map(float, found)) if all(map(is_number, found)) else None


def posed(values: Six) -> Structure:
    """A pose that the text states nowhere."""
    return Structure(kind=POSE, parts=dict(enumerate(values)))


def listed(items: Sequence[Any]) -> Structure:
    """A list that the text states nowhere."""
    return Structure(kind=LIST, parts=dict(enumerate(items))).bounded()


def featured(pose: Any) -> Structure | None:
    """What moved a pose, if nothing of it was set since."""
    found = pose.parts.get(FEATURE) if isinstance(pose, Structure) else None
    is_whole = isinstance(found, Structure) and found.part("base") == numbers(pose)
    return found if is_whole else None


def _in_feature(name: Any, frame: Any, point: Any) -> Structure:
    """A pose moved by a feature, which counts from there."""
    if not (of_kind(frame, POSE) and of_kind(point, POSE)):
        raise Unresolved("pose_trans is not given what it takes")
    moved, stated = _six(frame), _six(point)
    base = six_of(matrix(moved) @ matrix(stated))
    feature = Structure(
        kind=FEATURE, parts={"name": name[0], "key": name[1], "frame": moved, "stated": stated, "base": base}
    )
    origin = None if featured(point) else point.origin
    return Structure(kind=POSE, parts={**dict(enumerate(base)), FEATURE: feature}, origin=origin)


# Functions whose value follows from their arguments.


def _six(pose: Any) -> Six:
    values = numbers(pose)
    if values is None:
        raise Unresolved("a pose has six numbers")
    return values


def _transform(pose: Any) -> Float[np.ndarray, "4 4"]:
    return matrix(_six(pose))


def _apart(position: Callable[..., np.ndarray], rotation: Callable[..., np.ndarray]) -> Callable[..., Structure]:
    """A function of positions and of rotations apart."""

    def function(a: Any, b: Any) -> Structure:
        A, B = _transform(a), _transform(b)
        return posed(six_of(se3.pose(rotation(A[:3, :3], B[:3, :3]), position(A[:3, 3], B[:3, 3]))))

    return function


def _interpolate(a: Any, b: Any, share: float) -> Structure:
    A, B = _transform(a), _transform(b)
    turn = se3.log(A[:3, :3].T @ B[:3, :3])
    if np.linalg.norm(turn) > MAX_TURN_RAD:
        raise ValueError("half a turn may be gone either way round")
    return posed(six_of(se3.pose(A[:3, :3] @ se3.exp(turn * share), A[:3, 3] + share * (B[:3, 3] - A[:3, 3]))))


MAX_TURN_RAD = math.pi - 1e-6


def _rotation_vector(rpy: Any) -> Structure:
    angles = numbers(rpy, 3)
    if angles is None:
        raise ValueError("it takes three angles")
    R = angled_pose(0.0, 0.0, 0.0, *(math.degrees(angle) for angle in reversed(angles)))
    return listed([float(v) for v in se3.log(R[:3, :3])])


def _distance(a: Any, b: Any) -> float:
    return float(np.linalg.norm(_transform(a)[:3, 3] - _transform(b)[:3, 3]))


def _length(of: Any) -> int:
    found = elements(of)
    if found is None:
        raise ValueError("how long it is is not known")
    return len(found)


P, N, L = POSE, "", LIST
FUNCTIONS: Mapping[str, tuple[tuple[str, ...], tuple[str, ...], Callable[..., Any]]] = {
    "pose_trans": (("p_from", "p_from_to"), (P, P), lambda a, b: posed(six_of(_transform(a) @ _transform(b)))),
    "pose_inv": (("p_from",), (P,), lambda a: posed(six_of(se3.inverse(_transform(a))))),
    "pose_add": (("p_1", "p_2"), (P, P), _apart(lambda p, q: p + q, lambda R, S: R @ S)),
    # what pose_add takes from b to a (Universal Robots, forum: "pose_sub usage and meaning")
    "pose_sub": (("p_to", "p_from"), (P, P), _apart(lambda p, q: p - q, lambda R, S: R @ S.T)),
    "interpolate_pose": (("p_from", "p_to", "alpha"), (P, P, N), _interpolate),
    "d2r": (("d",), (N,), math.radians), "r2d": (("r",), (N,), math.degrees),
    "sqrt": (("f",), (N,), math.sqrt), "pow": (("base", "exponent"), (N, N), math.pow),
    "sin": (("f",), (N,), math.sin), "cos": (("f",), (N,), math.cos), "tan": (("f",), (N,), math.tan),
    "asin": (("f",), (N,), math.asin), "acos": (("f",), (N,), math.acos), "atan": (("f",), (N,), math.atan),
    "atan2": (("x", "y"), (N, N), math.atan2), "floor": (("f",), (N,), math.floor), "ceil": (("f",), (N,), math.ceil),
    "length": (("list_",), (L,), _length), "point_dist": (("p_from", "p_to"), (P, P), _distance),
    "rpy2rotvec": (("rpy_vector",), (L,), _rotation_vector),
}  # fmt: skip
"""Names of the arguments, what they are, and the function; positions of arguments are as in the manual."""


RESTING = frozenset({
    "abs", "acos", "asin", "assert", "atan", "atan2", "binary_list_to_integer", "ceil", "conveyor_pulse_decode", "cos", "d2r",
    "enable_external_ft_sensor", "encoder_enable_pulse_decode", "encoder_enable_set_tick_count", "encoder_get_tick_count",
    "encoder_set_tick_count", "encoder_unwind_delta_tick_count", "end_interpreter_mode", "floor", "force",
    "force_mode_set_damping", "force_mode_set_gain_scaling", "ft_rtde_input_enable", "get_actual_joint_positions",
    "get_actual_joint_positions_history", "get_actual_joint_speeds", "get_actual_tcp_pose", "get_actual_tcp_speed",
    "get_actual_tool_flange_pose", "get_analog_in", "get_analog_out", "get_configurable_digital_in",
    "get_configurable_digital_out", "get_controller_temp", "get_conveyor_tick_count", "get_digital_in", "get_digital_out",
    "get_euromap_input", "get_euromap_output", "get_flag", "get_forward_kin", "get_freedrive_status", "get_gravity",
    "get_inverse_kin", "get_inverse_kin_has_solution", "get_joint_temp", "get_joint_torques", "get_list_length",
    "get_standard_analog_in", "get_standard_analog_out", "get_standard_digital_in", "get_standard_digital_out", "get_steptime",
    "get_target_joint_positions", "get_target_joint_speeds", "get_target_payload", "get_target_payload_cog",
    "get_target_payload_inertia", "get_target_tcp_pose", "get_target_tcp_pose_along_path", "get_target_tcp_speed",
    "get_target_tcp_speed_along_path", "get_target_waypoint", "get_tcp_force", "get_tcp_offset", "get_tool_accelerometer_reading",
    "get_tool_analog_in", "get_tool_current", "get_tool_digital_in", "get_tool_digital_out", "integer_to_binary_list",
    "interpolate_pose", "inv", "is_steady", "is_within_safety_limits", "length", "log", "make_list", "modbus_add_rtu_signal",
    "modbus_add_signal", "modbus_delete_signal", "modbus_get_error", "modbus_get_signal_status",
    "modbus_get_time_since_signal_invalid", "modbus_send_custom_command", "modbus_set_digital_input_action",
    "modbus_set_output_register", "modbus_set_output_signal", "modbus_set_runstate_dependent_choice",
    "modbus_set_signal_update_frequency", "modbus_set_signal_watchdog", "norm", "normalize", "path_offset_get", "path_offset_set",
    "path_offset_set_alpha_filter", "path_offset_set_max_offset", "point_dist", "popup", "pose_add", "pose_dist", "pose_inv",
    "pose_sub", "pose_trans", "position_deviation_warning", "pow", "r2d", "random", "read_input_boolean_register",
    "read_input_float_register", "read_input_integer_register", "read_output_boolean_register", "read_output_float_register",
    "read_output_integer_register", "read_port_bit", "read_port_register", "request_boolean_from_primary_client",
    "request_float_from_primary_client", "request_integer_from_primary_client", "request_string_from_primary_client",
    "rotvec2rpy", "rpc_factory", "rpy2rotvec", "rtde_set_watchdog", "set_analog_inputrange", "set_analog_out",
    "set_analog_outputdomain", "set_configurable_digital_input_action", "set_configurable_digital_out", "set_conveyor_tick_count",
    "set_digital_out", "set_euromap_output", "set_euromap_runstate_dependent_choice", "set_flag", "set_gravity",
    "set_input_actions_to_default", "set_payload", "set_payload_cog", "set_payload_mass",
    "set_runstate_configurable_digital_output_to_value", "set_runstate_gp_boolean_output_to_value",
    "set_runstate_standard_analog_output_to_value", "set_runstate_standard_digital_output_to_value",
    "set_runstate_tool_digital_output_to_value", "set_safety_mode_transition_hardness", "set_standard_analog_input_domain",
    "set_standard_analog_out", "set_standard_digital_input_action", "set_standard_digital_out", "set_target_payload",
    "set_tool_analog_input_domain", "set_tool_communication", "set_tool_digital_input_action", "set_tool_digital_out",
    "set_tool_digital_output_mode", "set_tool_output_mode", "set_tool_voltage", "sin", "size", "sleep", "socket_close",
    "socket_get_var", "socket_open", "socket_read_ascii_float", "socket_read_binary_integer", "socket_read_byte_list",
    "socket_read_line", "socket_read_string", "socket_send_byte", "socket_send_int", "socket_send_line", "socket_send_string",
    "socket_set_var", "sqrt", "str_at", "str_cat", "str_empty", "str_find", "str_len", "str_sub", "struct", "sync", "tan",
    "textmsg", "time", "to_num", "to_str", "tool_contact", "tool_contact_examples", "transpose", "wrench_trans",
    "write_output_boolean_register", "write_output_float_register", "write_output_integer_register", "write_port_bit",
    "write_port_register", "zero_ftsensor",
})  # fmt: skip
"""Functions of the language that do not move the robot (*Script manual, e-Series* and *CB-Series*).

Whatever is neither among them nor in the files may move it: the names of functions that grippers, cameras and other devices bring
along do not tell. Functions of a server that ``rpc_factory`` connects to are no such ones: the robot waits for their answer.
"""


def _applied(name: str, given: Sequence[Any]) -> Any:
    """Value of a function applied to its arguments, in their order."""
    _, kinds, function = FUNCTIONS[name]
    if not all(of_kind(value, kind) if kind else is_number(value) for value, kind in zip(given, kinds, strict=True)):
        raise Unresolved(f"{name} is not given what it takes")
    try:
        value = function(*given)
    except (ValueError, ArithmeticError) as why:
        raise Unresolved(f"{name} has no value: {why}") from None
    return value if isinstance(value, Structure) else _finite(Whole(value) if isinstance(value, int) else float(value))


def _finite(value: float) -> float:
    if not math.isfinite(value):
        raise Unresolved("a number is out of range")
    return value


# Operators.

MAX_WHOLE = 2**31
"""Whole numbers have 32 bits."""


def _quotient(a: float, b: float) -> float:
    whole = isinstance(a, Whole) and isinstance(b, Whole)
    if not b:
        raise Unresolved(f"{a:g} is divided by zero")
    if whole and a % b:
        raise Unresolved(f"the manual does not say whether the quotient of the whole numbers {a:g} / {b:g} is cut off")
    return a / b


def _remainder(a: float, b: float) -> float:
    if not (isinstance(a, Whole) and isinstance(b, Whole) and a >= 0 and b > 0):
        raise Unresolved(f"what {a:g} % {b:g} is, the manual does not tell")
    return a % b


_OPERATORS: Operators = {("/", 2): _quotient, ("%", 2): _remainder}


def _each(sign: str, pairs: Sequence[Sequence[Any]]) -> Structure:
    """A list of what an operator makes of pairs of elements; of those that are not known, nothing is."""
    found = list[Any]()
    for pair in pairs:
        try:
            found.append(_joined(sign, pair))
        except Unresolved as why:
            found.append(Lost(reason=str(why), told=True))
    return listed(found)


def _joined(sign: str, values: Sequence[Any]) -> Any:
    """Value of an operator; lists are added element by element, and multiplied by a number."""
    for value in values:
        if isinstance(value, Lost):
            raise Unresolved(value.reason)
    items = [elements(value) if of_kind(value, LIST) else None for value in values]
    match sign, items, values:
        case "-", [[*_]], _:
            return _joined("*", [Whole(-1), *values])
        case "+" | "-", [[*a], [*b]], _ if len(a) == len(b):
            return _each(sign, list(zip(a, b, strict=True)))
        case "*", [[*a], None], [_, float() as b]:
            return _each(sign, [(b, item) for item in a])
        case "*", [None, [*a]], [float() as b, _]:
            return _each(sign, [(b, item) for item in a])
        case _ if any(isinstance(value, Structure) for value in values):
            raise Unresolved(f"what '{sign}' makes of these values is not known")
        case _:
            pass
    value = operated(sign, values, _OPERATORS)
    if not is_number(value):
        return value
    if all(isinstance(one, Whole) for one in values):
        if abs(value) >= MAX_WHOLE:
            raise Unresolved("a whole number is out of range")
        return Whole(value)
    return _finite(float(value))


def _element(of: Any, index: Any) -> Any:
    """An element of a list or of a pose."""
    found = elements(of)
    if found is None or not isinstance(index, Whole) or not 0 <= index < len(found):
        lost = next(
            (one for one in (of, index) if isinstance(one, Lost)), Lost(reason="an element of a list is not known")
        )
        raise Unresolved(lost.reason)
    return found[int(index)]


def _inverse(pose: Any, near: Any, tcp: Any) -> Structure:
    """Joint positions that reach a pose: those nearest to some, or to where the robot is (`NEAR_HERE`)."""
    if isinstance(pose, Lost):
        raise Unresolved(pose.reason)
    if tcp != ACTIVE_TCP:
        raise Unresolved("get_inverse_kin is given a TCP of its own")
    if isinstance(near, Lost):
        raise Unresolved(f"qnear is not known: {near.reason}")
    q = None if near == NEAR_HERE else numbers(near)
    if not of_kind(pose, POSE) or (near != NEAR_HERE and q is None):
        raise Unresolved("get_inverse_kin is not given a pose, and six joint positions to be near to")
    return Structure(kind=INVERSE, parts={"pose": pose, "near": q or NEAR_HERE})


ACTIVE_TCP, NEAR_HERE = "active_tcp", "where the robot is"

ELEMENT, IN_FEATURE = "[]", "pose_trans of a feature"
"""Operators that the language writes otherwise: an element of what is no variable, and a pose that a variable moves."""
_OWN: Mapping[str, Callable[..., Any]] = {
    ELEMENT: _element, IN_FEATURE: _in_feature, "get_inverse_kin": _inverse,
}  # fmt: skip
_LOGIC = ("and", "or")
_JOINS = frozenset({"or", "xor", "and", "==", "!=", "<", "<=", ">", ">=", "+", "-", "*", "/", "%", "not"})


def has_value(sign: str) -> bool:
    """Whether an operator, or a function, gives a value that follows from its operands."""
    return sign in _JOINS or sign in FUNCTIONS or sign in _OWN


def takes_unknown(sign: str) -> bool:
    """Whether it has a value, or a reason of its own for none, where not all of its operands are known."""
    return sign in (*_LOGIC, ELEMENT, "get_inverse_kin") or not has_value(sign)


def operate(sign: str, values: Sequence[Any]) -> Any:
    """Value of an operator, or of one of the language's functions.

    Raises:
        Unresolved: it has none, or none that the text tells.
    """
    if sign in _LOGIC and any(value is (sign == "or") for value in values):
        return sign == "or"
    if sign in _JOINS:
        return _joined(sign, values)
    if sign in FUNCTIONS:
        return _applied(sign, values)
    if sign in _OWN:
        return _OWN[sign](*values)
    raise Unresolved(f"what {sign} returns is known only at run time")

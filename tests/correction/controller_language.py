"""Helpers of a corrected program, run from their text: a translator of their few statements, with numbers in single precision."""

import copy
import functools
import re
from types import SimpleNamespace

import numpy as np
from scipy.spatial.transform import Rotation

from robot_programs.core.program import angled_pose, pose_numbers
from taskcal.geometry import se3
from taskcal.kinematics.inverse import solve_near
from taskcal.robot.error_model import ErrorModel

F = np.float32


class Stopped(Exception):
    """The helper stopped the program."""


class Record(SimpleNamespace):
    """A record of a controller; those of numbers are added."""

    def __add__(self, other):
        return Record(**{k: v + getattr(other, k) for k, v in vars(self).items()})

    def __sub__(self, other):
        return Record(**{k: v - getattr(other, k) for k, v in vars(self).items()})


def pos(x, y, z):
    return Record(x=F(x), y=F(y), z=F(z))


def orient(q):
    return Record(q1=F(q[0]), q2=F(q[1]), q3=F(q[2]), q4=F(q[3]))


def numbers(record):
    return np.array([float(v) for v in vars(record).values()])


def quaternion(R):
    return np.roll(Rotation.from_matrix(R).as_quat(canonical=True), 1)


def matrix(place, rot):
    return se3.pose(Rotation.from_quat(np.roll(numbers(rot), -1)).as_matrix(), numbers(place) * 1e-3)


def nominal_angles(robot, T, seed, prefix):
    """Joints of the nominal robot near others, by their names on a controller."""
    found = solve_near(ErrorModel(robot), T[None], seed[None])
    assert found.reached.all()
    return {f"{prefix}{k}": F(v) for k, v in enumerate(np.degrees(found.q[0]), start=1)}


def known_functions(calls):
    """Functions of both languages, in single precision, with those that a controller has of its own."""

    def stop(why):
        raise Stopped(why)

    def turned(function):
        return lambda angle: F(function(np.radians(float(angle))))

    return {
        "F": F, "single": F, "pos": pos, "take": copy.deepcopy, "stop": stop, "Record": Record, "Abs": abs, "Sqrt": np.sqrt,
        "Sin": turned(np.sin), "Cos": turned(np.cos), "ATan2": lambda y, x: F(np.degrees(np.arctan2(float(y), float(x)))), **calls,
    }  # fmt: skip


# RAPID.


def _turned(q, v):
    """A vector turned by a quaternion, rounding as a controller of single precision would."""
    x, y, z = (F(2) * one for one in (q.q3 * v.z - q.q4 * v.y, q.q4 * v.x - q.q2 * v.z, q.q2 * v.y - q.q3 * v.x))
    return Record(
        x=v.x + (q.q1 * x + (q.q3 * z - q.q4 * y)),
        y=v.y + (q.q1 * y + (q.q4 * x - q.q2 * z)),
        z=v.z + (q.q1 * z + (q.q2 * y - q.q3 * x)),
    )


def _pose_vect(pose, v):
    return pose.trans + _turned(pose.rot, v)


def _pose_mult(a, b):
    p, r = a.rot, b.rot
    rot = Record(
        q1=p.q1 * r.q1 - p.q2 * r.q2 - p.q3 * r.q3 - p.q4 * r.q4,
        q2=p.q1 * r.q2 + p.q2 * r.q1 + p.q3 * r.q4 - p.q4 * r.q3,
        q3=p.q1 * r.q3 - p.q2 * r.q4 + p.q3 * r.q1 + p.q4 * r.q2,
        q4=p.q1 * r.q4 + p.q2 * r.q3 - p.q3 * r.q2 + p.q4 * r.q1,
    )
    return Record(trans=_pose_vect(a, b.trans), rot=rot)


def _pose_inv(a):
    rot = Record(q1=a.rot.q1, q2=-a.rot.q2, q3=-a.rot.q3, q4=-a.rot.q4)
    back = _turned(rot, a.trans)
    return Record(trans=Record(x=-back.x, y=-back.y, z=-back.z), rot=rot)


_RAPID = (
    (r"\\WObj:=", ", "), (r"\b([tq])\{(\d+)\}", r"\1[\2]"), (r"\[0,0,0\]", "pos(0,0,0)"), (r"<>", "!="), (r"\bAND\b", "and"),
    (r"\bOR\b", "or"), (r"\bNOT\b", "not"), (r"(?<![\w.\[{])(\d+\.?\d*(?:E[+-]?\d+)?)(?![\w\]}])", r"F(\1)"),
)  # fmt: skip


def _rapid_line(line):
    """A statement of RAPID in Python."""
    if match := re.fullmatch(r"IF (.*?) (TaskcalStop \".*\"|RETURN \w+);", line):
        return f"if {_rapid_text(match[1])}: {_rapid_line(match[2] + ';')}"
    if match := re.fullmatch(r"FOR (\w+) FROM (\d+) TO (\d+) DO", line):
        return f"for {match[1]} in range({match[2]}, {match[3]} + 1):"
    if match := re.fullmatch(r"VAR (\w+) (\w+)(\{\d+\})?(?::=(.*))?;", line):
        made = {"num": "[F(0)] * 1000" if match[3] else "F(0)", "pos": "pos(0,0,0)"}.get(match[1], "None")
        return f"{match[2]} = {made}"
    if match := re.fullmatch(r"TaskcalStop (\".*\");", line):
        return f"stop({match[1]})"
    if match := re.fullmatch(r"(\w+) ([\w.,]+);", line):
        return f"return take({match[2]})" if match[1] == "RETURN" else f"{match[1]}({match[2]})"
    match = re.fullmatch(r"([\w.{}]+):=(.*);", line)
    return f"{_rapid_text(match[1])} = take({_rapid_text(match[2])})"


def _rapid_text(text):
    for pattern, by in _RAPID:
        text = re.sub(pattern, by, text)
    return text


def rapid_functions(text, calc_joint_t):
    """The routines of a RAPID module as functions of Python."""
    out, depth = [], 0
    for raw in text.splitlines():
        line = raw.strip()
        if match := re.fullmatch(r"(?:LOCAL )?(?:FUNC \w+|PROC) (\w+)\((.*)\)", line):
            names = [parameter.split()[-1] for parameter in match[2].split(",")]
            out.append(f"def {match[1]}({', '.join(names)}):")
            depth = 1
        elif line.startswith(("END", "MODULE", "!", "EXIT", "ErrWrite")) or not line:
            depth -= line == "ENDFOR"
        else:
            out.append("    " * depth + _rapid_line(line))
            depth += line.startswith("FOR ")

    known = known_functions(
        {"CalcJointT": calc_joint_t, "PoseVect": _pose_vect, "PoseMult": _pose_mult, "PoseInv": _pose_inv}
    )
    exec("\n".join(line for line in out if not line.startswith("def TaskcalStop")), known)
    return known


class RapidCell:
    """A nominal controller with a tool and a work object, as RAPID has them."""

    def __init__(self, robot, T_world_base, T_part, T_tool):
        self.robot, self.base, self.part, self.tool = robot, T_world_base, T_part, T_tool
        still = Record(trans=pos(0, 0, 0), rot=orient([1, 0, 0, 0]))
        frame = Record(trans=pos(*T_part[:3, 3] * 1e3), rot=orient(quaternion(T_part[:3, :3])))
        self.wobj = Record(robhold=False, ufprog=True, uframe=frame, oframe=still)
        self.tooldata = Record(robhold=True)

    def target(self, T):
        axes = Record(**{f"eax_{a}": F(9e9) for a in "abcdef"})
        return Record(trans=pos(*T[:3, 3] * 1e3), rot=orient(quaternion(T[:3, :3])), extax=axes)

    def calc_joint_t(self, p, tool, wobj):
        """CalcJointT, near `seed`."""
        end = self.part @ matrix(p.trans, p.rot) @ se3.inverse(self.tool) @ self.robot.T_flange_tool
        return Record(robax=Record(**nominal_angles(self.robot, se3.inverse(self.base) @ end, self.seed, "rax_")))


# KRL.

_KRL = (
    (r"\{FRAME: ", "Record("), (r"\}", ")"), (r"\b([XYZABC]) (?=[-\d])", r"\1="),
    (r"<>", "!="), (r"\$(\w+)", r"S_\1"), (r"\[\]", ""), (r"\bB_AND\b", "&"),
    (r"\b(SIN|COS|SQRT|ABS)\(", lambda m: f"{m[1].capitalize()}("),
    (r"\bATAN2\(", "ATan2("), (r"(?<![\w.\[])(\d+\.\d*(?:E[+-]?\d+)?)(?![\w\]])", r"single(\1)"),
)  # fmt: skip


def _krl_line(line):
    """A statement of KRL in Python."""
    line = line.partition(";")[0].strip()
    if match := re.fullmatch(r"IF (.*) THEN", line):
        return f"if {_krl_text(match[1]).replace('#', 'E_')}:"
    if match := re.fullmatch(r"FOR (\w+)=(\d+) TO (\d+)", line):
        return f"for {match[1]} in range({match[2]}, {match[3]} + 1):"
    if match := re.fullmatch(r"DECL (\w+) (.*)", line):
        made = []
        for name in re.split(r",\s*", match[2]):
            if array := re.fullmatch(r"(\w+)\[(\d+)\]", name):
                made.append(f"{array[1]} = [single(0)] * ({array[2]} + 1)")
            elif match[1] in ("E6POS", "FRAME"):
                made.append(f"{name} = Record() if {name!r} not in locals() else {name}")
        return "; ".join(made) or "pass"
    if match := re.fullmatch(r"RETURN(?: \((\w+)\))?", line):
        return f"return take({match[1]})"
    if re.fullmatch(r"\w+\s*\(.*\)", line):
        return _krl_text(line)
    name, value = line.split("=", 1)
    parts = [value] if "{" in value else value.split(":")
    return f"{_krl_text(name)} = take(product({', '.join(map(_krl_text, parts))}))"


def _krl_text(text):
    for pattern, by in _KRL:
        text = re.sub(pattern, by, text)
    return text


def _frames(*parts):
    """What ``:`` gives, rounded once; a value without it."""
    return krl_frame(functools.reduce(np.matmul, map(krl_pose, parts))) if len(parts) > 1 else parts[0]


def krl_functions(text, **known):
    """The routines of a KRL module as functions of Python.

    Args:
        text: of the module.
        known: variables of the controller's, S in place of their $.
    """
    out, depth = [], 0
    for raw in text.splitlines():
        line = raw.strip()
        if match := re.fullmatch(r"(?:GLOBAL )?DEF(?:FCT \w+)? (\w+) \((.*)\)", line):
            names = [parameter.split()[0].strip("[]") for parameter in match[2].split(",") if parameter.strip()]
            out.append(f"def {match[1]}({', '.join(names)}):")
            out += [f"    {part.split()[0]} = take({part.split()[0]})" for part in match[2].split(",") if ":IN" in part]
            depth = 1
            out += ["    pass"]
        elif line in ("END", "ENDFCT"):
            depth = 0
        elif line in ("ENDIF", "ENDFOR", "ENDLOOP"):
            depth -= 1
        elif line == "LOOP":
            depth += 1
        elif line == "HALT":
            out.append("    stop('halted')")
        elif line and not line.startswith((";", "&")):
            out.append("    " * depth + _krl_line(line))
            depth += line.startswith(("IF", "FOR "))
    inverse = {"INV_POS": lambda p: krl_frame(se3.inverse(krl_pose(p))), "product": _frames}
    functions = known_functions(
        {"S_IPO_MODE": 1, "E_BASE": 1, "S_EX_AX_NUM": 0, "S_NULLFRAME": krl_frame(np.eye(4)), **inverse, **known}
    )
    exec("\n".join(out), functions)
    return functions


def krl_pose(p):
    return angled_pose(*(float(getattr(p, name)) for name in "XYZABC"))


def krl_frame(T):
    x, y, z, a, b, c = pose_numbers(T)
    return Record(X=F(x), Y=F(y), Z=F(z), A=F(a), B=F(b), C=F(c))


# URScript.

_URSCRIPT = (
    (r"(?<![\w.\[])(\d+\.\d+)(?![\w\]])", r"F(\1)"), (r"\blocal ", ""), (r"^return (\w+)$", r"return take(\1)"),
    (r"^(\w+(?:\[\d+\])?) = (\w+)$", r"\1 = take(\2)"),
)  # fmt: skip


class Poses:
    """What ``p[…]`` means in Python."""

    def __getitem__(self, values):
        return [F(value) for value in values]


def urscript_functions(text, cell):
    """The functions of a URScript helper as functions of Python."""
    out, depth = [], 0
    for raw in text.splitlines():
        line = raw.strip()
        for pattern, by in _URSCRIPT:
            line = re.sub(pattern, by, line)
        if line == "end":
            depth -= 1
        elif line == "halt":
            out.append("  " * depth + "stop(tc_why)")
        elif line and not line.startswith(("#", "popup")):
            out.append("  " * depth + line)
            depth += line.endswith(":")
    known = known_functions(
        {
            "p": Poses(), "sin": np.sin, "cos": np.cos, "sqrt": np.sqrt,
            "atan2": np.arctan2, "norm": lambda of: np.sqrt(sum(v * v for v in of)) if isinstance(of, list) else abs(of),
            "sync": lambda: None, "pose_trans": lambda a, b: ur_pose(ur_matrix(a) @ ur_matrix(b)),
            "get_inverse_kin": cell.inverse, "get_forward_kin": cell.forward,
        }
    )  # fmt: skip
    exec("\n".join(out), known)
    return known


def ur_pose(T):
    return [F(value) for value in (*T[:3, 3], *Rotation.from_matrix(T[:3, :3]).as_rotvec())]


def ur_matrix(pose):
    x = np.array(pose, dtype=float)
    return se3.pose(Rotation.from_rotvec(x[3:]).as_matrix(), x[:3])


class UrCell:
    """A nominal controller with an active TCP."""

    def __init__(self, robot, T_tool):
        self.robot, self.tool = robot, T_tool

    def inverse(self, pose, near):
        T = ur_matrix(pose) @ se3.inverse(self.tool) @ self.robot.T_flange_tool
        return [
            F(angle)
            for angle in np.radians(list(nominal_angles(self.robot, T, np.array(near, dtype=float), "").values()))
        ]

    def forward(self, q, tcp=None):
        T = ErrorModel(self.robot).poses(np.array([q], dtype=float))[0] @ se3.inverse(self.robot.T_flange_tool)
        return ur_pose(T @ (self.tool if tcp is None else ur_matrix(tcp)))

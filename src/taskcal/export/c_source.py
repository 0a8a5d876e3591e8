"""A calibrated robot as C: one source and one header without dependencies, written from the model's own expressions."""

import keyword
import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from importlib import resources
from textwrap import indent
from typing import Any, get_args

import numpy as np
from jaxtyping import Float

from robot_programs.core.robot import WRIST_TOLERANCE_M, meeting_point
from taskcal.arguments import checked
from taskcal.errors import WrongValue, shown
from taskcal.export.forms import Export, Loss, spread_poses
from taskcal.geometry.expressions import Pool, SymbolicChain, statements, trace
from taskcal.identification.calibration import Calibration
from taskcal.kernels.chain import Fixed
from taskcal.kinematics.inverse import spread_postures
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects.base import Quantity
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot

STORED_POSES = 100
"""Of the self-test."""

SEEDS = 64
"""Starts for a robot without a closed form: eight for each of eight postures."""

PACKED_SHARE = 1e-3
"""Share of a predicted point's standard deviation that packing the covariance may cost."""

PARALLEL = 1e-9
"""Sine of the angle between axes that the robot file has as parallel."""

_HEADERS = re.compile(
    "assert|complex|ctype|errno|fenv|float|inttypes|iso646|limits|locale|math|setjmp|signal|std(arg|bool|def|int|io|lib)|string|"
    "tgmath|time|wchar|wctype"
)
"""Of C99: a file of the name beside the source would stand for them."""

_MODULES = sys.stdlib_module_names | {"test", "cffi", "setuptools"}
"""Which Python imports in place of one of the name."""

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,30}")


@checked
def export_c(calibration: Calibration, *, prefix: str = "robot", python: bool = False) -> Export:
    """Export the calibrated robot as C99, which is C++17 as well: forward, jacobian, inverse and uncertainty.

    Args:
        calibration: the robot, with all its effects.
        prefix: with which every name in the files begins.
        python: with a module for Python, by cffi: ``pip install FOLDER``, then ``import PREFIX``.

    Returns:
        `Export.files`: source, header, a self-test of a hundred poses, and what CMake and pkg-config need.

    Raises:
        WrongValue: the prefix is no name in C, or one that C or Python has already.
        TaskcalError: an effect of another package that decides by comparisons.
    """
    if not _NAME.fullmatch(prefix):
        raise WrongValue(f"prefix is '{shown(prefix)}'; begin with a letter, and use at most 31 letters, digits and _")
    if _HEADERS.fullmatch(prefix) or (python and (prefix in _MODULES or keyword.iskeyword(prefix))):
        raise WrongValue(
            f"prefix is '{prefix}', a name of {'Python' if python else 'C'}'s own; take another, such as {prefix}_robot"
        )
    q = spread_poses(calibration)
    function = _Function.of(calibration.model, calibration.estimate)
    words = {"P": prefix, "GUARD": prefix.upper(), **_described(calibration)}
    words["DECLARATIONS"] = _declarations(_text("robot.h")).replace("[@GUARD@_BRANCHES]", "[]")
    words |= _lines(function) | _branches(calibration.model.robot, words) | _uncertainty(calibration, q, function)
    words |= {"STORED": _stored(calibration, q[:STORED_POSES]), "STORED_COUNT": str(len(q[:STORED_POSES]))}
    files = {_named(name, prefix): _filled(name, words) for name in (*SOURCES, *(PYTHON if python else ()))}
    return Export(text="", files=files, loss=Loss(rms=0.0, maximum=0.0, poses=len(q), reasons=()), frames={})


SOURCES = {
    "robot.h": "{}.h",
    "robot.c": "{}.c",
    "test.c": "{}_test.c",
    "robot.pc.in": "{}.pc.in",
    "CMakeLists.txt": "CMakeLists.txt",
}
PYTHON = {
    "module.py.in": "{}.py",
    "build.py.in": "{}_build.py",
    "setup.py.in": "setup.py",
    "pyproject.toml.in": "pyproject.toml",
}
"""Templates, and what they are called."""


def _named(template: str, prefix: str) -> str:
    return (SOURCES | PYTHON)[template].format(prefix)


# The model in expressions.


@dataclass(frozen=True, eq=False, kw_only=True)
class _Function:
    """A model at joints and conditions that are not known yet."""

    pool: Pool
    q: Any
    traced: SymbolicChain
    by_joint: Any
    """∂(coordinates)/∂q."""
    nearly_by_joint: Any
    """The same without what effects add, which is thousandths: enough for Newton steps, and cheaper."""
    factors: list[Any]
    """∂(coordinate)/∂(parameter) of each of the model's pairs."""
    kept: list[Any]
    """What is positive where the closed loop assembles as it was built."""
    errors: Float[np.ndarray, "frames 6"]
    """Values of the error frames."""
    lengths: Mapping[str, float]
    """Inputs that are numbers after all: the closed loop's lengths, by which it is differentiated."""

    @classmethod
    def of(cls, model: ErrorModel, x: Float[np.ndarray, " p"]) -> "_Function":
        """The function of a model with parameter values x.

        Raises:
            TaskcalError: an effect decides by comparisons.
        """
        pool, count = Pool(), len(model.robot.joint_names)
        q = pool.inputs("q", count)
        conditions = object.__new__(Conditions)  # whose values are no numbers yet, which it would refuse
        vars(conditions).update(
            approach=pool.inputs("c->approach", count),
            move=pool.inputs("c->move", count),
            temperature=np.array([pool.input("c->temperature")], dtype=object),
            time=np.array([pool.input("c->time")], dtype=object),
        )
        bar, loop = model.robot.four_bar, model.robot.joint_side.loop_numbers(model.loop_deviations(x))
        lengths = {} if bar is None else {name: float(getattr(loop, name)) for name in ("L1", "L2", "L3")}
        loop = loop._replace(**{name: pool.input(name) for name in lengths})
        still, s, factors, kept = model.coordinates(q, x, loop, conditions)
        if bar is not None and not model.lengths_only:
            by_length = [pool.derivatives(list(still), pool.input(name)) for name in lengths]
            factors = [*(by_length[k][c] for c, k in bar.pairs), *factors]
        traced = trace(model.chain, s, model.error_frames(x))
        nearly, by_joint = (
            np.array([pool.derivatives(list(of), one) for one in q[0]], dtype=object).T for of in (still, s)
        )
        return cls(
            pool=pool,
            q=q[0],
            traced=traced,
            by_joint=by_joint,
            nearly_by_joint=nearly,
            factors=factors,
            kept=kept,
            lengths=lengths,
            errors=model.error_frames(x),
        )

    def defects(self) -> list[Any]:
        """Of each error frame three axes along and three about which it may stand off, and where: (7, 3)."""
        out: list[Any] = []
        for T, (*t, a, b, _) in zip(self.traced.frames, self.errors, strict=True):
            about = np.array(
                [
                    [1.0, 0.0, 0.0],
                    [0.0, np.cos(a), np.sin(a)],
                    [np.sin(b), -np.sin(a) * np.cos(b), np.cos(a) * np.cos(b)],
                ]
            )
            R = T[:3, :3]
            out.append([*R.T, *(about @ R.T), R @ np.array(t) + T[:3, 3]])
        return out


# What stands in the templates for words between @ signs.


def _described(calibration: Calibration) -> dict[str, str]:
    """What is said of the calibration, and how large everything is."""
    model, provenance = calibration.model, calibration.provenance
    count = len(model.robot.joint_names)
    coupled = [[*one.coefficients, *one.limits] for one in model.robot.coupled_limits] or [[0.0] * (count + 2)]
    return {
        "TITLE": _comment(f"{model.robot.name}, calibrated, as C"),
        "ROBOT": _comment(model.robot.name),
        "ROBOT_DIGEST": provenance.robot_digest,
        "ROWS": str(len(calibration.q)),
        "CAMPAIGN": _comment(provenance.campaign),
        "CAMPAIGN_DIGEST": provenance.campaign_digest,
        "DIGEST": sha256(calibration.to_text().encode()).hexdigest(),
        "EDITED": _comment(f" {calibration.edit_warning}") if calibration.edit_warning else "",
        "JOINTS": str(count),
        "SIX_JOINTS": str(6 * count),
        "COORDINATES": str(model.chain.joints),
        "FRAMES": str(model.chain.frames),
        "LIMITS": _array(model.robot.limits),
        "COUPLED": str(len(coupled)),
        "COUPLED_LIMITS": _array(np.array(coupled)),
    }


def _comment(text: str) -> str:
    """A text that ends no comment or string of C, Python and TOML, and is no word of a template."""
    return shown(text, 200).translate(str.maketrans({"@": "(at)", '"': "'", "\\": "/"})).replace("*/", "* /")


def _array(values: Any) -> str:
    """A table of numbers in braces."""
    if np.ndim(values):
        return "{" + ", ".join(_array(value) for value in values) + "}"
    if isinstance(values, np.integer | np.bool_ | int):
        return str(int(values))
    return repr(float(values)) if np.isfinite(values) else ("INFINITY" if values > 0.0 else "-INFINITY")


def _lines(function: _Function) -> dict[str, str]:
    """The bodies of the functions that are made of expressions."""
    traced, pool = function.traced, function.pool
    closes = [(f"const double kept{k}", value) for k, value in enumerate(function.kept)]
    ok = " && ".join(f"kept{k} > 0.0" for k in range(len(closes)))
    columns = traced.columns(traced.T[:3, 3])
    walked = {
        "axes": traced.axes,
        "origins": traced.origins,
        "defects": function.defects(),
        "factors": function.factors,
    }
    noted = [
        (f"w->{name}" + "".join(f"[{i}]" for i in place), value)
        for name, values in walked.items()
        for place, value in np.ndenumerate(np.array(values, dtype=object))
    ]
    lengths = [f"const double {name} = {value!r};" for name, value in function.lengths.items()]

    def body(*results: tuple[str, Any]) -> str:
        return indent("\n".join([*lengths, *statements(pool, [*results, *closes])]), "    ")

    at = _table("T", traced.T[:3])
    return {
        "FORWARD": body(*at),
        "STEPPING": body(*at, *_table("J", columns @ function.nearly_by_joint)),
        "JACOBIAN": body(*at, *_table("J", columns @ function.by_joint)),
        "WALK": body(*_table("w->pose", traced.T[:3]), *noted),
        "OPEN": f"{ok} ? @GUARD@_OK : @GUARD@_OPEN" if ok else "@GUARD@_OK",
    }


def _table(name: str, values: Any) -> list[tuple[str, Any]]:
    """Elements of a table, row by row, as elements of an array in C."""
    return [(f"{name}[{k}]", value) for k, value in enumerate(values.ravel())]


def _branches(robot: Robot, words: Mapping[str, str]) -> dict[str, str]:
    """Where the search for postures begins: at those of the nominal robot, where they have a closed form."""
    limits = robot.bounded_limits()
    middle = {"MIDDLE": _array(limits.mean(axis=1))}
    form = _closed_form(robot)
    if form is not None:
        about = "Found from those of the nominal robot."
        return middle | form | {"BRANCHES": _text("closed_form.c"), "INVERSE": about, "WHOLE": "True"}
    seeds = spread_postures(robot, SEEDS)
    about = f"Found from {SEEDS} starts: some may be missing, also where none is found."
    words = {"SEEDS": _array(seeds), "SEED_COUNT": str(SEEDS), "INVERSE": about, "WHOLE": "False"}
    return middle | words | {"BRANCHES": _text("seeds.c")}


def _closed_form(robot: Robot) -> dict[str, str] | None:
    """Axes of six joints whose postures have a closed form: a spherical wrist, or three parallel axes, behind parallel ones."""
    matrix = robot.joint_map.matrix
    if matrix.shape != (6, 6) or any(robot.prismatic) or robot.driven:
        return None
    T, frames = np.eye(4), list[np.ndarray]()
    for step in robot.steps():
        if isinstance(step, Fixed):
            T = T @ step.transform
        else:
            frames.append(T)
    at = np.array(frames)
    axes = at[:, :3, 2]

    def parallel(*joints: int) -> bool:
        return all(np.linalg.norm(np.cross(axes[joints[0]], axes[j])) < PARALLEL for j in joints[1:])

    wrist, far = meeting_point(at[3:])
    last, apart = meeting_point(at[4:])
    if parallel(1, 2) and far < WRIST_TOLERANCE_M:
        order, meeting = "spherical_wrist.c", wrist
    elif parallel(1, 2, 3) and apart < WRIST_TOLERANCE_M:
        order, meeting = "parallel_axes.c", last
    else:
        return None
    return {
        "AXES": _array(axes),
        "POINTS": _array(at[:, :3, 3]),
        "HOME": _array(T[:3].ravel()),
        "MEETING": _array(meeting),
        "UNMIX": _array(np.linalg.inv(matrix)),
        "OFFSET": _array(robot.joint_map.offset),
        "ORDER": _text(order),
    }


def _uncertainty(calibration: Calibration, q: Float[np.ndarray, "n joints"], function: _Function) -> dict[str, str]:
    """The packed covariance, and what it takes to use it."""
    model, measured = calibration.model, calibration.measured_range
    layout = model.layout()
    joint_error = np.resize(calibration.joint_error or 0.0, len(model.robot.joint_names))
    factor = _packed(calibration, q)
    asked = {quantity for effect in model.effects for quantity in (*effect.needs, *effect.uses)}
    table = np.stack([layout.joint, layout.column], axis=1) if len(layout.joint) else np.zeros((1, 2), dtype=int)
    return {
        "LOW": _array(measured.low),
        "HIGH": _array(measured.high),
        "BY_TURNS": _array(measured.same_after_turn),
        "JOINT_ERROR": _array(joint_error),
        "SLOTS": _array(layout.frames),
        "PAIR_TABLE": _array(table),
        "PAIRS": str(len(table)),
        "USED_PAIRS": str(len(layout.joint)),
        "PARAMETERS": str(len(factor)),
        "RANK": str(factor.shape[1]),
        "FACTOR": "{" + ", ".join("{" + ", ".join(f"{value:.7g}" for value in row) + "}" for row in factor) + "}",
        "PACKED": f"{PACKED_SHARE:g}",
        "GROWTH": repr(float(calibration.range_growth)),
        "MODEL_VARIANCE": repr(float(calibration.model_error[0]) ** 2),
        **{f"ASKS_{quantity.upper()}": str(int(quantity in asked)) for quantity in get_args(Quantity)},
        "SLIDES": _array(np.array(function.traced.slides)),
    }


LEVER_M = 0.3
"""Distance from the TCP, metres, at which points are looked at when a covariance is packed: a long tool."""


def _packed(calibration: Calibration, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "p rank"]:
    """A factor of the parameters' covariance with as few columns as predicted points need."""
    model = calibration.model
    spread = calibration.z_spread[: len(model)]
    J = calibration.tool_jacobian(q, _any_conditions(q))[:, :, : len(model)]
    J[:, 3:] *= LEVER_M
    rows = J.reshape(-1, len(model)) @ spread
    _, directions = np.linalg.eigh(rows.T @ rows)
    directions = directions[:, ::-1].T
    whole = np.einsum("ij,ij->i", rows, rows).reshape(len(q), 2, 3).sum(axis=2)
    seen = np.cumsum(np.square(rows @ directions.T).reshape(len(q), 2, 3, -1).sum(axis=2), axis=2)
    enough = (seen >= (1.0 - PACKED_SHARE) * whole[..., None]).all(axis=(0, 1))
    rank = int(np.argmax(enough)) + 1 if enough.any() else len(directions)
    return spread @ directions[:rank].T


def _any_conditions(q: Float[np.ndarray, "n joints"]) -> Conditions:
    """Poses reached from all sides, in the cold and in the heat."""
    rng = np.random.default_rng(0)
    return Conditions(
        approach=rng.choice([-1.0, 1.0], q.shape),
        move=rng.normal(size=q.shape),
        temperature=rng.uniform(0.0, 40.0, len(q)),
        time=rng.uniform(0.0, 4.0 * 3600.0, len(q)),
    )


def _stored(calibration: Calibration, q: Float[np.ndarray, "n joints"]) -> str:
    """Joints and poses of the self-test."""
    poses = calibration.tool_in_base(q)[:, :3].reshape(len(q), 12)
    return ",\n    ".join(
        "{" + f"{_array(joints)}, {_array(pose)}" + "}" for joints, pose in zip(q, poses, strict=True)
    )


def _declarations(header: str) -> str:
    """What a header declares, as cffi takes it: without what is for the preprocessor, and for C++."""
    plain = re.sub(r"/\*.*?\*/", "", header, flags=re.DOTALL)
    plain = re.sub(r"#ifdef __cplusplus.*?#endif", "", plain, flags=re.DOTALL)
    return re.sub(r"\n{2,}", "\n", re.sub(r"(?m)^#(?!define @GUARD@_BRANCHES).*$", "", plain)).strip()


def _text(name: str) -> str:
    return (resources.files("taskcal.export") / "c" / name).read_text(encoding="utf-8")


def _filled(name: str, words: Mapping[str, str]) -> str:
    """A template with its words; those may have words in them."""
    text = _text(name)
    while found := re.search("@([A-Z_]+)@", text):
        text = text.replace(found[0], words[found[1]])
    return text

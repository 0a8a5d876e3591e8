"""The C of a calibrated robot says what Python says: every effect's expressions, poses, derivatives, postures, uncertainty."""

import ctypes
import math
import re
import shutil
import subprocess
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from taskcal.errors import TaskcalError, WrongValue
from taskcal.export.c_source import _closed_form, _Function, export_c
from taskcal.geometry import se3
from taskcal.geometry.expressions import statements
from taskcal.identification.calibration import Calibration
from taskcal.kinematics.inverse import closes, conditioning, solve_near, spread_postures
from taskcal.robot.catalogue import load_robot
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects import (
    Backlash,
    Compliance,
    Coupling,
    Effect,
    EncoderGain,
    Harmonics,
    JointField,
    Overshoot,
    Settling,
    Thermal,
    WarmUp,
)
from taskcal.robot.effects.base import _KINDS
from taskcal.robot.error_model import ErrorModel
from tests.laws.calibrations import calibrated
from tests.robot.effects.dressed import BESIDE, dressed, positions

HARMONICS = Harmonics(orders=(1, 2, 3, 7, 30))
EFFECTS = (
    EncoderGain(),
    HARMONICS,
    JointField(features=3),
    Backlash(),
    Overshoot(),
    Settling(),
    Thermal(),
    WarmUp(),
    *BESIDE,
)


def conditions_of(rng: np.random.Generator, joints: int, *, told: bool) -> Conditions:
    """How one pose is reached; not told: nothing moved, and no temperature and time."""
    return Conditions(
        approach=np.sign(rng.normal(size=(1, joints))) * told,
        move=rng.normal(size=(1, joints)) * told,
        temperature=np.array([27.0 if told else np.nan]),
        time=np.array([1800.0 if told else np.nan]),
    )


def repeated(some: Conditions, count: int) -> Conditions:
    """The same conditions for so many poses."""
    quantities = ("approach", "move", "temperature", "time")
    return Conditions(**{name: np.repeat(getattr(some, name), count, axis=0) for name in quantities})


def run(function: _Function, results: dict[str, Any], q: np.ndarray, conditions: Conditions) -> dict[str, float]:
    """What the lines compute, run as Python: but for how a variable is declared, and a member named, they are that, too."""
    c = SimpleNamespace(
        approach=conditions.approach[0],
        move=conditions.move[0],
        temperature=conditions.temperature[0],
        time=conditions.time[0],
    )
    known = {name: getattr(math, name) for name in ("sin", "cos", "sqrt", "exp", "atan2", "fabs")}
    known |= {
        "fmax": max,
        "known": lambda v: 0.0 if math.isnan(v) else v,
        "above": lambda v, least, then: then if v > least else 0.0,
    }
    space: dict[str, Any] = {**known, **function.lengths, "q": q, "c": c}
    for line in statements(function.pool, results):
        exec(line.removeprefix("const double ").replace("->", "."), space)
    return {name: space[name] for name in results}


@pytest.mark.parametrize("told", [True, False])
@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: type(effect).__name__)
@pytest.mark.parametrize("name", ["abb-irb6660-205-1.9", "ur10"])
def test_expressions_of_every_effect_are_the_model(name, effect, told):
    robot = dressed(name)
    model = ErrorModel(robot, effects=(effect,))
    rng = np.random.default_rng(1)
    x = rng.normal(size=len(model)) * model.tolerances
    q = positions(model, 1)
    conditions = conditions_of(rng, q.shape[1], told=told)
    function = _Function.of(model, x)
    jacobian = function.traced.columns(function.traced.T[:3, 3]) @ function.by_joint
    results = {f"T{k}": value for k, value in enumerate(function.traced.T[:3].ravel())}
    results |= {f"J{k}": value for k, value in enumerate(jacobian.ravel())}
    results |= {f"f{k}": value for k, value in enumerate(function.factors)}
    found = run(function, results, q[0], conditions)
    pose = model.poses(q, x, conditions)[0]
    np.testing.assert_allclose([found[f"T{k}"] for k in range(12)], pose[:3].ravel(), atol=1e-12)
    at = model.walk(q, x, prepared=model.prepare(q, conditions))
    np.testing.assert_allclose(
        [found[f"f{k}"] for k in range(len(function.factors))], at.factor[0], rtol=1e-9, atol=1e-12
    )
    step = 1e-6
    for j in range(q.shape[1]):
        ahead, behind = (model.poses(q + sign * step * np.eye(q.shape[1])[j], x, conditions)[0] for sign in (1.0, -1.0))
        turned = (ahead - behind)[:3, :3] / (2.0 * step) @ pose[:3, :3].T
        expected = [*(ahead - behind)[:3, 3] / (2.0 * step), turned[2, 1], turned[0, 2], turned[1, 0]]
        np.testing.assert_allclose([found[f"J{i * q.shape[1] + j}"] for i in range(6)], expected, atol=1e-7)


def test_effect_that_decides_by_comparisons_is_refused():
    class Stepped(Effect):
        key, label = "stepped", "steps"

        def term(self, robot):
            whole = HARMONICS.term(robot)
            return replace(whole, basis=lambda q: np.where(whole.basis(q) > 0.0, 1.0, 0.0))

    try:
        model = ErrorModel(load_robot("ur5"), effects=(Stepped(),))
        with pytest.raises(TaskcalError, match=r"steps cannot be written as code: .*comparisons"):
            _Function.of(model, np.zeros(len(model)))
    finally:
        _KINDS.pop("Stepped")


@pytest.mark.parametrize("prefix", ["", "3d", "ur5-b", "a b", "ü"])
def test_prefix_that_is_no_name_in_c_is_refused(prefix):
    with pytest.raises(WrongValue, match="begin with a letter"):
        export_c(calibrated("ur5", poses=12), prefix=prefix)


@pytest.mark.parametrize(("prefix", "python"), [("math", False), ("test", True), ("import", True), ("cffi", True)])
def test_prefix_that_c_or_python_has_already_is_refused(prefix, python):
    with pytest.raises(WrongValue, match=f"{prefix}_robot"):
        export_c(calibrated("ur5", poses=12), prefix=prefix, python=python)


def test_names_of_files_end_no_comment_and_are_no_word_of_a_template():
    calibration = calibrated("ur5", poses=12)
    named = replace(calibration.provenance, campaign='a*/@ROWS@"""\\.csv')
    files = export_c(replace(calibration, provenance=named), python=True).files
    assert "of a* /(at)ROWS(at)'''/.csv" in files["robot.h"]
    assert not [name for name, text in files.items() if re.search("@[A-Z_]+@", text)]
    compile(files["robot.py"], "robot.py", "exec")


# Compiled, where there is a compiler.

CC = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
STRICT = ("-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror")

COMPILED = {
    "ur5": (EncoderGain(), Harmonics(orders=tuple(range(1, 31))), Coupling(), Compliance(), Backlash()),
    "abb-irb120": (),
    "abb-irb6660-205-1.9": (HARMONICS, Compliance()),
    "barrett-wam": (HARMONICS,),
    "denso-hsr065a1": (),
}
"""Three parallel axes, a spherical wrist, a closed loop, seven joints, four of which one slides."""


class Library:
    """The functions of one robot, called through ctypes."""

    def __init__(self, calibration: Calibration, folder: Path) -> None:
        self.calibration, self.joints = calibration, len(calibration.model.robot.joints)
        for name, text in export_c(calibration, prefix="r").files.items():
            (folder / name).write_text(text, encoding="utf-8")
        self.folder = folder
        self.cc(*STRICT, "-O1", "-shared", "-fPIC", "r.c", "-o", "r.so", "-lm")
        self.library = ctypes.CDLL(str(folder / "r.so"))

    def cc(self, *words: str) -> None:
        assert CC is not None
        subprocess.run([CC, *words], cwd=self.folder, check=True)

    def call(self, name: str, *arrays: np.ndarray | None) -> int:
        given = [None if a is None else a.ctypes.data_as(ctypes.c_void_p) for a in arrays]
        return getattr(self.library, f"r_{name}")(*given)

    def conditions(self, some: Conditions) -> np.ndarray:
        return np.concatenate([some.approach[0], some.move[0], some.temperature, some.time])

    def forward(self, q: np.ndarray) -> np.ndarray:
        pose = np.zeros(12)
        assert self.call("forward", q, None, pose) == 0
        return pose

    def inverse(self, pose: np.ndarray) -> tuple[bool, np.ndarray]:
        """Whether there may be more, and the postures."""
        q, said = np.zeros((16, self.joints)), np.zeros(1, dtype=np.int32)
        count = self.call("inverse", pose, None, q, said)
        assert said[0] in (-1, -2) if count > 0 else said[0] >= -1
        return count == 0 or said[0] == -2, q[: max(count, 0)]


@pytest.fixture(scope="module", params=COMPILED)
def robot(request, tmp_path_factory) -> Library:
    if CC is None:
        pytest.skip("there is no C compiler")
    found = calibrated(request.param, *COMPILED[request.param])
    scatter = tuple(np.linspace(2e-5, 2e-4, len(found.model.robot.joints)))
    return Library(replace(found, joint_error=scatter, range_growth=1.5), tmp_path_factory.mktemp("c"))


def some_poses(robot: Library, count: int) -> np.ndarray:
    model, x = robot.calibration.model, robot.calibration.estimate
    limits = np.clip(model.robot.limits, -np.pi, np.pi)
    q = np.random.default_rng(3).uniform(*limits.T, size=(20 * count, len(limits)))
    return np.ascontiguousarray(q[model.robot.inside_limits(q) & closes(model, q) & closes(model, q, x)][:count])


@pytest.mark.long
def test_compiled_poses_and_derivatives_are_pythons(robot):
    model, x = robot.calibration.model, robot.calibration.estimate
    q = some_poses(robot, 500)
    told = conditions_of(np.random.default_rng(0), robot.joints, told=True)
    many = repeated(told, len(q))
    expected, J = robot.calibration.tool_in_base(q, many)[:, :3], model.joint_jacobian(q, x)
    for row, joints in enumerate(q):
        pose, jacobian = np.zeros(12), np.zeros(6 * robot.joints)
        assert robot.call("forward", joints, robot.conditions(told), pose) == 0
        np.testing.assert_allclose(pose, expected[row].ravel(), atol=1e-12)
        assert robot.call("jacobian", joints, None, pose, jacobian) == 0
        np.testing.assert_allclose(jacobian, J[row].ravel(), atol=1e-12)


def near_singular(robot: Library, q: np.ndarray, joint: int) -> np.ndarray:
    """Joints with one of them beside where the arm does the least: the elbow stretched, or the wrist straight."""
    rng, out = np.random.default_rng(joint), q.copy()
    low, high = np.clip(robot.calibration.model.robot.limits[joint], -np.pi, np.pi)
    for row in out:
        tried = np.tile(row, (181, 1))
        tried[:, joint] = np.linspace(low, high, len(tried))
        row[joint] = tried[conditioning(robot.calibration.model, tried).argmin(), joint] + rng.normal() * 0.03
    return np.ascontiguousarray(out[robot.calibration.model.robot.inside_limits(out)])


def is_among(posture: np.ndarray, found: np.ndarray) -> bool:
    """Whether a posture is found, whole turns aside, which effects tell apart by milliradians."""
    turns = np.round((posture - found) / (2.0 * np.pi))
    off = np.abs(posture - found - 2.0 * np.pi * turns).max(axis=1, initial=0.0)
    return bool((off < np.where(turns.any(axis=1), 0.02, 1e-5)).any())


def search(robot: Library, T: np.ndarray) -> np.ndarray:
    """Postures of the calibrated robot from starts all over the joint ranges."""
    model, x = robot.calibration.model, robot.calibration.estimate
    seeds = spread_postures(model.robot, 128)
    seeds = seeds[closes(model, seeds, x)]
    ended = solve_near(model, np.broadcast_to(T, (len(seeds), 4, 4)), seeds, x, iterations=60)
    return ended.q[ended.reached]


def check_inverse(robot: Library, asked: np.ndarray, searched: int) -> tuple[int, int]:
    """Numbers of poses of which a posture is missing, and of which none is known to be; each of the former must be said.

    The joints from which a pose comes must be found; of the first ones, all that a search finds, too.
    """
    closed, missed, known = _closed_form(robot.calibration.model.robot) is not None, 0, 0
    assert closed != ("starts: some may be missing" in (robot.folder / "r.h").read_text())
    for k, q in enumerate(asked):
        may_be_more, postures = robot.inverse(pose := robot.forward(q))
        for posture in postures:
            assert robot.calibration.model.robot.inside_limits(posture[None]).all()
            np.testing.assert_allclose(robot.forward(posture), pose, atol=1e-9)
        others = search(robot, robot.calibration.tool_in_base(q[None])[0]) if k < searched else []
        missing = [one for one in [q, *others] if not is_among(one, postures)]
        assert may_be_more or not missing or not closed, (q, missing[0])
        missed, known = missed + bool(missing), known + (not may_be_more)
    return missed, known


@pytest.mark.skipif(CC is None, reason="there is no C compiler")
@pytest.mark.parametrize("name", ["ur5", "abb-irb120"])
def test_compiled_inverse_misses_no_posture_in_silence(name, tmp_path):
    """Of random poses, and beside a stretched elbow and a straight wrist."""
    robot = Library(calibrated(name), tmp_path)
    asked = some_poses(robot, 300)
    missed, known = check_inverse(robot, asked, 20)
    assert missed <= 1
    assert known > 0.75 * len(asked)
    for joint, share in ((2, 0.01), (4, 0.06)):
        beside = near_singular(robot, asked, joint)
        assert check_inverse(robot, beside, 10)[0] <= share * len(beside)


@pytest.mark.long
def test_compiled_inverse_finds_every_posture_and_returns(robot):
    asked = some_poses(robot, 1000)
    for q in asked[:12]:
        near, pose = np.zeros(robot.joints), robot.forward(q)
        if robot.call("inverse_near", pose, None, q + 0.02, near) == 0:
            np.testing.assert_allclose(robot.forward(near), pose, atol=1e-9)
    missed, known = check_inverse(robot, asked, 30)
    if _closed_form(robot.calibration.model.robot):
        assert missed <= 2
        assert known > 0.75 * len(asked)


@pytest.mark.long
def test_compiled_uncertainty_is_pythons(robot):
    """Of the tool in the robot's base, and of a point beside it, which its turns move, too."""
    calibration, point = robot.calibration, np.array([0.05, -0.02, 0.1])
    q, told = some_poses(robot, 20), conditions_of(np.random.default_rng(0), robot.joints, told=True)
    many = repeated(told, len(q))
    T, expected = calibration.tool_in_base(q, many), calibration.tool_covariance(q, many, frame="base")
    white = calibration.growth_at(q) * calibration.model_error[0] ** 2
    for row, joints in enumerate(q):
        for arm in (np.zeros(3), point):
            covariance, outside = np.zeros(9), np.zeros(1)
            assert robot.call("uncertainty", joints, robot.conditions(told), arm, covariance, outside) == 0
            carried = se3.by_twist(T[row, :3, :3] @ arm)
            own = expected[row] - np.diag([white[row]] * 3 + [0.0] * 3)
            stated = carried @ own @ carried.T + white[row] * np.eye(3)
            np.testing.assert_allclose(covariance.reshape(3, 3), stated, atol=3e-3 * np.trace(stated))
        assert outside[0] == pytest.approx(np.sqrt(calibration.measured_range.extrapolation(q[row : row + 1])[0]))
    untold = robot.conditions(conditions_of(np.random.default_rng(0), robot.joints, told=False))
    for given in (None, untold):
        status = robot.call("uncertainty", q[0], given, point, np.zeros(9), None)
        assert status == (-5 if calibration.model.conditioned else 0)


@pytest.mark.long
def test_self_test_passes_as_c_and_as_cpp(robot):
    robot.cc(*STRICT, "-O1", "r.c", "r_test.c", "-o", "as_c", "-lm")
    assert "off by" in subprocess.run(["./as_c"], cwd=robot.folder, check=True, capture_output=True, text=True).stdout
    checked = ("-Wall", "-Wextra", "-pedantic", "-Werror", "-fsyntax-only", "r.c", "r_test.c")
    for other in filter(shutil.which, ("gcc", "clang")):
        subprocess.run([other, "-std=c99", *checked], cwd=robot.folder, check=True)
        subprocess.run([other, "-x", "c++", "-std=c++17", *checked], cwd=robot.folder, check=True)


HOSTILE = """
#include "r.h"
#include <math.h>
#include <stdint.h>
#include <stdio.h>
static uint64_t state = 1;
static double number(void) {
    static const double odd[] = {0.0, -0.0, 1e308, -1e308, 1e-320, NAN, INFINITY, -INFINITY, 3.141592653589793, 1e6};
    state = state * 6364136223846793005u + 1442695040888963407u;
    if ((state >> 60) == 0) return odd[(state >> 33) % 10];
    return ((double)(state >> 11) / 9007199254740992.0 - 0.5) * 8.0;
}
int main(void) {
    long i, reached = 0;
    int k, said;
    for (i = 0; i < COUNT; i++) {
        double q[R_JOINTS], pose[12], J[6 * R_JOINTS], all[R_BRANCHES][R_JOINTS], covariance[9], point[3];
        r_conditions c;
        for (k = 0; k < R_JOINTS; k++) q[k] = number(), c.approach[k] = number(), c.move[k] = number();
        for (k = 0; k < 3; k++) point[k] = number();
        c.temperature = number(), c.time = number();
        for (k = 0; k < 12; k++) pose[k] = number();
        if (r_jacobian(q, i % 2 ? &c : 0, pose, J) == R_OK)
            for (k = 0; k < 12; k++)
                if (!isfinite(pose[k])) return 2;
        r_uncertainty(q, &c, point, covariance, 0);
        if (i % 50 == 0) reached += r_inverse(pose, i % 2 ? &c : 0, all, &said) > 0;
    }
    printf("%ld\\n", reached);
    return 0;
}
"""


@pytest.mark.long
def test_hostile_numbers_do_nothing_undefined(robot):
    (robot.folder / "hostile.c").write_text(HOSTILE, encoding="utf-8")
    checks = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-DCOUNT=20000")
    robot.cc("-std=c99", "-O1", *checks, "r.c", "hostile.c", "-o", "hostile", "-lm")
    subprocess.run(["./hostile"], cwd=robot.folder, check=True)


@pytest.mark.long
@pytest.mark.skipif(CC is None, reason="there is no C compiler")
def test_a_stream_of_poses_is_corrected_at_a_kilohertz(tmp_path):
    """The example of the guide: poses of the calibrated robot come back to its joints, one a millisecond."""
    calibration, count = calibrated("ur5", Harmonics(), Backlash()), 200
    for name, text in export_c(calibration, prefix="ur5_cell").files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    example = Path(__file__).parents[2] / "examples" / "stream_1khz.c"
    command = [CC, *STRICT, "-O2", "-I", ".", str(example), "ur5_cell.c", "-lm", "-o", "stream"]
    subprocess.run(command, cwd=tmp_path, check=True)
    q = np.linspace([0.2, -1.2, 1.3, 0.3, 0.8, 0.1], [0.5, -1.0, 1.1, 0.2, 0.9, -0.3], count)
    lines = [q[0] + 0.01, *calibration.tool_in_base(q)[:, :3].reshape(-1, 12)]
    began = time.monotonic()
    run = subprocess.run(
        ["./stream"],
        cwd=tmp_path,
        input="\n".join(" ".join(map(repr, line.tolist())) for line in lines),
        check=True,
        capture_output=True,
        text=True,
    )
    assert time.monotonic() - began > 0.9e-3 * count
    assert f"{count} poses" in run.stderr
    np.testing.assert_allclose(np.loadtxt(run.stdout.splitlines()), q, atol=1e-9)

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

from taskcal.errors import ReachError, TaskcalError, WrongValue
from taskcal.export.c_source import _Function, export_c
from taskcal.geometry.expressions import statements
from taskcal.identification.calibration import Calibration
from taskcal.kinematics.inverse import closes, find_postures, solve_near
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

    def inverse(self, pose: np.ndarray) -> tuple[int, np.ndarray, int]:
        q, failed = np.zeros((16, self.joints)), np.zeros(1, dtype=np.int32)
        count = self.call("inverse", pose, None, q, failed)
        return count, q[: max(count, 0)], int(failed[0])


@pytest.fixture(scope="module", params=COMPILED)
def robot(request, tmp_path_factory) -> Library:
    if CC is None:
        pytest.skip("there is no C compiler")
    return Library(calibrated(request.param, *COMPILED[request.param]), tmp_path_factory.mktemp("c"))


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


@pytest.mark.long
def test_compiled_inverse_finds_every_posture_and_returns(robot):
    model, x = robot.calibration.model, robot.calibration.estimate
    plain, found, asked = ErrorModel(model.robot), 0, some_poses(robot, 12)
    for q in asked:
        pose = robot.forward(q)
        near, start = np.zeros(robot.joints), q + 0.02
        if robot.call("inverse_near", pose, None, start, near) == 0:
            np.testing.assert_allclose(robot.forward(near), pose, atol=1e-9)
        count, postures, _ = robot.inverse(pose)
        for posture in postures:
            assert model.robot.inside_limits(posture[None]).all()
            np.testing.assert_allclose(robot.forward(posture), pose, atol=1e-9)
        if robot.joints != 6:
            found += count > 0
            continue
        try:
            seeds = find_postures(plain, robot.calibration.tool_in_base(q[None])[0])
        except ReachError:
            continue
        goal = np.repeat(robot.calibration.tool_in_base(q[None]), len(seeds), axis=0)
        ends = solve_near(model, goal, seeds, x)
        for end in ends.q[ends.reached]:  # but for whole turns, which effects tell apart by milliradians
            assert (np.abs(np.remainder(postures - end + np.pi, 2.0 * np.pi) - np.pi).max(axis=1) < 0.05).any()
        found += 1
    assert found > len(asked) // 2


@pytest.mark.long
def test_compiled_uncertainty_is_pythons(robot):
    calibration, point = robot.calibration, np.array([0.05, -0.02, 0.1])
    q, told = some_poses(robot, 20), conditions_of(np.random.default_rng(0), robot.joints, told=True)
    many, p = repeated(told, len(q)), len(calibration.model)
    R = calibration.T_tracker_base[:3, :3]
    by_parameter = np.stack(
        [R.T @ half for half in np.split(calibration.tool_jacobian(q, many)[:, :, :p], 2, axis=1)], axis=1
    )
    T, growth = calibration.tool_in_base(q, many), calibration.growth_at(q)
    by_joint = calibration.model.joint_jacobian(q, calibration.estimate)
    errors = np.resize(calibration.joint_error or 0.0, robot.joints)
    for row, joints in enumerate(q):
        covariance, outside = np.zeros(9), np.zeros(1)
        assert robot.call("uncertainty", joints, robot.conditions(told), point, covariance, outside) == 0
        x, y, z = T[row, :3, :3] @ point
        carried = np.hstack([np.eye(3), [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]])
        J, moved = carried @ np.concatenate(by_parameter[row]), carried @ by_joint[row] * errors
        expected = J @ calibration.covariance @ J.T + moved @ moved.T + np.eye(3) * calibration.model_error[0] ** 2
        np.testing.assert_allclose(
            covariance.reshape(3, 3), growth[row] * expected, atol=3e-3 * growth[row] * np.trace(expected)
        )
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
    int k, failed;
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
        if (i % 50 == 0) reached += r_inverse(pose, i % 2 ? &c : 0, all, &failed) > 0;
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

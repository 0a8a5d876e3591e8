"""The same calibrated robot in C and in Python: poses, and joints from the joints before."""

import ctypes
import shutil
import subprocess

import numpy as np
import pytest

from taskcal.export.c_source import export_c
from taskcal.identification.identify import identify
from taskcal.kinematics.inverse import solve_near
from taskcal.robot.effects import Harmonics

MANY = """#include "r.h"
void poses(const double *q, long n, double *pose) {
    for (; n > 0; n--, q += R_JOINTS, pose += 12) r_forward(q, 0, pose);
}
void joints(const double *pose, long n, const double *start, double *q) {
    for (; n > 0; n--, pose += 12, start += R_JOINTS, q += R_JOINTS) r_inverse_near(pose, 0, start, q);
}
"""

CC = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")


@pytest.mark.skipif(CC is None, reason="there is no C compiler")
@pytest.mark.parametrize("what", ["poses", "joints of poses"])
def test_c_against_python(race, model, joints, campaign, smoke, tmp_path, what):
    """One thread each; Python all poses in one call, as it is fastest."""
    calibration = identify(model + Harmonics(), campaign)
    files = {**export_c(calibration, prefix="r").files, "many.c": MANY}
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    command = [CC, "-std=c99", "-O2", "-shared", "-fPIC", "r.c", "many.c", "-o", "r.so", "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)
    library = ctypes.CDLL(str(tmp_path / "r.so"))

    def call(name: str, *arrays: np.ndarray) -> None:
        first, *others = [a.ctypes.data_as(ctypes.c_void_p) for a in arrays]
        getattr(library, name)(first, ctypes.c_long(len(arrays[0])), *others)

    q = joints(100 if smoke else 5000)
    T, x = calibration.tool_in_base(q), calibration.estimate
    pose, found = np.zeros((len(q), 12)), np.zeros(q.shape)
    goal = np.ascontiguousarray(T[:, :3].reshape(-1, 12))
    start = q + 0.01
    call("poses", q, pose)
    call("joints", goal, start, found)
    np.testing.assert_allclose(pose, goal, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(found, q, rtol=0.0, atol=1e-8)
    if what == "poses":
        race("C, 5000 poses", lambda: call("poses", q, pose), {"Python": lambda: calibration.tool_in_base(q)})
        return
    solve = lambda: solve_near(calibration.model, T, start, x)  # noqa: E731
    race("C, joints of 5000 poses", lambda: call("joints", goal, start, found), {"Python": solve}, rounds=3)

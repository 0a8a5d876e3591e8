"""The kernel of one robot written by hand in C++ (`irb6660.cpp`), built where a compiler is: what the machine can do."""

import ctypes
import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from taskcal.kernels.chain import ERROR_FRAME, FIXED, REVOLUTE
from taskcal.robot.error_model import ErrorModel

SOURCE = Path(__file__).with_name("irb6660.cpp")
FLAGS = ("-O3", "-march=native", "-ffast-math", "-std=c++17", "-shared", "-fPIC", "-pthread")

COLUMNS, ALL_COLUMNS = 45, 54
"""Of the robot's parameters; and with those of the tracker's frame and of the target."""

Address = ctypes.c_void_p


class _Robot(ctypes.Structure):
    _fields_ = [
        ("fixed", ctypes.c_double * 84),
        ("e", ctypes.c_double * 42),
        ("offset", ctypes.c_double * 6),
        ("lengths", ctypes.c_double * 4),
        ("levers", ctypes.c_double * 3),
    ]


class _Measured(ctypes.Structure):
    _fields_ = [
        ("base", ctypes.c_double * 12),
        ("base_error", ctypes.c_double * 6),
        ("target", ctypes.c_double * 3),
        ("points", Address),
        ("whiteners", Address),
    ]


def build(folder: Path) -> ctypes.CDLL | None:
    """Compile it into a folder; None where there is no g++."""
    compiler = shutil.which("g++")
    if compiler is None:
        return None
    library = folder / "irb6660.so"
    subprocess.run([compiler, *FLAGS, "-o", str(library), str(SOURCE)], check=True)
    return ctypes.CDLL(str(library))


@dataclass(frozen=True, eq=False, kw_only=True)
class HandWritten:
    """The IRB 6660-205/1.9 at some values of its 45 parameters, on as many threads as Taskcal takes."""

    library: Any
    robot: _Robot

    @classmethod
    def of(cls, library: ctypes.CDLL, model: ErrorModel, x: np.ndarray) -> "HandWritten":
        """From the model's own numbers; its structure is what is compiled in."""
        chain, drive = model.chain, model.robot.four_bar
        assert drive is not None
        np.testing.assert_array_equal(chain.kind, [*[FIXED, REVOLUTE, ERROR_FRAME] * 6, FIXED, ERROR_FRAME])
        np.testing.assert_array_equal(model.robot.joint_map.matrix, np.eye(6) - np.outer(np.eye(6)[2], np.eye(6)[1]))
        np.testing.assert_array_equal([drive.arm, drive.crank, drive.output], np.eye(6)[[1, 2, 2]])
        bar = drive.bar
        robot = _Robot()
        robot.fixed[:] = chain.fixed.reshape(-1).tolist()
        robot.e[:] = model.error_frames(x).reshape(-1).tolist()
        robot.offset[:] = model.robot.joint_map.offset.tolist()
        robot.lengths[:] = [*(np.array([bar.crank, bar.rod, bar.rocker]) + x[-3:]), bar.arm]
        robot.levers[:] = [bar.crank_angle, bar.rocker_angle, bar.assembly]
        return cls(library=library, robot=robot)

    def sensitivities(self, q: np.ndarray, out: np.ndarray) -> np.ndarray:
        """Derivatives of the tool point (n, 3, 45), written into `out`."""
        assert out.shape == (len(q), 3, COLUMNS)
        call = self.library.sensitivities
        call(ctypes.byref(self.robot), Address(q.ctypes.data), len(q), _threads(), Address(out.ctypes.data))
        return out

    def normal_equations(self, q: np.ndarray, measured: "MeasuredPoints") -> tuple[float, np.ndarray, np.ndarray]:
        """Cost, JᵀWr and JᵀWJ of whitened points, 54 columns: the model's, the tracker frame's, the target's."""
        products = np.empty((ALL_COLUMNS + 1, ALL_COLUMNS + 1))
        data = _Measured()
        data.base[:] = measured.base[:3].reshape(-1).tolist()
        data.base_error[:] = measured.base_error.tolist()
        data.target[:] = measured.target.tolist()
        data.points, data.whiteners = measured.points.ctypes.data, measured.whiteners.ctypes.data
        self.library.normal_equations(
            ctypes.byref(self.robot),
            ctypes.byref(data),
            Address(q.ctypes.data),
            len(q),
            _threads(),
            Address(products.ctypes.data),
        )
        return 0.5 * float(products[-1, -1]), products[:-1, -1], products[:-1, :-1]


@dataclass(frozen=True, eq=False, kw_only=True)
class MeasuredPoints:
    """What a tracker measured of one target."""

    base: np.ndarray
    """Robot base in the tracker's frame (4, 4), registered."""
    base_error: np.ndarray
    """Its deviation (6,)."""
    target: np.ndarray
    """Target in the tool (3,)."""
    points: np.ndarray
    """Measured (n, 1, 3)."""
    whiteners: np.ndarray
    """(n, 1, 3, 3), lower triangles."""

    def __post_init__(self) -> None:
        assert self.points.flags.c_contiguous
        assert self.whiteners.flags.c_contiguous


def _threads() -> int:
    return os.cpu_count() or 1

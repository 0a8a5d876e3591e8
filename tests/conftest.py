"""Settings and fixtures shared by all tests."""

import os

for _variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ[_variable] = "1"  # for the libraries and processes that are yet to start

import tempfile
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from jaxtyping import install_import_hook
from threadpoolctl import threadpool_limits

os.environ["TASKCAL_STATE_DIR"] = tempfile.mkdtemp(prefix="taskcal-state-")  # not the user's own

threadpool_limits(1)  # a pytest plugin may have loaded NumPy, and its BLAS, before this file

# Shapes and types in annotations are checked at every call, but for compiled kernels, which Numba has to read, and for
# robot and task files, which pydantic checks.
_CHECKED = """
tabular files geometry.chain geometry.polyline geometry.se3 estimation measurement identification analysis adaptation kinematics
robot.approach robot.catalogue robot.conditions robot.dh_table robot.effects robot.error_frames robot.error_model robot.expression
robot.joint_side robot.mechanism robot.parameter robot.robot robot.statics
task programs.apt programs.composing programs.csv_path programs.program programs.krl programs.spinning programs.tool_axis
programs.rapid.compose programs.rapid.configuration programs.rapid.numbers
correction.assessment correction.cell correction.chords correction.controller correction.correct correction.correction
correction.inverse correction.refusals correction.motion correction.placement correction.frame_calibration
correction.error_budget correction.grasped_frame correction.fixed_frame correction.rigid_motion correction.way
"""
install_import_hook([f"taskcal.{module}" for module in _CHECKED.split()], "beartype.beartype")

# The same examples at every run; compiling a kernel inside an example is slow only once.
settings.register_profile(
    "ci",
    derandomize=True,
    deadline=None,
    max_examples=40,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.register_profile("quick", settings.get_profile("ci"), max_examples=5)
settings.register_profile("thorough", settings.get_profile("ci"), derandomize=False, max_examples=1000)
settings.load_profile("ci")

DATA = Path(os.environ.get("TASKCAL_DATA") or Path(__file__).parents[1] / "../shared/data").resolve()


def _require_data() -> None:
    if DATA.is_dir():
        return
    reason = f"no measured robots in {DATA}; set TASKCAL_DATA to their folder"
    if os.environ.get("CI", "").lower() in {"true", "1"}:
        pytest.fail(reason, pytrace=False)
    pytest.skip(reason)


def pytest_runtest_setup(item: pytest.Item) -> None:
    if item.get_closest_marker("realdata"):
        _require_data()


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """The folder of measured robots; a test that asks for it is marked `realdata`."""
    _require_data()
    return DATA

import gzip

import numpy as np
import pytest
from hypothesis import given

from taskcal.errors import FileError, TaskcalError
from taskcal.export.forms import export_ur_yaml, spread_poses
from taskcal.robot.catalogue import describe_robot, load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from tests.laws.calibrations import calibrated
from tests.laws.plain import product, shift, turn
from tests.laws.robots import generators
from tests.robot_programs.fuzz import mutated

CONF = """[mounting]
delta_theta = [ 1.1e-05, -0.81, 0.53, 0.28, -2.0e-05, 1.5e-05]
delta_a = [ 3.1e-05, 0.12, 0.004, -4.0e-05, 6.0e-05, 0]
delta_d = [ 1.0e-04, 233.4, -150.5, -82.9, 2.0e-05, -1.1e-04]
delta_alpha = [ -5.0e-04, -1.3e-03, -1.2e-03, 9.0e-05, 3.0e-04, 0]
joint_checksum = [ 0xa0cb9b3a, 0, 0, 0, 0, 0]
calibration_status = 2 # 0 == notInitialised
"""


def write(folder, text, name):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_an_exported_yaml_comes_back_as_the_calibrated_robot(tmp_path):
    calibration = calibrated("ur5")
    made = export_ur_yaml(calibration)
    robot = load_robot(write(tmp_path, made.text, "kinematics.yaml"))
    assert robot.joint_names[0] == "shoulder_pan_joint"
    q = spread_poses(calibration, 10)
    np.testing.assert_allclose(
        ErrorModel(robot).poses(q) @ made.frames["tool"], calibration.tool_in_base(q), atol=1e-11
    )


def test_deltas_are_added_to_the_nominal_table(tmp_path):
    nominal = load_robot("ur5")
    robot = robot_from(describe_robot(write(tmp_path, CONF, "calibration.conf"), nominal=nominal))
    rows = {line.split(" = ")[0]: eval(line.split(" = ")[1]) for line in CONF.splitlines()[1:5]}
    q = np.random.default_rng(0).normal(size=6)
    T = np.eye(4)
    for i, joint in enumerate(nominal.description["joint"]):
        alpha = np.radians(joint["dh"].get("alpha_deg", 0.0)) + rows["delta_alpha"][i]
        a = joint["dh"].get("a_mm", 0.0) * 1e-3 + rows["delta_a"][i]
        d = joint["dh"].get("d_mm", 0.0) * 1e-3 + rows["delta_d"][i]
        T = T @ product([turn(2, q[i] + rows["delta_theta"][i]), shift(2, d), shift(0, a), turn(0, alpha)])
    np.testing.assert_allclose(ErrorModel(robot).poses(q[None])[0], T, atol=1e-10)
    np.testing.assert_array_equal(robot.limits, nominal.limits)


WRONG = {
    "no nominal": (CONF, "calibration.conf", None, r"name the robot of its type with --nominal; taskcal robots lists"),
    "five": (CONF.replace(", 1.5e-05]", "]"), "calibration.conf", "ur5", r"conf:2: delta_theta has 5 numbers"),
    **{
        f"number {odd}": (CONF.replace("233.4", odd), "calibration.conf", "ur5", r"conf:4: '.+' is not a number of metres or rad")
        for odd in ("2_3", "２３", "nan", "inf", "1e9", "0x10")
    },
    "text": (CONF.replace("233.4", "far"), "calibration.conf", "ur5", r"conf:4: 'far' is not a number of metres or radians"),
    "another file": ("[x]\ny = 1\n", "calibration.conf", None, r"neither a calibration\.conf nor a urcontrol\.conf"),
    **{
        f"no {key}": ("".join(line for line in CONF.splitlines(keepends=True) if f"delta_{key} " not in line), "calibration.conf",
        "ur5", rf"has no row 'delta_{key} = ")
        for key in ("theta", "a", "d", "alpha")
    },
    "another robot": (CONF, "calibration.conf", "kuka-kr16-2", r"kuka-kr16-2 is not a UR with a standard table"),
    "no link": ("kinematics:\n  shoulder:\n    x: 0\n", "k.yaml", None, r"has no y of the link 'shoulder'"),
    "other yaml": ("joints:\n  a:\n    speed: 1\n", "k.yaml", None, r"k\.yaml:3: 'speed' is not a key of UR's kinematics"),
    "a tag": ("kinematics: !!python/object:os.system\n", "k.yaml", None, r"k\.yaml"),
    "an option too much": (CONF, "k.yaml", "ur5", r"has no use for --nominal"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_file_is_refused(case, tmp_path):
    text, name, nominal, message = WRONG[case]
    with pytest.raises(TaskcalError, match=message):
        describe_robot(write(tmp_path, text, name), nominal=None if nominal is None else load_robot(nominal))


@pytest.mark.parametrize("name", ["k.yaml", "calibration.conf", "p.urp"])
def test_damaged_files_are_read_or_refused(name, tmp_path_factory):
    yaml = "kinematics:\n" + "".join(f"  {link}:\n" + "".join(f"    {k}: 0.1\n" for k in ("x", "y", "z", "roll", "pitch", "yaw")) for link in ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3"))  # fmt: skip  # noqa: E501
    table = "".join(f'<{key} value="0.1, -0.2, 0.3, 0, 1e-3, 0"/>' for key in ("deltaTheta", "a", "d", "alpha"))
    urp = f'<URProgram name="p"><kinematics status="LINEARIZED" validChecksum="true">{table}</kinematics></URProgram>'
    whole = {"k.yaml": yaml, "calibration.conf": CONF, "p.urp": urp}

    @given(generators)
    def law(rng):
        path = tmp_path_factory.mktemp("ur") / name
        damaged = mutated(rng, whole[name].encode(), marks=b"[]:=,# \n\t-.e09\xff\x00")
        path.write_bytes(gzip.compress(damaged) if name == "p.urp" else damaged)
        try:
            described = describe_robot(path, nominal=load_robot("ur5") if name == "calibration.conf" else None)
        except TaskcalError:
            return
        assert len(robot_from(described).joints) == 6

    law()


def test_an_unknown_ending_is_told_what_is_read(tmp_path):
    with pytest.raises(FileError, match=r"no robot's description has; Taskcal reads URDF"):
        describe_robot(write(tmp_path, "", "robot.step"))

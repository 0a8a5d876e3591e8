"""What is exported predicts what the calibration predicts, or is refused with the size of what would be lost."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from taskcal.errors import TaskcalError
from taskcal.export.descriptions import UNSTATED_SPEED, Tree, export_urdf, urdf_text
from taskcal.export.forms import (
    LINKS,
    CalibratedChain,
    export_dh,
    export_flexiv_yaml,
    export_ur_yaml,
    export_xarm_yaml,
    fit_table,
    placed,
    spread_poses,
)
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Harmonics
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.importers.dh import read_dh_table
from taskcal.robot.robot_file import robot_from
from tests.laws.calibrations import calibrated
from tests.laws.robots import cases, industrial
from tests.laws.urdfs import Referee

NAMES = ("ur5", "fanuc-r2000ic-165f", "kuka-kr16-2", "barrett-wam")
"""Standard and modified tables, coupled and reversed axes, seven joints."""


@pytest.fixture(scope="module")
def calibrations() -> dict[str, Calibration]:
    return {name: calibrated(name) for name in NAMES}


@pytest.mark.parametrize("name", NAMES)
def test_a_urdf_predicts_the_same_here_and_in_pinocchio(name, calibrations, tmp_path):
    calibration = calibrations[name]
    path = tmp_path / "robot.urdf"
    path.write_text(export_urdf(calibration).text, encoding="utf-8")
    robot = load_robot(path)
    assert robot.joint_names == calibration.model.robot.joint_names
    np.testing.assert_allclose(robot.limits, calibration.model.robot.limits, rtol=1e-12)
    speeds = calibration.model.robot.speed_limits  # where none is stated, planners refuse zero
    np.testing.assert_allclose(robot.speed_limits, np.where(np.isfinite(speeds), speeds, UNSTATED_SPEED), rtol=1e-12)
    q = spread_poses(calibration, 20)
    expected = calibration.tool_in_base(q)
    np.testing.assert_allclose(ErrorModel(robot).poses(q), expected, atol=1e-10)
    referee = Referee(path)
    for row, T in zip(q, expected, strict=True):
        values = dict(zip(robot.joint_names, row, strict=True))
        np.testing.assert_allclose(referee.pose(values, "tool0"), T, rtol=0.0, atol=1e-10)


def test_random_chains_come_back_from_their_urdf(tmp_path_factory):
    """Couplings, ratios, reversed and sliding joints, and defects of a tenth."""

    @settings(max_examples=25)
    @given(cases())
    def law(case):
        chain = CalibratedChain.of_model(case.model, case.x, case.q)
        np.testing.assert_allclose(chain.poses(case.q), case.model.poses(case.q, case.x), atol=1e-12)
        path = tmp_path_factory.mktemp("urdf") / "robot.urdf"
        path.write_text(urdf_text(Tree.of(chain)), encoding="utf-8")
        referee = Referee(path)
        tip = referee.tree.links[-1]
        for row, T in zip(case.q, case.model.poses(case.q, case.x), strict=True):
            values = dict(zip(case.robot.joint_names, row, strict=True))
            np.testing.assert_allclose(referee.pose(values, tip), T, rtol=0.0, atol=1e-9)
        again = load_robot(path, tip=tip)
        order = [case.robot.joint_names.index(name) for name in again.joint_names]
        assert again.prismatic == tuple(case.robot.prismatic[k] for k in order)
        assert again.inside_limits(case.q[:, order]).all()
        np.testing.assert_allclose(
            ErrorModel(again).poses(case.q[:, order]), case.model.poses(case.q, case.x), atol=1e-9
        )

    law()


def test_axes_that_meet_far_away_leave_no_frame_there(tmp_path):
    """As in a UR's own calibration, whose second axis is nearly parallel to the third: d of 125 m, and back."""
    description = load_robot("ur5").description
    joints = [dict(joint) for joint in description["joint"]]
    for k, far in ((1, 125e3), (2, -125e3)):
        joints[k] = {**joints[k], "dh": {**joints[k]["dh"], "d_mm": joints[k]["dh"].get("d_mm", 0.0) + far}}
    model = ErrorModel(robot_from({**description, "joint": joints}))
    q = np.random.default_rng(0).uniform(-2.0, 2.0, (20, 6))
    x = np.random.default_rng(1).normal(size=len(model)) * 1e-4
    chain = CalibratedChain.of_model(model, x, q)
    path = tmp_path / "robot.urdf"
    path.write_text(urdf_text(Tree.of(chain)), encoding="utf-8")
    text = path.read_text(encoding="utf-8")
    assert max(abs(float(v)) for xyz in re.findall('xyz="([^"]*)"', text) for v in xyz.split()) < 2.0
    assert 'velocity="0.0"' not in text
    again = ErrorModel(load_robot(path))
    np.testing.assert_allclose(again.poses(q), model.poses(q, x), atol=1e-9)


@settings(max_examples=15)
@given(cases(max_joints=7, prismatic=False), st.booleans())
def test_random_chains_are_their_tables(case, nominal):
    """Skew axes with defects of a tenth; without, axes that coincide, meet or are parallel as well."""
    x = np.zeros_like(case.x) if nominal else case.x
    chain = CalibratedChain.of_model(case.model, x, case.q)
    for convention in ("dh", "mdh"):
        T = fit_table(chain, convention).poses(case.q)
        np.testing.assert_allclose(T, case.model.poses(case.q, x), atol=1e-9)


@pytest.mark.parametrize("convention", ["dh", "mdh"])
@pytest.mark.parametrize("name", NAMES)
def test_a_table_with_its_base_and_tool_predicts_the_same(name, convention, calibrations, tmp_path):
    calibration = calibrations[name]
    made = export_dh(calibration, convention)
    path = tmp_path / "table.csv"
    path.write_text(made.text, encoding="utf-8")
    q = spread_poses(calibration, 20)
    robot = read_dh_table(path, convention)
    np.testing.assert_allclose(robot.limits, calibration.model.robot.limits, rtol=1e-8)
    T = made.frames["base"] @ ErrorModel(robot).poses(q) @ made.frames["tool"]
    # a thousandth of a nanometre in millimetres with twelve digits, at 500 m from the axes
    np.testing.assert_allclose(T[:, :3, 3], calibration.tool_in_base(q)[:, :3, 3], atol=1e-9)
    assert np.linalg.norm(made.frames["base"][:3, 3]) < 0.01


def test_a_nominal_robot_is_its_own_table():
    calibration = calibrated("ur5")
    nominal = replace(calibration, z=np.zeros_like(calibration.z))
    made = export_dh(nominal, "dh")
    rows = [line.split(",") for line in made.text.splitlines() if line[0] == "J"]
    alpha, a, d = (np.array([float(row[k]) for row in rows]) for k in (1, 2, 3))
    np.testing.assert_allclose(alpha, [90, 0, 0, 90, -90, 0], atol=1e-9)
    np.testing.assert_allclose(a, [0, -425, -392.25, 0, 0, 0], atol=1e-9)
    np.testing.assert_allclose(d, [89.159, 0, 0, 109.15, 94.65, 82.3], atol=1e-9)
    np.testing.assert_allclose(made.frames["tool"], np.eye(4), atol=1e-12)


def places(text: str) -> dict[str, np.ndarray]:
    """Links of a kinematics file, each in the one before."""
    out, link = {}, ""
    for line in text.splitlines()[1:]:
        key, _, value = line.strip().partition(": ")
        if key in ("hash", "axis"):
            continue
        if not value:
            link = key.rstrip(":")
            out[link] = {}
        else:
            out[link][key] = float(value)
    turn = lambda p: se3.rotation("z", p["yaw"]) @ se3.rotation("y", p["pitch"]) @ se3.rotation("x", p["roll"])  # noqa: E731
    return {link: se3.translation(p["x"], p["y"], p["z"]) @ turn(p) for link, p in out.items()}


def test_urs_yaml_predicts_the_same_with_its_tool(calibrations):
    calibration = calibrations["ur5"]
    made = export_ur_yaml(calibration)
    at = places(made.text)
    assert tuple(at) == LINKS
    for q in spread_poses(calibration, 10):
        T = np.eye(4)
        for link, angle in zip(LINKS, q, strict=True):
            T = T @ at[link] @ se3.rotation("z", float(angle))
        np.testing.assert_allclose(T @ made.frames["tool"], calibration.tool_in_base(q[None])[0], atol=1e-12)
    (x, _, z), along = made.frames["tool"][:3, :3].T, made.frames["tool"][2, 3]
    np.testing.assert_allclose([x[1], along], 0.0, atol=1e-12)  # those are the last link's own
    assert x[0] > 0.9
    assert z[2] > 0.9


MAKERS = {
    "xarm": (
        {
            "joint1": (0.0, 0.0, 0.267, 0.0, 0.0, 0.0),
            "joint2": (0.0, 0.0, 0.0, -1.5708, 0.0, 0.0),
            "joint3": (0.0535, -0.2845, 0.0, 0.0, 0.0, 0.0),
            "joint4": (0.0775, 0.3425, 0.0, -1.5708, 0.0, 0.0),
            "joint5": (0.0, 0.0, 0.0, 1.5708, 0.0, 0.0),
            "joint6": (0.076, 0.097, 0.0, -1.5708, 0.0, 0.0),
        },
        "zzzzzz",
        export_xarm_yaml,
    ),
    "flexiv": (
        {
            "joint1": (0.0, 0.0, 0.155, 0.0, 0.0, -3.141592654),
            "joint2": (0.0, 0.03, 0.21, 0.0, 0.0, 0.0),
            "joint3": (0.0, 0.035, 0.205, 0.0, 0.0, 0.0),
            "joint4": (-0.02, -0.03, 0.19, 0.0, 0.0, -3.141592654),
            "joint5": (-0.02, 0.025, 0.195, 0.0, 0.0, -3.141592654),
            "joint6": (0.0, 0.03, 0.19, 0.0, 0.0, 0.0),
            "joint7": (-0.015, 0.073, 0.11, 0.0, -1.570796327, 0.0),
            "link7_to_flange": (0.0, 0.0, 0.124, 0.0, 0.0, 3.141592654),
        },
        "zyzyzyz",
        export_flexiv_yaml,
    ),
}
"""Place of each joint and its axis: xarm6_default_kinematics.yaml of UFACTORY's xarm_ros; default_kinematics.yaml (Rizon 4) of
Flexiv's flexiv_description, with the flange of isaac_sim_ws's example of
SyncKinematicsYAML. The URDFs of both have the same origins."""


@pytest.mark.parametrize("maker", MAKERS)
def test_makers_yaml_predicts_the_same_with_its_tool(maker, tmp_path, calibrations):
    """And for the nominal robot it is the maker's own."""
    given, axes, export = MAKERS[maker]
    text = "".join(f'<link name="l{k}"/>' for k in range(len(given) + 1))
    for k, (name, (x, y, z, roll, pitch, yaw)) in enumerate(given.items()):
        axis = "0 1 0" if axes[k : k + 1] == "y" else "0 0 1"
        kind = "revolute" if k < len(axes) else "fixed"
        text += (
            f'<joint name="{name}" type="{kind}"><parent link="l{k}"/><child link="l{k + 1}"/><axis xyz="{axis}"/>'
            f'<origin xyz="{x} {y} {z}" rpy="{roll} {pitch} {yaw}"/><limit lower="-2" upper="2" velocity="3" effort="1"/></joint>'
        )
    path = tmp_path / "arm.urdf"
    path.write_text(f'<robot name="arm">{text}</robot>', encoding="utf-8")
    calibration = calibrated(load_robot(path))
    made = export(calibration)
    at = places(made.text)
    assert tuple(at) == tuple(given)
    for q in spread_poses(calibration, 10):
        T = np.eye(4)
        for k, name in enumerate(given):
            T = T @ at[name] @ (se3.rotation(axes[k], float(q[k])) if k < len(axes) else np.eye(4))
        np.testing.assert_allclose(T @ made.frames["tool"], calibration.tool_in_base(q[None])[0], atol=1e-12)
    nominal = places(export(replace(calibration, z=np.zeros_like(calibration.z))).text)
    for name, (x, y, z, *rpy) in given.items():
        expected = se3.pose(Rotation.from_euler("xyz", rpy).as_matrix(), np.array([x, y, z]))
        np.testing.assert_allclose(nominal[name], expected, atol=1e-9)
    with pytest.raises(TaskcalError, match=r"ur5 (has the joints J1, .* joint1, joint2|is not built like a Rizon)"):
        export(calibrations["ur5"])


@pytest.mark.realdata
def test_ur_yaml_of_nominal_model_matches_universal_robots(data_folder):
    """Origins of the joints of the UR5 in Universal_Robots_ROS2_Description, which come from such a file."""
    calibration = calibrated("ur5")
    nominal = replace(calibration, z=np.zeros_like(calibration.z))
    joints = Referee(data_folder / "urdf" / "ur5_yaml_calibration.urdf").tree.joints
    names = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
    for place, name in zip(places(export_ur_yaml(nominal).text).values(), names, strict=True):
        np.testing.assert_allclose(place, joints[f"{name}_joint"].origin, atol=1e-8)


def test_what_no_form_holds_is_refused_with_its_size():
    calibration = calibrated("ur5", Harmonics())
    made = export_urdf(calibration, accept_loss=True)
    assert 1e-6 < made.loss.rms < made.loss.maximum < 5e-3
    rms, largest = (
        rf"{1e3 * size:.4f} mm \({name}\)" for size, name in ((made.loss.rms, "rms"), (made.loss.maximum, "largest"))
    )
    with pytest.raises(TaskcalError, match=f"a URDF cannot hold {made.loss.reasons[0]}: {rms} and {largest}"):
        export_urdf(calibration)
    q = spread_poses(calibration)
    with pytest.raises(TaskcalError, match=r"a table cannot hold .*harmonics"):
        export_dh(calibration, "dh", q)


@pytest.fixture(scope="module")
def sliding() -> Calibration:
    """Of an arm of six axes at their own angles, the first of which slides."""
    arm = industrial(np.random.default_rng(3))
    first = {"name": "J1", "type": "prismatic", "mdh": arm["joint"][0]["mdh"]}
    return calibrated(robot_from({**arm, "joint": [first, *arm["joint"][1:]]}))


def test_a_robot_that_is_no_ur_has_no_such_yaml(calibrations, sliding):
    """Coupled axes, seven of them, one that slides, and six at their own angles that stand otherwise."""
    others = calibrations["fanuc-r2000ic-165f"], calibrations["barrett-wam"], calibrated("abb-irb120")
    for calibration in (*others, sliding):
        with pytest.raises(TaskcalError, match=rf"{calibration.model.robot.name} is not built like a UR"):
            export_ur_yaml(calibration, accept_uncertain=True)


def test_a_table_holds_no_axis_that_slides(sliding):
    with pytest.raises(TaskcalError, match="has prismatic joints, which a table cannot hold"):
        export_dh(sliding, "dh", accept_uncertain=True)


def test_export_rejects_nearly_parallel_axes_for_dh_table(calibrations):
    """Axes too close to parallel for a table are rejected, with the length this would need."""
    calibration = calibrations["ur5"]
    z = calibration.z.copy()
    wanted = [calibration.all_names.index(f"J{j}.{c}") for j in (2, 3) for c in ("rx", "ry")]
    z[wanted] = 0.0
    z[wanted[1]] = 1e-7
    nearly = replace(calibration, z=z)
    with pytest.raises(
        TaskcalError, match=r"a table cannot hold axes .*° from parallel, whose common normal is beyond 1000 m"
    ):
        export_dh(nearly, "dh")
    assert export_dh(nearly, "dh", accept_loss=True).loss.maximum < 1e-6
    z[wanted[3]] = 3e-7
    both = export_dh(replace(calibration, z=z), "dh", accept_loss=True)
    assert len({reason for reason in both.loss.reasons if "from parallel" in reason}) == 2
    assert not both.remarks
    assert both.loss.maximum < 1e-6


def test_rows_of_nearly_parallel_axes_are_remarked():
    """One defect turns one of a UR's parallel axes from the one before: one row, a row later where a twist is counted before it."""
    calibration, rows = calibrated("ur5"), []
    turned = calibration.all_names.index("J3.ry")
    nearly, plainly = (replace(calibration, z=np.eye(len(calibration.z))[turned] * radians) for radians in (1e-3, 2e-2))
    for convention in ("dh", "mdh"):
        (remark,) = export_dh(nearly, convention).remarks
        rows.append(int(remark.split("row ")[1].split()[0]))
        assert not export_dh(plainly, convention).remarks
    assert rows[1] == rows[0] + 1


def test_effects_at_a_single_pose_are_held_whole():
    """What effects add there is its own mean, and goes into the joints' zeros."""
    calibration = calibrated("ur5", Harmonics())
    for q in spread_poses(calibration, 3):
        at = q[None]
        chain = CalibratedChain.of(calibration, at)
        np.testing.assert_allclose(chain.poses(at), calibration.tool_in_base(at), atol=1e-12)
        without = replace(chain, offset=chain.robot.joint_map.offset)
        assert np.abs(without.poses(at) - calibration.tool_in_base(at))[:, :3, 3].max() > 1e-6


@pytest.mark.parametrize("form", [export_urdf, lambda *args, **keys: export_dh(args[0], "mdh", *args[1:], **keys)])
def test_the_stated_loss_is_that_of_the_file_that_is_read_back(form, tmp_path):
    calibration = calibrated("ur5", Harmonics())
    q = spread_poses(calibration, 40)
    made = form(calibration, q, accept_loss=True)
    if made.text.startswith("<?xml"):
        (tmp_path / "robot.urdf").write_text(made.text, encoding="utf-8")
        T = ErrorModel(load_robot(tmp_path / "robot.urdf")).poses(q)
    else:
        (tmp_path / "table.csv").write_text(made.text, encoding="utf-8")
        robot = read_dh_table(tmp_path / "table.csv", "mdh")
        T = made.frames["base"] @ ErrorModel(robot).poses(q) @ made.frames["tool"]
    off = np.linalg.norm((T - calibration.tool_in_base(q))[:, :3, 3], axis=1)
    assert made.loss.rms == pytest.approx(np.sqrt(np.mean(off**2)), rel=1e-4)
    assert made.loss.maximum == pytest.approx(off.max(), rel=1e-4)
    assert made.summary()["loss"]["max_mm"] == 1e3 * made.loss.maximum
    assert made.loss.poses == 40


def test_a_pose_is_stated_as_scipy_has_it():
    """Position in millimetres, a quaternion with its scalar last, and angles about fixed x, y and z."""
    rng = np.random.default_rng(5)
    for turn in Rotation.random(20, random_state=1):
        p = rng.normal(size=3)
        stated = placed(se3.pose(turn.as_matrix(), p))
        np.testing.assert_allclose(stated["position_mm"], 1e3 * p)
        np.testing.assert_allclose(Rotation.from_quat(stated["quaternion"]).as_matrix(), turn.as_matrix(), atol=1e-12)
        np.testing.assert_allclose(stated["rpy_deg"], turn.as_euler("xyz", degrees=True), atol=1e-9)

"""Links and joints for other programs: each of them, read by its own library, is the calibrated robot."""

import csv
import io
import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.spatial.transform import Rotation

from taskcal.errors import FileError, TaskcalError
from taskcal.export.descriptions import (
    BASE,
    Tree,
    draw_sample,
    export_description,
    export_samples,
    export_urdf,
    mjcf_text,
    sdf_text,
    usd_text,
)
from taskcal.export.forms import CalibratedChain, spread_poses
from taskcal.geometry import se3
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Harmonics
from taskcal.robot.importers.urdf import read_looks
from tests.laws.calibrations import calibrated
from tests.laws.robots import cases
from tests.laws.urdfs import telescopic_column


def values_of(tree: Tree, names, row) -> dict[str, float]:
    """Of all joints, those that follow others among them."""
    own = dict(zip(names, map(float, row), strict=True))
    return {j.name: own[j.name] if j.follows is None else j.follows[1] * own[j.follows[0]] for j in tree.joints}


def by_mujoco(tree: Tree, values) -> np.ndarray:
    mujoco = pytest.importorskip("mujoco", reason="the package mujoco is not installed")
    model = mujoco.MjModel.from_xml_string(mjcf_text(tree, {}))
    data = mujoco.MjData(model)
    for name, value in values.items():
        data.joint(name).qpos[0] = value
    mujoco.mj_kinematics(model, data)
    return se3.pose(data.site(tree.tip).xmat.reshape(3, 3), data.site(tree.tip).xpos.copy())


def by_usd(tree: Tree, values) -> np.ndarray:
    """Bodies where all joints are at zero, moved by what hangs between them; see below for the joints' own frames."""
    usd = pytest.importorskip("pxr.Usd", reason="the package usd-core is not installed")
    geom, physics = (pytest.importorskip(f"pxr.{name}", reason="usd-core") for name in ("UsdGeom", "UsdPhysics"))
    stage = usd.Stage.CreateInMemory()
    stage.GetRootLayer().ImportFromString(usd_text(tree))
    cache = geom.XformCache()

    def at(prim) -> np.ndarray:
        return np.array(cache.GetLocalToWorldTransform(prim)).T

    root = stage.GetDefaultPrim()
    poses = {root.GetChild(BASE).GetPath(): np.eye(4)}
    for joint in (prim for prim in root.GetChildren() if prim.IsA(physics.Joint)):
        if joint.GetName() == "world_fixed":
            continue
        both = physics.Joint(joint)
        (parent,), (child,) = both.GetBody0Rel().GetTargets(), both.GetBody1Rel().GetTargets()
        local = [
            se3.pose(Rotation.from_quat([*q.GetImaginary(), q.GetReal()]).as_matrix(), np.array(p))
            for q, p in (
                (both.GetLocalRot0Attr().Get(), both.GetLocalPos0Attr().Get()),
                (both.GetLocalRot1Attr().Get(), both.GetLocalPos1Attr().Get()),
            )
        ]
        between = se3.inverse(at(stage.GetPrimAtPath(parent))) @ at(stage.GetPrimAtPath(child))
        np.testing.assert_allclose(local[0] @ se3.inverse(local[1]), between, atol=2e-6)  # single precision
        value = values[joint.GetName()]
        slides = joint.IsA(physics.PrismaticJoint)
        moved = se3.translation(0.0, 0.0, value) if slides else se3.rotation("z", value)
        poses[child] = poses[parent] @ between @ local[1] @ moved @ se3.inverse(local[1])
    tip = next(prim for prim in stage.Traverse() if prim.GetName() == tree.tip)
    return poses[tip.GetParent().GetPath()] @ se3.inverse(at(tip.GetParent())) @ at(tip)


def by_sdf(tree: Tree, values) -> np.ndarray:
    """As its specification has it: frames that are relative to others, rotations about fixed axes."""
    model = ElementTree.fromstring(sdf_text(tree)).find("model")
    joints = {joint.get("name"): joint for joint in model.findall("joint") if joint.get("type") != "fixed"}
    links = {link.get("name"): link for link in model.findall("link")}

    def pose(element) -> np.ndarray:
        x, y, z, *rpy = map(float, element.find("pose").text.split())
        return se3.pose(Rotation.from_euler("xyz", rpy).as_matrix(), np.array([x, y, z]))

    def at(link: str) -> np.ndarray:
        on = links[link].find("pose").get("relative_to")
        if on is None:
            return pose(links[link])
        joint, axis = joints[on], np.array(list(map(float, joints[on].find("axis/xyz").text.split())))
        assert joint.find("pose").get("relative_to") == joint.find("parent").text
        assert joint.find("child").text == link
        mimic = joint.find("axis/mimic")
        value = values[on]
        if mimic is not None:
            assert value == pytest.approx(float(mimic.find("multiplier").text) * values[mimic.get("joint")])
        slides = joint.get("type") == "prismatic"
        moved = se3.pose(np.eye(3), axis * value) if slides else se3.pose(se3.exp(axis * value), np.zeros(3))
        return at(joint.find("parent").text) @ pose(joint) @ moved @ pose(links[link])

    frame = model.find("frame")
    return at(frame.get("attached_to")) @ pose(frame)


READERS = {"mjcf": by_mujoco, "sdf": by_sdf, "usd": by_usd}


@pytest.mark.parametrize("form", READERS)
def test_random_chains_are_the_same_in_every_form(form):
    """Couplings, ratios, reversed and sliding joints, and defects of a tenth."""

    @settings(max_examples=20)
    @given(cases())
    def law(case):
        tree = Tree.of(CalibratedChain.of_model(case.model, case.x, case.q))
        if form == "usd" and any(joint.follows for joint in tree.joints):
            with pytest.raises(TaskcalError, match="which no joint of USD's physics can do"):
                usd_text(tree)
            return
        for row, T in list(zip(case.q, case.model.poses(case.q, case.x), strict=True))[:3]:
            values = values_of(tree, case.robot.joint_names, row)
            np.testing.assert_allclose(READERS[form](tree, values), T, rtol=0.0, atol=1e-9)

    law()


def test_an_mjcf_is_read_back_as_the_robot(tmp_path):
    """Its couplings, too, as MuJoCo's equalities; whose values it does not set by itself."""
    pytest.importorskip("mujoco", reason="the package mujoco is not installed")
    calibration = calibrated("fanuc-r2000ic-165f")
    path = tmp_path / "robot.xml"
    path.write_text(export_description(calibration, "mjcf").text, encoding="utf-8")
    robot, q = load_robot(path), spread_poses(calibration, 20)
    order = [calibration.model.robot.joint_names.index(name) for name in robot.joint_names]
    np.testing.assert_allclose(robot.tool_poses(q[:, order]), calibration.tool_in_base(q), atol=1e-9)
    np.testing.assert_allclose(robot.limits, calibration.model.robot.limits[order], rtol=1e-9)


MESH = '<visual><origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 0.6"/><geometry><mesh filename="{}" scale="1 2 0.5"/></geometry></visual>'


@pytest.fixture(scope="module")
def dressed(tmp_path_factory):
    """An arm with a mesh on each link, those before its first joint and behind its last among them, and its calibration."""
    trimesh = pytest.importorskip("trimesh", reason="the package trimesh is not installed")
    folder = tmp_path_factory.mktemp("ws") / "arm" / "urdf"
    (folder.parent / "meshes").mkdir(parents=True)
    folder.mkdir()
    box = trimesh.creation.box(bounds=[[0.0, 0.0, 0.0], [0.1, 0.2, 0.3]])
    box.export(folder.parent / "meshes" / "part.stl")
    box.export(folder / "own.stl")
    text = telescopic_column().replace('<mimic joint="lift"/>', "")
    for k, file in enumerate(("package://arm/meshes/part.stl", *["own.stl"] * 6)):
        text = text.replace(f'<link name="l{k}"/>', f'<link name="l{k}">{MESH.format(file)}</link>')
    (folder / "arm.urdf").write_text(text, encoding="utf-8")
    calibration = calibrated(load_robot(folder / "arm.urdf"))
    return folder / "arm.urdf", replace(calibration, z=np.zeros_like(calibration.z)), np.array(box.vertices)


def corners(T: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Corners of the scaled mesh, in an order of their own."""
    p = np.round(se3.apply(T, vertices), 5)
    return np.unique(p + 0.0, axis=0)


def test_meshes_stay_where_the_given_urdf_has_them(dressed, tmp_path):
    """On the nominal robot, at any joints, in each form, from another folder."""
    path, nominal, vertices = dressed
    (tmp_path / "out").mkdir()
    keys = {"meshes": path, "folder": tmp_path / "out", "accept_uncertain": True}
    q = np.array([0.3, 0.2, 0.5, -0.4, 0.7])
    names = nominal.model.robot.joint_names
    looks = read_looks(path)

    def expected(q):
        posed = looks.link_poses(dict(zip(names, q, strict=True)))
        scaled = vertices * [1.0, 2.0, 0.5]
        found = [corners(posed[v.link] @ v.origin, scaled) for v in looks.visuals]
        return sorted(one.tolist() for one in found)

    written = tmp_path / "out" / "arm.urdf"
    written.write_text(export_description(nominal, "urdf", **keys).text, encoding="utf-8")
    again = read_looks(written)
    posed = again.link_poses(dict(zip(names, q, strict=True)))
    scaled = vertices * [1.0, 2.0, 0.5]
    assert sorted(corners(posed[v.link] @ v.origin, scaled).tolist() for v in again.visuals) == expected(q)
    assert all((written.parent / visual.file).is_file() for visual in again.visuals)

    mujoco = pytest.importorskip("mujoco", reason="the package mujoco is not installed")
    written = tmp_path / "out" / "arm.xml"
    written.write_text(export_description(nominal, "mjcf", **keys).text, encoding="utf-8")
    model = mujoco.MjModel.from_xml_path(str(written))
    data = mujoco.MjData(model)
    for name, value in zip(names, q, strict=True):
        data.joint(name).qpos[0] = value
    mujoco.mj_forward(model, data)
    found = []
    for k in range(model.ngeom):
        first, count = model.mesh_vertadr[model.geom_dataid[k]], model.mesh_vertnum[model.geom_dataid[k]]
        T = se3.pose(data.geom_xmat[k].reshape(3, 3), data.geom_xpos[k].copy())
        found.append(corners(T, model.mesh_vert[first : first + count].astype(float)).tolist())
    np.testing.assert_allclose(sorted(found), expected(q), atol=3e-5)

    usd = pytest.importorskip("pxr.Usd", reason="the package usd-core is not installed")
    geom = pytest.importorskip("pxr.UsdGeom", reason="usd-core")
    stage = usd.Stage.CreateInMemory()
    stage.GetRootLayer().ImportFromString(export_description(nominal, "usd", **keys).text)
    cache, found = geom.XformCache(), []
    for prim in (prim for prim in stage.Traverse() if prim.IsA(geom.Mesh)):
        T = np.array(cache.GetLocalToWorldTransform(prim)).T
        found.append(corners(T, np.array(geom.Mesh(prim).GetPointsAttr().Get(), dtype=float)).tolist())
    np.testing.assert_allclose(sorted(found), expected(np.zeros(5)), atol=3e-5)

    model = ElementTree.fromstring(export_description(nominal, "sdf", **keys).text).find("model")
    uris = [uri.text for uri in model.iter("uri")]
    assert len(uris) == 7
    assert all((tmp_path / "out" / uri).is_file() for uri in uris)


def test_meshes_of_another_robot_or_none_are_refused(dressed, tmp_path):
    path, nominal, _ = dressed
    text = path.read_text(encoding="utf-8")
    other = path.parent / "other.urdf"
    other.write_text(text.replace('xyz="0 0 0.5"', 'xyz="0 0.02 0.5"'), encoding="utf-8")
    with pytest.raises(TaskcalError, match="is not the robot that was calibrated, column: its axes are up to 20 mm"):
        export_description(nominal, "urdf", meshes=other, accept_uncertain=True)
    other.write_text(text.replace("own.stl", "lost.stl"), encoding="utf-8")
    with pytest.raises(FileError, match=r"names the mesh 'lost.stl', which is not there, or not one of \.stl"):
        export_description(nominal, "urdf", meshes=other, accept_uncertain=True)


def test_what_no_description_holds_is_refused_with_its_size():
    calibration = calibrated("ur5", Harmonics())
    for form, named in {"mjcf": "an MJCF", "sdf": "an SDF", "usd": "a USD"}.items():
        with pytest.raises(TaskcalError, match=rf"{named} cannot hold gear harmonics .*: \d\.\d+ mm \(rms\)"):
            export_description(calibration, form)
        assert (
            export_description(calibration, form, accept_loss=True).loss.rms
            == export_urdf(calibration, accept_loss=True).loss.rms
        )


def test_samples_spread_as_the_stated_covariance():
    """Of tool points in the measured range, along their principal axes; a sample is the same however many are drawn."""
    calibration = calibrated("ur5")
    q, count = calibration.q[:4], 400
    drawn = np.array([draw_sample(calibration, k).tool_in_base(q)[:, :3, 3] for k in range(count)])
    off = drawn - calibration.tool_in_base(q)[:, :3, 3]
    for k, C in enumerate(calibration.tool_covariance(q, frame="base", model_error=False)[:, :3, :3]):
        values, vectors = np.linalg.eigh(C)
        whitened = off[:, k] @ vectors / np.sqrt(values)
        # four standard deviations of a mean, and of a variance, of so many
        np.testing.assert_allclose(whitened.mean(axis=0), 0.0, atol=4.0 / np.sqrt(count))
        np.testing.assert_allclose(np.cov(whitened.T), np.eye(3), atol=4.0 * np.sqrt(2.0 / count))


def test_samples_are_files_with_a_table_of_their_parameters(tmp_path):
    calibration = calibrated("ur5")
    made, fewer = (export_samples(calibration, "urdf", count, seed=7) for count in (11, 10))
    names = [f"ur5_{k:02d}.urdf" for k in range(11)]
    assert list(made.files) == [*names, "parameters.csv"]
    assert fewer.files["ur5_3.urdf"] == made.files["ur5_03.urdf"]
    rows = list(csv.DictReader(io.StringIO(made.files["parameters.csv"])))
    assert [row["file"] for row in rows] == names
    model = calibration.model
    x = np.array(
        [[float(row[f"{p.name} [{p.shown.name}]"]) / p.shown.factor for p in model.parameters] for row in rows]
    )
    for k in (0, 10):
        (tmp_path / names[k]).write_text(made.files[names[k]], encoding="utf-8")
        T = load_robot(tmp_path / names[k]).tool_poses(calibration.q)
        np.testing.assert_allclose(T, model.poses(calibration.q, x[k]), atol=1e-9)
    assert np.abs(x[0] - calibration.estimate).max() > 1e-6

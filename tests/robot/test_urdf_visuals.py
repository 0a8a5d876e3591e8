"""Links of a URDF stand where the chain that is identified has them, and their meshes where the file says."""

from pathlib import Path

import numpy as np
import pytest

from taskcal.errors import FileError
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.importers.urdf import choose_tip, read_looks

ARM = """<robot name="arm">
  <link name="base"/>
  <link name="upper"><visual><origin xyz="0.1 0 0.2" rpy="0 0 1.5707963267948966"/>
    <geometry><mesh filename="package://arm/meshes/upper.stl" scale="0.001 0.001 0.001"/></geometry></visual>
    <visual><geometry><box size="1 1 1"/></geometry></visual></link>
  <link name="lower"><visual><geometry><mesh filename="meshes/lower.dae"/></geometry></visual></link>
  <link name="finger"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.3"/>
    <axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="slide" type="prismatic"><parent link="upper"/><child link="lower"/><origin xyz="0.4 0 0"/>
    <axis xyz="1 0 0"/><limit lower="0" upper="0.5" effort="1" velocity="1"/></joint>
  <joint name="grip" type="prismatic"><parent link="upper"/><child link="finger"/><axis xyz="0 1 0"/>
    <mimic joint="shoulder" multiplier="0.2" offset="0.1"/><limit lower="0" upper="0.5" effort="1" velocity="1"/></joint>
</robot>"""


def test_meshes_follow_their_links(tmp_path: Path) -> None:
    """Meshes stand where the file says and links follow their joints."""
    path = tmp_path / "arm.urdf"
    path.write_text(ARM)
    looks = read_looks(path)
    assert [(v.link, v.file) for v in looks.visuals] == [
        ("upper", "package://arm/meshes/upper.stl"),
        ("lower", "meshes/lower.dae"),
    ]
    assert looks.visuals[0].scale == (0.001, 0.001, 0.001)
    np.testing.assert_allclose(looks.visuals[0].origin @ [1, 0, 0, 1], [0.1, 1.0, 0.2, 1.0], atol=1e-12)
    poses = looks.link_poses({"shoulder": np.pi / 2, "slide": 0.25})
    np.testing.assert_allclose(poses["lower"][:3, 3], [0.0, 0.65, 0.3], atol=1e-12)
    np.testing.assert_allclose(poses["finger"][:3, 3], [-0.1 - 0.1 * np.pi, 0.0, 0.3], atol=1e-12)  # along -x by now


def test_mesh_without_numbers_is_refused_by_line(tmp_path: Path) -> None:
    """A mesh whose place is not numbers is named with its line."""
    path = tmp_path / "arm.urdf"
    path.write_text(ARM.replace('xyz="0.1 0 0.2"', 'xyz="0.1 0 high"'))
    with pytest.raises(FileError, match=r"arm\.urdf:3: .*'high' is not a number"):
        read_looks(path)


@pytest.mark.realdata
def test_the_tip_stands_where_the_nominal_robot_has_its_tool(data_folder: Path) -> None:
    rng = np.random.default_rng(0)
    files = sorted((data_folder / "urdf").glob("*.urdf"))
    assert len(files) > 10
    for path in files:
        looks = read_looks(path)
        try:
            tip = choose_tip(looks.tree)
        except FileError:
            continue
        model = ErrorModel(load_robot(path))
        q = rng.uniform(-0.5, 0.5, len(model.robot.joints))
        poses = looks.link_poses(dict(zip(model.robot.joint_names, q, strict=True)))
        np.testing.assert_allclose(poses[tip], model.nominal.poses(q[None])[0], atol=1e-9, err_msg=path.name)

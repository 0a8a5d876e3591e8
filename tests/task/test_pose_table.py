import numpy as np
import pytest
from hypothesis import given
from scipy.spatial.transform import Rotation

from taskcal.errors import FileError
from taskcal.tables.forms import read_csv
from taskcal.task.orientation import read_tool_poses
from tests.laws.robots import generators
from tests.robot_programs.fuzz import mutated

R = Rotation.from_euler("ZYX", [30.0, -20.0, 10.0], degrees=True)
QUATERNION = ",".join(map(repr, R.as_quat().tolist()))


def table(folder, header, line):
    path = folder / "poses.csv"
    path.write_text(f"x_mm,y_mm,z_mm,{header}\n100,200,300,{line}\n", encoding="utf-8")
    return read_csv(path)


@pytest.mark.parametrize(
    ("header", "line"),
    [
        ("qx,qy,qz,qw", QUATERNION),
        ("roll_deg,pitch_deg,yaw_deg", "10,-20,30"),
        ("A_deg,B_deg,C_deg", "30,-20,10"),
        ("W_deg,P_deg,R_deg", "10,-20,30"),
    ],
)
def test_every_way_to_write_an_orientation_is_the_same_pose(header, line, tmp_path):
    T = read_tool_poses(table(tmp_path, header, line))[0]
    np.testing.assert_allclose(T[:3, :3], R.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(T[:3, 3], [0.1, 0.2, 0.3])


def test_a_direction_is_the_tools_z_axis(tmp_path):
    T = read_tool_poses(table(tmp_path, "i,j,k", "0,0.6,-0.8"))[0]
    np.testing.assert_allclose(T[:3, 2], [0.0, 0.6, -0.8], atol=1e-15)
    np.testing.assert_allclose(T[:3, :3].T @ T[:3, :3], np.eye(3), atol=1e-15)


@pytest.mark.parametrize(
    ("header", "line", "message"),
    [
        ("weight", "1", r"says no orientation; a table of poses has the columns"),
        ("i,j,k,roll_deg,pitch_deg,yaw_deg", "0,0,1,0,0,0", r"says the orientation twice, rpy and direction"),
        ("a_deg,b_deg", "1,2", r"has 'a_deg' but no column 'c_deg'; an orientation needs all three"),
        ("i,j,k", "0,1,1", r"the direction has length 1\.4142"),
    ],
)
def test_what_is_no_orientation_is_refused(header, line, message, tmp_path):
    with pytest.raises(FileError, match=message):
        read_tool_poses(table(tmp_path, header, line))


@given(generators)
def test_damaged_tables_are_read_or_refused(tmp_path_factory, rng):
    path = tmp_path_factory.mktemp("poses") / "poses.csv"
    text = "x_mm,y_mm,z_mm,a_deg,b_deg,c_deg\n100,200,300,30,-20,10\n110,210,310,40,-30,20\n"
    path.write_bytes(mutated(rng, text.encode(), marks=b',;\n\t-.e09\xff\x00#"'))
    try:
        T = read_tool_poses(read_csv(path))
    except FileError:
        return
    np.testing.assert_allclose(np.linalg.det(T[:, :3, :3]), 1.0, atol=1e-9)

"""Measured cycles from files, and what each wrong cell is told."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from taskcal.campaigns.performance import read_path_cycles, read_pose_cycles
from taskcal.errors import FileError

POSES = "pose,cycle,command_x_mm,command_y_mm,command_z_mm,x_mm,y_mm,z_mm"
POSE_ROWS = ["P1,1,1000,0,500,1000.1,0,500", "P2,1,0,0,0,0.5,0,0", "P1,2,1000,0,500,1000.3,0,500"]
PATH = "section,cycle,command_x_mm,command_y_mm,command_z_mm,x_mm,y_mm,z_mm"
PATH_ROWS = ["a,1,0,0,0,0,0.1,0", "b,1,10,0,0,10,0.2,0", "a,2,0,0,0,0,0.3,0", "b,2,10,0,0,10,0.2,0.1"]


def write(folder, header, rows, name="measured.csv"):
    path = folder / name
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


def test_poses_are_gathered_in_metres(tmp_path):
    first, second = read_pose_cycles(write(tmp_path, POSES, POSE_ROWS))
    assert (first.pose, first.direction, first.cycles) == ("P1", "", ("1", "2"))
    np.testing.assert_allclose(first.attained, [[1.0001, 0, 0.5], [1.0003, 0, 0.5]])
    np.testing.assert_allclose(first.commanded, [1.0, 0.0, 0.5])
    assert first.rotations is None
    assert first.commanded_rotation is None
    assert (second.pose, second.cycles) == ("P2", ("1",))


def test_directions_orientations_and_other_letters(tmp_path):
    header = "Pose,Direction,Cycle,X_mm,Y_mm,Z_mm,qx,qy,qz,qw,command_qx,command_qy,command_qz,command_qw"
    q = Rotation.from_euler("z", 30, degrees=True).as_quat()
    numbers = ",".join(f"{value:.6f}" for value in q)
    rows = [f"P1,{way},1,1,2,3,{numbers},0,0,0,1" for way in ("left", "right")]
    left, right = read_pose_cycles(write(tmp_path, header, rows))
    assert (left.direction, right.direction) == ("left", "right")
    np.testing.assert_allclose(left.rotations[0], Rotation.from_quat(q).as_matrix(), atol=1e-5)
    np.testing.assert_array_equal(left.commanded_rotation, np.eye(3))
    assert left.commanded is None


def test_passes_with_their_commands_in_one_file(tmp_path):
    found = read_path_cycles(write(tmp_path, PATH, PATH_ROWS))
    assert (found.sections, found.cycles) == (("a", "b"), ("1", "2"))
    np.testing.assert_allclose(found.commanded, [[0, 0, 0], [0.01, 0, 0]])
    np.testing.assert_allclose(found.attained[1], [[0, 3e-4, 0], [0.01, 2e-4, 1e-4]])


def test_passes_beside_a_file_of_the_path(tmp_path):
    path = write(tmp_path, "x_mm,y_mm,z_mm", ["0,0,0", "10,0,0", "10,10,0"], "path.csv")
    rows = [f"{cycle},{x},0.1,0" for cycle, count in (("1", 5), ("2", 7)) for x in np.linspace(0, 10, count)]
    found = read_path_cycles(write(tmp_path, "cycle,x_mm,y_mm,z_mm", rows), path)
    assert found.sections == ("0", "1", "2")
    assert [len(samples) for samples in found.attained] == [5, 7]


WRONG_POSES = {
    "no cycle": (POSES.replace("cycle", "time"), POSE_ROWS, "has no column 'cycle'"),
    "a path": (PATH, PATH_ROWS, "has 'section' in place of 'pose'.*--path"),
    "no measurement": (POSES, [], "has no measurements below its header"),
    "empty": (POSES, [*POSE_ROWS, "P1,3,1000,0,500,,0,500"], "measured.csv:5: column 'x_mm': the cell is empty; give"),
    "no number": (POSES, [*POSE_ROWS, "P1,3,1000,0,500,one,0,500"], "5: column 'x_mm': 'one' is not a number"),
    "no name": (POSES, [",1,1000,0,500,1,0,500"], "2: column 'pose': the cell is empty; name the pose"),
    "twice": (POSES, [*POSE_ROWS, POSE_ROWS[0]], "5: column 'cycle': cycle '1' of pose 'P1' is in line 2 already"),
    "another command": (
        POSES,
        [*POSE_ROWS, "P1,3,1000,1,500,1000,0,500"],
        "5: column 'command_y_mm': 1 is another command for pose 'P1' than 0 in line 2",
    ),
    "half a command": (
        POSES.replace("command_z_mm", "note"),
        POSE_ROWS,
        "has 'command_x_mm' but no column 'command_z_mm'",
    ),
    "unknown": (POSES.replace("cycle", "cycle,note"), ["P1,1,warm,0,0,0,0,0,0"], "unknown column 'note'; it may have"),
    "two alike": (POSES.replace("pose", "pose,Pose"), ["P,P1,1,0,0,0,0,0,0"], "named 'pose' but for letter case"),
    "lost": (
        POSES,
        [*POSE_ROWS, "P1,3,1000,0,500,0,0,0"],
        "5: column 'x_mm': 0 in all three.*where pose 'P1' is, is no meas",
    ),
    "lost by nines": (
        POSES,
        [*POSE_ROWS, "P2,3,0,0,0,9999,9999,9999"],
        "5: column 'x_mm': 9999 in all three.*a lost beam",
    ),
    "lost, not commanded": (
        "pose,cycle,x_mm,y_mm,z_mm",
        ["P,1,0.000,0,0", "P,2,9,9,9", "P,3,9,9.1,9"],
        "2: column 'x_mm': 0 in all three.*leave out the row",
    ),
    "quaternion": ("pose,cycle,x_mm,y_mm,z_mm,qx,qy,qz,qw", ["P,1,0,0,0,1,1,0,0"], "2: column 'qx'.*length 1.4142"),
}


@pytest.mark.parametrize(("header", "rows", "message"), WRONG_POSES.values(), ids=WRONG_POSES)
def test_wrong_poses_are_told_where_and_what(tmp_path, header, rows, message):
    with pytest.raises(FileError, match=message):
        read_pose_cycles(write(tmp_path, header, rows))


WRONG_PATHS = {
    "no section": (POSES, POSE_ROWS, "has no column 'section'.*--command"),
    "new section": (PATH, [*PATH_ROWS, "c,2,9,0,0,9,0,0"], "6: column 'section': the first pass has no section 'c'"),
    "twice": (PATH, [*PATH_ROWS, PATH_ROWS[-1]], "6: column 'section': section 'b' of pass '2' is in line 5 already"),
    "another command": (PATH, [*PATH_ROWS[:3], "b,2,11,0,0,9,0,0"], "11 is another command for section 'b' than 10"),
    "lost": (PATH, [*PATH_ROWS[:3], "b,2,10,0,0,-99999.9,-99999.9,-99999.9"], "5: column 'x_mm': 99999.9 in all three"),
    "one row": (PATH, PATH_ROWS[:3], "4: column 'cycle': pass '2' has one row"),
}


@pytest.mark.parametrize(("header", "rows", "message"), WRONG_PATHS.values(), ids=WRONG_PATHS)
def test_wrong_passes_are_told_where_and_what(tmp_path, header, rows, message):
    with pytest.raises(FileError, match=message):
        read_path_cycles(write(tmp_path, header, rows))


def test_zeros_where_zero_is_meant_are_measured(tmp_path):
    rows = ["P1,1,0,0,0,0,0,0", "P1,2,0,0,0,0.1,0,0", "P2,1,9999,9999,9999,9999,9999,9999"]
    assert [len(pose.attained) for pose in read_pose_cycles(write(tmp_path, POSES, rows))] == [2, 1]
    path = write(tmp_path, "x_mm,y_mm,z_mm", ["-10,0,0", "10,0,0"], "path.csv")
    assert (
        len(read_path_cycles(write(tmp_path, "cycle,x_mm,y_mm,z_mm", ["1,-9,0,0", "1,0,0,0"]), path).attained[0]) == 2
    )


def test_a_path_of_its_own_has_points_only(tmp_path):
    measured = write(tmp_path, "cycle,x_mm,y_mm,z_mm", ["1,0,0,0", "1,1,0,0"])
    path = write(tmp_path, "point,x_mm,y_mm,z_mm", ["1,0,0,0"], "path.csv")
    with pytest.raises(FileError, match=r"path.csv:1: unknown column 'point'; it may have x_mm y_mm z_mm, qx qy qz qw"):
        read_path_cycles(measured, path)

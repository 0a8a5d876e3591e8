"""Orientations in the forms that instruments write."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from taskcal.errors import FileError
from taskcal.reading.options import ReadOptions
from taskcal.reading.reader import read_campaign
from tests.reading.measured_files import NAMED, ROBOT, measured, write

ORIENTATIONS = {
    "A B C": ("A B C", lambda R: Rotation.from_matrix(R).as_euler("ZYX", degrees=True), {}),
    "W P R": ("W P R", lambda R: Rotation.from_matrix(R).as_euler("xyz", degrees=True), {}),
    "roll, pitch, yaw": ("roll_rad pitch_rad yaw_rad", lambda R: Rotation.from_matrix(R).as_euler("xyz"), {}),
    "matrix": (" ".join(f"r{i}{j}" for i in "123" for j in "123"), lambda R: R.ravel(), {}),
    "matrix from zero": (" ".join(f"m{i}{j}" for i in "012" for j in "012"), lambda R: R.ravel(), {}),
    "axes of the matrix": ("nx ny nz ox oy oz ax ay az", lambda R: R.T.ravel(), {}),
    "quaternion, scalar first": ("q0 q1 q2 q3", lambda R: np.roll(Rotation.from_matrix(R).as_quat(), 1), {}),
    "rotation vector": ("Rx Ry Rz", lambda R: Rotation.from_matrix(R).as_rotvec(), {"angles": "rotation-vector-rad"}),
    "moving axes": ("Rx Ry Rz", lambda R: Rotation.from_matrix(R).as_euler("XYZ", degrees=True), {"angles": "moving-xyz-deg"}),
}  # fmt: skip


@pytest.mark.parametrize("case", ORIENTATIONS)
def test_orientations_mean_the_same_in_every_form(tmp_path, case):
    columns, written, stated = ORIENTATIONS[case]
    names = NAMED.replace("q", "J")
    q, T, _ = measured(4)
    rows = [[k, *np.degrees(q[k]), *T[k, :3, 3] * 1e3, *written(T[k, :3, :3])] for k in range(4)]
    campaign = read_campaign(
        write(tmp_path, "a.txt", f"id {names} x_mm y_mm z_mm {columns}", rows), ROBOT, options=ReadOptions(**stated)
    )
    np.testing.assert_allclose(campaign.rotations, T[:, :3, :3], atol=1e-9)


def test_angles_of_unknown_order_are_left_out_and_said(tmp_path):
    q, T, _ = measured(4)
    rows = [[*np.degrees(q[k]), *T[k, :3, 3] * 1e3, 1, 2, 3] for k in range(4)]
    campaign = read_campaign(write(tmp_path, "a.txt", f"{NAMED} x_mm y_mm z_mm Rx Ry Rz", rows), ROBOT)
    assert campaign.rotations is None
    assert campaign.notes[0].startswith("Rx Ry Rz are left out, since they may be angles about fixed or moving axes")


def test_a_mirrored_matrix_is_refused(tmp_path):
    q, T, _ = measured(2)
    rows = [[*np.degrees(q[k]), *T[k, :3, 3] * 1e3, *(T[k, :3, :3] * [1, -1, 1]).ravel()] for k in range(2)]
    header = f"{NAMED} x_mm y_mm z_mm " + ORIENTATIONS["matrix"][0]
    with pytest.raises(FileError, match=r"a\.txt:2: column 'r11': the matrix mirrors; is an axis or a sign swapped\?"):
        read_campaign(write(tmp_path, "a.txt", header, rows), ROBOT)


CONVENTIONS = {
    "W P R": {"wpr": "xyz", "moving-xyz-deg": "XYZ"},
    "A B C": {"abc": "ZYX", "fixed-xyz-deg": "xyz", "moving-xyz-deg": "XYZ"},
    "roll pitch yaw": {"rpy-deg": "xyz", "moving-xyz-deg": "XYZ"},
    "roll_deg pitch_deg yaw_deg": {"rpy-deg": "xyz", "moving-xyz-deg": "XYZ"},
    "Rx Ry Rz": {"fixed-xyz-deg": "xyz", "moving-xyz-deg": "XYZ", "rotation-vector-rad": None},
}
OPEN = [(header, form) for header, forms in CONVENTIONS.items() for form in forms]


def angles_of(folder, header, sequence, *, poses, noise=2e-3):
    """A file of a real robot's orientations, and what they are; a rotation vector without a sequence."""
    q, T, _ = measured(poses)
    rng = np.random.default_rng(1)
    R = Rotation.from_rotvec(noise * rng.normal(size=(poses, 3))) * Rotation.from_matrix(T[:, :3, :3])
    angles = R.as_rotvec() if sequence is None else R.as_euler(sequence, degrees=True)
    rows = [[k, *np.degrees(q[k]), *T[k, :3, 3] * 1e3, *angles[k]] for k in range(poses)]
    return write(folder, "a.txt", f"id {NAMED} x_mm y_mm z_mm {header}", rows), R.as_matrix()


@pytest.mark.parametrize(("header", "form"), OPEN)
def test_the_robot_tells_which_convention_angles_follow(tmp_path, header, form):
    path, R = angles_of(tmp_path, header, CONVENTIONS[header][form], poses=8)
    campaign = read_campaign(path, ROBOT)
    np.testing.assert_allclose(campaign.rotations, R, atol=1e-9)
    (note,) = campaign.notes
    assert note.startswith(f"{header} are read as {form}, by what fits")
    assert "--angles" in note


@pytest.mark.parametrize(
    ("header", "assumed", "other"), [("W P R", "wpr", "moving-xyz"), ("A B C", "abc", "fixed-xyz")]
)
def test_what_too_few_poses_leave_open_is_assumed_and_said(tmp_path, header, assumed, other):
    path, R = angles_of(tmp_path, header, {"wpr": "xyz", "abc": "ZYX"}[assumed], poses=4)
    campaign = read_campaign(path, ROBOT)
    np.testing.assert_allclose(campaign.rotations, R, atol=1e-9)
    (note,) = campaign.notes
    assert note.startswith(f"{header} are read as {assumed}, the usual meaning of these names; if they are {other}")
    assert note.endswith("state --angles")


def test_angles_of_no_known_convention_are_reported(tmp_path):
    path, _ = angles_of(tmp_path, "W P R", "zxz", poses=8)
    campaign = read_campaign(path, ROBOT)
    assert "none fits the nominal robot" in campaign.notes[0]
    assert "All rotations are left out" in campaign.notes[1]
    assert campaign.rotations is None


def test_a_convention_that_is_stated_is_not_questioned(tmp_path):
    path, R = angles_of(tmp_path, "W P R", "XYZ", poses=8)
    campaign = read_campaign(path, ROBOT, options=ReadOptions(angles="moving-xyz-deg"))
    np.testing.assert_allclose(campaign.rotations, R, atol=1e-9)
    assert campaign.notes == ()


def test_calculated_angles_are_not_taken_for_measured(tmp_path):
    path, _ = angles_of(tmp_path, "Rx Ry Rz", "XYZ", poses=8, noise=0.0)
    campaign = read_campaign(path, ROBOT)
    assert campaign.rotations is None
    assert campaign.notes[0].startswith("Rx Ry Rz are left out, since they are what the nominal robot calculates")

"""Orientations in the forms that instruments write."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from taskcal.errors import FileError
from taskcal.measurement.reader import ReadOptions, read_campaign
from tests.measurement.measured_files import NAMED, ROBOT, measured, write

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

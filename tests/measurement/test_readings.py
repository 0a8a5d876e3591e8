"""Files that hold joints, points or both, in the forms that instruments write."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from taskcal.errors import FileError, TaskcalError
from taskcal.measurement.reader import ReadOptions, read_campaign
from taskcal.measurement.readings import read_readings
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.tabular.csv_form import TableForm

ROBOT = load_robot("ur5")
T_TRACKER_BASE = np.block(
    [[Rotation.from_euler("z", 0.7).as_matrix(), np.array([[2.0], [-1.0], [0.3]])], [np.zeros((1, 3)), 1]]
)
OFFSETS = {"A": np.array([0.02, 0.03, 0.1]), "B": np.array([-0.08, 0.0, 0.12])}


def measured(n=30, seed=0):
    """Joints, and where the nominal robot's targets are."""
    q = np.random.default_rng(seed).uniform(-2.0, 2.0, (n, 6))
    T = T_TRACKER_BASE @ ErrorModel(ROBOT).poses(q)
    return q, T, {name: (T[:, :3, :3] @ t) + T[:, :3, 3] for name, t in OFFSETS.items()}


def write(folder, name, header, rows):
    path = folder / name
    lines = [] if header is None else [header]
    path.write_text("\n".join([*lines, *(" ".join(map(str, row)) for row in rows)]) + "\n")
    return path


NAMED = " ".join(f"J{k}_deg" for k in range(1, 7))


def test_one_target_a_row_is_the_same_as_targets_side_by_side(tmp_path):
    q, _, points = measured(5)
    wide = [[k, *np.degrees(q[k]), *points["A"][k] * 1e3, *points["B"][k] * 1e3] for k in range(5)]
    long = [
        [k, name, *np.degrees(q[k]), *points[name][k] * 1e3]
        for k in range(5)
        for name in points
        if (k, name) != (2, "B")
    ]
    expected = read_campaign(
        write(tmp_path, "w.txt", f"id {NAMED} A_x_mm A_y_mm A_z_mm B_x_mm B_y_mm B_z_mm", wide), ROBOT
    )
    campaign = read_campaign(write(tmp_path, "l.txt", f"id target {NAMED} x_mm y_mm z_mm", long), ROBOT)
    assert campaign.targets == expected.targets == ("A", "B")
    np.testing.assert_array_equal(campaign.valid, np.array([[True, True]] * 2 + [[True, False]] + [[True, True]] * 2))
    np.testing.assert_allclose(campaign.points[campaign.valid], expected.points[campaign.valid], atol=1e-12)
    np.testing.assert_array_equal(campaign.q, expected.q)


def test_shots_of_one_pose_are_averaged_and_their_scatter_said(tmp_path):
    q, _, points = measured(6)
    rng = np.random.default_rng(1)
    shots = [
        [k, *np.degrees(q[k]), *(points["A"][k] + rng.normal(0, 5e-5, 3)) * 1e3] for k in range(6) for _ in range(200)
    ]
    campaign = read_campaign(write(tmp_path, "a.txt", f"id {NAMED} x_mm y_mm z_mm", shots), ROBOT)
    np.testing.assert_allclose(campaign.points[:, 0], points["A"], atol=2e-5)
    (note,) = campaign.notes
    assert note.startswith("1200 rows are 6 poses measured up to 200 times, and averaged; the shots scatter by 0.0")
    assert float(note.split("by ")[1].split()[0]) == pytest.approx(0.05, rel=0.05)


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


@pytest.mark.parametrize("angle", ["deg", "rad"])
@pytest.mark.parametrize(("length", "per_metre"), [("mm", 1e3), ("m", 1.0), ("in", 1 / 0.0254)])
def test_units_that_are_stated_nowhere_are_told_by_the_robots_motion(tmp_path, angle, length, per_metre):
    q, _, points = measured()
    joints = np.degrees(q) if angle == "deg" else q
    rows = [[*joints[k], *points["A"][k] * per_metre] for k in range(len(q))]
    campaign = read_campaign(write(tmp_path, "a.txt", "A1 A2 A3 A4 A5 A6 X Y Z", rows), ROBOT)
    np.testing.assert_allclose(campaign.q, q, atol=1e-12)
    np.testing.assert_allclose(campaign.points[:, 0], points["A"], atol=1e-9)
    assert campaign.notes == (
        f"joints without a unit are read as {'degrees' if angle == 'deg' else 'radians'}, by their size",
        f"positions without a unit are read in {length}, by how far ur5 moved",
    )


def test_units_that_nothing_tells_are_not_guessed(tmp_path):
    q, _, points = measured(3)
    rows = [[*q[k], *points["A"][k]] for k in range(3)]
    with pytest.raises(FileError, match=r"column 'A1': the unit is not stated; name the column A1_deg or A1_rad"):
        read_campaign(write(tmp_path, "a.txt", "A1 A2 A3 A4 A5 A6 X Y Z", rows), ROBOT)
    q, _, points = measured()
    rows = [[*np.degrees(q[k]), *points["A"][k] * 100] for k in range(len(q))]
    with pytest.raises(FileError, match="in mm, m or inches the points would not spread as the robot's flange does"):
        read_campaign(write(tmp_path, "a.txt", f"{NAMED} X Y Z", rows), ROBOT)


def test_files_without_names_have_one_reading_or_are_asked_about(tmp_path):
    q, _, points = measured()
    rows = [[*np.degrees(q[k]), *points["A"][k] * 1e3] for k in range(len(q))]
    campaign = read_campaign(write(tmp_path, "a.txt", None, rows), ROBOT)
    np.testing.assert_allclose(campaign.points[:, 0], points["A"], atol=1e-9)
    assert "the file names no columns; they are read as J1 J2 J3 J4 J5 J6 x y z" in campaign.notes[0]
    path = write(tmp_path, "b.txt", None, [[*row, 1.5] for row in rows])
    with pytest.raises(FileError, match=r"names no columns, and its 10 columns .* name them: --columns \"id J1"):
        read_campaign(path, ROBOT)
    columns = ("J1_deg", "J2_deg", "J3_deg", "J4_deg", "J5_deg", "J6_deg", "x_mm", "y_mm", "z_mm", "-")
    named = read_campaign(path, ROBOT, options=ReadOptions(form=TableForm(columns=columns)))
    np.testing.assert_allclose(named.points, campaign.points)


def two_files(folder, ids, kept=None, joint_rows=None):
    q, _, points = measured(40)
    some = np.arange(40) if kept is None else kept
    mine = np.arange(40) if joint_rows is None else joint_rows
    first = [[*([f"p{k}"] if ids else []), *np.degrees(q[k])] for k in mine]
    second = [[*([f"p{k}"] if ids else []), *points["A"][k] * 1e3] for k in some]
    name = "id " if ids else ""
    return (
        write(folder, "j.txt", name + NAMED, first),
        write(folder, "p.txt", f"{name}x_mm y_mm z_mm", second),
        q,
        points["A"],
    )


@pytest.mark.parametrize(
    ("ids", "kept", "joint_rows", "note"),
    [
        (True, np.random.default_rng(0).permutation(40), None, "by 40 ids"),
        (True, np.arange(3, 39), None, "by 36 ids; 4 ids are in one file only and left out"),
        (False, None, None, "by their order, 40 of each"),
        (False, np.arange(3, 40), None, "by geometry: 37 fit together, 100% of the shorter file"),
        (False, np.delete(np.arange(40), [17, 30]), None, "by geometry: 38 fit together"),
        (
            False,
            np.delete(np.arange(40), 20),
            np.delete(np.arange(40), [3, 33]),
            "by geometry: 37 fit together, 97% of",
        ),
    ],
    ids=["shuffled", "some", "order", "shifted", "lost", "both"],
)
def test_joints_and_points_of_two_files_find_each_other(tmp_path, ids, kept, joint_rows, note):
    joints, points, q, p = two_files(tmp_path, ids, kept, joint_rows)
    campaign = read_campaign(joints, ROBOT, options=ReadOptions(points=points))
    assert note in campaign.notes[-1]
    for row in range(len(campaign)):
        k = int(np.argmin(np.abs(q - campaign.q[row]).max(axis=1)))
        np.testing.assert_allclose(campaign.points[row, 0], p[k], atol=1e-9)


def test_rows_that_cannot_be_paired_are_refused(tmp_path):
    joints, points, _, _ = two_files(tmp_path, False, np.random.default_rng(0).permutation(40)[:30])
    with pytest.raises(FileError, match=r"p\.txt has 30 rows, j\.txt 40, .* give both files ids"):
        read_campaign(joints, ROBOT, options=ReadOptions(points=points))
    with pytest.raises(FileError, match="both files hold joints"):
        read_campaign(joints, ROBOT, options=ReadOptions(points=joints))


text = st.text(st.sampled_from("0123456789.,;:-+eE \t\n\"'#/[]()xyzqJA_m°dégrnai="), max_size=200)


@settings(max_examples=300)
@given(text, st.booleans())
def test_any_text_is_read_or_refused_with_its_name(tmp_path_factory, content, headed):
    path = tmp_path_factory.mktemp("fuzz") / "any.csv"
    path.write_text((NAMED + " x_mm y_mm z_mm\n" if headed else "") + content, encoding="utf-8")
    try:
        read_readings(path, ROBOT)
    except TaskcalError as refusal:
        if "any.csv" not in str(refusal):
            raise


WHOLE = (NAMED.replace(" ", ";") + ";x_mm;y_mm;z_mm\n" + "10,5;20;-30;1;2;3;1000,25;-200;50\n" * 6).encode("utf-16")


@settings(max_examples=300)
@given(st.integers(0, len(WHOLE) - 1), st.binary(max_size=12), st.integers(0, 20))
def test_damaged_bytes_are_read_or_refused(tmp_path_factory, at, noise, dropped):
    path = tmp_path_factory.mktemp("fuzz") / "any.csv"
    path.write_bytes(WHOLE[:at] + noise + WHOLE[at + dropped :])
    try:
        read_readings(path, ROBOT)
    except TaskcalError as refusal:
        if "any.csv" not in str(refusal):
            raise

"""Tables with titles, groups, units and statistics around them, as people and instruments leave them."""

import numpy as np
import pytest

from taskcal.errors import FileError
from taskcal.reading.options import ReadOptions
from taskcal.reading.reader import read_campaign, read_measurements
from tests.reading.known_campaign import BARE, DEG, JOINTS, MM, ROBOT, XYZ, N, P, Q, R, lines, write

NUMBERED = [f"P{k}" for k in range(N)]
HEAD = ["id", *JOINTS, *XYZ]
ROWS = lines(NUMBERED, DEG, MM)
PLAIN = [*BARE, "X", "Y", "Z"]
BELOW = ["Mean", "Std. Dev.", "RMS error", "Max. error", "Durchschnitt", "Std.abw.", "3 sigma", "Mean value:"]


def summed(*names):
    """Rows of ones behind names."""
    return [name + 9 * ",1" for name in names]


def marked(rows, k, *cells):
    """Rows with other last cells in one."""
    kept = rows[k].split(",")[: -len(cells)]
    return [*rows[:k], ",".join([*kept, *cells]), *rows[k + 1 :]]


def german(values):
    """With points between thousands and decimal commas."""
    return f"{values:,.6f}".translate(str.maketrans(",.", ".,"))


def second_target(row, k):
    return row + "," + ",".join(f"{v:.9g}" for v in MM[k] + R[k] @ [40.0, 0.0, 0.0])


RANGE = np.linalg.norm(MM, axis=1)
AZIMUTH, ELEVATION = np.degrees(np.arctan2(MM[:, 1], MM[:, 0])), np.degrees(np.arcsin(MM[:, 2] / RANGE))
TWO_ROWS = [second_target(row, k) for k, row in enumerate(lines(NUMBERED, DEG, MM))]
MEAN = ",".join(f"{v:.4f}" for v in (*DEG.mean(axis=0), *MM.mean(axis=0)))
MATRIX = [f"R[{i}][{j}]" for i in range(3) for j in range(3)]
ROS = ["elbow_joint", "shoulder_lift_joint", "shoulder_pan_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"]

READ = {
    "statistics below": (HEAD, [*ROWS, *summed(*BELOW)], "rows below the table are left out: Mean (line 14)"),
    "a mean in the first joint's column": (HEAD[1:], [*lines(DEG, MM), "Average,,,,,,1,2,3"], "Average (line 14)"),
    "a mean without its name": (PLAIN, [*lines(DEG, MM), MEAN], "(line 14) are the mean of those above"),
    "a count and an end": (HEAD, [*ROWS, "Total points: 12", "*** end ***"], "Total points: 12 (line 14), *** end ***"),
    "ids that begin as percentiles do": (HEAD, lines([f"P{k}" for k in range(90, 90 + N)], DEG, MM), ""),
    "asked and measured under their names": (
        [*7 * [""], "Nominal", "", "", "Measured", "", ""],
        [",".join(["Pose", *PLAIN, "X", "Y", "Z"]), *lines(NUMBERED, DEG, MM + 3, MM)],
        "left out: Nominal X, Nominal Y, Nominal Z",
    ),
    "a smaller table above": (["id", *XYZ], ["b1,1,2,3", "b2,2,3,4", "", ",".join(HEAD), *ROWS], "lines 2 to 3 hold"),
    "units behind the numbers": (
        PLAIN,
        [",".join([*(f"{v:.7f}°" for v in DEG[k]), *(f"{v:.6f} mm" for v in MM[k])]) for k in range(N)],
        "",
    ),
    "units above": (["// Units: Inches, Degrees"], [",".join(PLAIN), *lines(DEG, MM / 25.4)], "read in in, as stated"),
    "units in a sentence": (
        ["# all values in mm and deg"],
        [",".join(PLAIN), *lines(DEG, MM)],
        "'all values in mm and",
    ),
    "units of the axes in a setting": (
        ["AXES = CARTESIAN: X", " Y", " Z (in)"],
        [",".join(PLAIN), *lines(DEG, MM / 25.4)],
        "read in in, as stated above the table: 'AXES = CARTESIAN: X Y Z (in)'",
    ),
    "units of the axes in a stream": (
        None,
        [
            "AXES = CARTESIAN: X, Y, Z (mm)",
            *(
                " ".join(f"{n}={v:.9g}" for n, v in zip([*BARE, *"XYZ"], (*DEG[k], *MM[k]), strict=True))
                for k in range(N)
            ),
        ],
        "read in mm, as stated above the table: 'AXES = CARTESIAN: X, Y, Z (mm)'",
    ),
    "names of the columns in a comment": (["# columns: X Y Z " + " ".join(BARE)], lines(MM, DEG, separator=" "), ""),
    "apostrophes": (HEAD, [row.replace(",-", ",\u2212") for row in lines(NUMBERED, DEG, MM)], ""),
    "Fortran": (
        None,
        [" ".join(f"{v:.9E}".replace("E", "D") for v in (*DEG[k], *MM[k])) for k in range(N)],
        "read as J1 J2",
    ),
    "a point nobody saw": (
        HEAD,
        marked(ROWS, 3, "nan", "nan", "nan"),
        "'nan' for x_mm … is taken for a lost beam (line 5)",
    ),
    "nines for a lost beam": (HEAD, marked(ROWS, 3, *3 * ["-9999.0"]), "taken for a lost beam (line 5)"),
    "a point that is called not valid": (
        [*HEAD, "Valid"],
        [row + (",0" if k == 3 else ",1") for k, row in enumerate(ROWS)],
        "taken for lost where 'Valid' says so (line 5)",
    ),
    "a line drawn below the names": (HEAD, [",".join(10 * ["-----"]), *ROWS], ""),
    "kinds of values below the names": (HEAD, [",".join(["string", *9 * ["float64"]]), *ROWS], ""),
    "units of groups": (
        ["Pose", "Joints [rad]", *5 * [""], "Tracker [m]", "", ""],
        [",".join(["", *PLAIN]), *lines(NUMBERED, Q, P)],
        "",
    ),
    "micrometres": ([*HEAD[:-3], "X [µm]", "Y [µm]", "Z [µm]"], lines(NUMBERED, DEG, MM * 1e3), ""),
    "azimuth, elevation, range": (
        [*JOINTS, "Azimuth [deg]", "Elevation [deg]", "Range [mm]"],
        lines(DEG, AZIMUTH, ELEVATION, RANGE),
        "turns counter-clockwise seen from above, an angle from the horizontal",
    ),
    "zenith in gon": (
        [*JOINTS, "Az (gon)", "Zenith (gon)", "Distance (m)"],
        lines(DEG, AZIMUTH / 0.9, (90 - ELEVATION) / 0.9, RANGE / 1e3),
        "an angle from the zenith",
    ),
    "a theodolite": (
        [*JOINTS, "Hz_deg", "V_deg", "D_mm"],
        lines(DEG, -AZIMUTH % 360, 90 - ELEVATION, RANGE),
        "turns clockwise seen from above, an angle from the zenith",
    ),
    "joints as ROS sorts them": ([*ROS, "x", "y", "z"], lines(Q[:, [2, 1, 0, 3, 4, 5]], P), ""),
    "joints as Yaskawa calls them": ([*"SLURBT", *XYZ], lines(DEG, MM), ""),
    "joints in another order": ([*JOINTS[::-1], *XYZ], lines(DEG[:, ::-1], MM), ""),
    "a matrix in brackets": ([*JOINTS, *XYZ, *MATRIX], lines(DEG, MM, R.reshape(N, 9)), ""),
}


@pytest.mark.parametrize("form", READ)
def test_the_table_is_found_and_read(tmp_path, form):
    header, rows, said = READ[form]
    campaign = read_campaign(write(tmp_path, header, rows), ROBOT)
    assert len(campaign.targets) == 1
    seen = campaign.valid[:, 0]
    assert seen.sum() >= N - 1
    np.testing.assert_allclose(campaign.q, Q, atol=1e-6)
    np.testing.assert_allclose(campaign.points[seen, 0], P[seen], atol=1e-6)
    assert said in " ".join(campaign.notes)


@pytest.mark.parametrize(
    "group",
    [["SMR1", "", "", "SMR2", "", ""], ["SMR1", "SMR1", "SMR1", "SMR2", "SMR2", "SMR2"]],
    ids=["merged", "each"],
)
def test_reflectors_under_their_names(tmp_path, group):
    campaign = read_campaign(
        write(tmp_path, [*7 * [""], *group], [",".join(["Pose", *PLAIN, "X", "Y", "Z"]), *TWO_ROWS]), ROBOT
    )
    assert campaign.targets == ("SMR1", "SMR2")
    np.testing.assert_allclose(campaign.points[:, 0], P, atol=1e-6)


def test_german_and_swiss_thousands_separators(tmp_path):
    """German and Swiss thousands separators are recognised."""
    path = tmp_path / "file.csv"
    for form, separator in (
        (german, ";"),
        (lambda v: f"{v:,.6f}".replace(",", "'"), ","),
        (lambda v: f"{v:,.6f}".replace(",", " "), ";"),
    ):
        rows = [separator.join(form(v) for v in (*DEG[k], *MM[k])) for k in range(N)]
        path.write_text("\n".join([separator.join(PLAIN), *rows]), encoding="utf-8")
        np.testing.assert_allclose(read_campaign(path, ROBOT).points[:, 0], P, atol=1e-6)


@pytest.mark.parametrize(
    ("ids", "header"),
    [
        ([f"P{k}_{t}" for k in range(N) for t in "AB"], "id"),
        ([f"Pose{k},{t}" for k in range(N) for t in "AB"], "Group,Point"),
        ([f"{2 * k + i},{t}" for k in range(N) for i, t in enumerate("AB")], "id,target"),
    ],
    ids=["in the name", "groups", "an id for each shot"],
)
def test_two_targets_one_a_row(tmp_path, ids, header):
    joints = np.repeat(DEG, 2, axis=0)
    points = np.stack([MM, MM + R @ [40.0, 0.0, 0.0]], axis=1).reshape(-1, 3)
    rows = [",".join([name, *map(str, (*q, *p))]) for name, q, p in zip(ids, joints, points, strict=True)]
    campaign = read_campaign(write(tmp_path, [header, *JOINTS, *XYZ], rows), ROBOT)
    assert campaign.targets == ("A", "B")
    np.testing.assert_allclose(campaign.points[:, 0], P, atol=1e-6)


def test_targets_behind_the_names_of_poses_in_a_second_file(tmp_path):
    joints = write(tmp_path, ["id", *JOINTS], lines(NUMBERED, DEG)).rename(tmp_path / "joints.csv")
    rows = [
        f"P{k}.{t}," + ",".join(map(str, MM[k] + R[k] @ [d, 0.0, 0.0]))
        for k in range(N)
        for t, d in (("A", 0), ("B", 40))
    ]
    points = write(tmp_path, ["id", *XYZ], rows)
    campaign = read_campaign(joints, ROBOT, options=ReadOptions(points=points))
    assert campaign.targets == ("A", "B")
    np.testing.assert_allclose(campaign.points[:, 0], P, atol=1e-6)


REFUSED = {
    "units above that cannot be": (
        ["// Units: Meters"],
        [",".join(PLAIN), *lines(DEG, MM)],
        r"states m above the table \('Units: Meters'\), but ur5 moved as far as the points only if they are mm",
    ),
    "angles without a unit": (
        [*JOINTS, "Azimuth", "Elevation", "Range_mm"],
        lines(DEG, AZIMUTH, ELEVATION, RANGE),
        "'Azimuth': the unit of the angle is not stated; name the column Azimuth_deg",
    ),
    "theta and phi": (
        [*JOINTS, "r_mm", "theta_deg", "phi_deg"],
        lines(DEG, RANGE, AZIMUTH, 90 - ELEVATION),
        "counted from the horizontal by some instruments and from the zenith by others",
    ),
    "another unit in a cell": (
        PLAIN,
        marked(
            [",".join([*map(str, DEG[k]), *(f"{v:.6f} mm" for v in MM[k])]) for k in range(N)], 4, "1 m", "1 m", "1 m"
        ),
        ":6: column 'X': '1 m' is not a number",
    ),
    "names of angles alone": ([*JOINTS, *XYZ, "A", "B", "C"], [], "has no measurements below its header"),
    "a line cut off": (HEAD, [*ROWS, "P12"], ":14: the line has 1 fields, the header 10"),
}


@pytest.mark.parametrize("form", REFUSED)
def test_what_may_mean_two_things_is_refused(tmp_path, form):
    header, rows, message = REFUSED[form]
    with pytest.raises(FileError, match=message):
        read_campaign(write(tmp_path, header, rows), ROBOT)


def test_rows_behind_a_comment_mark_are_told_of(tmp_path):
    campaign = read_campaign(write(tmp_path, HEAD, [*ROWS[:4], "#" + ROWS[4], *ROWS[5:]]), ROBOT)
    assert len(campaign) == N - 1
    assert campaign.notes == ("numbers behind a comment mark are left out (line 6)",)


def test_groups_state_units_for_their_columns(tmp_path):
    header = ["Pose", "Joints [deg]", *5 * [""], "Tracker [m]", "", ""]
    campaign = read_campaign(write(tmp_path, header, [",".join(["", *PLAIN]), *lines(NUMBERED, DEG, P * 2)]), ROBOT)
    np.testing.assert_allclose(campaign.points[:, 0], P * 2, atol=1e-6)


def test_axes_of_a_rotation_are_no_target(tmp_path):
    readings = read_measurements(write(tmp_path, [*XYZ, "normal_x", "normal_y", "normal_z"], lines(MM, MM)), ROBOT)
    assert list(readings.points) == ["tool"]

import numpy as np
import pytest
from hypothesis import given

from taskcal.errors import FileError, TaskcalError, UnknownName
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.importers.dh import read_dh_table
from tests.laws.robots import generators
from tests.robot_programs.fuzz import mutated

ROWS = np.array(
    [[-90.0, 150, 450, 0], [0, 600, 0, -90], [-90, 120, 0, 0], [90, 0, 640, 0], [-90, 0, 0, 0], [0, 0, 100, 180]]
)
"""alpha, a, d and theta of a robot of usual size, degrees and millimetres."""


def write(folder, header, rows, name="arm.csv"):
    path = folder / name
    lines = [",".join(map(repr, row)) for row in rows.tolist()]
    path.write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")
    return path


def poses(robot):
    return ErrorModel(robot).poses(np.random.default_rng(0).normal(size=(3, 6)))


@pytest.fixture
def expected(tmp_path):
    path = write(tmp_path, "alpha_deg,a_mm,d_mm,theta_offset_deg", ROWS, "own.csv")
    return poses(read_dh_table(path, "dh"))


@pytest.mark.parametrize("length", [1.0, 1e-3])
@pytest.mark.parametrize("angle", [1.0, np.pi / 180])
@pytest.mark.parametrize("header", ["alpha,a,d,theta", "Twist,r,d,theta_offset"])
def test_units_are_told_by_size_and_said(header, angle, length, tmp_path, expected):
    robot = read_dh_table(write(tmp_path, header, ROWS * [angle, length, length, angle]), "dh")
    np.testing.assert_allclose(poses(robot), expected, atol=1e-12)
    said = " ".join(robot.source[1:])
    assert ("taken for mm" in said) == (length == 1.0)
    assert ("taken for deg" in said) == (angle == 1.0)


@pytest.mark.parametrize(
    "header",
    [
        "alpha [rad],a [m],d [m],theta [rad]",
        "alpha_rad,a_m,d_m,theta_offset_rad",
        "Alpha (rad),R (m),D (m),Offset (rad)",
    ],
)
def test_units_in_headers_are_taken(header, tmp_path, expected):
    robot = read_dh_table(write(tmp_path, header, ROWS * [np.pi / 180, 1e-3, 1e-3, np.pi / 180]), "dh")
    np.testing.assert_allclose(poses(robot), expected, atol=1e-12)
    assert robot.source == ("imported from arm.csv",)


@pytest.mark.parametrize(
    "header",
    [
        "Joint i,alpha_i (deg),a_i (mm),d_i (mm),theta_i",
        "i,Link twist [°],Link length [mm],Link offset [mm],Joint angle offset [°]",
        "Link;alpha_{i} [deg];a_{i} [mm];d_{i} [mm];theta offset [deg]",
    ],
)
def test_tables_as_textbooks_have_them_are_read(header, tmp_path, expected):
    separator = ";" if ";" in header else ","
    lines = [separator.join(map(str, (i, *row))) for i, row in enumerate(ROWS.tolist(), start=1)]
    path = tmp_path / "book.csv"
    path.write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")
    np.testing.assert_allclose(poses(read_dh_table(path, "dh")), expected, atol=1e-12)


def test_a_table_of_the_joint_before_is_modified(tmp_path):
    path = write(tmp_path, "alpha_{i-1} (deg),a_{i-1} (mm),d_i (mm),theta_i", ROWS)
    own = write(tmp_path, "alpha_deg,a_mm,d_mm,theta_offset_deg", ROWS, "own.csv")
    np.testing.assert_allclose(poses(read_dh_table(path, "mdh")), poses(read_dh_table(own, "mdh")), atol=1e-12)
    with pytest.raises(
        FileError, match="of the joint before, as modified tables have it; import it with --convention mdh"
    ):
        read_dh_table(path, "dh")


def test_a_joint_angle_by_its_letter_is_its_offset(tmp_path, expected):
    angles = ["θ1", "θ2 - 90°", "q3", "theta_4", "θ5*", "θ6 + 180"]
    lines = [f"{i},{a},{r},{d},{angles[i]}" for i, (a, r, d) in enumerate(ROWS[:, :3].tolist())]
    path = tmp_path / "book.csv"
    path.write_text("\n".join(["i,alpha,a,d,theta", *lines]) + "\n", encoding="utf-8")
    np.testing.assert_allclose(poses(read_dh_table(path, "dh")), expected, atol=1e-12)


def test_a_name_over_two_lines_is_unknown(tmp_path):
    with pytest.raises(FileError, match="unknown column"):
        read_dh_table(
            write(tmp_path, 'alpha_deg,a_mm,d_mm,theta_offset_deg,"of\nthe joint"', np.c_[ROWS, ROWS[:, :1]]), "dh"
        )


def test_ambiguous_unit_is_requested(tmp_path):
    """What size does not tell is asked for and taken when stated."""
    toy = ROWS * [1.0, 0.03, 0.03, 1.0]  # 62 mm, or a robot of 62 m
    with pytest.raises(FileError, match=r"the unit of a, d is not stated, .* \(mm or m\) with --units"):
        read_dh_table(write(tmp_path, "alpha,a,d,theta", toy), "dh")
    robot = read_dh_table(write(tmp_path, "alpha,a,d,theta", toy), "dh", units="mm")
    assert robot.reach == pytest.approx(np.abs(toy[:, 1:3]).sum() * 1e-3)
    small = ROWS * [0.03, 1.0, 1.0, 0.02]
    with pytest.raises(FileError, match=r"the unit of alpha, theta is not stated, .* \(deg or rad\)"):
        read_dh_table(write(tmp_path, "alpha,a,d,theta", small), "dh")
    with pytest.raises(TaskcalError, match=r"'inch' is not a unit of a table"):
        read_dh_table(write(tmp_path, "alpha,a,d,theta", small), "dh", units="inch")


def test_a_calibrated_table_does_not_tell_its_lengths(tmp_path):
    """Common normals of axes that are nearly parallel are hundreds of metres away: 0.2 km would look like 0.2 m in mm."""
    rows = np.array([[90.0, 0.0006, 0.089, 0.0], [-0.0745, -0.297, 233.36, -45.4], [90.0, 0.2, -233.2, 45.3]])
    with pytest.raises(FileError, match=r"the unit of a, d is not stated"):
        read_dh_table(write(tmp_path, "alpha_deg,a,d,theta_deg", rows), "dh")


def test_a_convention_may_be_in_any_letter_case(tmp_path, expected):
    path = write(tmp_path, "alpha,a,d,theta", ROWS)
    np.testing.assert_allclose(poses(read_dh_table(path, "DH")), expected, atol=1e-12)
    with pytest.raises(UnknownName, match=r"no convention 'craig' of Denavit–Hartenberg tables"):
        read_dh_table(path, "craig")


def test_two_columns_of_the_same_are_refused(tmp_path):
    with pytest.raises(FileError, match=r"two columns are a_mm: 'a' and 'r'; keep one"):
        read_dh_table(write(tmp_path, "alpha,a,r,theta", ROWS), "dh")


@given(generators)
def test_damaged_tables_are_read_or_refused(tmp_path_factory, rng):
    path = write(tmp_path_factory.mktemp("dh"), "alpha,a,d,theta", ROWS)
    path.write_bytes(mutated(rng, path.read_bytes(), marks=b',;\n\t-.e09\xff\x00#"'))
    try:
        joints = len(read_dh_table(path, "mdh").joints)
    except TaskcalError:
        return
    assert joints

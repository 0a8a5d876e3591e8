import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.errors import FileError
from taskcal.robot.catalogue import load_robot, robot_toml
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.importers.dh import describe_dh_table, read_dh_table
from tests.laws.plain import product, shift, turn
from tests.laws.robots import generators

HEADER = "joint,alpha_deg,a_mm,d_mm,theta_offset_deg"


def table_pose(rows, convention, theta):
    """Product of standard or modified (Khalil, Craig) Denavit–Hartenberg transforms."""
    T = np.eye(4)
    for (alpha, a, d, offset), angle in zip(rows, theta, strict=True):
        about_z, along_x = (
            [turn(2, angle + np.radians(offset)), shift(2, d / 1e3)],
            [shift(0, a / 1e3), turn(0, np.radians(alpha))],
        )
        T = T @ product([*about_z, *along_x] if convention == "dh" else [*reversed(along_x), *about_z])
    return T


def write(path, lines, header=HEADER):
    path.write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("convention", ["dh", "mdh"])
def test_a_table_is_the_product_of_its_conventions_transforms(convention, tmp_path_factory):
    @given(generators, st.integers(1, 8))
    def law(rng, joints):
        rows = rng.uniform(30, 300, (joints, 4)) * rng.choice((-1.0, 1.0), (joints, 4))
        rows[rng.random(rows.shape) < 0.3] = 0.0
        path = write(
            tmp_path_factory.mktemp("dh") / "arm.csv",
            [f"{i + 1}," + ",".join(map(repr, row.tolist())) for i, row in enumerate(rows)],
        )
        model = ErrorModel(read_dh_table(path, convention))
        q = rng.uniform(-3, 3, (4, joints))
        np.testing.assert_allclose(model.poses(q), [table_pose(rows, convention, row) for row in q], atol=1e-10)
        assert model.robot.joint_names == tuple(f"J{i + 1}" for i in range(joints))

    law()


def test_a_controllers_angles_are_mapped_as_the_table_says(tmp_path):
    lines = ["1,0,0,670,0,J1", "2,-90,312,0,-90,J2", "3,0,1075,0,0,-(J2+J3)"]
    robot = read_dh_table(write(tmp_path / "arm.csv", lines, HEADER + ",theta_from_controller"), "mdh")
    np.testing.assert_array_equal(robot.joint_map.matrix, [[1, 0, 0], [0, 1, 0], [0, -1, -1]])
    np.testing.assert_allclose(robot.joint_map.offset, [0, -np.pi / 2, 0])


def test_limits_and_names_come_from_the_table(tmp_path):
    lines = ["shoulder,0,0,670,0,-170,170", "elbow,90,0,0,0,-90,90.5"]
    robot = read_dh_table(write(tmp_path / "arm.csv", lines, HEADER + ",lower_deg,upper_deg"), "dh", name="mine")
    assert (robot.name, robot.joint_names) == ("mine", ("shoulder", "elbow"))
    np.testing.assert_allclose(np.degrees(robot.limits), [[-170, 170], [-90, 90.5]])


@pytest.mark.parametrize("unit", ["deg", "rad"])
def test_a_table_of_a_scara_states_limits_of_turning_joints(tmp_path, unit):
    """A sliding joint's are lengths, which the column cannot hold."""
    header = f"joint,type,alpha_deg,a_mm,d_mm,theta_offset_deg,lower_{unit},upper_{unit}"
    lines = ["1,,0,350,400,0,-2.5,2.5", "2,,180,300,0,0,,", "3,prismatic,0,0,0,0,,", "4,,0,0,50,0,-170,170"]
    if unit == "rad":
        lines[3] = "4,,0,0,50,0,-3,3"
    path = write(tmp_path / "scara.csv", lines, header)
    limits, scale = read_dh_table(path, "dh").limits, np.pi / 180.0 if unit == "deg" else 1.0
    np.testing.assert_allclose(limits[0], np.array([-2.5, 2.5]) * scale)
    assert not np.isfinite(limits[1:3]).any()
    for cells, column in (("0,200", "lower"), (",200", "upper")):
        lines[2] = f"3,prismatic,0,0,0,0,{cells}"
        match = rf"scara\.csv:4: column '{column}_deg': the joint slides .* empty.*limits_mm"
        with pytest.raises(FileError, match=match):
            read_dh_table(write(path, lines, header), "dh")
    lines[2], lines[1] = "3,prismatic,0,0,0,0,,", "2,,180,300,0,0,,2"
    with pytest.raises(FileError, match=r"scara\.csv:3: column 'lower_deg': the cell is empty; state both"):
        read_dh_table(write(path, lines, header), "dh")


def test_joints_with_numbers_of_their_own_stand_in_any_order(tmp_path):
    lines = ["E7,prismatic,0,0,670,0", "A1,revolute,90,0,9,0", "A2,revolute,0,99,0,0"]
    robot = read_dh_table(write(tmp_path / "arm.csv", lines, HEADER.replace("joint", "joint,type", 1)), "dh")
    assert robot.joint_names == ("E7", "A1", "A2")


def test_an_imported_table_is_a_robot_file(tmp_path):
    lines = ["1,-90,100,670,0", "2,0,312.5,0,-90"]
    table = write(tmp_path / "arm.csv", lines)
    path = tmp_path / "arm.toml"
    path.write_text(robot_toml(describe_dh_table(table, "dh")), encoding="utf-8")
    q = np.random.default_rng(0).normal(size=(3, 2))
    np.testing.assert_array_equal(
        ErrorModel(load_robot(path)).poses(q), ErrorModel(read_dh_table(table, "dh")).poses(q)
    )
    assert load_robot(path).source == ("imported from arm.csv",)


WRONG = {
    "missing column": ("joint,alpha_deg,a_mm,d_mm", ["1,0,0,0"], r"arm\.csv:1.* no column 'theta_offset_deg'"),
    "limits in mm": (HEADER + ",lower_mm,upper_mm", ["1,0,9,9,0,,"], r"arm\.csv:1: unknown columns 'lower_mm'"),
    "unknown column": (HEADER + ",beta_deg", ["1,0,0,0,0,0"], r"arm\.csv:1: unknown column 'beta_deg'; a table has"),
    "no joints": (HEADER, [], r"arm\.csv: has no joints"),
    "text for a number": (
        HEADER,
        ["1,0,0,0,0", "2,ninety,0,0,0"],
        r"arm\.csv:3: column 'alpha_deg': 'ninety' is not a number",
    ),
    "empty cell": (HEADER, ["1,0,,0,0"], r"arm\.csv:2: column 'a_mm': the cell is empty"),
    "one limit only": (HEADER + ",lower_deg", ["1,0,0,0,0,-10"], r"arm\.csv:1: gives one limit only"),
    "joint twice": (HEADER, ["1,0,0,0,0", "1,0,0,0,0"], r"arm\.csv: .*two joints are named 'J1'"),
    "flange first": (
        HEADER,
        ["2,0,0,9,0", "1,0,99,99,0"],
        r"arm\.csv:3: column 'joint': 'J1' stands below 'J2': the rows are",
    ),
    "other order": (
        HEADER,
        ["A1,0,0,9,0", "A3,0,9,99,0", "A2,0,99,9,0"],
        r"arm\.csv:4: column 'joint': 'A2' stands below 'A3'",
    ),
    "unknown joint": (HEADER + ",theta_from_controller", ["1,0,0,0,0,J1+J2"], r"arm\.csv: .*no joint 'J2'"),
    "unknown type": (HEADER + ",type", ["1,0,0,0,0,helical"], r"arm\.csv: joint 1, type: .*helical"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_table_is_refused_with_its_place(case, tmp_path):
    header, lines, message = WRONG[case]
    with pytest.raises(FileError, match=message):
        read_dh_table(write(tmp_path / "arm.csv", lines, header), "dh")


UR10 = [  # of the maker's data sheet: alpha_deg, a_mm, d_mm, theta_offset_deg
    (90.0, 0.0, 127.3, 0.0),
    (0.0, -612.0, 0.0, 0.0),
    (0.0, -572.3, 0.0, 0.0),
    (90.0, 0.0, 163.941, 0.0),
    (-90.0, 0.0, 115.7, 0.0),
    (0.0, 0.0, 92.2, 0.0),
]


def in_units(rows, angle, length):
    """Lines of a table whose angles and lengths are multiplied."""
    return [
        f"{i},{al * angle!r},{a * length!r},{d * length!r},{o * angle!r}" for i, (al, a, d, o) in enumerate(rows, 1)
    ]


IN_OTHER_UNITS = {
    "metres": (
        in_units(UR10, 1.0, 1e-3),
        r"arm\.csv:3: column 'a_mm': -0\.612 mm is .*probably in metres: give millimetres, here -612",
    ),
    "micrometres": (in_units(UR10, 1.0, 1e3), r"arm\.csv:3: column 'a_mm': -612000 mm is longer .*micrometres"),
    "radians": (
        in_units(UR10, np.pi / 180, 1.0),
        r"arm\.csv:2: column 'alpha_deg': 1\.5708 is probably in radians, .* give degrees, here 90",
    ),
    "milliradians": (
        in_units(UR10, 1e3 * np.pi / 180, 1.0),
        r"arm\.csv:2: column 'alpha_deg': 1570\.8° is more than a turn",
    ),
    "radians with two digits": (
        ["1,1.57,0,670,0", "2,0,1075,0,-1.57"],
        r"arm\.csv:2: column 'alpha_deg': 1\.57 is probably in radians",
    ),
    "a SCARA in radians": (
        ["1,0,325,416,0", "2,3.14159,275,0,0"],
        r"arm\.csv:3: column 'alpha_deg': 3\.14159 is probably in radians, .* here 180",
    ),
    "parallel axes, offset in radians": (
        ["1,0,325,416,1.5708", "2,0,275,0,0"],
        r"arm\.csv:2: column 'theta_offset_deg': 1\.5708 is probably in radians",
    ),
    "identified twists in radians": (
        ["1,1.5663,300,416,0.0021", "2,-0.0013,275,0,0"],
        "1\\.5663 is probably in radians",
    ),
}


@pytest.mark.parametrize("case", IN_OTHER_UNITS)
def test_a_table_in_other_units_is_refused_and_the_unit_named(case, tmp_path):
    lines, message = IN_OTHER_UNITS[case]
    for convention in ("dh", "mdh"):
        with pytest.raises(FileError, match=message):
            read_dh_table(write(tmp_path / "arm.csv", lines), convention)


def test_limits_in_radians_are_refused(tmp_path):
    lines = ["1,90,0,670,0,-2.96,2.96", "2,0,1075,0,0,-1.5,1.1"]
    with pytest.raises(FileError, match=r"arm\.csv:2: column 'lower_deg': -2\.96 is probably in radians"):
        read_dh_table(write(tmp_path / "arm.csv", lines, HEADER + ",lower_deg,upper_deg"), "dh")


SOUND = {
    "a small robot": ["1,-90,0,135,0", "2,0,135,0,-90", "3,-90,38,0,0", "4,90,0,120,0", "5,-90,0,0,0", "6,0,0,70,180"],
    "a SCARA without twists": ["1,0,325,416,0", "2,0,275,0,0"],
    "a gantry of 60 m": ["1,-90,0,60000,0", "2,90,0,4000,0"],
    "identified twists in degrees": ["1,0.021,325,416,0.35", "2,-0.113,275,0,0.02"],
    "a wrist alone": ["1,-90,0,0,0", "2,90,0,0,0", "3,0,0,0,0"],
    "one usual twist": ["1,45,0,100,1.5708"],
}


@pytest.mark.parametrize("case", SOUND)
def test_a_table_in_its_units_is_read(case, tmp_path):
    robot = read_dh_table(write(tmp_path / "arm.csv", SOUND[case]), "dh")
    assert len(robot.joints) == len(SOUND[case])


def test_a_table_of_more_rows_than_joints_is_refused(tmp_path):
    path = write(tmp_path / "dh.csv", [f"{k},90,0,400,0" for k in range(200)])
    with pytest.raises(FileError, match=r"dh\.csv: has 200 rows, one for each joint; a robot has up to 50"):
        read_dh_table(path, "dh")

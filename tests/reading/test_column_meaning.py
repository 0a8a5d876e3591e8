import pytest

from taskcal.observations import base
from taskcal.reading.columns import meanings, split_unit

JOINTS = [f"J{k}" for k in range(1, 7)]


@pytest.mark.parametrize(
    ("name", "text", "unit"),
    [
        ("x_mm", "x", "mm"),
        ("X [mm]", "x", "mm"),
        ("X/mm", "x", "mm"),
        ("X in mm", "x", "mm"),
        ("Joint 1 (deg)", "joint 1", "deg"),
        ("Achse 3 [°]", "achse 3", "deg"),
        ("q2_rad", "q2", "rad"),
        ("Time (Seconds)", "time", "s"),
        ("Point ID", "point id", None),
        ("x [unknown]", "x [unknown]", None),
    ],
)
def test_a_unit_is_parted_from_its_name(name, text, unit):
    assert split_unit(name) == (text, unit)


JOINT_NAMES = {
    "J": "J{}_deg",
    "A": "A{}",
    "q": "q{} [rad]",
    "joint": "Joint {} (deg)",
    "axis": "Axis{}",
    "German": "Achse {} [°]",
    "position": "joint_{}_position",
}


@pytest.mark.parametrize("form", JOINT_NAMES.values(), ids=list(JOINT_NAMES))
def test_joints_are_known_by_number_whatever_they_are_called(form):
    known = meanings([form.format(k) for k in range(1, 7)], [""] * 6, JOINTS)
    assert [(m.kind, m.index) for m in known] == [("joint", k) for k in range(6)]


def test_joints_are_counted_from_zero_where_all_are_there():
    known = meanings([f"actual_q_{k}" for k in range(6)], [""] * 6, JOINTS)
    assert [(m.kind, m.index) for m in known] == [("joint", k) for k in range(6)]


def test_a_robots_own_names_come_first():
    names = ["shoulder_pan_joint", "Elbow Joint", "J1"]
    known = meanings(names, [""] * 3, ["shoulder_pan_joint", "elbow_joint"])
    assert [m.index for m in known[:2]] == [0, 1]


def test_four_numbered_parts_are_a_quaternion_scalar_first():
    known = meanings([*JOINTS, "q1", "q2", "q3", "q4"], [""] * 10, JOINTS)
    assert [(m.kind, m.index) for m in known[6:]] == [("quaternion", k) for k in (3, 0, 1, 2)]


CELLS = {
    "Y [mm]": ("position", 1, "", "mm"),
    "Z-Koordinate": ("position", 2, "", None),
    "smr1_x_mm": ("position", 0, "smr1", "mm"),
    "X_SMR 2 (mm)": ("position", 0, "SMR 2", "mm"),
    "x1": ("position", 0, "target1", None),
    "Pos X": ("position", 0, "", None),
    "X actual": ("position", 0, "", None),
    "X nominal": ("nominal", 0, "", None),
    "Dev": ("nominal", 0, "", None),
    "Goal x": ("nominal", 0, "", None),
    "x_dif": ("nominal", 0, "", None),
    "x_vel": ("nominal", 0, "", None),
    "X [ft]": ("position", 0, "", "ft"),
    "measurement_std_y": ("uncertainty", 1, "measurement", None),
    "sx": ("uncertainty", 0, "", None),
    "u_mm": ("uncertainty", 3, "", "mm"),
    "smr1_u_mm": ("uncertainty", 3, "smr1", "mm"),
    "qw": ("quaternion", 3, "", None),
    "Left_qx": ("quaternion", 0, "Left", None),
    "r21": ("matrix", 21, "", None),
    "temp_C": ("temperature", 0, "", "C"),
    "T [°C]": ("temperature", 0, "", "C"),
    "Reflector": ("target", 0, "", None),
    "J2_approach": ("approach", 1, "", None),
    "J2_move_deg": ("move", 1, "", "deg"),
}


@pytest.mark.parametrize("name", CELLS)
def test_other_columns_are_known_by_their_names(name):
    (meaning,) = meanings([name], [""], JOINTS)
    assert (meaning.kind, meaning.index, meaning.target, meaning.unit) == CELLS[name]


@pytest.mark.parametrize("name", ["comment", "force_N", "Device Position", "E1", "Probe", "-"])
def test_what_means_nothing_here_has_no_meaning(name):
    assert meanings([name], [""], JOINTS) == [None]


@pytest.mark.parametrize(
    ("names", "form"), [("ABC", "abc"), ("WPR", "wpr"), (("Rx", "Ry", "Rz"), "rxyz"), (("roll", "pitch", "yaw"), "rpy")]
)
def test_three_angles_are_known_together(names, form):
    known = meanings(list(names), ["deg"] * 3, JOINTS)
    assert [(m.kind, m.index, m.form, m.unit) for m in known] == [("euler", k, form, "deg") for k in range(3)]
    assert all(m is None or m.kind != "euler" for m in meanings(list(names)[:2], ["", ""], JOINTS))


def test_a_row_of_units_counts_as_much_as_a_unit_in_the_name():
    known = meanings(["x", "J1"], ["mm", "deg"], JOINTS)
    assert [m.unit for m in known] == ["mm", "deg"]


def test_a_joint_too_many_is_one_where_its_unit_is_an_angle():
    assert [m and m.index for m in meanings(["J7_deg", "A7"], ["", ""], JOINTS)] == [6, None]


@pytest.mark.parametrize(
    ("said", "measured"),
    [
        ("target", "actual"),
        ("tcp", "tracker"),
        ("T", "SMR1"),
        ("robot_tcp", "SMR1"),
        ("flange", "T-Mac"),
        ("actual", "measured"),
    ],
)
def test_controllers_position_beside_a_measured_one_is_no_target(said, measured):
    def kinds(*prefixes):
        names = [f"{prefix}_{axis}_mm" for prefix in prefixes for axis in "xyz"]
        return {m.kind for m in meanings(names, [""] * len(names), JOINTS)[:3]}

    assert kinds(said, measured) == {"nominal"}
    assert kinds(said) == kinds(said, "base1") == {"position"}


def test_long_column_name_means_nothing_and_costs_little():
    assert split_unit("(" * 100_000) == ("", None)


def test_what_a_controller_says_is_never_a_target():
    for name in ("ctrl", "controller_tcp", "fk"):
        assert [m.kind for m in meanings([f"{name}_{axis}_mm" for axis in "xyz"], [""] * 3, JOINTS)] == ["nominal"] * 3


def test_controllers_quaternion_beside_points_is_left_out():
    names = [*(f"robot_{part}" for part in ("qx", "qy", "qz", "qw")), "smr_x", "smr_y", "smr_z"]
    assert [m.kind for m in meanings(names, [""] * 7, JOINTS)] == ["nominal"] * 4 + ["position"] * 3


def test_a_rigid_bodys_pose_is_known_as_vicon_tracker_writes_it():
    known = meanings(["Frame", "Sub Frame", "RX", "RY", "RZ", "RW", "TX", "TY", "TZ"], [""] * 9, JOINTS)
    assert [(m.kind, m.index) for m in known[2:]] == [
        *(("quaternion", k) for k in range(4)),
        *(("position", k) for k in range(3)),
    ]
    assert meanings(["TX", "TY", "TZ"], [""] * 3, JOINTS) == [None] * 3


def test_a_kind_takes_no_columns_of_joints_or_rotations(monkeypatch):
    """A kind without a column of names leaves roll, pitch and yaw to a pose, and has roll and pitch where no yaw is."""
    monkeypatch.setattr(base, "_KINDS", dict(base._KINDS))

    class Levels(base.Observation):
        key = "level"
        needed = ("roll", "pitch")
        columns = {"roll": ("roll",), "pitch": ("pitch",)}  # noqa: RUF012

    pose = ["x_mm", "y_mm", "z_mm", "roll_deg", "pitch_deg", "yaw_deg"]
    assert [m.kind for m in meanings(pose, [""] * 6, JOINTS)] == ["position"] * 3 + ["euler"] * 3
    alone = meanings(["J1_deg", "roll_deg", "pitch_deg"], [""] * 3, JOINTS)
    assert [(m.kind, m.target) for m in alone[1:]] == [("observed", "roll"), ("observed", "pitch")]
    assert [m.kind for m in meanings(["roll", "pitch"], [""] * 2, ["roll", "pitch"])] == ["joint"] * 2

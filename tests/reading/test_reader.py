import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from taskcal.errors import FileError
from taskcal.reading.reader import read_campaign
from tests.reading import measured_files
from tests.reading.campaign_files import HEADER, JOINTS, ROBOT, ROWS, write


def test_a_sound_campaign_is_in_metres_and_radians(tmp_path):
    campaign = read_campaign(write(tmp_path), ROBOT)
    assert campaign.ids == ("a", "b")
    np.testing.assert_allclose(
        campaign.q, [[np.radians(10), np.radians(20), 0.3], [np.radians(-30.5), np.radians(4), 0.0]]
    )
    assert campaign.targets == ("tool",)
    np.testing.assert_allclose(campaign.points, [[[1.0, -0.2, 0.0505]], [[0.9, 0.1, 0.06]]])
    assert campaign.rotations is None
    assert campaign.uncertainty is None
    assert campaign.temperature is None
    assert campaign.reference_points == {}
    assert campaign.source == "campaign.csv"


def test_semicolons_and_tabs_separate_as_well_as_commas(tmp_path):
    expected = read_campaign(write(tmp_path), ROBOT)
    for delimiter in ";\t":
        path = write(tmp_path, HEADER.replace(",", delimiter), [row.replace(",", delimiter) for row in ROWS])
        np.testing.assert_array_equal(read_campaign(path, ROBOT).points, expected.points)


def test_a_lost_beam_is_empty_or_all_zero_in_its_target_alone(tmp_path):
    header = f"id,{JOINTS},smr1_x_mm,smr1_y_mm,smr1_z_mm,smr2_x_mm,smr2_y_mm,smr2_z_mm"
    rows = ["a,0,0,0,,,,1,2,3", "b,0,0,0,4,5,6,0,0.0,0", "c,0,0,0,0,1,0,7,8,9"]
    campaign = read_campaign(write(tmp_path, header, rows), ROBOT)
    assert campaign.targets == ("smr1", "smr2")
    np.testing.assert_array_equal(campaign.valid, [[False, True], [True, False], [True, True]])
    assert np.isnan(campaign.points[0, 0]).all()
    np.testing.assert_allclose(campaign.points[2], [[0, 1e-3, 0], [7e-3, 8e-3, 9e-3]])


def test_a_pose_has_its_quaternion_with_the_scalar_last(tmp_path):
    R = Rotation.from_euler("xyz", [0.3, -0.2, 1.0])
    quaternion = ",".join(f"{v:.6f}" for v in R.as_quat())
    rows = [f"a,0,0,0,1,2,3,{quaternion}", "b,0,0,0,,,,,,,"]
    campaign = read_campaign(write(tmp_path, HEADER + ",qx,qy,qz,qw", rows), ROBOT)
    assert campaign.rotations is not None
    np.testing.assert_allclose(campaign.rotations[0], R.as_matrix(), atol=2e-6)
    np.testing.assert_allclose(campaign.rotations[0] @ campaign.rotations[0].T, np.eye(3), atol=1e-14)
    np.testing.assert_array_equal(campaign.valid, [[True], [False]])


def test_unknown_columns_are_ignored_and_reported(tmp_path):
    """Unknown columns are ignored and reported in the notes."""
    rows = [f"{row},5,fine" for row in ROWS]
    campaign = read_campaign(write(tmp_path, f"{HEADER},force_N,comment", rows), ROBOT)
    assert campaign.notes == ("columns left out: force_N, comment; measured: x_mm, y_mm, z_mm",)
    assert read_campaign(write(tmp_path), ROBOT).notes == ()


@pytest.mark.parametrize(
    ("columns", "read"),
    [("sx_mm,sy_mm", ""), ("sx_mm,sy_mm,sz_mm", "sx_mm, sy_mm, sz_mm"), ("sx_mm,sy_mm,sz_mm,u_mm", "u_mm")],
)
def test_uncertainties_are_read_of_all_three_axes_or_of_the_point(tmp_path, columns, read):
    """Each column is read or reported as left out, never both; the root mean square of three axes is that of one."""
    values = {"sx_mm": 0.01, "sy_mm": 0.02, "sz_mm": 0.03, "u_mm": 0.04}
    own = columns.split(",")
    rows = [f"{row},{','.join(str(values[name]) for name in own)}" for row in ROWS]
    campaign = read_campaign(write(tmp_path, f"{HEADER},{columns}", rows), ROBOT)
    said = [note.partition(";")[0] for note in campaign.notes]
    left = ", ".join(name for name in own if name not in read.split(", "))
    assert [note for note in said if note.startswith("column")] == ([f"columns left out: {left}"] if left else [])
    assert sum("are read" in note for note in said) == ("," in read)
    if read:
        of = [values[name] for name in read.split(", ")]
        seen = campaign.valid
        np.testing.assert_allclose(campaign.uncertainty[seen], 1e-3 * np.sqrt(np.mean(np.square(of))))
    else:
        assert campaign.uncertainty is None


def test_rows_without_ids_are_numbered(tmp_path):
    path = write(tmp_path, HEADER.replace("id,", ""), [row.split(",", 1)[1] for row in ROWS])
    assert read_campaign(path, ROBOT).ids == ("1", "2")


def test_reader_reports_the_first_twenty_faults_at_once(tmp_path):
    rows = ["a,10,20,300,1000,-200,50.5", "b,up,4,0,900,100,60", "c,1,2,3,4,5", "d,1,2,3,lost,5,6"]
    with pytest.raises(FileError) as caught:
        read_campaign(write(tmp_path, rows=rows), ROBOT)
    lines = str(caught.value).split("\n")
    assert [line.split("campaign.csv:")[1] for line in lines] == [
        "3: column 'J1_deg': 'up' is not a number; give a number such as 12.5",
        "4: the line has 6 fields, the header 7; write one for each column, or leave the line out",
        "5: column 'x_mm': 'lost' is not a number; give a number such as 12.5",
    ]
    assert (caught.value.line, caught.value.column) == (3, "J1_deg")
    with pytest.raises(FileError) as caught:
        read_campaign(write(tmp_path, rows=[f"r{k},up,4,0,900,100,60" for k in range(35)]), ROBOT)
    assert str(caught.value).count("\n") == 20
    assert str(caught.value).endswith("and 15 more faults")


LIKE = {
    "German spreadsheet": (
        "utf-8-sig",
        "Punkt;Achse 1 [°];Achse 2 [°];slide [mm];X [mm];Y [mm];Z [mm]\r\na;10,0;20,0;300,0;1000,0;-200,0;50,5\r\n"
        "b;-30,5;4,0;0,0;900,0;100,0;60,0\r\n",
    ),
    "UTF-16": (
        "utf-16",
        "id\tJ1_deg\tElbow_deg\tslide_mm\tX [mm]\tY [mm]\tZ [mm]\na\t10\t20\t300\t1000\t-200\t50.5\nb\t-30.5\t4\t0\t900\t100\t60\n",
    ),
    "Latin-1, preamble and a row of units": (
        "latin-1",
        "Messung vom Dienstag\nTemperatur 21 °C\n\nPoint ID,A1,A2,A3,X,Y,Z,Bemerkung\n,[°],[°],[mm],[mm],[mm],[mm],\n"
        "a,10,20,300,1000,-200,50.5,über\nb,-30.5,4,0,900,100,60,\n",
    ),
    "blanks and comments": (
        "utf-8",
        "// made by hand\nid  J1_deg  Elbow_deg  slide_m  x_m  y_m  z_m\n"
        "a  10  20  0.3  1.0  -0.2  0.0505\n# pause\nb -30.5 4 0 0.9  0.1 0.06\n",
    ),
    "thousands parted": (
        "utf-8",
        'id;J1 (deg);Elbow (deg);slide (mm);x (um);y (um);z (um)\na;10;20;300;"1,000,000.0";"-200,000.0";"50,500.0"\n'
        'b;-30.5;4;0;"900,000.0";"100,000.0";"60,000.0"\n',
    ),
}


@pytest.mark.parametrize("case", LIKE)
def test_equivalent_column_layouts_parse_identically(tmp_path, case):
    """Equivalent column layouts and encodings give the same campaign."""
    encoding, text = LIKE[case]
    path = tmp_path / "measured.txt"
    path.write_bytes(text.encode(encoding))
    campaign, expected = read_campaign(path, ROBOT), read_campaign(write(tmp_path), ROBOT)
    assert campaign.ids == expected.ids
    np.testing.assert_allclose(campaign.q, expected.q, atol=1e-15)
    np.testing.assert_allclose(campaign.points, expected.points, atol=1e-15)


def test_time_counts_from_when_the_robot_began_to_work(tmp_path):
    header = HEADER + ",time_s"
    campaign = read_campaign(write(tmp_path, header, [ROWS[0] + ",60.5", ROWS[1] + ","]), ROBOT)
    np.testing.assert_array_equal(campaign.time, [60.5, np.nan])
    np.testing.assert_array_equal(campaign.take([0]).conditions.time, [60.5])
    for wrong in ("-5", "1763700000"):
        with pytest.raises(FileError, match=r"s is not a time since the robot began to work.*subtract") as caught:
            read_campaign(write(tmp_path, header, [ROWS[0] + ",0", f"{ROWS[1]},{wrong}"]), ROBOT)
        assert (caught.value.line, caught.value.column) == (3, "time_s")


def test_temperature_may_be_missing_here_and_there(tmp_path):
    campaign = read_campaign(write(tmp_path, HEADER + ",temp_C", [ROWS[0] + ",21.5", ROWS[1] + ","]), ROBOT)
    np.testing.assert_array_equal(campaign.temperature, [21.5, np.nan])


@pytest.mark.parametrize("wrong", ["294.65", "-999", "9999"])
def test_what_is_no_temperature_of_a_robot_is_refused(tmp_path, wrong):
    with pytest.raises(FileError, match=r"°C is not a robot's temperature \(-50 to 150 °C\).*kelvins") as caught:
        read_campaign(write(tmp_path, HEADER + ",temp_C", [ROWS[0] + ",21.5", f"{ROWS[1]},{wrong}"]), ROBOT)
    assert (caught.value.line, caught.value.column) == (3, "temp_C")


APPROACH = f"{HEADER},J1_approach,Elbow_approach,J3_approach"


def test_approach_is_read_or_taken_from_the_row_order(tmp_path):
    rows = ["a,10,20,300,1,2,3", "b,20,20,200,1,2,3", "c,15,30,200,1,2,3"]
    ordered = read_campaign(write(tmp_path, rows=rows), ROBOT)
    np.testing.assert_array_equal(ordered.approach, [[0, 0, 0], [1, 0, -1], [-1, 1, -1]])
    np.testing.assert_allclose(ordered.move * [180 / np.pi, 180 / np.pi, 1e3], [[0, 0, 0], [10, 0, -100], [-5, 10, 0]])
    stated = [f"{row},{way}" for row, way in zip(rows, ("1,0,-1", "-1,-1,1", "0,+1,1"), strict=True)]
    np.testing.assert_array_equal(
        read_campaign(write(tmp_path, APPROACH, stated), ROBOT).approach, [[1, 0, -1], [-1, -1, 1], [0, 1, 1]]
    )
    moves = f"{HEADER},J1_move_deg,q2_move_rad,slide_move_mm"
    moved = read_campaign(write(tmp_path, moves, [f"{row},-90,0.5,0" for row in rows]), ROBOT)
    np.testing.assert_allclose(moved.move, np.tile([-np.pi / 2, 0.5, 0.0], (3, 1)))
    np.testing.assert_array_equal(moved.approach, np.tile([-1, 1, 0], (3, 1)))


@pytest.mark.parametrize("ids", ["numbers", "names"])
def test_rows_in_any_order_are_reached_in_that_of_their_times(tmp_path, ids):
    """Where two are the same, a way is that of the rows as they stand, or not known."""
    rng = np.random.default_rng(0)
    q = rng.integers(-45, 45, (12, 3))
    names = [str(k) if ids == "numbers" else "abcdefghijkl"[k] for k in range(12)]
    rows = [f"{names[k]},{a},{b},{100 + c},1,2,{k + 3}" for k, (a, b, c) in enumerate(q)]
    plain = read_campaign(write(tmp_path, rows=rows), ROBOT)
    for order in (np.arange(12), np.arange(12)[::-1], rng.permutation(12)):
        timed = [f"{rows[k]},{60 * k}" for k in order]
        found = read_campaign(write(tmp_path, f"{HEADER},time_s", timed), ROBOT)
        np.testing.assert_array_equal(found.approach, plain.approach[order])
        np.testing.assert_array_equal(found.move, plain.move[order])
        assert any("order of their times" in note for note in found.notes) == (order[0] > 0)
        same = read_campaign(write(tmp_path, f"{HEADER},time_s", [f"{rows[k]},{60 * (k // 2)}" for k in order]), ROBOT)
        untimed = read_campaign(write(tmp_path, rows=[rows[k] for k in order]), ROBOT)
        assert ((same.approach == untimed.approach) | (same.approach == 0.0)).all()


def test_behind_a_clock_that_begins_anew_nothing_is_known_of_a_way(tmp_path):
    rows = [f"r{k},{10 * k},{5 * k},{20 * k},1,2,{k + 3},{60 * (k % 4)}" for k in range(8)]
    found = read_campaign(write(tmp_path, f"{HEADER},time_s", rows), ROBOT)
    known = np.array([0, 1, 1, 1, 0, 1, 1, 1], dtype=float)
    np.testing.assert_array_equal(found.approach, np.repeat(known[:, None], 3, axis=1))
    assert found.notes == ()


@pytest.mark.parametrize(
    ("ids", "known"),
    [
        (("1", "2", "3", "5", "6"), [False, True, True, False, True]),
        (("10", "20", "40", "50", "60"), [False, True, False, True, True]),
        (("3", "2", "1", "0", "7"), [False, True, True, True, True]),
        (("a", "2", "5", "6", "7"), [False, True, True, True, True]),
    ],
    ids=str,
)
def test_ids_that_count_tell_where_rows_were_left_out(tmp_path, ids, known):
    rows = [f"{name},{10 * i},{5 * i},{20 * i},1,2,3" for i, name in enumerate(ids)]
    approach = read_campaign(write(tmp_path, rows=rows), ROBOT).approach
    np.testing.assert_array_equal(approach, np.repeat(np.array(known, dtype=float)[:, None], 3, axis=1))


@pytest.mark.parametrize(
    ("header", "row", "message"),
    [
        (
            f"{HEADER},J1_approach",
            "a,0,0,0,1,2,3,1",
            r"has 'J1_approach' but no column 'Elbow_approach'; give it, with 0",
        ),
        (APPROACH, "a,0,0,0,1,2,3,1,0.5,0", r":2: column 'Elbow_approach': 0.5 is not a way of approach; give 1"),
        (APPROACH, "a,0,0,0,1,2,3,1,,0", r":2: column 'Elbow_approach': the cell is empty; give 1, -1, or 0"),
        (
            f"{APPROACH},q1_approach",
            "a,0,0,0,1,2,3,1,0,0,1",
            r"joint J1 is given twice, by 'J1_approach' and 'q1_approach'",
        ),
        (f"{HEADER},J1_move_deg,Elbow_move_deg", "a,0,0,0,1,2,3,1,1", r"but no column 'slide_move_mm'"),
        (f"{HEADER},J4_approach", "a,0,0,0,1,2,3,1", r"unknown column 'J4_approach'; .* J1_approach …"),
    ],
)
def test_an_approach_that_is_none_is_refused(tmp_path, header, row, message):
    with pytest.raises(FileError, match=message):
        read_campaign(write(tmp_path, header, [row]), ROBOT)


@pytest.mark.parametrize(
    "ids", [["9" * 5000, "8" * 5001, "7" * 5002], ["١", "٢", "٣"]], ids=["endless", "other digits"]
)
def test_ids_that_are_no_counts_are_names(tmp_path, ids):
    campaign = read_campaign(write(tmp_path, rows=[f"{name},10,20,300,1000,-200,50.5" for name in ids]), ROBOT)
    assert campaign.ids == tuple(ids)


BESIDE = {
    "nothing": "",
    "a quaternion, a matrix and angles": "quaternion matrix angles",
    "a matrix and angles": "matrix angles",
    "a quaternion and angles": "quaternion angles",
    "angles": "angles",
    "part of a matrix": "first",
    "uncertainties": "total parts",
    "parts of uncertainties": "parts",
    "one part": "first-part",
    "times": "times",
}


@pytest.mark.parametrize("beside", BESIDE)
def test_a_column_is_named_as_left_out_where_it_changes_nothing(beside, tmp_path):
    """Of several forms of one quantity, those that are not read."""
    q, T, _ = measured_files.measured(6)
    rng = np.random.default_rng(0)
    R = Rotation.from_matrix(T[:, :3, :3])
    matrix = {f"r{i + 1}{j + 1}": T[:, i, j] for i in range(3) for j in range(3)}
    parts = {f"s{axis}_mm": rng.uniform(0.01, 0.02, 6) for axis in "xyz"}
    forms = {
        "quaternion": dict(zip(("qx", "qy", "qz", "qw"), R.as_quat().T, strict=True)),
        "matrix": matrix,
        "first": {"r11": matrix["r11"]},
        "angles": dict(zip("ABC", R.as_euler("ZYX", degrees=True).T, strict=True)),
        "total": {"u_mm": rng.uniform(0.01, 0.02, 6)},
        "parts": parts,
        "first-part": {"sx_mm": parts["sx_mm"]},
        "times": {"time_s": np.arange(6.0), "timestamp_s": 7.0 * np.arange(6.0)},
    }
    more = {name: cells for form in BESIDE[beside].split() for name, cells in forms[form].items()}
    columns = dict(zip(measured_files.NAMED.split(), np.degrees(q).T, strict=True))
    columns |= (
        dict(zip(("x_mm", "y_mm", "z_mm"), 1e3 * T[:, :3, 3].T, strict=True)) | more | {"pressure": rng.uniform(size=6)}
    )

    def read(columns):
        rows = np.stack(list(columns.values()), axis=1)
        try:
            path = measured_files.write(tmp_path, "a.txt", " ".join(columns), rows.tolist())
            return read_campaign(path, measured_files.ROBOT)
        except FileError as error:
            return str(error)

    def numbers(campaign):
        own = (
            campaign.q,
            campaign.points,
            campaign.rotations,
            campaign.uncertainty,
            campaign.time,
            campaign.temperature,
        )
        return [None if one is None else one.tolist() for one in own]

    whole = read(columns)
    (said,) = [
        note.partition("left out: ")[2].partition(";")[0].split(", ") for note in whole.notes if "left out: " in note
    ]
    for name in columns:
        other = read(columns | {name: columns[name] + 1e-3 * np.arange(6.0)})
        unread = not isinstance(other, str) and numbers(other) == numbers(whole)
        assert unread == (name in said), name

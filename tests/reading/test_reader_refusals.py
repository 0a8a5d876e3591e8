"""Campaign files that are refused: with file, line, column, value and a remedy."""

import numpy as np
import pytest

from taskcal.errors import FileError
from taskcal.reading.reader import read_campaign
from tests.reading.campaign_files import HEADER, JOINTS, ROBOT, ROWS, write

TARGETS = f"id,{JOINTS}," + ",".join(f"{t}_{a}_mm" for t in ("smr1", "base1", "Base2", "smr2") for a in "xyz")


TARGET_ROW = ["a,0,0,0," + ",".join(map(str, range(1, 13)))]


def row(**cells):
    """The first row with some cells replaced."""
    names = HEADER.split(",")
    values = dict(zip(names, ROWS[0].split(","), strict=True)) | cells
    return [",".join(values[name] for name in names), ROWS[1]]


POSE = HEADER + ",qx,qy,qz,qw"


WRONG = {
    "id empty": (HEADER, row(id=""), ":2: column 'id': the row has no id; give each row its own"),
    "id twice": (HEADER, row(id="b"), ":3: column 'id': id 'b' stands in line 2 already; give each row its own"),
    "joint missing": (
        HEADER.replace(",Elbow_deg", ""),
        ["a,1,2,3,4,5"],
        r":1: has no column for joint Elbow of arm; it needs one for each of J1, Elbow, slide, such as Elbow_deg or q",
    ),
    "joint twice": (
        HEADER.replace("id,", "id,q2_deg,"),
        ["a,1,2,3,4,5,6,7"],
        r":1: joint Elbow is given twice, by 'q2_deg' and 'Elbow_deg'; keep one",
    ),
    "joint in two units": (
        HEADER.replace("id,", "id,J1_rad,"),
        ["a,1,2,3,4,5,6,7"],
        r":1: joint J1 is given twice, by 'J1_rad' and 'J1_deg'; keep one",
    ),
    "joint without unit": (
        HEADER.replace("J1_deg", "J1"),
        ROWS,
        ":1: column 'J1': the unit is not stated; name the column J1_deg or J1_rad",
    ),
    "sliding joint in degrees": (
        HEADER.replace("slide_mm", "slide_deg"),
        ROWS,
        ":1: column 'slide_deg': 'deg' is no unit of this joint; name the column slide_mm or slide_m",
    ),
    "joint too many": (
        HEADER + ",J4_deg",
        [r + ",0" for r in ROWS],
        ":1: 'J4_deg' is a joint that arm does not have; it has 3",
    ),
    "joint empty": (
        HEADER,
        row(J1_deg=""),
        ":2: column 'J1_deg': the cell is empty; give a number, or leave out the row",
    ),
    "joint NaN": (
        HEADER,
        row(Elbow_deg="NaN"),
        ":2: column 'Elbow_deg': 'NaN' is not a finite number; .* leave out the row",
    ),
    "joint infinite": (HEADER, row(Elbow_deg="-inf"), ":2: column 'Elbow_deg': '-inf' is not a finite number"),
    "joint text": (
        HEADER,
        row(J1_deg="home"),
        ":2: column 'J1_deg': 'home' is not a number; give a number such as 12.5",
    ),
    "joint beyond its limit": (
        HEADER,
        row(J1_deg="170.1", Elbow_deg="75"),
        r":2: J1 = 170\.100° is outside -170 to 170° \(1 of 2 rows are outside the limits of arm\); check the units",
    ),
    "joints beyond a coupled limit": (HEADER, row(J1_deg="-90"), r":2: Elbow - J1 = 110\.000° is outside -100 to 100°"),
    "sliding joint beyond its limit": (HEADER, row(slide_mm="-1"), r":2: slide = -1\.000 mm is outside 0 to 800 mm"),
    "no target": (f"id,{JOINTS}", ["a,0,0,0"], ":1: names no target; give columns x_mm, y_mm, z_mm, or NAME_x_mm"),
    "only points": (f"id,{JOINTS},base_x_mm,base_y_mm,base_z_mm", ["a,0,0,0,1,2,3"], ":1: names no target"),
    "axis missing": (HEADER.replace(",y_mm", ""), ["a,0,0,0,1,2"], ":1: has 'x_mm' but no column 'y_mm'"),
    "axis of a target missing": (
        HEADER + ",smr_x_mm,smr_y_mm",
        [r + ",1,2" for r in ROWS],
        ":1: has 'smr_x_mm' but no column 'smr_z_mm'",
    ),
    "point partly empty": (
        HEADER,
        row(z_mm=""),
        ":2: column 'z_mm': the cell is empty while its target's others are not; leave all three empty",
    ),
    "point text": (HEADER, row(x_mm="lost"), ":2: column 'x_mm': 'lost' is not a number"),
    "point NaN": (HEADER, row(x_mm="nan"), ":2: column 'x_mm': 'nan' is not a finite number; .*target's cells empty"),
    "point without unit": (
        HEADER.replace("x_mm", "x"),
        ROWS,
        ":1: column 'x': the unit is not stated; name the column x_mm",
    ),
    "two units of length": (
        HEADER.replace("z_mm", "z_m"),
        ROWS,
        r":1: the axes of one target have different units: 'x_mm' \(mm\), 'y_mm' \(mm\), 'z_m' \(m\); give all three in one unit",
    ),
    "points in degrees": (
        HEADER.replace("_mm,", "_deg,").replace("z_mm", "z_deg").replace("slide_deg", "slide_mm"),
        ROWS,
        ":1: column 'x_deg': 'deg' is no unit of length; known: mm, m",
    ),
    "nearly an approach": (
        HEADER + ",J4_approach",
        [r + ",5" for r in ROWS],
        r":1: unknown column 'J4_approach'; a campaign has id, joints \(J1_deg",
    ),
    "columns equal but for case": (
        HEADER + ",X_mm",
        [r + ",5" for r in ROWS],
        ":1: 'x_mm' and 'X_mm' are both the x of one target; keep one",
    ),
    "quaternion lacks a column": (
        HEADER + ",qx,qy,qz",
        [r + ",0,0,0" for r in ROWS],
        ":1: has 'qx' but no column 'qw'; a pose needs",
    ),
    "quaternion partly empty": (
        POSE,
        [r + ",0,0,,1" for r in ROWS],
        ":2: column 'qz': the cell is empty while the position is there",
    ),
    "quaternion not unit": (
        POSE,
        [ROWS[0] + ",0,0,0,1", ROWS[1] + ",0.5,0,0,1"],
        r":3: column 'qx': the quaternion has length 1\.1180; it must be 1",
    ),
    "quaternion of several targets": (
        TARGETS + ",qx,qy,qz,qw",
        [TARGET_ROW[0] + ",0,0,0,1"],
        ":1: a pose has one target, this file names smr1, smr2; choose one",
    ),
    "uncertainty zero": (
        HEADER + ",u_mm",
        [ROWS[0] + ",0.1", ROWS[1] + ",0"],
        ":3: column 'u_mm': 0 is not a standard uncertainty; give one",
    ),
    "uncertainty negative": (
        HEADER + ",u_mm",
        [r + ",-0.1" for r in ROWS],
        ":2: column 'u_mm': -0.1 is not a standard uncertainty",
    ),
    "uncertainty empty": (HEADER + ",u_mm", [ROWS[0] + ",", ROWS[1] + ",1"], ":2: column 'u_mm': the cell is empty"),
    "uncertainty of some targets": (
        TARGETS + ",smr1_u_mm",
        [TARGET_ROW[0] + ",1"],
        ":1: states the uncertainty of some targets but not of 'smr2'; give smr2_u_mm",
    ),
    "decimal comma between commas": (
        HEADER,
        ["a,10,5,20,0,1,2,3"],
        r":2: the line has 8 fields, the header 7; is it written with decimal commas\?",
    ),
    "fields too few": (HEADER, ["a,10,20"], ":2: the line has 3 fields, the header 7"),
    "no rows": (HEADER, [], ": has no measurements below its header"),
}


@pytest.mark.parametrize("case", WRONG)
def test_reader_refuses_with_place_value_and_remedy(tmp_path, case):
    header, rows, message = WRONG[case]
    with pytest.raises(FileError, match=rf"campaign\.csv{message}"):
        read_campaign(write(tmp_path, header, rows), ROBOT)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b"\x00\x01\x02\x03,\n", "binary file"),
        (b"\xff\xfe\x81", "not the UTF-16 text that it says it is"),
        (None, "cannot be read"),
    ],
    ids=["empty", "binary", "cut off", "missing"],
)
def test_rejects_file_without_table(tmp_path, content, message):
    """A file without a table is rejected."""
    path = tmp_path / "campaign.csv"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(FileError, match=rf"campaign\.csv: .*{message}"):
        read_campaign(path, ROBOT)


@pytest.mark.parametrize("choice", [{"targets": ["smr9"]}, {"reference_points": ["smr9"]}])
def test_a_target_that_is_not_there_is_named_with_those_that_are(tmp_path, choice):
    with pytest.raises(FileError, match=r"campaign\.csv:1: has no target 'smr9'; it has smr1, base1, Base2, smr2"):
        read_campaign(write(tmp_path, TARGETS, TARGET_ROW), ROBOT, **choice)


def test_reader_refuses_a_coordinate_beyond_all_trackers(tmp_path):
    with pytest.raises(FileError, match=r"campaign\.csv:3: column 'y_mm': '1e200' is beyond ±100000"):
        read_campaign(write(tmp_path, rows=[ROWS[0], "b,-30.5,4,0,900,1e200,60"]), ROBOT)


def test_reader_refuses_more_targets_than_a_tool_carries(tmp_path):
    columns = ",".join(f"T{i}_{axis}_mm" for i in range(1_100) for axis in "xyz")
    row = "a,10,20,300," + ",".join(["1"] * 3_300)
    with pytest.raises(FileError, match=r"names 1100 targets; Taskcal fits 100 at most: choose some"):
        read_campaign(write(tmp_path, f"id,{JOINTS},{columns}", [row]), ROBOT)


def test_limits_forgive_rounding_to_six_digits(tmp_path):
    campaign = read_campaign(write(tmp_path, rows=row(J1_deg="100.00001", Elbow_deg="0")), ROBOT)
    assert len(campaign) == 2


SEVERAL = f"id,{JOINTS}," + ",".join(f"{t}_{a}_mm" for t in ("one", "two") for a in "xyz")

MOVED_MM = np.array([50.0, 0.0, -3.0])


@pytest.mark.parametrize(
    ("second", "said"),
    [
        (lambda one: one, "has the numbers of 'one' in 9 rows"),
        (lambda one: np.roll(one, 2, axis=0), "has the numbers of 'one' in 9 rows"),
        (lambda one: np.concatenate([one[:6], one[6:] + MOVED_MM]), "has the numbers of 'one' in 6 rows"),
        (lambda one: one + MOVED_MM, "is that of 'one' moved by the same numbers in all 9 rows"),
        (lambda one: np.broadcast_to(one[0] + 40.0, one.shape), "has the same numbers in all 9 rows"),
    ],
)
def test_columns_of_a_target_that_were_copied_are_refused(tmp_path, second, said):
    """The same numbers, a few rows farther, in some rows, moved along, or one for all; chosen alone, the measured one is read."""
    rng = np.random.default_rng(0)
    one, q = (rng.uniform(-60.0, 60.0, (9, 3)).round(3) for _ in range(2))
    two = second(one).round(3)
    q = np.abs(q)  # a slide that begins at zero
    rows = [",".join(map(str, [f"r{k}", *q[k], *one[k], *two[k]])) for k in range(9)]
    path = write(tmp_path, SEVERAL, rows)
    with pytest.raises(FileError, match=f"target 'two' {said}") as refusal:
        read_campaign(path, ROBOT)
    assert "--targets" in str(refusal.value)
    assert read_campaign(path, ROBOT, targets=["one"]).targets == ("one",)

"""Groups of columns mean the same in whatever letters, units and order a file writes them."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.errors import FileError
from taskcal.tables.column_groups import JOINT_UNITS, ColumnGroups
from taskcal.tables.table import Table

ARM = SimpleNamespace(name="arm", joint_names=("base", "J2", "rail"), prismatic=(False, False, True))


def groups(*lines):
    header, *rows = (tuple(line.split(",")) for line in lines)
    return ColumnGroups(Table(Path("table.csv"), header, rows, range(2, len(rows) + 2)))


def either_case(text):
    return st.lists(st.booleans(), min_size=len(text), max_size=len(text)).map(
        lambda upper: "".join(c.upper() if u else c.lower() for c, u in zip(text, upper, strict=True))
    )


@given(st.data(), st.lists(st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3), min_size=1, max_size=4))
def test_joints_are_read_by_any_spelling_unit_letter_case_and_order(data, rows):
    q = np.array(rows)
    units = [data.draw(st.sampled_from(["mm", "m"] if slides else ["deg", "rad"])) for slides in ARM.prismatic]
    spellings = [data.draw(st.sampled_from([name, f"J{i}", f"q{i}"])) for i, name in enumerate(ARM.joint_names, 1)]
    header = [data.draw(either_case(f"{spelling}_{unit}")) for spelling, unit in zip(spellings, units, strict=True)]
    written = q / [JOINT_UNITS[unit] for unit in units]
    order = data.draw(st.permutations(range(3)))
    lines = [",".join(repr(float(row[j])) for j in order) for row in written]
    columns = groups(",".join(header[j] for j in order), *lines)
    assert columns.joint_columns(ARM) == tuple(header)
    np.testing.assert_allclose(columns.joints(ARM), q, rtol=1e-12)
    columns.refuse_unused("")


def test_what_was_asked_for_is_remembered_in_any_letters():
    columns = groups("ID,X_mm,y_MM,z_mm,note,qx,qy,qz,qw", "a,1,2,3,hot,0,0,0,1")
    assert columns.texts("id") == ["a"]
    np.testing.assert_allclose(columns.points(), [[1e-3, 2e-3, 3e-3]])
    with pytest.raises(FileError, match="unknown columns 'note', 'qx', 'qy', 'qz', 'qw'; only points"):
        columns.refuse_unused("only points")
    np.testing.assert_array_equal(columns.quaternions(), [[0, 0, 0, 1]])
    with pytest.raises(FileError, match="unknown column 'note'; no notes"):
        columns.refuse_unused("no notes")
    assert columns.texts("Note") == ["hot"]
    columns.refuse_unused("anything")


def test_rows_that_need_no_rotation_get_none_that_turns():
    columns = groups("id,p_qx,p_qy,p_qz,p_qw", "a,1,0,0,0", "b,,,,", "c,0.6,0,0,0.7")
    needed = np.array([True, False, False])
    np.testing.assert_array_equal(columns.quaternions("p_", needed=needed), [[1, 0, 0, 0], [0, 0, 0, 1], [0, 0, 0, 1]])


WRONG = {
    "case": (lambda: groups("a,A", "1,2"), "csv:1: two columns are named 'a' but for letter case"),
    "some": (lambda: groups("X_mm,z_mm", "1,2").points(), "csv:1: has 'X_mm' but no column 'y_mm'"),
    "none": (lambda: groups("a", "1").points(), "csv:1: has no column 'x_mm'; it has a"),
    "unit": (
        lambda: groups("X,y,z", "1,2,3").points(),
        "csv:1: column 'X': the unit is not stated; name the column X_mm",
    ),
    "cell": (lambda: groups("x_mm,y_mm,Z_mm", "1,2,").points(), "csv:2: column 'Z_mm': the cell is empty; .*leave out"),
    "length": (
        lambda: groups("QX,qy,qz,qw", "0,0,0,1", "1,0,0,1").quaternions(),
        r"csv:3: column 'QX': the quaternion has length 1\.4142; it must be 1 \(is qw last\?\)",
    ),
    "robot": (lambda: groups("J1_deg,J2_deg", "1,2").joints(ARM), "csv:1: has no column for joint rail of arm"),
    "twice": (
        lambda: groups("J1_deg,Base_rad", "1,2").joints(ARM),
        "joint base is given twice, by 'Base_rad' and 'J1_",
    ),
    "too many": (
        lambda: groups("J1_deg,J2_deg,J3_m,q4_rad", "1,2,3,4").joints(ARM),
        "'q4_rad' is a joint that arm does",
    ),
    "some joints": (
        lambda: groups("J1_deg,J3_m", "1,2").joint_columns(ARM),
        "has 'J1_deg' but no column 'J2_deg' of arm",
    ),
    "joint without a unit": (lambda: groups("J1", "1").joints(ARM), "column 'J1': .*name the column J1_deg or J1_rad"),
}


@pytest.mark.parametrize(("read", "message"), WRONG.values(), ids=WRONG)
def test_a_wrong_group_is_told_where_and_what(read, message):
    with pytest.raises(FileError, match=message):
        read()

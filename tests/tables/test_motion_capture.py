from pathlib import Path

import pytest

from taskcal.errors import FileError
from taskcal.tables.text import is_motion_capture, parse_motion_capture

EXPORT = """Format Version,1.23,Take Name,a,Rotation Type,Quaternion,Length Units,Millimeters

,Type,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body Marker
,Name,My Tool,My Tool,My Tool,My Tool,My Tool,My Tool,My Tool,My Tool:M1
,ID,1,1,1,1,1,1,1,2
,,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Position
Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,X
0,0.0,0,0,0,1,10,20,30,5
1,0.1,0,0,0,1,11,20,30,6
"""


def test_bodies_and_markers_are_named_columns():
    assert is_motion_capture(EXPORT)
    sheet = parse_motion_capture(Path("a.csv"), EXPORT)
    assert sheet.rows[0] == (
        *("Frame", "Time (Seconds)", "My_Tool_qx", "My_Tool_qy", "My_Tool_qz", "My_Tool_qw"),
        *("My_Tool_x_mm", "My_Tool_y_mm", "My_Tool_z_mm", "My_Tool_M1_x_mm"),
    )
    assert sheet.rows[2] == ("1", "0.1", "0", "0", "0", "1", "11", "20", "30", "6")
    assert tuple(sheet.lines) == (7, 8, 9)


def test_rows_of_types_and_names_need_not_say_so():
    older = EXPORT.replace(",Type,", ",,").replace(",Name,", ",,").replace(",ID,", ",,")
    assert list(parse_motion_capture(Path("a.csv"), older).rows) == list(
        parse_motion_capture(Path("a.csv"), EXPORT).rows
    )


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("Quaternion", "XYZ", "has rotations as XYZ; export them as quaternions"),
        ("Millimeters", "Furlongs", "states no unit of length that is known"),
        (",Name,", ",Label,", "lacks its rows of types, names and axes"),
        ("Frame,", "Number,", "lacks its rows of types, names and axes"),
    ],
)
def test_other_exports_are_refused_with_what_is_lacking(old, new, message):
    with pytest.raises(FileError, match=rf"a\.csv:1: .*{message}"):
        parse_motion_capture(Path("a.csv"), EXPORT.replace(old, new))

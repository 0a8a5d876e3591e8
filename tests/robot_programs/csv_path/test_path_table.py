"""What is not a path."""

import pytest

from taskcal.errors import FileError
from tests.robot_programs.csv_path.texts import read

WRONG = {
    "id,x_mm,y_mm,z_mm\n0,1,2,3\n": r"path\.csv:1: has positions without the tool's orientation",
    "x_mm,y_mm,i,j,k\n": r"path\.csv:1: has 'x_mm' but no column 'z_mm'",
    "x,y,z,i,j,k\n": r"path\.csv:1: column 'x': the unit is not stated; name the column x_mm",
    "x_mm,y_mm,z_mm,i,j,k,feed\n": r"path\.csv:1: unknown column 'feed'; a path has",
    "x_mm,y_mm,z_mm,i,j,k,X_MM\n": r"path\.csv:1: two columns are named 'x_mm' but",
    "x_mm,y_mm,z_mm,i,j,k,qx,qy,qz,qw\n": r"path\.csv:1: has both a quaternion and a tool axis",
    "qx,qy,qz,qw,J1_deg\n": r"path\.csv:1: has orientations without positions",
    "id\n1\n": r"path\.csv:1: has neither positions x_mm y_mm z_mm nor joints",
    "J2_deg\n1\n": r"path\.csv:1: has no column for joint 1, such as J1_deg",
    "x_mm,y_mm,z_mm,i,j,k\n1,2,,0,0,1\n": r"path\.csv:2: column 'z_mm': the cell is empty while its others are not",
    "x_mm,y_mm,z_mm,i,j,k\n\n1,2,3,0,0,2\n": r"path\.csv:3: column 'i': the tool axis has length 2\.0000",
    "x_mm,y_mm,z_mm,qx,qy,qz,qw\n1,2,3,0,0,0,0\n": r"path\.csv:2: column 'qx': the quaternion has length 0\.0000",
    "x_mm,y_mm,z_mm,i,j,k\n1,2,3,0,0,one\n": r"path\.csv:2: column 'k': 'one' is not a number",
    "x_mm,y_mm,z_mm,i,j,k,J1_deg\n1,2,3,0,0,1,5\n": r"path\.csv:2: the row has a pose and joint positions",
    "x_mm,y_mm,z_mm,i,j,k,J1_deg\n,,,,,,\n1,2,3,0,0,1,\n,,,,,,5\nx,,,,,,\n": r"path\.csv:5: column 'x_mm': 'x' is not a number",
    "id,J1_deg\n7,\n": r"path\.csv:2: the row has no target",
    "x_mm,y_mm,z_mm,i,j,k,move\n1,2,3,0,0,1,hop\n": r"path\.csv:2: column 'move': 'hop' is not a motion to a pose; write joint,",
    "x_mm,y_mm,z_mm,i,j,k,move\n1,2,3,0,0,1,via\n": r"path\.csv:2: a via point must be followed",
    "x_mm,y_mm,z_mm,i,j,k,move\n1,2,3,0,0,1,circular\n": r"path\.csv:2: column 'move': a row 'via' .* before the end",
    "J1_deg,move\n1,linear\n": r"path\.csv:2: column 'move': 'linear' needs a pose",
    "J1_deg,speed_mm_s\n1,-5\n": r"path\.csv:2: column 'speed_mm_s': -5 is not a speed",
    "J1_deg,stop\n1,maybe\n": r"path\.csv:2: column 'stop': 'maybe' is neither yes nor no",
    'J1_deg,name\n1,"a ""b"""\n': r"path\.csv: has quotes inside cells",
    'J1_deg,J2_deg\n1,2\n1,"2': r"path\.csv:3: has a quote that does not end",
    "J1_deg\r1\r2": r"path\.csv:1: has a carriage return alone",
    "": r"path\.csv: is empty; its first line must name the columns",
    "x_mm,y_mm\n" + 30_000 * "1,": r"path\.csv:2: has more than 20000 columns",
    "J1_deg,J1_deg\n": r"path\.csv:1: two columns are named 'J1_deg'; column names must differ",
    "J1_deg\n1,5\n2\n3,5\n": r"path\.csv:2: the line has 2 fields, the header 1; is it written with decimal commas\?\n.*:4",
    "J1_deg\na\n1\nnan\n1e7\n": r"(?s)path\.csv:2: .*'a' is not a.*:4: .*'nan' is not a finite.*:5: .*beyond ±1e\+06",
}


@pytest.mark.parametrize("text", WRONG)
def test_what_is_no_path_is_refused_with_its_place(text):
    with pytest.raises(FileError, match=WRONG[text]):
        read(text)

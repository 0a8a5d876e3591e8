"""What the rows of a path mean."""

import numpy as np

from tests.robot_programs.csv_path.texts import ARC, read


def test_an_arc_has_a_row_for_the_point_on_its_way():
    program = read(ARC)
    assert [move.kind for move in program.motions] == ["joint", "circular", "linear"]
    assert [move.follows for move in program.motions] == [None, 0, 1]
    arc = program.motions[1]
    np.testing.assert_allclose(arc.via.T[:3, 3], [0.01, 0.01, 0.0])
    assert (arc.place.line, arc.via.place.line) == (4, 3)


def test_rows_of_another_tool_stay_as_they_are():
    program = read("tool,x_mm,y_mm,z_mm,i,j,k\nmill,1,2,3,0,0,1\nsaw,1,2,3,0,0,1\nmill,1,2,4,0,0,1\n")
    assert [move.place.line for move in program.motions] == [2, 4]
    assert program.motions[1].follows is None
    assert str(program.diagnostics[0]).startswith("path.csv:3: tool 'saw' is not known; only 'mill' was given")

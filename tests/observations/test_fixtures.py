import re

import numpy as np
import pytest

from taskcal.errors import FileError
from taskcal.observations import load_fixtures


@pytest.fixture
def write(tmp_path):
    def written(*lines):
        path = tmp_path / "stands.csv"
        path.write_text("\n".join(lines) + "\n")
        return path

    return written


def test_sockets_have_places_and_directions(write):
    path = write("place,socket,x_mm,y_mm,z_mm,i,j,k", "left,a,400,100,50,0,0,2", "right,a,400,-100,50,3,0,4")
    fixtures = load_fixtures(path, "socket")
    assert fixtures.names == ("left/a", "right/a")
    assert fixtures.places == ("left", "right")
    np.testing.assert_allclose(fixtures.position, [[0.4, 0.1, 0.05], [0.4, -0.1, 0.05]])
    np.testing.assert_allclose(fixtures.direction, [[0, 0, 1], [0.6, 0, 0.8]])


def test_without_a_direction_things_face_up(write):
    fixtures = load_fixtures(write("anchor,x_mm,y_mm,z_mm", "front,900,0,0"), "wire")
    assert (fixtures.names, fixtures.places) == (("front",), ("",))
    np.testing.assert_array_equal(fixtures.direction, [[0, 0, 1]])


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (["socket,x_mm,y_mm", "a,1,2"], "has no column 'z_mm'"),
        (["x_mm,y_mm,z_mm", "1,2,3"], "has no column 'socket'"),
        (["socket,x_mm,y_mm,z_mm", "a,1,2,3", "a,4,5,6"], "3: column 'socket': 'a' is there twice"),
        (["socket,x_mm,y_mm,z_mm", ",1,2,3"], "2: column 'socket': the cell is empty"),
        (["place,socket,x_mm,y_mm,z_mm", ",a,1,2,3"], "2: column 'place': the cell is empty"),
        (["socket,x_mm,y_mm,z_mm", "a/b,1,2,3"], "has a /"),
        (["socket,x_mm,y_mm,z_mm", "a,1,here,3"], "'here' is not a number"),
        (["socket,x_mm,y_mm,z_mm,i,j,k", "a,1,2,3,0,0,0"], "0 0 0 is not a direction"),
        (["socket,x_mm,y_mm,z_mm,i,j", "a,1,2,3,0,0"], "has no column 'k'"),
    ],
)
def test_a_wrong_cell_is_named(write, lines, said):
    with pytest.raises(FileError, match=re.escape(said)):
        load_fixtures(write(*lines), "socket")

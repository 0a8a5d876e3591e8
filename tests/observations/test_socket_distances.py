import re
from dataclasses import replace

import numpy as np
import pytest

from taskcal.campaigns.campaign import Campaign, with_distances
from taskcal.errors import FileError
from taskcal.observations import Sockets
from taskcal.observations.socket import CALLIPER


def campaign(*names):
    n = len(names)
    kind = Sockets(sockets=names, of=np.arange(n))
    return Campaign(
        ids=tuple(map(str, range(n))),
        q=np.zeros((n, 6)),
        targets=("ball",),
        points=np.zeros((n, 1, 3)),
        observations=(kind,),
    )


BLOCKS = campaign("left/0", "left/1", "right/0", "right/1", "far/0")


def test_socket_distance_applies_to_every_place_of_block(tmp_path):
    """A stated distance of two sockets applies at every place of their block."""
    file = tmp_path / "d.csv"
    file.write_text("socket_a,socket_b,distance_mm,u_mm\n0,1,50.0,0.01\n")
    (kind,) = with_distances(BLOCKS, file).observations
    assert [(d.a, d.b, d.distance, d.uncertainty) for d in kind.distances] == [
        ("left/0", "left/1", 0.05, 1e-5),
        ("right/0", "right/1", 0.05, 1e-5),
    ]


def test_one_block_s_sockets_are_named_with_their_place(tmp_path):
    file = tmp_path / "d.csv"
    file.write_text("socket_a,socket_b,distance_mm,u_mm\nleft/0,left/1,50.1,\nleft/1,right/0,812.5,0.3\n")
    (kind,) = with_distances(BLOCKS, file).observations
    assert [(d.a, d.b) for d in kind.distances] == [("left/0", "left/1"), ("left/1", "right/0")]
    assert [d.uncertainty for d in kind.distances] == [CALLIPER, pytest.approx(3e-4)]


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("0,7,50,", "d.csv:2: column 'socket_b': the campaign has no socket '7'; it has left/0"),
        ("0,0,50,", "d.csv:2: column 'socket_b': '0' is no distance from itself"),
        ("0,1,0.05,", "d.csv:2: column 'distance_mm': 0.05 mm is not a distance of two sockets"),
        ("0,1,fifty,", "d.csv:2: column 'distance_mm': 'fifty' is not a number"),
        ("0,1,50,0", "d.csv:2: column 'u_mm': give an uncertainty above zero"),
        ("0,1,50,\nleft/1,left/0,50,", "d.csv:3: column 'socket_a': the distance of left/1 and left/0 is stated twice"),
        ("left/0,1,50,", "no block of the campaign has the sockets 'left/0' and '1'"),
    ],
)
def test_a_wrong_row_is_refused_with_line_column_and_remedy(tmp_path, row, message):
    file = tmp_path / "d.csv"
    file.write_text(f"socket_a,socket_b,distance_mm,u_mm\n{row}\n")
    with pytest.raises(FileError, match=re.escape(message)):
        with_distances(BLOCKS, file)


def test_a_campaign_without_sockets_has_no_use_for_distances(tmp_path):
    file = tmp_path / "d.csv"
    file.write_text("socket_a,socket_b,distance_mm\n0,1,50\n")
    with pytest.raises(FileError, match=r"states distances of sockets, and .* has no column socket"):
        with_distances(replace(BLOCKS, observations=()), file)

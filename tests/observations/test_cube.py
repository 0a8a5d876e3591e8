import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taskcal.errors import CampaignError, FileError
from taskcal.geometry import se3
from taskcal.observations import Cubes, Measured
from taskcal.observations.cube import CubeSize
from taskcal.reading.reader import read_campaign
from taskcal.reading.writer import write_campaign
from tests.observations.files import ROBOT, written

seeds = st.integers(0, 2**32 - 1)
FACES = ("+x", "-x", "+y", "-y", "+z")
HEADER = "cube,face,edge_mm,tip_radius_mm"


def touched(seed, rows=40, faces=FACES, edge=0.1):
    """Poses of a probe that touches a cube of 100 mm with a ball of 2 mm, its tip on the tool, and the cube."""
    rng = np.random.default_rng(seed)
    t, of = rng.uniform(-0.1, 0.1, 3), np.arange(rows) % len(faces)
    cube = se3.pose(se3.exp(rng.normal(size=3)), rng.uniform(-0.8, 0.8, 3))
    at = rng.uniform(-0.045, 0.045, (rows, 3))
    for row, k in enumerate(of):
        at[row, "xyz".index(faces[k][1])] = (1 if faces[k][0] == "+" else -1) * (0.5 * edge + 0.002)
    R = se3.exp(rng.uniform(-1.0, 1.0, (rows, 3)))
    tool = se3.pose(R, se3.apply(cube, at) - R @ t)
    size = CubeSize(name="1", edge=0.1, tip=0.002)
    kind = Cubes(faces=tuple(f"1/{face}" for face in faces), of=of, sizes=(size,))
    return tool, Measured(np.zeros((rows, 3))), kind, t, cube


@given(seeds)
@settings(max_examples=5)
def test_tip_and_cube_are_found_without_a_guess(seed):
    tool, measured, kind, t, cube = touched(seed)
    placed = kind.place(tool, measured)
    np.testing.assert_allclose(placed.T_tool_target[:3, 3], t, atol=1e-6)
    np.testing.assert_allclose(se3.pose(se3.exp(placed.unknown[3:6]), placed.unknown[:3]), cube, atol=1e-6)
    np.testing.assert_array_equal(placed.unknown[6:], 0.0)
    assert placed.distance.max() < 1e-6


def test_opposite_cube_faces_determine_scale():
    """Opposite faces determine the edge length, and with it the scale of the robot."""
    tool, measured, kind, t, _ = touched(3, edge=0.1005)
    found = kind.settle(tool @ se3.pose(np.eye(3), t), measured, np.full(10, np.nan))
    (edge,) = kind.compare(found)
    assert (edge.name, edge.stated) == ("edge of cube 1", 0.1)
    assert edge.found == pytest.approx(0.1005, abs=1e-6)
    assert (kind.tells_scale, kind.shrinks) == (True, False)
    three = touched(3, faces=("+x", "+y", "+z"))[2]
    assert (three.tells_scale, three.shrinks) == (False, True)
    assert three.compare(found) == ()


def test_faces_under_wrong_names_and_too_few_are_refused():
    tool, measured, kind, _, _ = touched(4, faces=("+x", "+y", "+z"))
    mirrored = Cubes(faces=("1/+y", "1/+x", "1/+z"), of=kind.of, sizes=kind.sizes)
    with pytest.raises(
        CampaignError, match=r"the touches of face 1/\+[xyz] are turned by .* look at the names of the faces"
    ):
        mirrored.place(tool, measured)
    tool, measured, kind, _, _ = touched(4, faces=("+x", "-x"))
    with pytest.raises(CampaignError, match="cube '1' was not touched on three faces that meet"):
        kind.place(tool, measured)


def test_one_orientation_does_not_tell_the_tip():
    tool, measured, kind, t, _ = touched(6)
    tips = tool[:, :3, 3] + tool[:, :3, :3] @ t
    placed = kind.place(se3.pose(np.broadcast_to(np.eye(3), (len(tips), 3, 3)), tips), measured)
    np.testing.assert_allclose(placed.unobservable, np.eye(3), atol=1e-6)
    np.testing.assert_allclose(placed.T_tool_target, np.eye(4), atol=1e-9)
    assert placed.distance.max() < 1e-6


def test_touches_at_one_spot_of_every_face_are_refused():
    tool, measured, kind, t, cube = touched(7)
    faces = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1.0]])
    spots = se3.apply(cube, 0.052 * faces[kind.of] + [0.001, 0.002, 0.003])
    once = se3.pose(tool[:, :3, :3], spots - tool[:, :3, :3] @ t)
    with pytest.raises(CampaignError, match="the touches of cube '1' do not tell how it is turned; spread them"):
        kind.place(once, measured)


@given(seeds)
@settings(max_examples=5)
def test_cube_is_registered_from_six_touches_per_face(seed):
    """Six touches per face register the cube of a robot with errors of half a millimetre."""
    tool, measured, kind, t, cube = touched(seed, rows=30)
    tool[:, :3, 3] += 5e-4 * np.random.default_rng(seed).normal(size=(30, 3))
    placed = kind.place(tool, measured)
    assert np.linalg.norm(placed.T_tool_target[:3, 3] - t) < 0.01
    assert np.linalg.norm(placed.unknown[:3] - cube[:3, 3]) < 0.01
    assert np.linalg.norm(se3.log(cube[:3, :3].T @ se3.exp(placed.unknown[3:6]))) < 0.1


def test_a_few_touches_settle_about_the_cube_that_is_known():
    tool, measured, kind, t, cube = touched(5)
    known = np.concatenate([cube[:3, 3], se3.log(cube[:3, :3]), np.zeros(4)])
    rows = np.arange(3)
    few = kind.take(rows)
    found = few.settle((tool @ se3.pose(np.eye(3), t))[rows], measured.take(rows), known)
    np.testing.assert_allclose(found[:6], known[:6], atol=1e-6)


def test_touches_are_read_and_written(tmp_path):
    file = written(tmp_path, HEADER, "a,+X,100,2", ",,,", "a,-x,100,2", "b,+z,50,2")
    campaign = read_campaign(file, ROBOT)
    (kind,) = campaign.observations
    assert (kind.faces, kind.of.tolist()) == (("a/+x", "a/-x", "b/+z"), [0, -1, 1, 2])
    assert kind.sizes == (CubeSize(name="a", edge=0.1, tip=0.002), CubeSize(name="b", edge=0.05, tip=0.002))
    write_campaign(tmp_path / "again.csv", campaign, ROBOT)
    again = read_campaign(tmp_path / "again.csv", ROBOT).observations[0]
    assert again.describe() == kind.describe()
    assert Cubes.of_description(again.describe()).describe() == kind.describe()
    assert kind.take(np.array([0, 2])).sizes == kind.sizes[:1]


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (["a,top,100,2"], "campaign.csv:2: column 'face': 'top' is not a face; write +x, -x, +y, -y, +z or -z"),
        ([",+x,100,2"], "campaign.csv:2: column 'cube': the cell is empty; name the cube that was touched"),
        (["a,+x,,2"], "campaign.csv:2: column 'edge_mm': give the distance of opposite faces"),
        (
            ["a,+x,100,2", "a,+y,90,2"],
            "campaign.csv:3: column 'edge_mm': cube 'a' has another edge or tip in a row above",
        ),
    ],
)
def test_a_wrong_cell_is_refused(tmp_path, rows, message):
    with pytest.raises(FileError, match=re.escape(message)):
        read_campaign(written(tmp_path, HEADER, *rows), ROBOT)

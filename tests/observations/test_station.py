"""The station file, and what the tracker sees."""

import numpy as np
import pytest
import tomli_w
from hypothesis import given, settings

from taskcal.errors import FileError
from taskcal.geometry import se3
from taskcal.io.codec import describe
from taskcal.kinematics.clearance import Box, Links
from taskcal.observations.point import Reflector, Station, load_station
from tests.laws.campaigns import random_pose
from tests.laws.robots import generators

STATION = """
position_mm = [3200.0, -1900.0, -350.0]
reach_m = 25.0
[[reflector]]
name = "smr1"
position_mm = [0.0, 20.0, 80.0]
axis = [0.0, 0.0, 2.0]
acceptance_deg = 45.0
[[reflector]]
name = "ball"
position_mm = [10.0, 0.0, 0.0]
[[keep_out]]
center_mm = [500.0, 0.0, 100.0]
size_mm = [200.0, 400.0, 600.0]
"""


def written(tmp_path, text: str):
    path = tmp_path / "station.toml"
    path.write_text(text, encoding="utf-8")
    return path


def no_links(n: int) -> Links:
    return Links(start=np.zeros((n, 0, 3)), end=np.zeros((n, 0, 3)), radius=np.zeros(0))


def station(**changed) -> Station:
    reflector = Reflector(name="smr", position=np.zeros(3), axis=np.array([1.0, 0, 0]), acceptance=np.radians(30.0))
    given = {"position": np.zeros(3), "reach": 5.0, "nearest": 0.5, "reflectors": (reflector,), "keep_out": ()}
    return Station(**{**given, **changed})


def test_station_file_converts_to_metres_and_radians(tmp_path):
    """A file in millimetres and degrees gives a station in metres and radians."""
    found = load_station(written(tmp_path, STATION))
    np.testing.assert_allclose(found.position, [3.2, -1.9, -0.35])
    assert (found.reach, found.nearest) == (25.0, 0.5)
    smr, ball = found.reflectors
    np.testing.assert_allclose(smr.axis, [0, 0, 1])
    assert smr.acceptance == pytest.approx(np.pi / 4)
    assert ball.axis is None
    np.testing.assert_allclose(found.offsets, [[0, 0.02, 0.08], [0.01, 0, 0]])
    np.testing.assert_allclose(found.keep_out[0].size, [0.2, 0.4, 0.6])
    np.testing.assert_allclose(se3.apply(found.T_tracker_base, found.position[None])[0], 0.0, atol=1e-15)


def test_a_station_is_described_as_its_file_states_it(tmp_path):
    found = load_station(written(tmp_path, STATION))
    described = describe(found, brief=True)
    again = load_station(written(tmp_path, tomli_w.dumps(described)))
    np.testing.assert_allclose(again.position, found.position, rtol=1e-15)
    np.testing.assert_allclose(again.reflectors[0].axis, found.reflectors[0].axis, rtol=1e-15)
    assert described["reflector"][1] == {"name": "ball", "position_mm": [10.0, 0.0, 0.0]}
    assert (described["reach_m"], "nearest_m" in described) == (25.0, False)
    assert described["keep_out"] == [{"center_mm": [500.0, 0.0, 100.0], "size_mm": [200.0, 400.0, 600.0]}]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("position_mm = [3200.0, -1900.0, -350.0]", "", r"position_mm: is missing"),
        ("[3200.0, -1900.0, -350.0]", "[3200.0, -1900.0]", r"position_mm 3: is missing"),
        ("reach_m = 25.0", "reach_m = 0.0", r"reach_m: must be 1e-06 or more \(got 0\.0\)"),
        ("reach_m = 25.0", "range_m = 25.0", r"'range_m' is not a known key"),
        ("reach_m = 25.0", "reach_m = nan", r"reach_m: .*finite"),
        ("acceptance_deg = 45.0", "acceptance_deg = 200.0", r"reflector 1, acceptance_deg: .*180.*got 200\.0"),
        ('name = "ball"', 'name = "smr1"', r"two reflectors are named 'smr1'; give each its own name"),
        ('name = "ball"', 'name = "my ball"', r"reflector 2, name: is not a name.*got 'my ball'"),
        ("axis = [0.0, 0.0, 2.0]", "axis = [0.0, 0.0, 0.0]", r"reflector 1, axis: has no direction; give"),
        ("[200.0, 400.0, 600.0]", "[200.0, -400.0, 600.0]", r"keep_out 1, size_mm 2: must be 1e-06 or more \(got -400"),
        ("[10.0, 0.0, 0.0]", '[10.0, "x", 0.0]', r"reflector 2, position_mm 2: .*got 'x'"),
        ("reach_m = 25.0", "reach_m = ", r"is not TOML"),
    ],
)
def test_what_is_wrong_is_named_with_its_place_and_value(tmp_path, old, new, said):
    assert old in STATION
    path = written(tmp_path, STATION.replace(old, new))
    with pytest.raises(FileError, match=said) as caught:
        load_station(path)
    assert str(caught.value).startswith(str(path))


def test_station_rejects_missing_reflector_and_missing_file(tmp_path):
    """A station without a reflector and a missing file are rejected."""
    with pytest.raises(FileError, match="reflector"):
        load_station(written(tmp_path, "position_mm = [0.0, 0.0, 0.0]"))
    with pytest.raises(FileError, match="cannot be read"):
        load_station(tmp_path / "none.toml")


@pytest.mark.parametrize("length", [0.0, 0.5])
def test_a_quaternion_that_is_no_rotation_is_refused(tmp_path, length):
    box = f"{STATION}quaternion = [0.0, 0.0, 0.0, {length}]\n"
    with pytest.raises(FileError, match=r"keep_out 1.*quaternion.*must be 1"):
        load_station(written(tmp_path, box))


@given(generators)
def test_reflector_is_visible_within_acceptance_and_range(rng):
    """A reflector is visible within its acceptance angle and the tracker's range."""
    cell = station(position=rng.uniform(-1, 1, 3), reach=float(rng.uniform(1.5, 3)), nearest=float(rng.uniform(0.3, 1)))
    reflector = Reflector(
        name="smr", position=rng.uniform(-0.2, 0.2, 3), axis=np.array([0, 0, 1.0]), acceptance=rng.uniform(0.2, 2.8)
    )
    T = np.stack([random_pose(rng, 2.0) for _ in range(40)])
    found = station(position=cell.position, reach=cell.reach, nearest=cell.nearest, reflectors=(reflector,)).visible(
        T, no_links(40)
    )
    for pose, seen in zip(T, found[:, 0], strict=True):
        center = pose[:3, :3] @ reflector.position + pose[:3, 3]
        beam = cell.position - center
        distance = np.sqrt(beam @ beam)
        angle = np.arccos(np.clip(pose[:3, 2] @ beam / distance, -1, 1))
        assert seen == (cell.nearest <= distance <= cell.reach and angle <= reflector.acceptance)


@given(generators)
@settings(max_examples=20)
def test_a_ball_is_seen_from_everywhere(rng):
    ball = Reflector(name="ball", position=np.zeros(3), axis=None, acceptance=np.radians(1.0))
    T = np.stack([random_pose(rng, 1.0) for _ in range(20)])
    T[:, 0, 3] += 2.5
    assert station(reflectors=(ball,)).visible(T, no_links(20)).all()


def test_a_box_or_a_link_in_the_way_hides_a_reflector():
    T = np.tile(np.diag([-1.0, -1.0, 1.0, 1.0]), (2, 1, 1))  # the reflector looks back at the tracker
    T[:, 0, 3] = 2.0
    T[1, 1, 3] = 0.8
    assert station().visible(T, no_links(2))[:, 0].tolist() == [True, True]
    box = Box(pose=se3.translation(1.0, 0.0, 0.0), size=np.full(3, 0.3))
    assert station(keep_out=(box,)).visible(T, no_links(2))[:, 0].tolist() == [False, True]
    # one link across the first beam, then the last link, which carries the reflector and hides nothing
    start, end = np.zeros((2, 2, 3)), np.zeros((2, 2, 3))
    start[:, 0], end[:, 0] = [1.0, 0.0, -1.0], [1.0, 0.0, 1.0]
    start[:, 1], end[:, 1] = [1.0, 0.0, 1.0], T[:, :3, 3]
    links = Links(start=start, end=end, radius=np.full(2, 0.1))
    assert station().visible(T, links)[:, 0].tolist() == [False, True]


def test_a_link_of_no_length_hides_what_is_behind_it():
    """A wrist whose axes meet is a ball."""
    T = np.diag([-1.0, -1.0, 1.0, 1.0])[None].copy()
    T[0, 0, 3] = 2.0
    start = np.array([[[1.0, 0.05, 0.0], [3.0, 0.0, 0.0]]])
    links = Links(start=start, end=start.copy(), radius=np.array([0.1, 0.1]))
    assert not station().visible(T, links)[0, 0]
    assert station().visible(T, Links(start=start, end=start.copy(), radius=np.array([0.04, 0.1])))[0, 0]

"""One scene of the cell: all of it in the view, the robot as reports draw it, measured points and instruments where they are."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given

from taskcal.campaigns.campaign import Campaign, Stations
from taskcal.geometry import se3
from taskcal.identification.identify import identify
from taskcal.report.scene import draw_robot, robot_look
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.mechanism import trace_skeleton
from taskcal.virtual.cell import simulate
from taskcal_studio.measured_rows import fitted_rows, registered_rows
from taskcal_studio.views import FIELD_DEG, LEAST_ASPECT, VIEWS, drawn_parts, fitted_camera, lasting_corners
from tests.laws.robots import generators

MODEL = ErrorModel(load_robot("ur5"))


@given(generators)
def test_all_points_are_just_in_view_from_each_side(rng: np.random.Generator) -> None:
    points = rng.normal(size=(30, 3)) * rng.uniform(0.01, 3.0, 3) + rng.normal(size=3)
    for direction in VIEWS.values():
        place, at = fitted_camera(np.array(direction), points)
        out = (place - at) / np.linalg.norm(place - at)
        right = np.cross([0.0, 0.0, 1.0], out) / np.linalg.norm(np.cross([0.0, 0.0, 1.0], out))
        seen = points - place
        depth = -seen @ out
        assert depth.min() > 0.0
        half = np.tan(np.radians(0.5 * FIELD_DEG))
        across, upright = (
            np.abs(seen @ right) / depth / half / LEAST_ASPECT,
            np.abs(seen @ np.cross(out, right)) / depth / half,
        )
        assert 0.5 < max(across.max(), upright.max()) <= 1.0


@pytest.mark.parametrize("name", ["ur5", "abb-irb6660-205-1.9", "denso-hsr065a1"])
def test_the_robot_has_the_parts_that_reports_draw(name: str) -> None:
    robot = load_robot(name)
    q = np.clip(np.full((1, len(robot.joints)), 0.1), *robot.limits.T)
    (pose,), look = draw_robot(robot, q, ["one"]), robot_look(robot)
    bars, balls = drawn_parts(trace_skeleton(robot, q), look, lasting_corners(robot, q[0]))
    radii = {(part, round(radius * 1e3, 2)) for _, radius, part in (*bars, *balls)}
    links = {("link", radius) for radius, link in zip(look["links"], pose["links"], strict=True) if len(link) > 1}
    assert links <= radii
    assert {("joint", radius) for radius in look["drums"]} <= radii
    assert ("tool", look["tool"]) in radii
    corners = {tuple(np.round(end * 1e3, 1) + 0.0) for ends, _, part in bars if part == "link" for end in ends}
    assert corners == {tuple(np.array(corner) + 0.0) for link in pose["links"] if len(link) > 1 for corner in link}
    assert sum(part == "loop" for _, _, part in bars) == len(pose["loop"])


@pytest.fixture(scope="module")
def measured() -> tuple[Campaign, np.ndarray]:
    """A campaign, and where its tracker stood in the base."""
    campaign, truth = simulate(
        MODEL, np.random.default_rng(0).uniform(-1.2, 1.2, (40, 6)), rng=np.random.default_rng(1)
    )
    return campaign, se3.inverse(truth.T_tracker_base)[:3, 3]


def test_points_and_instrument_are_where_they_were_measured(measured: tuple[Campaign, np.ndarray]) -> None:
    campaign, at = measured
    for rows in (registered_rows(MODEL, campaign), fitted_rows(identify(MODEL, campaign))):
        assert rows is not None
        assert rows.in_base
        tool = MODEL.poses(campaign.q)[:, :3, 3]
        away = np.linalg.norm(rows.points[:, 0] - tool, axis=1)
        assert np.ptp(away) < 0.05  # the target stands on the tool
        start, ends = rows.beams(3)
        np.testing.assert_allclose(start, at, atol=0.05)
        np.testing.assert_array_equal(ends, rows.points[3])
        assert len(rows.beams(None)[1]) == 0
        points, number, target = rows.cloud
        np.testing.assert_array_equal(points, rows.points[number, target])


def test_each_row_s_beam_begins_at_its_own_station(measured: tuple[Campaign, np.ndarray]) -> None:
    campaign, _ = measured
    second = se3.pose(np.eye(3), np.array([1.0, 2.0, 0.5]))
    of = np.arange(len(campaign)) % 2
    moved = replace(campaign, stations=Stations(names=("a", "b"), of=of, T_first_station=np.stack([np.eye(4), second])))
    rows, alone = registered_rows(MODEL, moved), registered_rows(MODEL, campaign)
    assert len(rows.standing) == 2
    starts = np.array([rows.beams(row)[0] for row in range(len(campaign))])
    np.testing.assert_allclose(starts[of == 0], alone.beams(0)[0][None].repeat(20, axis=0), atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(starts[1] - starts[0]), np.linalg.norm(second[:3, 3]), atol=1e-9)


def test_points_that_do_not_fit_the_robot_are_left_alone(measured: tuple[Campaign, np.ndarray]) -> None:
    campaign, _ = measured
    mixed = replace(campaign, q=campaign.q[np.random.default_rng(2).permutation(len(campaign))])
    rows = registered_rows(MODEL, mixed)
    assert not rows.in_base
    np.testing.assert_array_equal(rows.points[campaign.valid], campaign.points[campaign.valid])


def test_a_frame_that_is_the_base_has_no_instrument(measured: tuple[Campaign, np.ndarray]) -> None:
    campaign, _ = measured
    rows = registered_rows(MODEL, campaign)
    in_base = registered_rows(MODEL, replace(campaign, points=rows.points))
    assert in_base.instruments is None
    assert len(in_base.beams(0)[1]) == 0

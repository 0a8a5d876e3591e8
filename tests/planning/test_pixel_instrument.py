"""Postures for images: what OpenCV's own projection shows of the board there."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.identification.identify import identify
from taskcal.observations import Fixtures, PixelInstrument
from taskcal.observations.instrument import Measurable, find_measurable
from taskcal.planning.experiment import calibrated_experiments
from taskcal.virtual.cell import draw_defects
from tests.planning.without_tracker import BOARD, CAMERA, GOAL, LENS, MODEL, TASK, TIP, instrument_of, measure, plan_of

cv2 = pytest.importorskip("cv2")
WAY = instrument_of("pixels")
SIZE = np.array([LENS.width, LENS.height])


def share_seen(T: np.ndarray) -> tuple[float, float]:
    """Share of the board's corners in an image, and in focus, by the board's pose in the camera's frame; tilt, degrees."""
    K = np.array([[1440.0, 0.0, 799.5], [0.0, 1440.0, 599.5], [0.0, 0.0, 1.0]])
    pixel = cv2.projectPoints(BOARD.corners(), se3.log(T[:3, :3]), T[:3, 3], K, np.zeros(5))[0][:, 0]
    depth = se3.apply(T, BOARD.corners())[:, 2]
    inside = (
        ((pixel > 0) & (pixel < SIZE)).all(axis=1) & (depth > WAY.depths[0] - 1e-5) & (depth < WAY.depths[1] + 1e-5)
    )
    sight = se3.apply(T, BOARD.corners().mean(axis=0))
    return inside.mean(), np.degrees(np.arccos(T[:3, 2] @ sight / np.linalg.norm(sight)))


def test_enough_corners_are_in_view_and_in_focus():
    """Also where camera and board are off by their stated uncertainty; tilts use what is allowed."""
    made = plan_of("pixels")
    board = se3.pose(se3.exp(WAY.unknown[3:6]), WAY.unknown[:3])
    T = se3.inverse(MODEL.poses(made.q) @ TIP) @ board
    seen, tilt = np.array([share_seen(one) for one in T]).T
    assert seen.min() >= WAY.in_view
    assert 40.0 < tilt.max() <= 60.0 + 1e-6
    rng = np.random.default_rng(0)
    off = se3.error_transform(np.repeat([WAY.place_m, WAY.place_rad], 3) * rng.normal(size=(len(T), 6)))
    assert min(share_seen(one)[0] for one in off @ T) >= 0.8 * WAY.in_view
    np.testing.assert_allclose(made.views["tilt_deg"], tilt, atol=1e-6)
    np.testing.assert_allclose(made.views["corners"], len(BOARD.corners()) * seen, atol=len(BOARD.corners()) * 0.1)


def test_a_camera_that_stands_sees_the_board_on_the_tool():
    place = Fixtures(names=("camera",), position=np.array([[0.55, 0.0, 0.05]]), direction=np.array([[-0.3, 0.0, 1.0]]))
    place = replace(place, direction=place.direction / np.linalg.norm(place.direction))
    way = PixelInstrument.set_up(MODEL, TASK, TIP, place, board=(BOARD,), camera=CAMERA)
    found = find_measurable(MODEL, TASK, way, 300, 0)
    assert len(found.q) > 5
    camera = se3.pose(se3.exp(way.unknown[3:6]), way.unknown[:3])
    T = se3.inverse(camera) @ MODEL.poses(found.q) @ way.T_tool_targets[0]
    seen, tilt = np.array([share_seen(one) for one in T]).T
    assert seen.min() >= way.in_view
    assert tilt.max() <= 60.0 + 1e-6


def test_a_board_that_is_none_is_refused_with_those_there_are():
    place = Fixtures(names=("wall",), position=np.zeros((1, 3)), direction=np.array([[0.0, 0.0, 1.0]]))
    with pytest.raises(CampaignError, match=r"'wall' stands, and is none of the boards board"):
        PixelInstrument.set_up(MODEL, TASK, TIP, place, board=(BOARD,), camera=CAMERA)


def test_an_experiment_on_pictures_counts_errors_of_position_rotation_and_joints():
    """Rows are whitened by noise and all that errs at single poses, the rotation among it; what is told of lenses follows."""
    way, made, rng = instrument_of("pixels"), plan_of("pixels"), np.random.default_rng(7)
    found = identify(MODEL, measure(way, made.q, made.of, draw_defects(MODEL, rng), rng, 3e-5))
    found = replace(found, model_error=(3e-5, 2e-4), joint_error=(2e-5,) * 6)
    fitted = way.as_fitted(found.layout.kinds[0], found.layout.unknowns(found.z)[0], found.T_tool_target[0])
    poses = Measurable(q=made.q, rows=np.arange(len(made.q)), visible=made.visible, lost={})
    judged = calibrated_experiments(found, GOAL, poses, fitted, None)[0]
    at, problem = made.q[:3], judged.linear.problem(made.q[:3], made.visible[:3])
    rows, X = problem.linearise(found.z, joints=True), judged.rows(at, made.visible[:3])[:, :6]
    white = np.repeat([judged.linear.errors.position, 2e-4**2], 3)
    R = problem.noise[:, 0] + np.diag(white) + 2e-5**2 * rows.by_joint @ np.swapaxes(rows.by_joint, 1, 2)
    J = rows.by_entry * judged.linear.deviations @ judged.basis
    told = np.swapaxes(J, 1, 2) @ np.linalg.solve(R, J)
    np.testing.assert_allclose(np.swapaxes(X, 1, 2) @ X, told, rtol=1e-6, atol=1e-9 * told.max())

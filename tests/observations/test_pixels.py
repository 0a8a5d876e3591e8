import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from taskcal.geometry import se3
from taskcal.identification.calibration import load_calibration
from taskcal.identification.identify import identify
from taskcal.kernels.projection import FISHEYE, PINHOLE, project
from taskcal.observations.base import TrackerNoise
from tests.observations.pictured import CAMERA, CORNERS, LENS, MODEL, PIXELS, take_pictures

seeds = st.integers(0, 2**32 - 1)
LENSES = [(PINHOLE, PIXELS), (FISHEYE, np.array([900.0, 905.0, 790.0, 627.0, 0.05, -0.02, 0.01, 0.003]))]


@pytest.mark.parametrize(("lens", "camera"), LENSES, ids=["pinhole", "fisheye"])
@given(seeds)
@settings(max_examples=10)
def test_corners_are_where_opencv_projects_them(lens, camera, seed):
    cv2 = pytest.importorskip("cv2")
    rng = np.random.default_rng(seed)
    X, R, t = rng.uniform(-0.2, 0.2, (20, 3)), se3.exp(rng.normal(size=3)), np.array([0.02, 0.01, 0.6])
    K = np.array([[camera[0], 0, camera[2]], [0, camera[1], camera[3]], [0, 0, 1]])
    turn = cv2.Rodrigues(R)[0]
    if lens == PINHOLE:
        expected = cv2.projectPoints(X, turn, t, K, camera[4:])[0]
    else:
        expected = cv2.fisheye.projectPoints(X[:, None], turn, t.reshape(3, 1), K, camera[4:])[0]
    found = project(lens, camera, np.tile(R, (20, 1, 1)), np.tile(t, (20, 1)), X)[0]
    np.testing.assert_allclose(found, expected.reshape(-1, 2), atol=1e-8)


@pytest.mark.parametrize(("lens", "camera"), LENSES, ids=["pinhole", "fisheye"])
def test_projection_derivatives_are_those_of_differences(lens, camera):
    rng = np.random.default_rng(1)
    X, R, t = rng.uniform(-0.2, 0.2, (20, 3)), se3.exp(np.array([0.2, -0.3, 0.5])), np.array([0.02, 0.01, 0.6])

    def pixels(change):
        turned = np.tile(se3.exp(change[3:6]) @ R, (20, 1, 1))
        return project(lens, camera + change[6:], turned, np.tile(t + change[:3], (20, 1)), X)[0]

    by = project(lens, camera, np.tile(R, (20, 1, 1)), np.tile(t, (20, 1)), X)[1]
    steps = np.diag([1e-6] * 6 + [1e-3] * 4 + [1e-5] * (len(camera) - 4))
    differences = np.stack([(pixels(h) - pixels(-h)) / (2 * h.max()) for h in steps], axis=2)
    np.testing.assert_allclose(by, differences, atol=1e-4 * np.abs(by).max(axis=(0, 1)).min())


@pytest.mark.parametrize("on_wrist", [True, False])
def test_pixel_derivatives_are_those_of_differences(on_wrist):
    """By the target's twist, what stands, camera and the board's size; of corners without noise, whose poses leave nothing."""
    seen = take_pictures(3, 6, on_wrist=on_wrist, noise=1e-9)
    campaign = seen.campaign(u_scale=1e-3)
    (kind,), measured = campaign.observations, campaign.read(0)
    T = MODEL.poses(seen.q, seen.x) @ seen.moving @ se3.error_transform(np.full(6, 1e-3))
    unknown = np.concatenate([seen.standing[:3, 3], se3.log(seen.standing[:3, :3]), CAMERA, [5e-4]])
    at = kind.differentiate(T, unknown, measured)

    def residual(change):
        moved = se3.pose(se3.exp(change[3:6]) @ T[:, :3, :3], T[:, :3, 3] + change[:3])
        return kind.differentiate(moved, unknown + change[6:], measured).residual

    steps = 1e-6 * np.eye(6 + len(unknown))
    differences = np.stack([(residual(-h) - residual(h)) / 2e-6 for h in steps], axis=2)
    np.testing.assert_allclose(np.concatenate([at.by_target, at.by_unknown], axis=2), differences, atol=2e-5)


def test_pictures_alone_give_the_camera_of_opencv():
    cv2 = pytest.importorskip("cv2")
    seen = take_pictures(0, 12)
    pictures = seen.campaign().observations[0].pictures[0]
    corners = [CORNERS.astype(np.float32)] * 12
    pixels = list(seen.pixel.reshape(12, -1, 2).astype(np.float32))
    rms, K, distortion, _, _ = cv2.calibrateCamera(corners, pixels, (LENS.width, LENS.height), None, None)
    own = pictures.settle(pictures.camera)
    deviations = np.sqrt(np.diag(np.linalg.inv(own.of_camera[0].sum(axis=0))))
    opencv = np.array([K[0, 0] / 1e3, K[1, 1] / 1e3, K[0, 2] / 1e3, K[1, 2] / 1e3, *distortion.ravel()])
    # apart by what Huber's weights leave out of Gaussian noise, a part of a standard deviation
    assert (np.abs(pictures.camera - opencv) < 0.3 * deviations).all()
    assert abs(pictures.noise - 0.15) < 0.01
    assert np.sqrt((pictures.residual(own, pictures.camera) ** 2).sum(axis=1).mean()) == pytest.approx(rms, rel=0.01)


def test_poses_and_camera_of_pictures_are_as_sure_as_stated():
    """Poses of the boards less those that are true, and the camera less the true one, over 60 pictures."""
    squares = []
    for seed in range(3):
        seen = take_pictures(seed, 20)
        campaign = seen.campaign()
        kind = campaign.observations[0]
        unknown = np.concatenate([seen.standing[:3, 3], se3.log(seen.standing[:3, :3]), CAMERA])
        at = kind.differentiate(MODEL.poses(seen.q, seen.x) @ seen.moving, unknown, campaign.read(0))
        C = kind.covariance(campaign.read(0), None, TrackerNoise())
        squares.append(np.einsum("ni,nij,nj->n", at.residual, np.linalg.inv(C), at.residual) / 6)
        stated = kind.stated(unknown)
        assert (stated.residual**2).sum() < 30.0  # of nine numbers: once in two thousand
    assert np.mean(squares) == pytest.approx(1.0, abs=0.25)  # of 360 numbers: 3 standard deviations


@pytest.mark.parametrize("on_wrist", [True, False])
def test_robot_camera_and_hand_eye_are_found_together(on_wrist, tmp_path):
    seen = take_pictures(2, on_wrist=on_wrist)
    campaign = seen.campaign(u_scale=2e-4)
    calibration = identify(MODEL, campaign)
    rows = calibration.residuals_on(campaign)
    assert np.abs(rows).max() < 5e-3
    names, z, deviation = calibration.layout.names, calibration.z, np.sqrt(np.diag(calibration.z_covariance))
    camera = [names.index(f"camera.{name}") for name in LENS.unknowns]
    alone = campaign.observations[0].pictures[0].settle(CAMERA).of_camera[0].sum(axis=0)
    assert (np.abs(z[camera] - CAMERA) < 4.5 * deviation[camera]).all()
    # the arm tells the camera more than the pictures do
    assert deviation[camera[0]] < 0.7 * np.sqrt(np.linalg.inv(alone)[0, 0])
    p = len(MODEL)
    off, C = z[:p] - seen.x, calibration.z_covariance[:p, :p]
    assert off @ np.linalg.solve(C, off) < p + 4.0 * np.sqrt(2.0 * p)
    apart, own = se3.inverse(calibration.T_tool_target[0]) @ seen.moving, calibration.layout.places[0].columns
    e = np.concatenate([apart[:3, 3], se3.log(apart[:3, :3])])
    assert e @ np.linalg.solve(calibration.z_covariance[np.ix_(own, own)], e) < chi2(6).ppf(0.95)  # hand-eye
    true = (MODEL.poses(seen.q, seen.x) @ seen.moving)[:, :3, 3]
    # where the robot stands is told by nothing but what stands where nobody knows: errors are those after placing it
    found, nominal = (
        np.linalg.norm(se3.apply(se3.fit_points(own, true), own) - true, axis=1).mean()
        for own in (calibration.target_poses(seen.q)[:, 0, :3, 3], (MODEL.poses(seen.q) @ seen.moving)[:, :3, 3])
    )
    assert found < 0.7 * nominal
    calibration.save(tmp_path / "cal.json")
    again = load_calibration(tmp_path / "cal.json")
    np.testing.assert_allclose(again.residuals_on(campaign), rows, atol=1e-9)


def test_a_corner_found_elsewhere_hardly_moves_the_camera():
    seen = take_pictures(5, 12)
    first = seen.campaign().observations[0].pictures[0]
    seen.pixel[[10, 200, 400]] += 25.0
    moved = seen.campaign().observations[0].pictures[0]
    deviations = np.sqrt(np.diag(np.linalg.inv(first.settle(first.camera).of_camera[0].sum(axis=0))))
    assert (np.abs(moved.camera - first.camera) < deviations).all()


def test_some_pictures_say_what_they_say_among_all():
    campaign = take_pictures(6, 8).campaign()
    part = campaign.take([5, 2, 7])
    kind, whole = part.observations[0], campaign.observations[0]
    unknown = np.concatenate([np.zeros(6), CAMERA])
    T = np.tile(np.eye(4), (8, 1, 1))
    few = kind.differentiate(T[:3], unknown, part.read(0)).residual
    np.testing.assert_allclose(few, whole.differentiate(T, unknown, campaign.read(0)).residual[[5, 2, 7]], atol=1e-9)

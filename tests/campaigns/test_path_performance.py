"""Path performance after ISO 9283:1998, 8.2 and 8.3, on paths whose errors are known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, Slerp
from scipy.stats import maxwell

from taskcal.campaigns.performance import assess_path
from taskcal.errors import CampaignError
from taskcal.geometry import se3

ANGLES = np.linspace(0.0, 2 * np.pi, 721)


def circle(radius: float, angles: np.ndarray = ANGLES) -> np.ndarray:
    points = radius * np.c_[np.cos(angles), np.sin(angles), np.zeros(len(angles))]
    if angles is ANGLES:
        points[-1] = points[0]
    return points


LINE = np.c_[np.linspace(0.0, 1.0, 11), np.zeros((11, 2))]


def test_a_circle_too_large_by_r_is_off_by_r():
    found = assess_path(circle(0.5), [circle(0.5 + 2e-4)])
    assert found.accuracy == pytest.approx(2e-4, rel=1e-9)
    np.testing.assert_allclose(found.accuracy_along, 2e-4, rtol=1e-9)
    assert found.repeatability is None
    assert found.cycles == 1
    assert list(found.summary()) == ["cycles", "sections", "AT_p_mm", "max_mm", "rms_mm"]
    assert not len(found.left_out)


def test_samples_may_lie_anywhere_along_the_path():
    passes = [circle(0.5 + 2e-4, np.linspace(start, 2 * np.pi + start, 4000)) for start in (1e-4, 0.01, 0.3)]
    found = assess_path(circle(0.5), passes)
    sagitta = 0.5 * (1 - np.cos(np.pi / 720))  # the path is straight between its points
    assert found.accuracy == pytest.approx(2e-4, rel=1e-3)
    assert found.repeatability < 1e-6
    assert 2e-4 <= found.rms <= found.maximum <= 2e-4 + sagitta


def test_a_table_worked_out_by_hand():
    # at x = 0.5 four passes are at y = 2, 0 and z = ±1 mm about (1, 0): l = 1 each; elsewhere all are at (1, 0)
    passes = np.repeat(LINE[None] + np.array([0.0, 1e-3, 0.0]), 4, axis=0)
    passes[:, 5] += 1e-3 * np.array([[0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    found = assess_path(LINE, passes)
    np.testing.assert_allclose(found.accuracy_along, 1e-3)
    np.testing.assert_allclose(found.repeatability_along, np.where(np.arange(11) == 5, 1e-3, 0.0), atol=1e-15)
    assert found.repeatability == pytest.approx(1e-3)
    assert found.maximum == pytest.approx(2e-3)


@given(seed=st.integers(0, 10_000))
def test_errors_of_a_line_are_those_across_it_in_any_frame(seed):
    """Samples shifted along the line by any amount under their distance: the same accuracy, from SciPy's interpolation."""
    rng = np.random.default_rng(seed)
    x = np.linspace(0.0, 1.0, 60)
    y, z = (CubicSpline(np.linspace(0, 1, 5), 1e-3 * rng.normal(size=5))(x) for _ in range(2))
    attained = np.c_[x, y, z]
    attained[1:-1, 0] += rng.uniform(-0.008, 0.008, 58)
    expected = np.hypot(*(np.interp(LINE[:, 0], attained[:, 0], attained[:, k]) for k in (1, 2)))
    R, p = se3.exp(rng.normal(size=3)), rng.normal(size=3)
    found = assess_path(LINE @ R.T + p, [attained @ R.T + p])
    np.testing.assert_allclose(found.accuracy_along, expected[found.sections], atol=1e-12)
    assert len(found.sections) >= 9
    assert found.maximum == pytest.approx(np.hypot(y, z).max())


@pytest.mark.slow
def test_path_repeatability_of_normal_noise_is_rayleigh():
    """Only what lies in the normal plane counts: two coordinates, not three."""
    rng = np.random.default_rng(0)
    passes = LINE + np.r_["-1", np.zeros((1_500, 11, 1)), 1e-4 * rng.normal(size=(1_500, 11, 2))]
    found = assess_path(LINE, passes)
    expected = 1e-4 * (np.sqrt(np.pi / 2) + 3 * np.sqrt(2 - np.pi / 2))
    np.testing.assert_allclose(found.repeatability_along, expected, rtol=0.06)
    assert found.repeatability < maxwell.mean(scale=1e-4) + 3 * maxwell.std(scale=1e-4)


def test_rows_of_a_raster_are_not_taken_for_each_other():
    rows = [np.c_[LINE[:: 1 - 2 * (k % 2), :1], np.full((11, 1), 0.01 * k), np.zeros((11, 1))] for k in range(5)]
    path = np.vstack(rows)
    late = path[1:] + np.array([0.0, 0.0, 1e-4])  # this pass begins at the second section
    found = assess_path(path, [late])
    np.testing.assert_array_equal(found.left_out, [0])
    np.testing.assert_allclose(found.accuracy_along, 1e-4)


def test_a_path_that_crosses_itself_is_followed_in_order():
    t = np.linspace(0.1, 2 * np.pi + 0.1, 800)
    path = np.c_[np.sin(t), np.sin(2 * t) / 2, np.zeros(800)]
    found = assess_path(path, [path + np.array([0.0, 0.0, 1e-3])])
    np.testing.assert_allclose(found.accuracy_along, 1e-3)
    assert not len(found.left_out)


def test_what_lies_beyond_the_ends_is_no_deviation():
    attained = np.vstack([[[-0.5, 0.2, 0.0]], LINE + np.array([0.0, 1e-4, 0.0]), [[1.5, 0.3, 0.0]]])
    found = assess_path(LINE, [attained])
    assert found.maximum == pytest.approx(1e-4)
    assert len(found.deviations) == 11


def test_pass_that_ends_a_little_short_is_carried_on():
    attained = LINE + np.array([0.0, 2e-4, 0.0])
    attained[0, 0] += 1e-4
    attained[-1, 0] -= 1e-4
    assert not len(assess_path(LINE, [attained]).left_out)
    attained[0, 0] += 1e-3
    np.testing.assert_array_equal(assess_path(LINE, [attained]).left_out, [0])


def test_orientations_turn_evenly_between_samples():
    rng = np.random.default_rng(0)
    x = np.sort(np.r_[0.0, rng.uniform(0, 1, 30), 1.0])
    turns = [Rotation.from_rotvec(0.02 * rng.normal(size=(32, 3))) for _ in range(6)]
    commanded = np.repeat(np.eye(3)[None], 11, axis=0)
    attained = np.repeat(np.c_[x, np.zeros((32, 2))][None], 6, axis=0)
    rotations = np.stack([turn.as_matrix() for turn in turns])
    found = assess_path(LINE, attained, commanded_rotations=commanded, rotations=rotations)
    there = [Slerp(x, turn)(LINE[:, 0]) for turn in turns]
    for section in found.sections:
        at = Rotation.concatenate([slerp[section] for slerp in there])
        np.testing.assert_allclose(found.turn[section], at.mean().as_rotvec(), atol=1e-10)
    assert found.orientation_accuracy == pytest.approx(np.abs(found.turn).max(axis=0))
    angles = np.array([slerp.as_rotvec() for slerp in there])
    expected = 3 * angles.std(axis=0, ddof=1).max(axis=0)
    np.testing.assert_allclose(found.orientation_repeatability, expected, rtol=0.01)
    keys = ["AT_rx_deg", "AT_ry_deg", "AT_rz_deg", "RT_p_mm", "RT_rx_deg", "RT_ry_deg", "RT_rz_deg"]
    assert list(found.summary())[3:-2] == keys


REFUSED = [
    (LINE[:1], [LINE], "needs two points or more, not 1"),
    (LINE, [], "no pass"),
    (LINE, [LINE, LINE[:1]], "pass 1 has 1 samples"),
    (LINE[[0, 1, 1, 2]], [LINE], "points 1 and 2 of the commanded path are the same"),
    (LINE[[0, 2, 1]], [LINE], "turns back on itself at point 1"),
    (LINE, [np.full((2, 3), np.nan)], "pass 0 is not a number"),
    (np.full((2, 3), np.nan), [LINE], "commanded path is not a number"),
    (LINE, [LINE, LINE[::-1]], "pass 1 crosses no plane"),
    (LINE, [LINE[:5], LINE[7:]], "crossed by every pass"),
    (LINE, [LINE + np.array([2.0, 0, 0])], "pass 0 lies beyond the ends"),
]


@pytest.mark.parametrize(("commanded", "attained", "message"), REFUSED, ids=[message for _, _, message in REFUSED])
def test_what_cannot_be_judged_is_refused(commanded, attained, message):
    with pytest.raises(CampaignError, match=message):
        assess_path(commanded, attained)

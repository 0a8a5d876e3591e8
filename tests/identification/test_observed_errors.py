from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.linalg import eigh

from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.identification.calibration import covariance_on, load_calibration, residuals_on, unknowns_of
from taskcal.identification.holdout import with_held_out
from taskcal.identification.identify import identify
from taskcal.identification.validation import examine, validate
from taskcal.virtual.cell import simulate
from tests.laws.observations import KINDS_WITHOUT_TRACKER, observed, observed_with_points

KINDS = [pytest.param(kind, marks=[pytest.mark.long] if kind == "board" else []) for kind in KINDS_WITHOUT_TRACKER]
"""A board is a landmark that is turned, too; its search from fifty starts takes seconds."""


@cache
def identified(kind):
    """Model, campaign, true robot and calibration of a robot that is measured without a tracker."""
    model, campaign, truth = observed(kind, 2, rows=60)
    return model, campaign, truth, identify(model, campaign)


def tool_error(calibration, truth, seed=0, *, sized=False):
    """Mean error of the tool in space at other postures, as far as a shift and a turn of the base and another TCP, and if
    asked for another size of the robot, leave it, metres."""
    q = np.random.default_rng(seed).uniform(-2.0, 2.0, (200, 6))
    found, true = calibration.tool_in_base(q), truth.model.poses(q, truth.x)
    p, off = found[:, :3, 3], (true - found)[:, :3, 3]
    moves = np.concatenate([se3.by_twist(p), found[:, :3, :3], *([p[:, :, None]] if sized else [])], axis=2)
    left = off - moves @ np.linalg.lstsq(moves.reshape(3 * len(p), -1), off.reshape(-1), rcond=None)[0]
    return float(np.linalg.norm(left, axis=1).mean())


@pytest.mark.parametrize("kind", KINDS)
def test_identify_recovers_robot_without_tracker_or_guess(kind):
    """The robot is identified without a tracker and without initial values."""
    model, campaign, truth, calibration = identified(kind)
    nominal = identify(model, campaign, keep=[], prior=None)
    assert not calibration.left_out
    sized = not campaign.observations[0].tells_scale
    assert tool_error(calibration, truth, sized=sized) < 0.15 * tool_error(nominal, truth, sized=sized)
    residual = residuals_on(calibration, campaign)
    np.testing.assert_allclose(residual[campaign.valid], calibration.residuals[campaign.valid], atol=1e-12)
    np.testing.assert_array_equal(np.isnan(residual[..., 0]), ~campaign.valid)


@pytest.mark.parametrize(
    "kind", ["socket", "distance", pytest.param("landmark", marks=pytest.mark.long), "plane", "cube"]
)
def test_a_tracker_beside_it_leaves_no_direction_less_certain(kind):
    model, both, _ = observed_with_points(kind, 2)
    held = {"prior_scale": 1.0, "model_error": 0.0}
    whole = identify(model, both, **held).covariance
    for name in both.targets:
        part = identify(model, both.of_targets([name]), **held).covariance
        # but for the points about which the fits are linearised
        assert eigh(whole, part, eigvals_only=True)[-1] < 1.01


@pytest.mark.parametrize(
    "kind", ["socket", *(pytest.param(kind, marks=pytest.mark.long) for kind in ("distance", "cube"))]
)
def test_a_tracker_beside_it_makes_neither_worse(kind):
    # which of two sound estimates of one robot is nearer is chance, so that several robots have to say it
    errors = []
    for seed in (2, 3, 4):
        model, both, truth = observed_with_points(kind, seed, rows=60)
        campaigns = [both, *(both.of_targets([name]) for name in both.targets)]
        errors.append([tool_error(identify(model, campaign), truth) for campaign in campaigns])
    whole, *parts = np.sqrt(np.square(errors).mean(axis=0))
    assert whole < min(parts)


@pytest.mark.parametrize("kind", [*KINDS, "beside a tracker"])
def test_a_calibration_is_saved_and_loaded_with_what_stands(kind, tmp_path):
    if kind == "beside a tracker":
        model, campaign, _ = observed_with_points("socket", 4, rows=40)
        calibration = identify(model, campaign)
    else:
        _, campaign, _, calibration = identified(kind)
    calibration.save(tmp_path / "cal.json")
    loaded = load_calibration(tmp_path / "cal.json")
    np.testing.assert_array_equal(loaded.residuals_on(campaign), calibration.residuals_on(campaign))
    np.testing.assert_array_equal(loaded.predict_covariance(campaign.q), calibration.predict_covariance(campaign.q))
    assert loaded.to_json() == calibration.to_json()


@pytest.mark.parametrize("kind", ["socket", "distance"])
def test_errors_are_in_base_axes_only_if_measured_in_them(kind, tmp_path):
    """Errors are along the axes of the base only if they were measured along them."""
    model, both, _ = observed_with_points(kind, 4, rows=60)
    out = np.arange(0, len(both), 5)
    fitted = identify(model, both.take(np.setdiff1d(np.arange(len(both)), out)))
    calibration = with_held_out(fitted, both, out, lambda part: identify(model, part, keep=[], prior=None))
    calibration.save(tmp_path / "cal.json")
    seen, along = both.valid, [one.along_axes for one in both.observations]
    assert along == [name == "smr" or kind == "socket" for name in both.targets]
    validations = {
        "kept": load_calibration(tmp_path / "cal.json").held_out.validation,
        "made": calibration.held_out.validation,
        "of all": validate(calibration, both),
    }
    for name, validation in validations.items():
        targets = np.nonzero(seen if name == "of all" else seen[out])[1]
        has = np.isfinite(validation.components)
        np.testing.assert_array_equal(has, np.repeat(np.array(along)[targets, None], 3, axis=1))
        lengths = np.linalg.norm(validation.components[has[:, 0]], axis=1)
        np.testing.assert_allclose(lengths, validation.errors[has[:, 0]], atol=1e-12)
        assert validation.in_space == (kind == "socket")
        assert "max_x_mm" in validation.summary()
    alone = both.of_targets([name for name in both.targets if name != "smr"])
    assert ("max_x_mm" in validate(identify(model, alone), alone).summary()) == (kind == "socket")
    points = [point for point in examine(calibration, both).points() if point["target"] != "smr"]
    assert all(("x_mm" in point) == (kind == "socket") for point in points)
    assert all(abs(point.get("signed_mm", point["error_mm"])) == point["error_mm"] for point in points)
    assert all(("signed_mm" in point) == (kind == "distance") for point in points)


def test_planes_tell_all_but_the_size_of_the_robot():
    model, campaign, truth = observed("plane", 4, rows=120)
    calibration = identify(model, campaign)
    assert any("how large the robot is comes from its nominal lengths" in remark for remark in calibration.remarks)
    assert tool_error(calibration, truth, sized=True) < 2e-5
    assert tool_error(calibration, truth) > 3e-4
    cube = identify(model, observed("cube", 4)[1])
    assert not any("how large" in remark for remark in cube.remarks)


def test_scale_is_unobservable_without_stated_distance():
    """Without a stated distance the scale of the robot is unobservable."""
    model, campaign, _ = observed("socket", 6, rows=80)
    unstated = replace(campaign, observations=tuple(replace(one, distances=()) for one in campaign.observations))
    stated, free = identify(model, campaign), identify(model, unstated)
    assert any("how large the robot is comes from its nominal lengths" in remark for remark in free.remarks)
    assert not any("how large" in remark for remark in stated.remarks)
    assert free.prior_scale == 1.0
    with pytest.raises(CampaignError, match=r"has no length that was measured or stated.*at most 3 tolerances"):
        identify(model, unstated, prior=None)
    with pytest.raises(CampaignError, match="the smallest best"):
        identify(model, unstated, prior_scale=10.0)

    def spread(calibration):
        """Standard error of how far the two sockets of a block are apart."""
        own = calibration.layout.own[0].columns
        a, b = calibration.z[own].reshape(-1, 3)[:2]
        g = np.zeros(len(calibration.z))
        g[own[:3]], g[own[3:6]] = (a - b) / np.linalg.norm(a - b), (b - a) / np.linalg.norm(a - b)
        return float(np.sqrt(g @ calibration.z_covariance @ g))

    assert spread(stated) < 2.5e-5
    assert spread(free) > spread(stated)


def test_a_row_in_the_wrong_socket_is_left_out_and_named():
    model, campaign, _ = observed("socket", 3, rows=60)
    (kind,) = campaign.observations
    of = kind.of.copy()
    of[7] = (of[7] + 1) % 4
    calibration = identify(model, replace(campaign, observations=(replace(kind, of=of),)))
    assert [row.row for row in calibration.left_out] == [7]
    assert "1 of 60 rows cannot be right" in calibration.remarks[0]


def test_validation_centres_each_socket_wherever_block_is():
    """A validation judges each socket by its own mean, wherever its block is fixed."""
    model, campaign, _ = observed("socket", 5, rows=80)
    (kind,) = campaign.observations
    first = np.isin(kind.of, (0, 1))
    calibration = identify(model, campaign.take(np.flatnonzero(first)))
    elsewhere = campaign.take(np.flatnonzero(~first))
    validation = validate(calibration, elsewhere)
    ball = calibration.target_poses(elsewhere.q)[:, 0, :3, 3]
    of = elsewhere.observations[0].of
    middle = np.stack([ball[of == k].mean(axis=0) for k in range(2)])
    np.testing.assert_allclose(validation.errors, np.linalg.norm(ball - middle[of], axis=1), atol=1e-12)
    (one,) = validation.compared
    assert (one.name, one.stated) == ("1/a to 1/b", 0.08)
    assert one.found == pytest.approx(np.linalg.norm(middle[0] - middle[1]))
    assert validation.summary()["distance_max_mm"] == pytest.approx(1e3 * abs(one.found - one.stated))


def test_holdout_rows_are_expected_at_estimated_sockets():
    """Held-out rows are expected at the socket positions that the calibration estimated."""
    model, campaign, _ = observed("socket", 5, rows=60)
    calibration = identify(model, campaign.take(np.arange(50)))
    (known,) = unknowns_of(calibration, campaign.take(np.arange(50, 60)))
    names = campaign.take(np.arange(50, 60)).observations[0].unknowns
    assert (
        dict(zip(names, known, strict=True)).items()
        <= dict(zip(calibration.all_names, calibration.z, strict=True)).items()
    )


def test_stated_covariance_matches_errors_over_robots():
    """The stated covariance is that of the errors over many simulated robots."""
    squares = []
    for seed in range(8):
        model, campaign, _ = observed("socket", 100 + seed, rows=60)
        calibration = identify(model, campaign.take(np.arange(50)), gross_errors="keep")
        rest = campaign.take(np.arange(50, 60))
        C = covariance_on(calibration, rest, rest.covariances())
        r = residuals_on(calibration, rest)
        squares.append(np.einsum("nti,ntij,ntj->nt", r, np.linalg.inv(C), r).ravel())
    assert 2.4 < np.mean(np.concatenate(squares)) < 3.8


def test_sockets_are_no_targets_of_a_tracker_s_calibration():
    model, campaign, truth = observed("socket", 5)
    plain, _ = simulate(model, campaign.q, rng=np.random.default_rng(0), x=truth.x)
    calibration = identify(model, plain)
    with pytest.raises(CampaignError, match="the campaign's target 'ball' is not in the calibration"):
        validate(calibration, campaign)
    assert validate(calibration, campaign, reregister=True).mean < 5e-4


def test_too_few_postures_are_refused():
    model, campaign, _ = observed("socket", 5)
    with pytest.raises(CampaignError, match="measured numbers in 4 rows are too few"):
        identify(model, campaign.take(np.arange(4)))

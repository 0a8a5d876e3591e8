"""What is measured without a tracker is what the true robot gives, with the noise that its kind states."""

import numpy as np
import pytest

from taskcal.campaigns.campaign import distances_text, with_distances
from taskcal.errors import CampaignError, UnknownName
from taskcal.identification.identify import identify
from taskcal.observations import Sockets, instrument_of, kinds
from taskcal.observations.base import Measured, TrackerNoise
from taskcal.observations.landmark import FARTHEST, NEAREST, VIEW
from taskcal.observations.pixels import Pixels
from taskcal.reading.reader import read_campaign
from taskcal.reading.writer import campaign_text
from taskcal.robot.effects import Backlash
from taskcal.virtual import cell as virtual_cell
from taskcal.virtual.cell import OutOfReachError, Truth, simulate
from taskcal_groundwork.options import OptionError
from tests.reading.virtual_task import MODEL, postures

# images are simulated with the board and the camera of a file, and tested with the command that does it
INSTRUMENTS = tuple(
    kind.instrument for kind in kinds() if kind.instrument and not kind.in_tracker and kind is not Pixels
)


OF_LENGTHS = tuple(way for way in INSTRUMENTS if instrument_of(way).width > instrument_of(way).angles)
"""What no parameter explains turns those of angles alone: `tests/examples/test_plugin.py`."""


def residuals(campaign, truth: Truth, q=None):
    """Measured less what the truth says, target by target, and the covariance of its noise."""
    T = truth.poses(campaign.q if q is None else q, campaign.conditions)
    for t, kind in enumerate(campaign.observations):
        seen = campaign.valid[:, t]
        unknown = np.array([truth.unknowns[name] for name in kind.unknowns])
        read = campaign.read(t)
        residual = kind.differentiate(T[:, t], unknown, read).residual[seen]
        yield kind, residual, kind.covariance(Measured(read.points[seen], None), None, TrackerNoise())


def chi_squared(residual, covariance) -> float:
    """Mean square over the noise; 1 where they agree."""
    return float(np.einsum("ni,nij,nj->", residual, np.linalg.inv(covariance), residual) / residual.size)


def test_every_way_to_measure_has_an_instrument():
    assert {"socket", "wire", "camera", "board"} <= {*INSTRUMENTS}


@pytest.mark.parametrize("way", INSTRUMENTS)
def test_true_residuals_have_stated_noise(way):
    """The residuals of the true robot have the noise that the observation states."""
    campaign, truth = simulate(MODEL, postures(300), rng=np.random.default_rng(3), observe=way)
    ((kind, residual, covariance),) = residuals(campaign, truth)
    assert kind.instrument == way
    assert chi_squared(residual, covariance) == pytest.approx(1.0, abs=5.0 / np.sqrt(residual.size / 2.0))
    assert MODEL.robot.inside_limits(campaign.q).all()


@pytest.mark.parametrize("way", INSTRUMENTS)
def test_observation_round_trips_and_nominal_model_deviates(way, tmp_path):
    """The campaign is written and read back, and the nominal model deviates from it."""
    campaign, truth = simulate(MODEL, postures(60), rng=np.random.default_rng(3), observe=way)
    (tmp_path / "c.csv").write_text(campaign_text(campaign, MODEL.robot))
    read = read_campaign(tmp_path / "c.csv", MODEL.robot)
    if way == "socket":
        (tmp_path / "d.csv").write_text(distances_text(campaign))
        read = with_distances(read, tmp_path / "d.csv")
    np.testing.assert_allclose(read.q, campaign.q, atol=1e-10)
    np.testing.assert_allclose(read.points, campaign.points, atol=1e-9)
    (before, after) = campaign.observations[0], read.observations[0]
    assert (after.key, sorted(after.unknowns)) == (before.key, sorted(before.unknowns))
    nominal = Truth(
        model=MODEL,
        x=np.zeros(len(MODEL)),
        T_tracker_base=np.eye(4),
        T_tool_target=truth.T_tool_target,
        unknowns=truth.unknowns,
    )
    ((_, residual, covariance),) = residuals(read, nominal)
    assert chi_squared(residual, covariance) > 25.0


@pytest.mark.parametrize("way", OF_LENGTHS)
def test_what_no_parameter_explains_adds_in_squares(way):
    error = 1e-3
    campaign, truth = simulate(MODEL, postures(300), rng=np.random.default_rng(3), observe=way, model_error=error)
    ((kind, residual, covariance),) = residuals(campaign, truth)
    covariance[:, range(kind.width - kind.angles), range(kind.width - kind.angles)] += error**2
    assert chi_squared(residual, covariance) == pytest.approx(1.0, abs=5.0 / np.sqrt(residual.size / 2.0))


def test_a_joint_that_stands_off_is_not_what_the_controller_says():
    off = np.radians(0.05)
    campaign, truth = simulate(MODEL, postures(300), rng=np.random.default_rng(3), observe="socket", joint_error=off)
    ((_, residual, covariance),) = residuals(campaign, truth)
    J = MODEL.joint_jacobian(campaign.q, truth.x)[:, :3]
    covariance = covariance + off**2 * J @ np.swapaxes(J, 1, 2)
    assert chi_squared(residual, covariance) == pytest.approx(1.0, abs=5.0 / np.sqrt(residual.size / 2.0))


def test_a_robot_with_backlash_is_in_its_sockets_nevertheless():
    model = MODEL + Backlash()
    campaign, truth = simulate(model, postures(60), rng=np.random.default_rng(3), observe="socket")
    assert np.abs(truth.x[len(MODEL) :]).max() > 1e-5
    ((_, residual, covariance),) = residuals(campaign, truth)
    assert chi_squared(residual, covariance) == pytest.approx(1.0, abs=0.5)


@pytest.mark.parametrize("way", ["camera", "board"])
def test_a_camera_has_its_landmark_in_the_picture(way):
    campaign, _ = simulate(MODEL, postures(200), rng=np.random.default_rng(3), observe=way, places=2)
    y = campaign.points[:, 0]
    assert (np.arctan2(np.hypot(y[:, 0], y[:, 1]), y[:, 2]) < VIEW + 0.01).all()
    assert (np.linalg.norm(y, axis=1) > NEAREST - 1e-3).all()
    assert (np.linalg.norm(y, axis=1) < FARTHEST + 1e-3).all()


@pytest.mark.parametrize(
    ("way", "count"), [("socket", 2), ("wire", 1), ("camera", 1), ("board", 1), ("plane", 1), ("cube", 5)]
)
def test_there_are_as_many_places_as_asked_for(way, count):
    campaign, _ = simulate(MODEL, postures(20), rng=np.random.default_rng(3), observe=way, places=4)
    (kind,) = campaign.observations
    assert len(np.unique(kind.of)) == 4 * count


def test_one_calliper_error_applies_to_block_at_all_places():
    """One calliper measurement, with its error, applies to the block at all places."""
    campaign, truth = simulate(MODEL, postures(20), rng=np.random.default_rng(3), observe="socket")
    (kind,) = campaign.observations
    assert isinstance(kind, Sockets)
    assert len({(d.distance, d.uncertainty) for d in kind.distances}) == 1
    centres = np.array([truth.unknowns[name] for name in kind.unknowns]).reshape(-1, 2, 3)
    apart = np.linalg.norm(centres[:, 0] - centres[:, 1], axis=1)
    np.testing.assert_allclose(apart, 0.1, atol=1e-12)
    assert 0.0 < abs(kind.distances[0].distance - 0.1) < 5.0 * kind.distances[0].uncertainty


def test_ways_share_the_rows_and_are_identified_at_once():
    campaign, truth = simulate(
        MODEL, postures(90), rng=np.random.default_rng(3), observe="tracker+socket+wire", places=1
    )
    assert campaign.targets == ("tool", "ball", "wire")
    np.testing.assert_array_equal(campaign.valid.sum(axis=0), [30, 30, 30])
    for kind, residual, covariance in residuals(campaign, truth):
        if kind.key != "point":
            assert chi_squared(residual, covariance) < 2.0
    q = postures(40, seed=5)
    calibration = identify(MODEL, campaign)
    off = np.linalg.norm(calibration.predict(q) - truth.points(q), axis=2)
    assert off[:, :2].mean() < 1e-4
    assert off.mean() < 3e-4


def test_unreachable_task_is_rejected_with_row_count(monkeypatch):
    """A task out of reach is rejected with the number of unreachable rows."""
    monkeypatch.setattr(virtual_cell, "MAX_CELLS", 1)  # in another one it may reach all
    stretched = np.tile([0.0, 1.3, -0.9, 0.0, 0.0, 0.0], (12, 1)) + np.linspace(0.0, 0.01, 12)[:, None]
    said = r"abb-irb120 cannot measure with 'socket' in \d+ of 12 rows: .* to socket '\d/[ab]'.*, \d{3}( to \d{3})? mm from its"
    with pytest.raises(CampaignError, match=said):
        simulate(MODEL, stretched, rng=np.random.default_rng(3), observe="socket")


def test_what_is_out_of_reach_is_put_elsewhere(monkeypatch):
    visit, refused = virtual_cell.visit, []

    def visit_the_third(*given, **options):
        if len(refused) < 2:
            refused.append(given)
            raise OutOfReachError("too far")
        return visit(*given, **options)

    monkeypatch.setattr(virtual_cell, "visit", visit_the_third)
    campaign, truth = simulate(MODEL, postures(20), rng=np.random.default_rng(3), observe="plane")
    ((_, residual, _),) = residuals(campaign, truth)
    assert np.abs(residual).max() < 2e-4  # the truth has the planes that were touched, not those that were out of reach


def test_options_that_do_not_go_together_are_refused():
    q, rng = postures(4), np.random.default_rng(3)
    with pytest.raises(UnknownName, match="no instrument 'sokcet'; did you mean 'socket'"):
        simulate(MODEL, q, rng=rng, observe="tracker+sokcet")
    with pytest.raises(CampaignError, match="names wire twice"):
        simulate(MODEL, q, rng=rng, observe="wire+wire")
    with pytest.raises(OptionError, match="a tracker alone"):
        simulate(MODEL, q, rng=rng, observe="wire", pose=True)
    with pytest.raises(OptionError, match="places: 0 is not 1 or more"):
        simulate(MODEL, q, rng=rng, observe="wire", places=0)
    with pytest.raises(CampaignError, match="4 rows cannot be shared among 5"):
        simulate(MODEL, q, rng=rng, observe="tracker+socket+wire+camera+board")
    with pytest.raises(UnknownName, match="tracker"):
        instrument_of("none")

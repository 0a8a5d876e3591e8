"""A scale of all measured lengths is told as well as robots within their tolerances let it, and named from three of these on."""

import re
from dataclasses import replace

import numpy as np
import pytest

from taskcal.campaigns.campaign import Campaign
from taskcal.diagnosis.diagnose import diagnose
from taskcal.identification.calibration import SCALE_IN_DOUBT
from taskcal.identification.checks import checks
from taskcal.identification.identify import identify
from taskcal.observations import Pixels
from taskcal.reading.reader import read_campaign
from taskcal.registration.length_scale import find_length_scale
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from tests.diagnosis.virtual_campaigns import VIRTUAL, virtual
from tests.observations.pictured import MIDDLE, MIDDLE_OF_OTHER, MODEL, OTHER, take_pictures


def scales(factor: float, seeds: int):
    """What is found of virtual robots of every kind whose points are larger by a factor."""
    for name, how in VIRTUAL.items():
        model = ErrorModel(load_robot(name))
        for seed in range(seeds):
            error = (5e-5, 3e-4)[seed % 2]
            campaign = virtual(name, seed, rows=how.get("rows", 40), targets=how.get("targets", 1), error=error)
            found = find_length_scale(model, replace(campaign, points=factor * campaign.points))
            assert found is not None
            yield found


def test_sound_campaigns_have_no_scale_and_its_standard_error_is_honest():
    """Of 110 sound campaigns at most one is named, and the errors are as large as is stated: χ² of so many within 3σ."""
    found = list(scales(1.0, 10))
    assert len(found) == 110
    assert sum(one.named for one in found) <= 1
    spread = np.mean([((one.value - 1.0) / one.standard_error) ** 2 for one in found])
    assert abs(spread - 1.0) < 3.0 * np.sqrt(2.0 / len(found))


@pytest.mark.parametrize("factor", [0.98, 0.99, 1.01, 1.05, 1.2])
def test_scale_is_found_and_named_wherever_it_can_be(factor):
    for found in scales(factor, 2):
        sigmas = abs(factor - 1.0) / found.standard_error
        assert found.named or sigmas < 5.0
        # beyond some per cent what is neglected, the second order of scale and registration, counts as well
        assert abs(found.value - factor) < 4.0 * found.standard_error + 0.05 * (factor - 1.0) ** 2


def test_robots_far_beyond_their_tolerances_have_no_scale():
    """Five times the tolerances are a robot's own matter: the standard error grows with them."""
    for name in VIRTUAL:
        robot = load_robot(name)
        model = ErrorModel(robot)
        campaign = virtual(name, 3, rows=50, targets=1)
        rng = np.random.default_rng(1)
        x = 5.0 * model.tolerances * rng.normal(size=len(model))
        T = model.poses(campaign.q, x)
        points = (T @ np.array([0.05, 0.02, 0.1, 1.0]))[:, None, :3] + 5e-5 * rng.normal(size=(len(T), 1, 3))
        found = find_length_scale(model, replace(campaign, points=points))
        assert found is not None
        assert not found.named, name


def test_fit_and_doctor_name_a_scale_that_held_out_rows_do_not_show():
    """Points 1.01 times too large: both say it, the doctor alone; sound points are as they were."""
    robot, campaign = load_robot("kuka-kr16-2"), virtual("kuka-kr16-2", 1, rows=40, error=5e-5)
    large = replace(campaign, points=1.01 * campaign.points)
    calibration = identify(ErrorModel(robot), large)
    assert len(calibration.doubts) == 1
    assert "1.01" in calibration.doubts[0]
    assert calibration.doubts[0] in calibration.remarks
    found = diagnose(large, robot)
    assert [finding.id for finding in found.findings] == ["points-scaled"]
    assert found.unmended == ("points-scaled",)
    assert found.campaign.points == pytest.approx(large.points)
    assert identify(ErrorModel(robot), campaign).doubts == ()


def with_size_stated(campaign: Campaign, factor: float) -> Campaign:
    """A campaign as it is read where the board's file states so many times its size."""
    (kind,) = campaign.observations
    assert isinstance(kind, Pixels)
    assert kind.pictures is not None
    (pictures,) = kind.pictures
    T = pictures.T_camera_board.copy()
    T[:, :3, 3] *= factor
    stated = replace(pictures, corner=pictures.corner * factor, T_camera_board=T, _last=[])
    return replace(campaign, points=campaign.points * factor, observations=(replace(kind, pictures=(stated,)),))


@pytest.mark.slow
def test_fit_and_doctor_name_a_board_that_is_larger_than_its_stated_uncertainty_lets_it_be():
    """By 2 %, where a robot's lengths are known to 0.2 %: of a size stated to 0.5 %, not of one stated to 2 %; no sound board."""
    pictured = take_pictures(0, 30, on_wrist=True, error=5e-5, gears=1e-4)
    for larger, u_scale, named in ((1.0, 5e-3, 0), (1.02, 5e-3, 1), (1.02, 2e-2, 0)):
        campaign = with_size_stated(pictured.campaign(u_scale=u_scale), 1.0 / larger)
        said = identify(MODEL, campaign).doubts
        assert len(said) == named
        assert all("board floor is 1.0" in doubt for doubt in said)
        assert [one.id for one in diagnose(campaign, MODEL.robot).findings] == ["square-size"] * named


@pytest.mark.slow
@pytest.mark.parametrize("on_wrist", [True, False])
@pytest.mark.parametrize(("model", "middle"), [(MODEL, MIDDLE), (OTHER, MIDDLE_OF_OTHER)])
def test_fit_and_doctor_say_the_same_of_a_board_that_is_stated_wrong(monkeypatch, model, middle, on_wrist):
    """By 2 to 5 %, its size taken as known, so that nothing but the robot's parameters may follow it; nothing of a sound board."""
    monkeypatch.setattr(checks, "catalogue_names", lambda: ())  # other robots, which take long to place by images
    sound = take_pictures(1, 30, on_wrist=on_wrist, error=5e-5, model=model, middle=middle).campaign()
    for factor in (1.0, 0.95, 0.98, 1.02, 1.03):
        campaign = with_size_stated(sound, factor)
        said = [one for one in identify(model, campaign).doubts if one.startswith(SCALE_IN_DOUBT)]
        found = [one for one in diagnose(campaign, model.robot).findings if one.id == "square-size"]
        assert len(said) == len(found) == (factor != 1.0)
        for doubt, finding in zip(said, found, strict=True):
            assert doubt == f"{SCALE_IN_DOUBT}{finding.fix.replace('the board', 'board floor')}"
            (size,) = map(float, re.findall(r"is ([\d.]+) times", doubt))
            assert size == pytest.approx(1.0 / factor, abs=0.01)


@pytest.mark.realdata
@pytest.mark.parametrize(
    ("name", "folder"),
    [
        ("ur5", "ur5_tracker"), ("ur10", "ur10_tmac"), ("abb-irb120", "irb120_faro"), ("fanuc-r2000ic-165f", "fanuc_r2000_tracker"),
        ("barrett-wam", "wam_tracker"),
    ],
)  # fmt: skip
def test_measured_robots_have_no_scale(name, folder, data_folder):
    """Laser trackers are right to some millionths; what is found is within two standard errors of 1."""
    model = ErrorModel(load_robot(name))
    found = find_length_scale(model, read_campaign(data_folder / folder / "measurements.csv", model.robot))
    assert found is not None
    assert abs(found.value - 1.0) < 2.0 * found.standard_error


@pytest.mark.realdata
def test_scaled_case(data_folder):
    model = ErrorModel(load_robot("ur5e"))
    found = find_length_scale(model, read_campaign(data_folder / "cases/measurements/scale.csv", model.robot))
    assert found is not None
    assert found.named
    assert found.value == pytest.approx(1.01, abs=0.003)

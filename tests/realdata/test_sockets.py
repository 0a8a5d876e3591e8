"""A robot measured with a ball in sockets alone: mean distance of the ball from its socket's mean place, in millimetres."""

from pathlib import Path

import numpy as np
import pytest

from taskcal.campaigns.campaign import Campaign
from taskcal.identification.effects import explain
from taskcal.identification.identify import identify
from taskcal.identification.validation import validate
from taskcal.reading.options import ReadOptions
from taskcal.reading.reader import read_campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel

pytestmark = pytest.mark.realdata

PLACES = ("back-high", "front", "right")


@pytest.fixture
def distances(tmp_path: Path) -> Path:
    file = tmp_path / "distances.csv"
    file.write_text("socket_a,socket_b,distance_mm\n0,1,50.0\n")
    return file


def place_of(campaign: Campaign) -> np.ndarray:
    (kind,) = campaign.observations
    return np.array([kind.sockets[k].partition("/")[0] for k in kind.of])


def test_the_panda_at_places_that_were_not_fitted(data_folder: Path, distances: Path) -> None:
    folder = data_folder / "panda_sockets"
    model = ErrorModel(load_robot(folder / "nominal.urdf"))
    campaign = read_campaign(folder / "measurements.csv", model.robot, options=ReadOptions(distances=distances))
    assert len(campaign) == 182
    place, errors, before = place_of(campaign), [], []
    for name in PLACES:
        rest, own = campaign.take(np.flatnonzero(place != name)), campaign.take(np.flatnonzero(place == name))
        calibration = identify(model, rest)
        assert not calibration.left_out
        errors.append(validate(calibration, own).mean * 1e3)
        before.append(validate(identify(model, rest, keep=[], prior=None), own).mean * 1e3)
    assert np.mean(before) > 7.0
    assert np.mean(errors) < 0.81
    assert max(errors) < 0.96


@pytest.mark.long
def test_effects_that_extrapolate_worse_are_dropped(data_folder: Path) -> None:
    """At one place single rows are predicted better with effects, and sockets elsewhere much worse."""
    folder = data_folder / "panda_sockets"
    model = ErrorModel(load_robot(folder / "nominal.urdf"))
    campaign = read_campaign(folder / "measurements.csv", model.robot)
    place = place_of(campaign)
    here, elsewhere = (campaign.take(np.flatnonzero((place == PLACES[0]) == own)) for own in (True, False))
    found = explain(model, here)
    assert validate(found.calibration, elsewhere).mean <= validate(identify(model, here), elsewhere).mean
    assert "neighbouring poses left out together worse" in found.calibration.remarks[-1]

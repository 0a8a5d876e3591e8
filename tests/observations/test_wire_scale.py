import numpy as np
import pytest

from taskcal.campaigns.campaign import with_unknown_scale
from taskcal.errors import CampaignError
from taskcal.identification.identify import identify
from taskcal.reading.options import ReadOptions
from taskcal.reading.reader import read_campaign
from tests.laws.observations import observed
from tests.observations.files import ROBOT, written


def test_unknown_wire_scale_is_estimated_with_robot():
    """An unknown scale is estimated with the robot as accurately as the robot's lengths are known."""
    model, campaign, _ = observed("distance", 3, rows=90)
    campaign.points[:, 0, 0] *= 1.004
    scaled = identify(model, with_unknown_scale(campaign))
    assert scaled.all_names[-1] == "distance.scale"
    error = np.sqrt(scaled.z_covariance[-1, -1])
    assert abs(scaled.z[-1] - 0.004) < 4.0 * error
    assert error > 1e-4  # the nominal lengths alone tell it
    assert any("how large the robot is comes from its nominal lengths" in remark for remark in scaled.remarks)


def test_it_is_asked_for_in_reading(tmp_path):
    file = written(tmp_path, "d_mm,anchor", "812.5,left", "700,right")
    assert read_campaign(file, ROBOT, options=ReadOptions(wire_scale=True)).observations[0].scaled
    file = written(tmp_path, "socket", "a", "b")
    with pytest.raises(CampaignError, match="has no lengths"):
        read_campaign(file, ROBOT, options=ReadOptions(wire_scale=True))

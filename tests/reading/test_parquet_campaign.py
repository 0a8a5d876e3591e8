import numpy as np
import pytest

from taskcal.reading.reader import read_campaign
from taskcal.reading.writer import write_campaign
from tests.laws.fleets import lay_campaigns, small_model


@pytest.fixture
def campaign(tmp_path):
    return read_campaign(lay_campaigns(tmp_path) / "a" / "2026-03-01.csv", small_model().robot)


def test_a_campaign_is_the_same_in_parquet_as_in_csv(campaign, tmp_path):
    robot = small_model().robot
    read = []
    for name in ("same.csv", "same.parquet"):
        write_campaign(tmp_path / name, campaign, robot)
        read.append(read_campaign(tmp_path / name, robot))
    assert (tmp_path / "same.parquet").read_bytes()[:4] == b"PAR1"
    for one in read:
        assert one.ids == campaign.ids
        np.testing.assert_array_equal(one.q, read[0].q)
        np.testing.assert_array_equal(one.points, read[0].points)
        np.testing.assert_allclose(one.points, campaign.points, atol=1e-9)

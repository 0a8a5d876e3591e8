"""Campaigns that are put together say what each of them said."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.campaigns.campaign import join
from taskcal.errors import CampaignError
from taskcal.virtual.cell import simulate
from tests.reading.virtual_task import MODEL, postures


def measured(way: str, seed: int = 1, **choices):
    return simulate(MODEL, postures(10), rng=np.random.default_rng(seed), observe=way, **choices)[0]


@pytest.mark.parametrize("ways", [("tracker", "socket", "wire"), ("camera", "tracker"), ("board", "wire")])
def test_the_rows_of_each_are_as_they_were(ways):
    parts = [measured(way) for way in ways]
    joined = join(parts)
    assert len(joined) == 10 * len(parts)
    for k, part in enumerate(parts):
        rows = slice(10 * k, 10 * k + 10)
        np.testing.assert_array_equal(joined.q[rows], part.q)
        np.testing.assert_array_equal(joined.points[rows, k], part.points[:, 0])
        assert np.isnan(np.delete(joined.points[rows], k, axis=1)).all()
        alone = joined.take(np.arange(len(joined))[rows]).of_targets(part.targets)
        np.testing.assert_array_equal(alone.covariances()[..., :3, :3], part.covariances()[..., :3, :3])
        if not part.tracked:
            (kind,) = part.observations
            np.testing.assert_array_equal(joined.observations[k].of[rows], kind.of)
            assert joined.observations[k].unknowns == kind.unknowns


def test_one_alone_is_itself_and_none_is_refused():
    one = measured("wire")
    assert join([one]) is one
    with pytest.raises(CampaignError, match="no campaign"):
        join([])


def test_what_cannot_be_one_campaign_is_refused():
    wire, board = measured("wire"), measured("board")
    with pytest.raises(CampaignError, match="two of the campaigns have a target 'wire'"):
        join([wire, wire])
    with pytest.raises(CampaignError, match="two of the campaigns measure rotations"):
        join([board, measured("tracker", pose=True)])
    with pytest.raises(CampaignError, match="state all or none"):
        join([replace(wire, uncertainty=np.full((10, 1), 1e-4)), board])

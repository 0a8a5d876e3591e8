from typing import get_args

import pytest

from taskcal.observations import WAYS, Way, kind_of


def test_every_way_has_its_kinds():
    assert set(WAYS) == set(get_args(Way))


@pytest.mark.parametrize("way", WAYS)
def test_a_tracker_alone_needs_a_frame_of_its_own(way):
    assert {kind_of(key).in_tracker for key in WAYS[way]} == {way == "tracker"}

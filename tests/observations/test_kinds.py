import pytest

from taskcal.observations import Standalone, kinds


@pytest.mark.parametrize("kind", kinds(), ids=lambda kind: kind.key)
def test_a_tracker_alone_needs_a_frame_of_its_own(kind):
    assert kind.in_tracker == (not issubclass(kind, Standalone))

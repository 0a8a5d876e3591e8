from dataclasses import replace

import numpy as np
import pytest

from taskcal.errors import ReachError
from taskcal.kinematics.clearance import place_links, segment_distance
from taskcal.observations.instrument import find_measurable
from tests.planning.without_tracker import MODEL, TASK, TIP, instrument_of, plan_of

INSTRUMENT = instrument_of("wire")


def wires(q, of):
    tip = MODEL.poses(q) @ TIP
    return tip, INSTRUMENT.fixtures.position[of] - tip[:, :3, 3]


def test_wires_have_measurable_length_and_clear_tool():
    """Every wire has a measurable length and leaves the tool without contact."""
    made = plan_of("wire")
    tip, way = wires(made.q, made.of)
    length = np.linalg.norm(way, axis=1)
    assert INSTRUMENT.lengths[0] <= length.min() <= length.max() <= INSTRUMENT.lengths[1]
    assert np.arccos((way * tip[:, :3, 2]).sum(axis=1) / length).max() <= INSTRUMENT.angle + 1e-9


def test_no_wire_crosses_a_link():
    made = plan_of("wire")
    tip, way = wires(made.q, made.of)
    links = place_links(MODEL, made.q)
    # all but what carries the wire's end, beside which it begins
    for k in range(5):
        apart = segment_distance(tip[:, :3, 3], tip[:, :3, 3] + way, links.start[:, k], links.end[:, k])
        assert apart.min() > links.radius[k]


def test_wire_out_of_range_everywhere_names_its_anchor():
    """A wire that is out of range at every pose is rejected, and its anchor is named."""
    with pytest.raises(
        ReachError, match=r"anchor 'front' cannot be measured .* the wire too short or too long; move it"
    ):
        find_measurable(MODEL, TASK, replace(INSTRUMENT, lengths=(INSTRUMENT.lengths[0], 0.12)), 60, 0)


def test_a_sensor_of_unknown_scale_tells_less():
    assert replace(INSTRUMENT, wire_scale=True).unknown.shape == (13,)
    assert INSTRUMENT.unknown.shape == (12,)

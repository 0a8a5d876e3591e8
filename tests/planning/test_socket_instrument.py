from dataclasses import replace

import numpy as np
import pytest

from taskcal.errors import ReachError
from taskcal.geometry import se3
from taskcal.kinematics.clearance import clear_of_boxes, place_links, without_carriers
from taskcal.observations import Fixtures
from taskcal.observations.instrument import check_measurable, find_measurable
from taskcal.observations.socket import APPROACH_STEPS, MAX_DEVIATION, SocketInstrument
from tests.planning.without_tracker import MODEL, TASK, TIP, instrument_of, plan_of

INSTRUMENT = instrument_of("socket")


def test_the_ball_is_in_its_socket_and_the_stem_within_the_cone():
    made = plan_of("socket")
    ball = (MODEL.poses(made.q) @ TIP)[:, :3, 3]
    np.testing.assert_allclose(ball, INSTRUMENT.fixtures.position[made.of], atol=1e-6)
    tilt = INSTRUMENT.tilt(MODEL, made.q, made.of)
    assert tilt.max() <= INSTRUMENT.cone + 1e-6
    assert tilt.max() > 0.8 * INSTRUMENT.cone  # the whole cone is used


def test_socket_approach_is_axial_and_links_clear_block():
    """The approach is along the socket's axis, and the links stay outside the block."""
    made = plan_of("socket")
    ways = INSTRUMENT.visits(MODEL, made.q, made.of)
    assert ways.shape[1] == APPROACH_STEPS + 1
    np.testing.assert_array_equal(ways[:, -1], made.q)
    finer = np.concatenate(
        [
            ways[:, k, None] + np.linspace(0, 1, 5)[:, None] * (ways[:, k + 1] - ways[:, k])[:, None]
            for k in range(APPROACH_STEPS)
        ],
        axis=1,
    )
    flat = finer.reshape(-1, 6)
    of = np.repeat(made.of, finer.shape[1])
    away = (MODEL.poses(flat) @ TIP)[:, :3, 3] - INSTRUMENT.fixtures.position[of]
    along = (away * INSTRUMENT.fixtures.direction[of]).sum(axis=1)
    assert along.reshape(len(made.q), -1)[:, 0] == pytest.approx(INSTRUMENT.distance, abs=1e-9)
    assert np.all(np.diff(along.reshape(len(made.q), -1), axis=1) <= 1e-9)
    assert np.linalg.norm(away - along[:, None] * INSTRUMENT.fixtures.direction[of], axis=1).max() < 1.1 * MAX_DEVIATION
    links = without_carriers(place_links(MODEL, flat), away + INSTRUMENT.fixtures.position[of])
    assert clear_of_boxes(links, INSTRUMENT.blocks).all()
    assert MODEL.robot.inside_limits(flat).all()


def test_a_block_reaches_around_its_sockets_and_up_to_the_balls():
    turned = se3.exp(np.array([0.5, -0.3, 0.8]))
    fixtures = Fixtures(
        names=("p/a", "p/b", "q/a"),
        position=np.array([[0.3, 0.0, 0.2], [0.3, 0.1, 0.2], [0.5, 0.0, 0.2]]) @ turned.T,
        direction=np.tile(turned[:, 2], (3, 1)),
    )
    first, second = SocketInstrument(fixtures=fixtures).blocks
    assert sorted(first.size) == pytest.approx([0.06, 0.06, 0.16])
    top = se3.apply(first.pose, np.array([[0.0, 0.0, 0.5 * first.size[2]]]))[0]
    assert turned[:, 2] @ top == pytest.approx(turned[:, 2] @ fixtures.position[0])
    assert second.size == pytest.approx([0.06, 0.06, 0.06])
    assert SocketInstrument(fixtures=fixtures).stages.tolist() == [0, 0, 1]


def test_socket_cone_excludes_poses_and_narrow_cone_costs():
    """Poses outside the cone are not candidates, and a narrow cone raises the expected error."""
    narrow = replace(INSTRUMENT, cone=np.radians(10.0))
    found = find_measurable(MODEL, TASK, narrow, 120, 0)
    assert narrow.tilt(MODEL, found.q, found.visible.argmax(axis=1)).max() <= narrow.cone + 1e-6


def test_a_posture_in_the_block_is_refused():
    upside_down = replace(INSTRUMENT, fixtures=replace(INSTRUMENT.fixtures, direction=-INSTRUMENT.fixtures.direction))
    made = plan_of("socket")
    ok, lost = check_measurable(MODEL, upside_down, made.q, made.of)
    assert not ok.all()
    assert lost["too near the block"] > 0.5 * len(made.q)


def test_a_socket_out_of_reach_is_named_with_how_far_it_is():
    far = replace(
        INSTRUMENT.fixtures, position=INSTRUMENT.fixtures.position + np.array([[0.0, 0.0, 0.0]] * 3 + [[1.0, 0.0, 0.0]])
    )
    with pytest.raises(ReachError, match=r"does not reach .*socket 'second/b' at x .* comes within about \d+ mm\)"):
        find_measurable(MODEL, TASK, replace(INSTRUMENT, fixtures=far), 60, 0)

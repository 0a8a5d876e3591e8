from dataclasses import replace
from itertools import pairwise

import numpy as np

from taskcal.geometry import se3
from taskcal.kinematics.clearance import Box, clear_of_boxes, place_links
from taskcal.observations.instrument import find_blocked_paths
from tests.planning.without_tracker import MODEL, instrument_of

INSTRUMENT = instrument_of("camera")
OF = np.zeros(3, dtype=int)
TURNED = np.array([[-0.9, 0.5, 0.2, 0, 0.4, 0], [0.9, 0.5, 0.2, 0, 0.4, 0], [0.0, -1.2, 0.8, 0, 0.4, 0]])
POST = Box(pose=se3.translation(0.45, 0.0, 0.3), size=np.array([0.05, 0.05, 0.6]))


def test_blocked_path_is_found_with_a_way_round():
    assert find_blocked_paths(MODEL, INSTRUMENT, TURNED, OF) == ()
    behind_a_post = replace(INSTRUMENT, keep_out=(POST,))
    assert clear_of_boxes(place_links(MODEL, TURNED), (POST,)).all()
    (blocked,) = find_blocked_paths(MODEL, behind_a_post, TURNED, OF)
    assert blocked.pose == 1
    road = np.concatenate([TURNED[:1], blocked.via, TURNED[1:2]])
    share = np.linspace(0.0, 1.0, 25)[:, None]
    driven = np.concatenate([a + share * (b - a) for a, b in pairwise(road)])
    assert clear_of_boxes(place_links(MODEL, driven), (POST,)).all()


def test_blocked_path_without_a_way_round_has_none():
    wall = Box(pose=se3.translation(0.45, 0.0, 0.5), size=np.array([0.9, 0.02, 3.0]))
    behind = Box(pose=se3.translation(-0.45, 0.0, 0.5), size=np.array([0.6, 0.02, 3.0]))
    (blocked,) = find_blocked_paths(MODEL, replace(INSTRUMENT, keep_out=(wall, behind)), TURNED[:2], OF[:2])
    assert (blocked.pose, blocked.via) == (1, None)

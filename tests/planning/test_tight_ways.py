from dataclasses import replace
from itertools import pairwise

import numpy as np

from taskcal.geometry import se3
from taskcal.kinematics.clearance import Box, clear_of_boxes, place_links
from taskcal.planning.instruments import find_tight_ways
from tests.planning.without_tracker import MODEL, way_of

WAY = way_of("camera")
OF = np.zeros(3, dtype=int)
TURNED = np.array([[-0.9, 0.5, 0.2, 0, 0.4, 0], [0.9, 0.5, 0.2, 0, 0.4, 0], [0.0, -1.2, 0.8, 0, 0.4, 0]])
POST = Box(pose=se3.translation(0.45, 0.0, 0.3), size=np.array([0.05, 0.05, 0.6]))


def test_a_way_through_a_box_is_found_and_a_way_round_it():
    assert find_tight_ways(MODEL, WAY, TURNED, OF) == ()
    behind_a_post = replace(WAY, keep_out=(POST,))
    assert clear_of_boxes(place_links(MODEL, TURNED), (POST,)).all()
    (tight,) = find_tight_ways(MODEL, behind_a_post, TURNED, OF)
    assert tight.pose == 1
    road = np.concatenate([TURNED[:1], tight.via, TURNED[1:2]])
    share = np.linspace(0.0, 1.0, 25)[:, None]
    driven = np.concatenate([a + share * (b - a) for a, b in pairwise(road)])
    assert clear_of_boxes(place_links(MODEL, driven), (POST,)).all()


def test_where_there_is_no_way_round_none_is_named():
    wall = Box(pose=se3.translation(0.45, 0.0, 0.5), size=np.array([0.9, 0.02, 3.0]))
    behind = Box(pose=se3.translation(-0.45, 0.0, 0.5), size=np.array([0.6, 0.02, 3.0]))
    (tight,) = find_tight_ways(MODEL, replace(WAY, keep_out=(wall, behind)), TURNED[:2], OF[:2])
    assert (tight.pose, tight.via) == (1, None)

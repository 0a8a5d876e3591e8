"""The reference task is a file like any other."""

import numpy as np

import taskcal as tc
from taskcal_demo.procedure import reference_task


def test_the_file_says_the_published_box_to_the_last_bit():
    task = reference_task()
    np.testing.assert_array_equal(task.workspace.center, [1.711, 0.03, 1.489])
    np.testing.assert_array_equal(task.workspace.size, [0.5, 0.7, 0.5])
    assert task.accuracy == 1e-4


def test_the_spread_opens_tilt_and_turn():
    (orientation,) = tc.demo.reference_task(0.3).workspace.orientations
    assert orientation.cone == orientation.spin == 0.3
    (closed,) = tc.demo.reference_task().workspace.orientations
    assert closed.cone == closed.spin == 0.0

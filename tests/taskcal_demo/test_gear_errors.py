"""Errors of gears that no effect describes."""

import numpy as np

from taskcal_demo.true_robot import GearErrors


def test_an_unknown_ripple_is_no_sum_of_the_orders_that_compete(robot):
    """Cosines and sines of orders 1 to 30 over a whole turn leave nearly all of a ripple of a higher one."""
    gears = GearErrors(orders=(37.3,) * 6, swell=(0.7,) * 6)
    term = gears.term(robot)
    q = np.zeros((600, 6))
    q[:, 0] = np.linspace(-np.pi, np.pi, 600)
    column = term.prepare(q)[:, list(term.names).index("J1.ripple_cos")]
    orders = np.arange(31)[None] * q[:, :1]
    known = np.concatenate([np.cos(orders), np.sin(orders)], axis=1)
    left = column - known @ np.linalg.lstsq(known, column, rcond=None)[0]
    assert 0.9 < np.linalg.norm(left) / np.linalg.norm(column) <= 1.0

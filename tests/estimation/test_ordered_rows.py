"""A step or a smooth motion is found with row and size, whatever was fitted; a function of the posture is neither."""

import numpy as np
import pytest

from taskcal.estimation.ordered_rows import OrderedRows, Source, find_event

ROWS, UNIT = 50, 1e-4


def rows_of(rng, left, *, ordered=False):
    """Points of three numbers whose fit has ten columns and a place, and two sources, one of which may grow smoothly."""
    q = rng.normal(size=(ROWS, 3))
    q = q[np.argsort(q[:, 0])] if ordered else q
    sources = (
        Source(id="step", of=(0,), columns=rng.normal(size=(ROWS, 3, 2)) / UNIT),
        Source(id="drift", of=(0,), columns=np.tile(np.eye(3) / UNIT, (ROWS, 1, 1)), steps=False, smooth=(3,)),
    )
    rows = OrderedRows(
        row=np.arange(ROWS),
        residual=rng.normal(size=(ROWS, 3)),
        unit=np.full((ROWS, 3), UNIT),
        known=100.0 * np.concatenate([rng.normal(size=(ROWS, 3, 10)), np.tile(np.eye(3), (ROWS, 1, 1))], axis=2),
        q=q,
        joints=rng.normal(size=(ROWS, 3, 3)) / UNIT,
        sources=sources,
    )
    return rows, rows.residual + left(rows) / UNIT


def with_residual(rows, residual):
    return OrderedRows(
        **{**{name: getattr(rows, name) for name in OrderedRows.__dataclass_fields__}, "residual": residual}
    )


@pytest.mark.parametrize("seed", range(6))
def test_a_step_and_a_drift_are_found_beside_all_that_was_fitted(seed):
    rng = np.random.default_rng(seed)
    row, by = int(rng.integers(8, ROWS - 8)), np.array([8e-4, -6e-4])
    rows, residual = rows_of(rng, lambda r: UNIT * r.sources[0].columns @ by * (r.row >= row)[:, None])
    fitted = residual + rows.known @ rng.normal(size=13)
    for left in (residual, fitted):
        found = find_event(with_residual(rows, left))
        assert (found.id, found.row) == ("step", row)
        np.testing.assert_allclose(found.motion[:, 0], by, rtol=0.15)
        assert found.after < 0.5 * found.before
    grown = np.linspace(0.0, 1.0, ROWS)[:, None] * np.array([1.0e-3, 0.0, -1.0e-3])
    found = find_event(with_residual(rows, rows.residual + grown / UNIT))
    assert (found.id, found.order) == ("drift", 1)
    assert found.displacement == pytest.approx(1.41e-3, rel=0.15)


def test_noise_and_functions_of_the_posture_are_nothing_that_happened():
    """The rows follow the first joint, so that a function of it changes as smoothly as a drift, by three to ten times the noise."""
    accused = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        size, way = (3.0 if seed % 2 else 10.0) * UNIT, rng.normal(size=3)
        rows, residual = rows_of(rng, lambda r, by=size * way: np.sin(1.5 * r.q[:, [0]] + 0.3) * by, ordered=True)
        assert find_event(rows) is None
        accused.append(find_event(with_residual(rows, residual)) is not None)
    assert sum(accused) <= 1

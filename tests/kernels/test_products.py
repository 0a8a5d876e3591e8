"""Products of columns, tile by tile."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.kernels.compiled import compiled
from taskcal.kernels.lanes import LANES, as_lanes
from taskcal.kernels.products import TILE, VECTORS, add_products, allocate_products, symmetric
from tests.laws.robots import generators


@compiled
def added(products, vectors):
    add_products(as_lanes(products.block), vectors, products.sums)


@given(generators, st.integers(0, 3 * TILE), st.integers(1, VECTORS))
def test_products_are_those_of_all_columns_with_each_other(rng, columns, vectors):
    products = allocate_products(columns, vectors + 2)
    expected = np.zeros((columns + 1, columns + 1))
    for _ in range(2):
        products.block[: columns + 1] = rng.normal(size=(columns + 1, *products.block.shape[1:]))
        added(products, vectors)
        rows = products.block[: columns + 1, :vectors].reshape(columns + 1, vectors * LANES)
        expected += rows @ rows.T
    sums = symmetric(products.sums)
    np.testing.assert_allclose(sums[: columns + 1, : columns + 1], expected, rtol=1e-13, atol=1e-12)
    assert not sums[columns + 1 :].any()


@pytest.mark.parametrize(("columns", "vectors"), [(0, 0), (3, 1), (4, 7), (54, 10**6)])
def test_a_block_has_whole_tiles_and_no_more_rows_than_there_are(columns, vectors):
    products = allocate_products(columns, vectors)
    tiled, held, lanes = products.block.shape
    assert columns < tiled <= columns + TILE
    assert tiled % TILE == 0
    assert held == min(vectors, VECTORS)
    assert lanes == LANES
    assert products.sums.shape == (tiled, tiled)

"""Sums of products of columns, JᵀJ, from a block of rows at a time that stays in the nearest cache.

A rank-one update for each row would go through the whole sum every time. Here rows are gathered, their numbers of one column side
by side, and each tile of four by four sums is taken along all of them in registers.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from taskcal.kernels.compiled import inlined, part
from taskcal.kernels.lanes import allocate_lanes, total_of

TILE = 4
"""Columns and rows of the sums that are taken at once."""

VECTORS = 48
"""Lanes of rows in a block: two tiles' columns of a block fit the first cache."""


class Products(NamedTuple):
    """A block of rows, and the sums of what went before."""

    columns: int
    """Without the last one, which stands for the residuals."""
    block: Float[np.ndarray, "tiled vectors lanes"]
    """The rows' numbers, column by column; columns that only fill up a tile are zero."""
    sums: Float[np.ndarray, "tiled tiled"]


def allocate_products(columns: int, vectors: int) -> Products:
    """Buffers for columns besides the residuals, and so many lanes of rows in all, no more of them in a block; sums of zero."""
    tiled = -(-(columns + 1) // TILE) * TILE
    (block,) = allocate_lanes((tiled, min(VECTORS, vectors)))
    return Products(columns, block, np.zeros((tiled, tiled)))


@inlined
def _add_totals(row, k, a, b, c, d):
    row[k] += total_of(a)
    row[k + 1] += total_of(b)
    row[k + 2] += total_of(c)
    row[k + 3] += total_of(d)


@part
def add_products(block, vectors, sums):
    """Add the products of a block's columns, as lanes, over its first vectors, one at least; tiles on and above the diagonal."""
    for j in range(0, block.shape[0], TILE):
        for k in range(j, block.shape[0], TILE):
            a, b, c, d = block[k, 0], block[k + 1, 0], block[k + 2, 0], block[k + 3, 0]
            v, w, x, y = block[j, 0], block[j + 1, 0], block[j + 2, 0], block[j + 3, 0]
            s00, s01, s02, s03 = v * a, v * b, v * c, v * d
            s10, s11, s12, s13 = w * a, w * b, w * c, w * d
            s20, s21, s22, s23 = x * a, x * b, x * c, x * d
            s30, s31, s32, s33 = y * a, y * b, y * c, y * d
            for i in range(1, vectors):
                a, b, c, d = block[k, i], block[k + 1, i], block[k + 2, i], block[k + 3, i]
                v = block[j, i]
                s00, s01, s02, s03 = s00 + v * a, s01 + v * b, s02 + v * c, s03 + v * d
                v = block[j + 1, i]
                s10, s11, s12, s13 = s10 + v * a, s11 + v * b, s12 + v * c, s13 + v * d
                v = block[j + 2, i]
                s20, s21, s22, s23 = s20 + v * a, s21 + v * b, s22 + v * c, s23 + v * d
                v = block[j + 3, i]
                s30, s31, s32, s33 = s30 + v * a, s31 + v * b, s32 + v * c, s33 + v * d
            _add_totals(sums[j], k, s00, s01, s02, s03)
            _add_totals(sums[j + 1], k, s10, s11, s12, s13)
            _add_totals(sums[j + 2], k, s20, s21, s22, s23)
            _add_totals(sums[j + 3], k, s30, s31, s32, s33)


def symmetric(sums: Float[np.ndarray, "tiled tiled"]) -> Float[np.ndarray, "tiled tiled"]:
    """The sums with those below the diagonal, which are not added up."""
    return np.where(_above(len(sums)), sums, sums.T)


@cache
def _above(size: int) -> np.ndarray:
    return np.triu(np.ones((size, size), dtype=bool))

import numpy as np

from taskcal.kernels.chain import Columns


def layout(frames, column, count):
    column = np.array(column, dtype=np.int64)
    return Columns(frames=np.array(frames), joint=np.zeros_like(column), column=column, count=count)


def test_columns_that_belong_to_nothing_are_noticed():
    assert layout([[0, 1, 2, -1, -1, -1]], [3, 4, 4], 5).fills
    assert not layout([[0, 1, 2, -1, -1, -1]], [3, 4, 4], 6).fills
    assert not layout([[0, 1, -1, -1, -1, -1]], [3], 4).fills
    assert layout(np.empty((0, 6), dtype=np.int64), [], 0).fills

"""Passes a part at a time."""

import pytest

from taskcal.errors import ClosureError
from taskcal.kernels.chunks import in_chunks


@pytest.mark.parametrize("n", [0, 1, 7, 8, 50])
def test_parts_cover_all_in_order(n):
    parts = in_chunks(lambda rows: list(range(rows.start, rows.stop)), n, 8)
    assert [i for part in parts for i in part] == list(range(n))
    assert all(len(part) <= 8 for part in parts)


def test_a_pass_within_a_pass_does_not_wait_for_its_own_threads():
    def outer(rows):
        return sum(in_chunks(lambda inner: inner.stop - inner.start, 1000 * (rows.stop - rows.start), 10))

    assert sum(in_chunks(outer, 64, 2)) == 64_000


def test_an_error_names_its_pose_among_all():
    def close(rows):
        if rows.start >= 16:
            raise ClosureError(3, "open")

    with pytest.raises(ClosureError) as raised:
        in_chunks(close, 40, 8)
    assert raised.value.pose == 19

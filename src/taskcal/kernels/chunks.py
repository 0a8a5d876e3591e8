"""Passes over many poses, a part of them at a time, on a pool of threads."""

import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any

from taskcal.errors import ClosureError

CHUNK = 8192
"""Poses a thread takes at a time; fewer are walked in the calling thread."""


_thread = threading.local()


def _mark() -> None:
    _thread.of_pool = True


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(os.cpu_count(), thread_name_prefix="taskcal-walk", initializer=_mark)


if hasattr(os, "register_at_fork"):  # not on Windows
    os.register_at_fork(after_in_child=_pool.cache_clear)  # a child has no threads but the one that forked


def in_chunks(walk_rows: Callable[[slice], Any], n: int, size: int = CHUNK) -> list[Any]:
    """Call `walk_rows` with slices that cover n poses, so many each, on a thread pool where there are several; results in order.

    Raises:
        ClosureError: as `walk_rows` does, its pose counted among all n.
    """

    def count(rows: slice) -> Any:
        try:
            return walk_rows(rows)
        except ClosureError as error:
            raise error.counted_from(rows.start) from None

    if n <= size:
        return [count(slice(0, n))]
    parts = [slice(i, min(i + size, n)) for i in range(0, n, size)]
    if getattr(_thread, "of_pool", False):  # a pass within a pass: all threads would wait for one that is free
        return [count(part) for part in parts]
    return list(_pool().map(count, parts))

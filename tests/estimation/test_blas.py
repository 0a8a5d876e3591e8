"""BLAS on one thread, and the caller's setting afterwards."""

from concurrent.futures import ThreadPoolExecutor
from threading import Event

import pytest
import scipy.linalg  # noqa: F401 - brings a BLAS of its own, which the first call would load
from threadpoolctl import ThreadpoolController

from taskcal.estimation.matrices import ONE_BLAS_THREAD, single_threaded


def threads() -> set[int]:
    return {library["num_threads"] for library in ThreadpoolController().select(user_api="blas").info()}


def test_single_thread_call_restores_thread_setting():
    """The function runs on one thread, and the caller's setting is restored."""

    @single_threaded
    def inside(fail: bool) -> set[int]:
        if fail:
            raise KeyError("stop")
        return threads()

    with ThreadpoolController().limit(limits=2, user_api="blas"):
        before = threads()
        assert inside(fail=False) == {1}
        assert threads() == before
        with pytest.raises(KeyError, match="stop"):
            inside(fail=True)
        assert threads() == before
    assert inside.__name__ == "inside"


def test_threads_that_are_done_leave_the_others_alone():
    began, ended = Event(), Event()

    @single_threaded
    def outlast() -> set[int]:
        began.set()
        assert ended.wait(30.0)
        return threads()

    with ThreadpoolController().limit(limits=2, user_api="blas"), ThreadPoolExecutor(1) as other:
        before = threads()
        with ONE_BLAS_THREAD:
            during = other.submit(outlast)
            assert began.wait(30.0)
            assert single_threaded(threads)() == {1}
            ended.set()
            assert during.result() == {1}
        assert threads() == before

"""BLAS on one thread, and the caller's setting afterwards."""

import os
import subprocess
import sys
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
        with ONE_BLAS_THREAD.held():
            during = other.submit(outlast)
            assert began.wait(30.0)
            assert single_threaded(threads)() == {1}
            ended.set()
            assert during.result() == {1}
        assert threads() == before


FORKS = """
import os, signal, threading, warnings
import numpy as np, taskcal as tc
from taskcal.estimation import matrices

warnings.simplefilter("ignore", DeprecationWarning)  # of Python 3.12 and later, of forks beside threads
model = tc.ErrorModel(tc.load_robot("abb-irb120"))
q = np.random.default_rng(0).uniform(-0.6, 0.6, (30, 6))
campaign, _ = tc.simulate(model, q, rng=np.random.default_rng(0))

def child_status(compute):
    if (child := os.fork()) == 0:
        signal.alarm(20)
        compute()
        os._exit(0)
    return os.waitpid(child, 0)[1]

def fit():
    tc.identify(model, campaign)

def fit_on():
    while not done.is_set():
        fit()

done, fits = threading.Event(), [threading.Thread(target=fit_on) for _ in range(2)]
fit()
for thread in fits: thread.start()
statuses = [child_status(fit) for _ in range(3)]
done.set()
for thread in fits: thread.join()
many = np.zeros((40_000, 6))
model.poses(many)  # on a pool of threads
statuses.append(child_status(lambda: model.poses(many)))
assert statuses == [0] * 4, statuses

matrices.FORK_WAIT_S = 0.1
begun, ended = threading.Event(), threading.Event()
endless = threading.Thread(target=matrices.single_threaded(lambda: (begun.set(), ended.wait())))
endless.start()
begun.wait()
with warnings.catch_warnings(record=True) as said:
    warnings.simplefilter("always", RuntimeWarning)
    assert child_status(lambda: None) == 0
ended.set()
endless.join()
assert "fits in other threads (1)" in str(said[0].message), said
assert matrices.single_threaded(lambda: child_status(fit))() == 0  # does not wait for itself
"""


@pytest.mark.skipif(not hasattr(os, "register_at_fork"), reason="no forks on this system")
def test_child_of_a_fork_beside_fits_can_fit():
    """A child forked in the midst of other threads' work fits and walks many poses; a fork waits, but not for ever."""
    done = subprocess.run([sys.executable, "-c", FORKS], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr

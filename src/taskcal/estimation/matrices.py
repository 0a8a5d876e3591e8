"""Positive semidefinite matrices of very different scales, inverted and solved on unit diagonal."""

import os
from collections import Counter
from collections.abc import Callable, Generator
from contextlib import contextmanager
from functools import cache, wraps
from importlib import import_module
from threading import Condition, get_ident
from typing import Any, ParamSpec, TypeVar
from warnings import warn

import numpy as np
from jaxtyping import Float
from threadpoolctl import ThreadpoolController


@cache
def _lapack(name: str) -> Any:
    """One of LAPACK's routines for Cholesky's factors; SciPy takes a while to import."""
    from scipy.linalg import get_lapack_funcs

    return get_lapack_funcs((name,), dtype=np.float64)[0]


QR_BLOCK = 64
"""Columns for which LAPACK's routine gets room at once (`nbmax` of dormqr)."""


def inverse_scale(A: Float[np.ndarray, "p p"]) -> Float[np.ndarray, " p"]:
    """1/√diagonal, finite where the diagonal is zero: scale·A·scale has a unit diagonal."""
    return 1.0 / np.sqrt(np.maximum(np.diag(A), 1e-300))


def solve_scaled(A: Float[np.ndarray, "p p"], b: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Solve A·x = b for a positive definite A of very different scales, by Cholesky on unit diagonal.

    Raises:
        numpy.linalg.LinAlgError: A is not positive definite.
    """
    if not len(A):  # which LAPACK refuses
        return b.copy()
    scale = inverse_scale(A)
    right = scale * b if b.ndim == 1 else scale[:, None] * b
    _, x, info = _lapack("posv")(A * scale * scale[:, None], right, lower=True)
    if info:
        raise np.linalg.LinAlgError(f"leading minor {info} is not positive definite")
    return scale * x if b.ndim == 1 else scale[:, None] * x


def factor_lower(A: Float[np.ndarray, "p p"]) -> Float[np.ndarray, "p p"]:
    """Lower triangular L with L·Lᵀ = A, of which the lower triangle is looked at.

    Raises:
        numpy.linalg.LinAlgError: A is not positive definite.
    """
    if not len(A):  # which LAPACK refuses
        return A.copy()
    factor, info = _lapack("potrf")(A, lower=True, clean=True)
    if info:
        raise np.linalg.LinAlgError(f"leading minor {info} is not positive definite")
    return factor


def solve_factored(L: Float[np.ndarray, "p p"], b: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Solution of L·Lᵀ·x = b, or of several such equations, one a column."""
    return _lapack("potrs")(L, b, lower=True)[0] if len(L) else b.copy()


def solve_triangular(L: Float[np.ndarray, "p p"], B: Float[np.ndarray, "p k"]) -> Float[np.ndarray, "p k"]:
    """Solution X of L·X = B, L lower triangular; B is written over where it lies in columns."""
    return _lapack("trtrs")(L, B, lower=True, overwrite_b=True)[0] if B.size else B


def invert_triangular(L: Float[np.ndarray, "p p"]) -> Float[np.ndarray, "p p"]:
    """Inverse of a lower triangular L."""
    return _lapack("trtri")(L, lower=True)[0] if len(L) else L.copy()


def invert_factored(L: Float[np.ndarray, "p p"]) -> Float[np.ndarray, "p p"]:
    """Inverse of L·Lᵀ."""
    if not len(L):
        return L.copy()
    inverse = _lapack("potri")(L, lower=True)[0]  # the upper triangle stays that of L, zero
    out = inverse + inverse.T
    np.fill_diagonal(out, np.diag(inverse))
    return out


def turn_to_triangle(
    A: Float[np.ndarray, "n k"], B: Float[np.ndarray, "n p"]
) -> tuple[Float[np.ndarray, "k k"], Float[np.ndarray, "n p"]]:
    """Upper triangular R of A = Q·R, and Qᵀ·B with all n columns of Q, which is not formed."""
    if not A.shape[1]:  # which LAPACK refuses
        return np.zeros((0, 0)), B.copy()
    reflectors, scales = _lapack("geqrf")(A)[:2]
    turned = _lapack("ormqr")("L", "T", reflectors, scales, B, B.shape[1] * QR_BLOCK)[0]
    return np.triu(reflectors[: A.shape[1]]), turned


def invert_positive(A: Float[np.ndarray, "p p"]) -> Float[np.ndarray, "p p"]:
    """Inverse of a positive definite matrix of very different scales, by Cholesky on unit diagonal.

    Raises:
        numpy.linalg.LinAlgError: A is not positive definite.
    """
    scale = inverse_scale(A)
    return invert_factored(factor_lower(A * scale * scale[:, None])) * scale * scale[:, None]


def factor_positive(C: Float[np.ndarray, "p p"], tolerance: float) -> Float[np.ndarray, "p p"]:
    """Lower triangular L with L·Lᵀ = C, a positive semidefinite matrix of very different scales, by Cholesky on unit diagonal.

    L·Lᵀ differs from C by less than (p + 1)·1.2·10⁻¹⁶·√(Cᵢᵢ·Cⱼⱼ) in every entry (Higham 2002, Accuracy and Stability of
    Numerical Algorithms, theorem 10.3). Where C is singular, its eigenvalues on unit diagonal that rounding left under zero
    are taken for zero.

    Args:
        C: the matrix, of which the lower triangle is looked at.
        tolerance: how far under zero an eigenvalue on unit diagonal may be.

    Raises:
        numpy.linalg.LinAlgError: C is not positive semidefinite.
    """
    scale, diagonal = inverse_scale(C), np.diag(C)
    if not len(C):  # which LAPACK refuses
        return C.copy()
    if not np.isfinite(C).all() or diagonal.min() < 0.0:
        raise np.linalg.LinAlgError(f"its least entry on the diagonal is {diagonal.min():.2g}")
    unit = C * scale * scale[:, None]
    factor, info = _lapack("potrf")(unit, lower=True, clean=True)
    if info:
        values, vectors = np.linalg.eigh(unit)
        if values[0] < -tolerance:
            raise np.linalg.LinAlgError(f"its least eigenvalue on unit diagonal is {values[0]:.2g}")
        upper = np.linalg.qr((vectors * np.sqrt(np.maximum(values, 0.0))).T).R
        factor = (upper * np.where(np.diag(upper) < 0.0, -1.0, 1.0)[:, None]).T
    return np.where(diagonal[:, None] > 0.0, factor / scale[:, None], 0.0)


def root_of(covariance: Float[np.ndarray, "*n b b"]) -> Float[np.ndarray, "*n b b"]:
    """R with R·Rᵀ = covariance, which may be singular."""
    values, vectors = np.linalg.eigh(covariance)
    return vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :]


def invert_scaled(A: Float[np.ndarray, "p p"]) -> Float[np.ndarray, "p p"]:
    """Inverse of a symmetric matrix, by elimination on unit diagonal.

    Raises:
        numpy.linalg.LinAlgError: A is singular.
    """
    scale = inverse_scale(A)
    return np.linalg.inv(A * scale * scale[:, None]) * scale * scale[:, None]


def pseudo_invert_scaled(A: Float[np.ndarray, "p p"], rcond: float) -> Float[np.ndarray, "p p"]:
    """Pseudo-inverse of a positive semidefinite matrix; scaled eigenvalues under `rcond` of the largest give zero."""
    scale = inverse_scale(A)
    return np.linalg.pinv(A * scale * scale[:, None], rcond=rcond, hermitian=True) * scale * scale[:, None]


# Many small covariances factored at once: LAPACK takes some microseconds for each.


def inverse_factors(covariance: Float[np.ndarray, "*n b b"]) -> Float[np.ndarray, "*n b b"]:
    """Lower triangular W with W·covariance·Wᵀ = I, the inverse of Cholesky's factor; NaN where there is none."""
    b, W = covariance.shape[-1], np.zeros(covariance.shape)
    for i in range(b):
        # of row i what the rows before it explain, one number of all blocks after another
        explained = [sum(W[..., j, k] * covariance[..., i, k] for k in range(j + 1)) for j in range(i)]
        left = covariance[..., i, i] - sum(part * part for part in explained)
        scale = 1.0 / np.sqrt(np.where(left > 0.0, left, np.nan))
        W[..., i, i] = scale
        for k in range(i):
            W[..., i, k] = -scale * sum(explained[j] * W[..., j, k] for j in range(k, i))
    return W


# The squared-exponential correlation of a smooth random function (Rasmussen and Williams 2006, eq. 4.9).


def squared_exponential(square: Float[np.ndarray, "*b"]) -> Float[np.ndarray, "*b"]:
    """Correlation exp(−d²/2) of a function's values at two places.

    Args:
        square: d², squared distance of the places in units of the length scales; rounding may leave it below zero.
    """
    return np.exp(-0.5 * np.maximum(square, 0.0))


# One thread for the linear algebra: matrices of a hundred rows gain nothing from more, and threads contend for cores.

P = ParamSpec("P")
R = TypeVar("R")


@cache
def _controller() -> ThreadpoolController:
    """Thread controller of the loaded libraries; SciPy's own BLAS would be loaded later and keep its threads."""
    import_module("scipy.linalg")
    return ThreadpoolController()


FORK_WAIT_S = 60.0
"""Seconds that a fork waits for the fits of other threads; most fits take less than a tenth of that. A convention."""


class _OneBlasThread:
    """BLAS at one thread while any thread of the process wants it, and no fork in the midst of another thread's fit.

    The setting is the process's: the first thread that is done would give it back while others still compute. OpenBLAS takes it
    from the main thread alone where that has set it before (seen in 0.3.31), so that who starts threads holds it there.

    What a fit holds at a fork is held in the child for ever: BLAS, the compiler and, before Python 3.12, every cached property
    have locks. So `os.fork` waits until the fits of other threads have ended, and new ones wait until it is done.
    """

    def __init__(self) -> None:
        self._changed, self._limit = Condition(), None
        self._entered = Counter[tuple[int, bool]]()
        """How often each thread is within, in fits and otherwise."""
        self._forking = set[int]()
        """Threads that wait to fork, and compute nothing meanwhile."""

    @contextmanager
    def held(self, *, fit: bool = False) -> Generator[None, None, None]:
        """Hold BLAS at one thread.

        Args:
            fit: forks wait for it; not where a thread only waits for what others compute.
        """
        entry = (get_ident(), fit)
        with self._changed:
            if fit and entry not in self._entered:
                self._changed.wait_for(lambda: not self._forking)
            if not self._entered:
                self._limit = _controller().limit(limits=1, user_api="blas")
            self._entered[entry] += 1
        try:
            yield
        finally:
            with self._changed:
                self._entered -= Counter([entry])
                self._restore_after_last()
                self._changed.notify_all()

    def _restore_after_last(self) -> None:
        if not self._entered and self._limit is not None:
            self._limit.restore_original_limits()
            self._limit = None

    def _fits_elsewhere(self) -> int:
        return len({thread for thread, fit in self._entered if fit} - self._forking)

    def before_fork(self) -> None:
        """Wait for the fits of other threads, and let none begin or end during the fork."""
        self._changed.acquire()
        self._forking.add(get_ident())
        self._changed.notify_all()  # another that waits to fork need not wait for this thread's fit
        if not self._changed.wait_for(lambda: not self._fits_elsewhere(), FORK_WAIT_S):
            warn(
                f"os.fork() did not wait longer than {FORK_WAIT_S:g} s for fits in other threads ({self._fits_elsewhere()}), and "
                "the child may hang; fork before they begin, or start processes by 'spawn'",
                RuntimeWarning,
                stacklevel=2,
            )

    def after_fork(self) -> None:
        """Let fits go on."""
        self._forking.discard(get_ident())
        self._changed.notify_all()
        self._changed.release()

    def after_fork_in_child(self) -> None:
        """Forget the other threads, which the child does not have."""
        self._changed, self._forking = Condition(), set()
        self._entered = Counter({entry: n for entry, n in self._entered.items() if entry[0] == get_ident()})
        self._restore_after_last()


ONE_BLAS_THREAD = _OneBlasThread()
if hasattr(os, "register_at_fork"):  # not on Windows
    os.register_at_fork(
        before=ONE_BLAS_THREAD.before_fork,
        after_in_parent=ONE_BLAS_THREAD.after_fork,
        after_in_child=ONE_BLAS_THREAD.after_fork_in_child,
    )


def single_threaded(function: Callable[P, R]) -> Callable[P, R]:
    """Run a function with BLAS held at one thread, and give the caller's setting back; a fork waits for its end."""

    @wraps(function)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> R:
        with ONE_BLAS_THREAD.held(fit=True):
            return function(*args, **kwargs)

    return wrapped

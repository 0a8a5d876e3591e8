"""Positive definite matrices of very different scales inside kernels: factored on unit diagonal, solved and inverted.

As `estimation.scaled` does it by LAPACK, which a kernel that runs without Python cannot reach. Inner loops go along rows, so
that the compiler takes several numbers at a time.
"""

import numpy as np

from taskcal.geometry.compiled import part


@part
def factor_scaled(A, scale, U):
    """Fill U with the upper factor, Uᵀ·U = scale·A·scale, and `scale` with 1/√diagonal of A; whether A is positive definite.

    Of A only what is on and above the diagonal is read, and only that of U is filled.
    """
    p = A.shape[0]
    for i in range(p):
        scale[i] = 1.0 / np.sqrt(max(A[i, i], 1e-300))
    for i in range(p):
        for j in range(i, p):
            U[i, j] = A[i, j] * scale[i] * scale[j]
    for i in range(p):
        pivot = U[i, i]
        if not pivot > 0.0:
            return False
        inverse = 1.0 / np.sqrt(pivot)
        for j in range(i, p):
            U[i, j] *= inverse
        for k in range(i + 1, p):
            v = U[i, k]
            for j in range(k, p):
                U[k, j] -= v * U[i, j]
    return True


@part
def solve_factored(U, scale, b, x):
    """Fill x with the solution of A·x = b, of the factor that `factor_scaled` leaves of A."""
    p = b.shape[0]
    for i in range(p):
        x[i] = b[i] * scale[i]
    for i in range(p):
        x[i] /= U[i, i]
        v = x[i]
        for j in range(i + 1, p):
            x[j] -= U[i, j] * v
    for i in range(p - 1, -1, -1):
        v = x[i]
        for j in range(i + 1, p):
            v -= U[i, j] * x[j]
        x[i] = v / U[i, i]
    for i in range(p):
        x[i] *= scale[i]


@part
def invert_factored(U, scale, work, out):
    """Fill `out` with the inverse of A; `work` is room for a matrix."""
    p = U.shape[0]
    # rows of work: those of the inverse of Uᵀ, which is lower triangular
    for i in range(p):
        for j in range(p):
            work[i, j] = 0.0
    for i in range(p):
        work[i, i] += 1.0
        inverse = 1.0 / U[i, i]
        for j in range(i + 1):
            work[i, j] *= inverse
        for k in range(i + 1, p):
            v = U[i, k]
            for j in range(i + 1):
                work[k, j] -= v * work[i, j]
    for i in range(p):
        for j in range(p):
            out[i, j] = 0.0
    for k in range(p):
        for i in range(k + 1):
            v = work[k, i]
            for j in range(i, k + 1):
                out[i, j] += v * work[k, j]
    for i in range(p):
        for j in range(i, p):
            out[i, j] *= scale[i] * scale[j]
            out[j, i] = out[i, j]

"""The order in which parameters, or groups of them, are missed least, with the error expected after each.

In units of the prior, F = (1 + A)⁻¹ restricted to the kept parameters is the gain of a design, with A = XᵀX its information and
W = TᵀT its influence. With G = T·F·Xᵀ and K = 1 + X·Xᵀ the mean squared error over the task is

    |T|² − 2 tr(G·X·Tᵀ) + tr(G·K·Gᵀ)

Dropping a group g makes F − F_g·F_gg⁻¹·F_gᵀ. What each group would cost follows from the products F·Tᵀ and F·Xᵀ, whose inner
dimensions are those of task and campaign, not of the model.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

SMALLEST = 1e-15
"""Eigenvalue of information and influence, in units of the largest, under which there is nothing."""


def order_of_dropping(
    information: Float[np.ndarray, "p p"],
    influence: Float[np.ndarray, "p p"],
    prior: Float[np.ndarray, " p"],
    groups: Sequence[Int[np.ndarray, " _"]],
) -> tuple[list[int], Float[np.ndarray, " sizes"]]:
    """Drop groups one by one, always the one that is missed least.

    Args:
        information: A of the campaign.
        influence: W of the task.
        prior: standard deviations.
        groups: parameters that go together; each parameter is in one.

    Returns:
        numbers of the groups in the order in which they go, and the mean squared error over the task before each goes and after
        the last.
    """
    T, X = (_root(M * prior * prior[:, None]) for M in (influence, information))
    F = np.linalg.inv(np.eye(len(prior)) + information * prior * prior[:, None])
    F = 0.5 * (F + F.T)
    K, XT = np.eye(len(X)) + X @ X.T, X @ T.T
    FT, FX = F @ T.T, F @ X.T
    left = list(range(len(groups)))
    order: list[int] = []
    errors: list[float] = []
    while True:
        G = T @ FX
        GK = G @ K
        errors.append(float(np.sum(T**2) - 2.0 * np.sum(G * XT.T) + np.sum(GK * G)))
        if not left:
            return order, np.array(errors)
        costs = _costs(F, FT, FX, FX @ (XT - GK.T), FX @ K, [groups[g] for g in left])
        # groups that repeat each other cost the same: let the last one go
        k = int(np.flatnonzero(costs <= costs.min() + 1e-9 * (abs(costs.min()) + abs(errors[-1])))[-1])
        gone = left.pop(k)
        order.append(gone)
        g = groups[gone]
        column = F[:, g].copy()
        back = np.linalg.solve(F[np.ix_(g, g)], np.concatenate([column.T, FT[g], FX[g]], axis=1))
        p, m = len(prior), len(T)
        F, FT, FX = F - column @ back[:, :p], FT - column @ back[:, p : p + m], FX - column @ back[:, p + m :]
        F[g], F[:, g], FT[g], FX[g] = 0.0, 0.0, 0.0, 0.0


def _root(M: Float[np.ndarray, "p p"]) -> Float[np.ndarray, "k p"]:
    """R with RᵀR = M."""
    values, vectors = np.linalg.eigh(0.5 * (M + M.T))
    some = values > SMALLEST * max(values[-1], 1e-300)
    return (vectors[:, some] * np.sqrt(values[some])).T


def _costs(
    F: Float[np.ndarray, "p p"],
    FT: Float[np.ndarray, "p m"],
    FX: Float[np.ndarray, "p n"],
    slope: Float[np.ndarray, "p m"],
    FXK: Float[np.ndarray, "p n"],
    groups: Sequence[Int[np.ndarray, " _"]],
) -> Float[np.ndarray, " groups"]:
    """What the mean squared error grows by without each group."""
    out = np.empty(len(groups))
    alone = np.flatnonzero([len(g) == 1 for g in groups])
    if len(alone):
        s = np.concatenate([g for g in groups if len(g) == 1])
        a, t = np.diag(F)[s], FT[s]
        by_rows = np.einsum("pn,pn->p", FX[s], FXK[s])
        out[alone] = 2.0 * np.einsum("pm,pm->p", t, slope[s]) / a + np.einsum("pm,pm->p", t, t) * by_rows / a**2
    for k, g in enumerate(groups):
        if len(g) == 1:
            continue
        inverse = np.linalg.inv(F[np.ix_(g, g)])
        by_task, by_rows = inverse @ FT[g], inverse @ FX[g]
        out[k] = 2.0 * np.sum(by_task * slope[g]) + np.sum((by_task @ FT[g].T) * (FXK[g] @ by_rows.T))
    return out

"""Collinearity: parameters that a few others nearly repeat at some poses, which the data can hardly tell apart."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from taskcal.short_repr import short_repr

LEVEL = 0.99
"""Share of a column's squared length from which on a few others are said to nearly repeat it."""

MOST = 4
"""How many others may do so together: many columns explain anything."""

NULL = 1e-6
"""Share of a unit vector that counts as nothing."""


@short_repr
@dataclass(frozen=True, kw_only=True)
class Collinearity:
    """A parameter that others nearly repeat."""

    name: str
    share: float
    """Of its column's squared length, explained by the named ones; 1 where they repeat it exactly."""
    inflation: float
    """How many times larger its variance becomes because all other parameters are free too; infinite where they repeat it."""
    by: Mapping[str, float]
    """The named ones, the strongest first: column ≈ Σ c · column, in SI units."""


def find_collinearities(
    matrix: Float[np.ndarray, "rows p"],
    names: Sequence[str],
    wanted: Sequence[str],
    *,
    against: Sequence[str] | None = None,
    level: float = LEVEL,
    most: int = MOST,
    negligible: float = 1e-9,
) -> tuple[Collinearity, ...]:
    """Which of the wanted parameters a few others nearly repeat, the most repeated first.

    The few are found by orthogonal matching pursuit (Pati, Rezaiifar and Krishnaprasad 1993); the variance inflation is the
    diagonal of the inverse of the correlation matrix (Marquardt 1970).

    Args:
        matrix: stacked sensitivities, or their triangular factor.
        names: of its columns.
        wanted: names to look at; those without effect are passed over.
        against: names that may repeat them; all by default.
        level: share of a column's squared length that must be explained.
        most: how many others may explain it.
        negligible: share of the largest singular value, or column, under which one counts as zero.
    """
    norms = np.linalg.norm(matrix, axis=0)
    alive = np.flatnonzero(norms > negligible * max(norms.max(initial=0.0), 1e-300))
    labels = [names[int(i)] for i in alive]
    unit, size = matrix[:, alive] / norms[alive], norms[alive]
    inflation = _inflations(unit, negligible)
    allowed = np.array([against is None or label in set(against) for label in labels], dtype=bool)
    out: list[Collinearity] = []
    for k in (k for k, label in enumerate(labels) if label in set(wanted)):
        chosen, c, share = _pursue(unit, k, allowed, level, most)
        if share >= level:
            by = {labels[j]: float(c[i] * size[k] / size[j]) for i, j in enumerate(chosen)}
            out.append(Collinearity(name=labels[k], share=share, inflation=float(inflation[k]), by=by))
    return tuple(sorted(out, key=lambda found: -found.share))


def _inflations(unit: Float[np.ndarray, "rows p"], negligible: float) -> Float[np.ndarray, " p"]:
    """1/(1 − R²) of every column on all others; infinite where it takes part in an exact dependence."""
    _, s, Vt = np.linalg.svd(unit, full_matrices=True)
    rank = int((s > negligible * s.max(initial=0.0)).sum())
    repeated = np.linalg.norm(Vt[rank:], axis=0) > NULL
    return np.where(repeated, np.inf, ((Vt[:rank] / s[:rank, None]) ** 2).sum(axis=0))


def _pursue(
    unit: Float[np.ndarray, "rows p"], k: int, allowed: Bool[np.ndarray, " p"], level: float, most: int
) -> tuple[list[int], Float[np.ndarray, " few"], float]:
    """Others that explain column k best, one after another, with their coefficients and the share they explain."""
    column, chosen = unit[:, k], list[int]()
    c, left = np.zeros(0), column
    while float(left @ left) > 1.0 - level and len(chosen) < most:
        match = np.where(allowed, np.abs(unit.T @ left), -1.0)
        match[[k, *chosen]] = -1.0
        best = int(np.flatnonzero(match >= match.max() - NULL)[0])  # of those that repeat each other the first one
        if match[best] <= 0.0:
            break
        chosen.append(best)
        c = np.linalg.lstsq(unit[:, chosen], column, rcond=None)[0]
        left = column - unit[:, chosen] @ c
    order = sorted(range(len(chosen)), key=lambda i: -abs(float(c[i])))
    return [chosen[i] for i in order], c[order], 1.0 - float(left @ left)

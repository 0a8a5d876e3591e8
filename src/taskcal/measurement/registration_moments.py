"""How well a rotation fits measured points, from sums over the points: no step of a registration reads them again.

With M the inverse of the frame's rotation, a target at o leaves M·y + m − p − R·o at a point, which is linear in M, m and o. Its
sum of squares is therefore a quadratic of the nine numbers of M, once m and the offsets that are best for M are put in.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

OFFSET_PULL = 1e-9
"""Weight of a target's offset from the tool point against one measured point: in one orientation only the sum of the frame's
translation and the offset is seen, and a slight pull leaves the target at the tool point."""

HELD = 1e12
"""The same along directions in which offsets are held."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Quadratic:
    """Sum of squares of the residuals as a function of M: vec(M)ᵀ·Q·vec(M) − 2·q·vec(M) + rest."""

    Q: Float[np.ndarray, "9 9"]
    q: Float[np.ndarray, " 9"]
    rest: float

    def __call__(self, M: Float[np.ndarray, " 9"]) -> float:
        """Metres², the slight pull on the offsets included."""
        return float(max(M @ (self.Q @ M - 2.0 * self.q) + self.rest, 0.0))

    def fall(self, before: Float[np.ndarray, " 9"], after: Float[np.ndarray, " 9"]) -> float:
        """By how much the sum is smaller after than before, exact where both are nearly the same."""
        return float((after - before) @ (2.0 * self.q - self.Q @ (before + after)))


@dataclass(frozen=True, eq=False, kw_only=True)
class Moments:
    """Sums over points about their means; columns of offsets are those of one target after another."""

    n: int
    y_mean: Float[np.ndarray, " 3"]
    p_mean: Float[np.ndarray, " 3"]
    R_mean: Float[np.ndarray, "3 offsets"]
    """Of the derivative of p + R·o by the offsets."""
    yy: Float[np.ndarray, "3 3"]
    """Σ y·yᵀ."""
    py: Float[np.ndarray, "3 3"]
    """Σ p·yᵀ."""
    pp: float
    """Σ p·p."""
    by_offset: Float[np.ndarray, "9 offsets"]
    """Σ of R times y: M·y beside R·o, for every number of M and o."""
    pull: Float[np.ndarray, " offsets"]
    """Σ Rᵀ·p."""
    information: Float[np.ndarray, "offsets offsets"]
    """Of the offsets, the translation eliminated."""

    @classmethod
    def of(
        cls,
        R: Float[np.ndarray, "n 3 3"],
        p: Float[np.ndarray, "n 3"],
        y: Float[np.ndarray, "n 3"],
        target: Int[np.ndarray, " n"],
        count: int,
    ) -> "Moments":
        """Of points y of some targets, measured at poses R, p of the tool."""
        y_mean, p_mean = y.mean(axis=0), p.mean(axis=0)
        both = np.concatenate([y - y_mean, p - p_mean], axis=1)
        square = both.T @ both
        by_offset, pull = np.empty((3, 3, count, 3)), np.empty((count, 3))
        for t in range(count):
            own = slice(None) if count == 1 else target == t
            turned = (R[own].reshape(-1, 9).T @ both[own]).reshape(3, 3, 6)
            by_offset[:, :, t] = turned[:, :, :3].transpose(0, 2, 1)
            pull[t] = np.trace(turned[:, :, 3:], axis1=0, axis2=2)
        total, information = offset_information(R, target, count)
        return cls(
            n=len(y),
            y_mean=y_mean,
            p_mean=p_mean,
            R_mean=total / len(y),
            yy=square[:3, :3],
            py=square[3:, :3],
            pp=float(square[3, 3] + square[4, 4] + square[5, 5]),
            by_offset=by_offset.reshape(9, -1),
            pull=pull.reshape(-1),
            information=information,
        )

    def offsets(
        self, Z: Float[np.ndarray, "3 3"], held: Float[np.ndarray, "offsets offsets"] | None = None
    ) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, "targets 3"]]:
        """Translation and offsets that are best for a rotation Z from base to tracker, metres.

        Along the directions of the projector `held` the offsets stay zero.
        """
        A = self.information + OFFSET_PULL * np.eye(len(self.pull))
        if held is not None:
            A = A + HELD * held
        o = np.linalg.solve(A, self.by_offset.T @ Z.T.reshape(-1) - self.pull)
        return self.y_mean - Z @ (self.p_mean + self.R_mean @ o), o.reshape(-1, 3)

    def squares(self, Z: Float[np.ndarray, "3 3"]) -> float:
        """Sum of squares that a rotation leaves of the points, metres², but for rounding of the points' own squares."""
        M = Z.T.reshape(-1)
        o = self.offsets(Z)[1].reshape(-1)
        by_offset = self.by_offset.T @ M - self.pull
        turned = self.pp + np.trace(self.yy) - 2.0 * self.py.reshape(-1) @ M
        return float(max(turned - 2.0 * by_offset @ o + o @ self.information @ o, 0.0))

    @cached_property
    def quadratic(self) -> Quadratic:
        """The sum of squares by the rotation alone."""
        A = self.information + OFFSET_PULL * np.eye(len(self.pull))
        eliminated = np.linalg.solve(A, np.concatenate([self.by_offset.T, self.pull[:, None]], axis=1))
        Q = np.kron(np.eye(3), self.yy) - self.by_offset @ eliminated[:, :9]
        return Quadratic(
            Q=0.5 * (Q + Q.T),
            q=self.py.reshape(-1) - self.by_offset @ eliminated[:, 9],
            rest=self.pp - float(self.pull @ eliminated[:, 9]),
        )


def offset_information(
    R: Float[np.ndarray, "n 3 3"], target: Int[np.ndarray, " n"], count: int
) -> tuple[Float[np.ndarray, "3 offsets"], Float[np.ndarray, "offsets offsets"]]:
    """Sum of the rotations of each target, and the information of the offsets, the translation eliminated."""
    if count == 1:
        total = R.sum(axis=0)
        return total, len(R) * np.eye(3) - total.T @ total / len(R)
    total = np.concatenate([R[target == t].sum(axis=0) for t in range(count)], axis=1)
    seen = np.repeat(np.bincount(target, minlength=count), 3)
    return total, np.diag(seen) - total.T @ total / len(R)

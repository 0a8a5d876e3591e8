"""Residual of a rotation at measured points, from sums over the points: no step of a registration reads them again.

With M the inverse of the frame's rotation, a target at o leaves M·y + m − p − R·o at a point, which is linear in M, m and o. Its
sum of squares is therefore a quadratic of the nine numbers of M, once m and the offsets that are best for M are put in.
"""

import itertools
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from taskcal.geometry import se3

OFFSET_PULL = 1e-9
"""Weight of a target's offset from the TCP against one measured point: in one orientation only the sum of the frame's
translation and the offset is seen, and a slight pull leaves the target at the TCP."""

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
        """Compute the decrease of the sum of squares, exact where both sums are nearly equal."""
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
        """Moments of points y of some targets, measured at poses R, p of the tool."""
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


# The rotation from base to tracker that fits measured points best, from a starting one: damped Gauss–Newton.

MAX_STEPS = 40
"""Of the refinement."""

LEAST_DAMPING = 1e-6
"""Holds what the points do not tell, and slows down what they do by a millionth."""


def refine(Z: Float[np.ndarray, "3 3"], moments: Moments) -> tuple[Float[np.ndarray, "3 3"], float]:
    """Damped Gauss–Newton on the rotation, translation and offsets being the best for it; the best point met.

    Args:
        Z: rotation from base to tracker to start from.
        moments: of the points.

    Returns:
        rotation; root mean square of the residual in space, metres.
    """
    squares, M = moments.quadratic, Z.T
    damping = LEAST_DAMPING
    for _ in range(MAX_STEPS):
        K = _by_turn(M)
        H, g = K.T @ squares.Q @ K, K.T @ (squares.q - squares.Q @ M.reshape(-1))
        step = np.linalg.solve(H * (1.0 + damping * np.eye(3)), g)
        turned = _turn(step) @ M
        fall = squares.fall(M.reshape(-1), turned.reshape(-1))
        if fall < 0.0:
            damping = max(damping * 10.0, 1e-3)
            if damping > 1e3:
                break
            continue
        M, damping = turned, max(damping / 10.0, LEAST_DAMPING)
        if step @ step < 1e-18 or fall < 1e-12 * squares(M.reshape(-1)):
            break
    return M.T, float(np.sqrt(moments.squares(M.T) / moments.n))


def _turn(w: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "3 3"]:
    """A rotation about w by its length to second order (Cayley's), in a few operations: the step is none that has to be exact."""
    x, y, z = 0.5 * w
    A = np.array([[1.0, -z, y], [z, 1.0, -x], [-y, x, 1.0]])
    return np.linalg.solve(A.T, A)


def _by_turn(M: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "9 3"]:
    """Derivative of exp(w)·M by w about zero."""
    K = np.zeros((3, 3, 3))
    K[1, :, 0], K[2, :, 0] = -M[2], M[1]
    K[2, :, 1], K[0, :, 1] = -M[0], M[2]
    K[0, :, 2], K[1, :, 2] = -M[1], M[0]
    return K.reshape(9, 3)


def rms_length(residual: Float[np.ndarray, "n 3"]) -> float:
    """Root mean square length of vectors (n, 3)."""
    return float(np.sqrt(np.einsum("ni,ni->", residual, residual) / len(residual)))


# Starting rotations of a registration in closed form, and many orientations for where they fail.

NEARLY_NOTHING = 1e-12
"""Of the largest: an eigenvalue of the sum of squares below this says nothing (flat clouds), and its direction stays at zero."""


def closed_form(moments: Moments) -> Float[np.ndarray, "3 3"]:
    """Rotation from base to tracker that fits y = Z·(p + R·o) + t, by a matrix M = Zᵀ of which nothing is asked."""
    squares = moments.quadratic
    M = np.linalg.pinv(squares.Q, rcond=NEARLY_NOTHING, hermitian=True) @ squares.q
    return se3.nearest_rotation(M.reshape(3, 3)).T


def products(R: Float[np.ndarray, "n 3 3"], Y: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "9 9"]:
    """The mean over all poses of the Kronecker products of Y and R: all that rotations Z and X with Z·R·X = Y ask of them."""
    return (Y.reshape(-1, 9).T @ R.reshape(-1, 9)).reshape(3, 3, 3, 3).transpose(0, 2, 3, 1).reshape(9, 9) / len(R)


def closed_form_rotations(
    mean: Float[np.ndarray, "9 9"],
) -> tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, "3 3"]]:
    """Z and X of Z·R·X = Y from the mean products of Y and R: without noise, their first singular vectors (Shah 2013)."""
    Z = np.linalg.svd(mean)[0][:, 0].reshape(3, 3)
    return alternate(se3.nearest_rotation(Z if np.linalg.det(Z) > 0 else -Z), mean, rounds=10)


def alternate(
    Z: Float[np.ndarray, "3 3"], mean: Float[np.ndarray, "9 9"], rounds: int = 30
) -> tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, "3 3"]]:
    """Each of Z and X in turn from the other, as the rotation nearest to the mean."""
    X = np.eye(3)
    for _ in range(rounds):
        X = target_rotation(Z, mean)
        Z = se3.nearest_rotation((mean @ X.reshape(9)).reshape(3, 3))
    return Z, X


def target_rotation(Z: Float[np.ndarray, "3 3"], mean: Float[np.ndarray, "9 9"]) -> Float[np.ndarray, "3 3"]:
    """Rotation X of the target in the tool that fits Z·R·X = Y best, for a rotation Z from base to tracker."""
    return se3.nearest_rotation((Z.reshape(9) @ mean).reshape(3, 3))


def orientations() -> list[np.ndarray]:
    """The 24 rotations of a cube, and the same turned by 45° about a skew axis."""
    signed = itertools.product(itertools.permutations(np.eye(3)), itertools.product((1.0, -1.0), repeat=3))
    proper = [R for axes, signs in signed if np.linalg.det(R := np.array(axes) * np.array(signs)) > 0.0]
    skew = se3.exp(np.array([0.5, 0.4, 0.45]))
    return proper + [skew @ R for R in proper]

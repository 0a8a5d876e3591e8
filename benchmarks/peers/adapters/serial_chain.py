"""Small motions before every joint, a base and a reflector: what a user of SciPy or Pinocchio would write."""

import numpy as np


def turn(angles):
    """Rotations about z, (n, 4, 4)."""
    T = np.tile(np.eye(4), (len(angles), 1, 1))
    T[:, 0, 0] = T[:, 1, 1] = np.cos(angles)
    T[:, 1, 0] = np.sin(angles)
    T[:, 0, 1] = -T[:, 1, 0]
    return T


def motion(six):
    """A translation after a rotation by Rodrigues' formula."""
    T = np.eye(4)
    angle = np.linalg.norm(six[3:])
    if angle > 0.0:
        x, y, z = six[3:] / angle
        K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        T[:3, :3] += np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K
    T[:3, 3] = six[:3]
    return T


def independent(J):
    """Columns that are not combinations of earlier ones: pivots of a QR decomposition of scaled columns, from the last on.

    The last columns, base and reflector, are kept; what they say as well is dropped from the chain.
    """
    size = np.linalg.norm(J, axis=0)
    kept: list[int] = []
    Q = np.zeros((len(J), 0))
    for k in reversed(range(J.shape[1])):
        if size[k] < 1e-12:
            continue
        column = J[:, k] / size[k]
        rest = column - Q @ (Q.T @ column)
        rest -= Q @ (Q.T @ rest)
        if np.linalg.norm(rest) > 1e-6:
            kept.append(k)
            Q = np.column_stack([Q, rest / np.linalg.norm(rest)])
    return np.array(sorted(kept))

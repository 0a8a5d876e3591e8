"""A measured pose: the first three rows of its block are a point's, the others say how the end of the chain is turned."""

import numpy as np

from taskcal.geometry.compiled import part


@part
def linearise_rotation(walk, seen, i, block):
    """Rows 3–5 of a block: r = log(R_measured·R_predictedᵀ), whose derivative is Jr⁻¹(r) times the angular columns in J.

    R_predicted = exp(o)·T turns with o by Jl(o), and with all else by exp(o) times the angular columns.
    """
    turn, turning, columns = walk.points.turn, walk.points.turning, walk.points.columns
    T, r, J, w, v, y_rotation = block.T, block.r, block.J, block.room[0], block.room[1], seen.rotation[i]
    for i in range(3):
        for j in range(3):
            v[i, j] = y_rotation[i, 0] * T[j, 0] + y_rotation[i, 1] * T[j, 1] + y_rotation[i, 2] * T[j, 2]
    for i in range(3):
        for j in range(3):
            w[i, j] = v[i, 0] * turn[j, 0] + v[i, 1] * turn[j, 1] + v[i, 2] * turn[j, 2]
    v0, v1, v2 = 0.5 * (w[2, 1] - w[1, 2]), 0.5 * (w[0, 2] - w[2, 0]), 0.5 * (w[1, 0] - w[0, 1])
    sine = np.sqrt(v0 * v0 + v1 * v1 + v2 * v2)
    angle = np.arctan2(sine, 0.5 * (w[0, 0] + w[1, 1] + w[2, 2] - 1.0))
    # half a turn has no unique axis; a fit starts from a registration that is nowhere near it
    scale = 1.0 if sine < 1e-12 else angle / sine
    r[3], r[4], r[5] = scale * v0, scale * v1, scale * v2
    c = 1.0 / 12.0
    if angle > 1e-4:
        c = 1.0 / (angle * angle) - (1.0 + np.cos(angle)) / (2.0 * angle * np.sin(angle))
    a, b, g = r[3], r[4], r[5]
    w[0, 0], w[0, 1], w[0, 2] = 1.0 - c * (b * b + g * g), -0.5 * g + c * a * b, 0.5 * b + c * a * g
    w[1, 0], w[1, 1], w[1, 2] = 0.5 * g + c * a * b, 1.0 - c * (a * a + g * g), -0.5 * a + c * b * g
    w[2, 0], w[2, 1], w[2, 2] = -0.5 * b + c * a * g, 0.5 * a + c * b * g, 1.0 - c * (a * a + b * b)
    for i in range(3):
        for j in range(3):
            v[i, j] = w[i, 0] * turn[0, j] + w[i, 1] * turn[1, j] + w[i, 2] * turn[2, j]
    for k in range(J.shape[1]):
        a, b, g = J[3, k], J[4, k], J[5, k]
        for i in range(3):
            J[3 + i, k] = v[i, 0] * a + v[i, 1] * b + v[i, 2] * g
    for d in range(3):
        k = columns[0, d]
        if k >= 0:
            for i in range(3):
                J[i, k] = 0.0
                J[3 + i, k] = w[i, 0] * turning[0, d] + w[i, 1] * turning[1, d] + w[i, 2] * turning[2, d]

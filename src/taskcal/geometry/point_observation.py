"""A measured point that is fixed to the end of a chain."""

from taskcal.geometry.compiled import inlined
from taskcal.geometry.walk import fill_columns


@inlined
def linearise_point(walk, seen, i, t, block):
    """Residual (measured less predicted) of target t at pose i, and the derivative J of the prediction.

    Where J has six rows the last three are left as the angular columns, for a measured pose.
    """
    T, r, J = block.T, block.r, block.J
    points, columns, y = walk.points.position, walk.points.columns, seen.position[i]
    a, b, c = points[t, 0], points[t, 1], points[t, 2]
    x0 = T[0, 3] + T[0, 0] * a + T[0, 1] * b + T[0, 2] * c
    x1 = T[1, 3] + T[1, 0] * a + T[1, 1] * b + T[1, 2] * c
    x2 = T[2, 3] + T[2, 0] * a + T[2, 1] * b + T[2, 2] * c
    fill_columns(block.axes, walk.layout, walk.factor[i], x0, x1, x2, J)
    for other in range(columns.shape[0]):
        for d in range(3):
            k = columns[other, d]
            if k >= 0:
                for row in range(J.shape[0]):
                    J[row, k] = T[row, d] if other == t and row < 3 else 0.0
    r[0], r[1], r[2] = y[t, 0] - x0, y[t, 1] - x1, y[t, 2] - x2

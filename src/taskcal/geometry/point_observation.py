"""A measured point that is fixed to the end of a chain."""

from taskcal.geometry.compiled import part
from taskcal.geometry.walk import fill_columns


@part
def linearise_point(targets, layout, factor, y, t, block):
    """Residual (measured less predicted) of target t, measured at y, and the derivative J of the prediction.

    Where J has six rows the last three are left as the angular columns, for a measured pose.
    """
    T, r, J = block.T, block.r, block.J
    points, columns = targets.position, targets.columns
    a, b, c = points[t, 0], points[t, 1], points[t, 2]
    x0 = T[0, 3] + T[0, 0] * a + T[0, 1] * b + T[0, 2] * c
    x1 = T[1, 3] + T[1, 0] * a + T[1, 1] * b + T[1, 2] * c
    x2 = T[2, 3] + T[2, 0] * a + T[2, 1] * b + T[2, 2] * c
    fill_columns(block.axes, layout, factor, x0, x1, x2, J)
    for other in range(columns.shape[0]):
        for d in range(3):
            k = columns[other, d]
            if k >= 0:
                for row in range(J.shape[0]):
                    if other == t and row < 3:
                        J[row, k] = T[row, d]
                    else:
                        J[row, k] = 0.0
    r[0], r[1], r[2] = y[0] - x0, y[1] - x1, y[2] - x2

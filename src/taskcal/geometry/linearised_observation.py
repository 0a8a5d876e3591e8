"""A measurement of any kind, linearised beforehand by the twist of the chain's end and by unknowns of its own."""

from taskcal.geometry.compiled import part
from taskcal.geometry.walk import fill_columns


@part
def copy_linearised(walk, linear, i, t, block):
    """Residual of target t at pose i, and the derivative J of the prediction: what moves the end, then the unknowns."""
    T, J, twist, columns = block.T, block.J, block.twist, linear.columns
    fill_columns(block.axes, walk.layout, walk.factor[i], T[0, 3], T[1, 3], T[2, 3], twist)
    for row in range(J.shape[0]):
        block.r[row] = linear.residual[i, t, row]
        for k in range(J.shape[1]):
            J[row, k] = 0.0
        for c in range(6):
            by = linear.by_end[i, t, row, c]
            if by != 0.0:
                for k in range(J.shape[1]):
                    J[row, k] += by * twist[c, k]
        for u in range(columns.shape[1]):
            k = columns[t, u]
            if k >= 0:
                J[row, k] += linear.by_unknown[i, t, row, u]

"""pybotics' robot and handler with the three components of each row's error as residuals, in place of its own distance.

Not what its documents show, but the better problem: a distance has no derivative where it is zero, and Gauss and Newton crawl.
"""

import numpy as np
import pybotics_fit
from protocol import main


def components(vector, handler, qs, positions):
    handler.apply_optimization_vector(vector)
    return (np.array([handler.robot.fk(q)[:3, 3] for q in qs]) - positions).ravel()


def calibrate(case, given: bool):
    return pybotics_fit.calibrate(case, given, residuals=components, each=3)


if __name__ == "__main__":
    main(calibrate)

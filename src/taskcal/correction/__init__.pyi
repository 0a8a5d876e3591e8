# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.correction.assessment import Deviations as Deviations
from taskcal.correction.cell import Measured as Measured
from taskcal.correction.inverse import solve_calibrated as solve_calibrated
from taskcal.correction.joint_motion import JointMotion as JointMotion

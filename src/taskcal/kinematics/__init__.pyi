# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.kinematics.clearance import Box as Box
from taskcal.kinematics.inverse import Reached as Reached
from taskcal.kinematics.inverse import solve_near as solve_near
from taskcal.kinematics.spin import Spun as Spun
from taskcal.kinematics.spin import choose_spin as choose_spin

# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.virtual.cell import SimulationOptions as SimulationOptions
from taskcal.virtual.cell import Truth as Truth
from taskcal.virtual.cell import draw_defects as draw_defects
from taskcal.virtual.station import Reflector as Reflector
from taskcal.virtual.station import Standing as Standing
from taskcal.virtual.station import load_standing as load_standing

# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.observations.point import Reflector as Reflector
from taskcal.virtual.cell import Truth as Truth
from taskcal.virtual.cell import draw_defects as draw_defects
from taskcal.virtual.options import SimulationOptions as SimulationOptions
from taskcal.virtual.pictures import Shots as Shots
from taskcal.virtual.pictures import VirtualCamera as VirtualCamera
from taskcal.virtual.pictures import take_shots as take_shots
from taskcal.virtual.rendering import Exposure as Exposure
from taskcal.virtual.rendering import render_boards as render_boards

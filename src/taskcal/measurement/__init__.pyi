# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.measurement.axis_circles import AxisCircle as AxisCircle
from taskcal.measurement.axis_circles import find_circles as find_circles
from taskcal.measurement.axis_circles import register_from_circles as register_from_circles
from taskcal.measurement.drift import Drift as Drift
from taskcal.measurement.drift import compensate_drift as compensate_drift
from taskcal.measurement.reader import ReadOptions as ReadOptions
from taskcal.measurement.registration import Registration as Registration
from taskcal.measurement.registration_file import load_registration as load_registration
from taskcal.measurement.registration_file import save_registration as save_registration
from taskcal.measurement.standing import Standing as Standing
from taskcal.measurement.standing import load_standing as load_standing
from taskcal.measurement.station import Reflector as Reflector
from taskcal.measurement.virtual_cell import SimulationOptions as SimulationOptions
from taskcal.measurement.virtual_cell import Truth as Truth
from taskcal.measurement.virtual_cell import draw_defects as draw_defects
from taskcal.tabular.csv_form import TableForm as TableForm

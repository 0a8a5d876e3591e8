# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.registration.circles import AxisCircle as AxisCircle
from taskcal.registration.circles import find_circles as find_circles
from taskcal.registration.circles import register_from_circles as register_from_circles
from taskcal.registration.registration import Registration as Registration
from taskcal.registration.registration_file import load_registration as load_registration
from taskcal.registration.registration_file import save_registration as save_registration
from taskcal.registration.stations import join_stations as join_stations

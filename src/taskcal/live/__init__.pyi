# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.live.devices import Controller as Controller
from taskcal.live.devices import DeviceError as DeviceError
from taskcal.live.devices import Instrument as Instrument
from taskcal.live.devices import JointReading as JointReading
from taskcal.live.devices import Shot as Shot

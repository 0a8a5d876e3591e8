"""Kinds of observation: what is measured of something on the tool, as a function of where it is and of unknowns of its own.

A kind is one class in one file. It says how many numbers it measures, what it predicts and how that moves, where to start
without a guess, and how sure it is; registration, fit, identifiability, reports and plans take it from there.
"""

from taskcal.measurement.observation.board import Boards as Boards
from taskcal.measurement.observation.columns import ObservedColumns as ObservedColumns
from taskcal.measurement.observation.cube import Cubes as Cubes
from taskcal.measurement.observation.distance import Lengths as Lengths
from taskcal.measurement.observation.landmark import Landmarks as Landmarks
from taskcal.measurement.observation.observation import Compared as Compared
from taskcal.measurement.observation.observation import Differential as Differential
from taskcal.measurement.observation.observation import Measured as Measured
from taskcal.measurement.observation.observation import Observation as Observation
from taskcal.measurement.observation.observation import Placed as Placed
from taskcal.measurement.observation.observation import Read as Read
from taskcal.measurement.observation.observation import Scene as Scene
from taskcal.measurement.observation.observation import Standalone as Standalone
from taskcal.measurement.observation.observation import Stated as Stated
from taskcal.measurement.observation.observation import find_columns as find_columns
from taskcal.measurement.observation.observation import instrument_of as instrument_of
from taskcal.measurement.observation.observation import kind_of as kind_of
from taskcal.measurement.observation.observation import kinds as kinds
from taskcal.measurement.observation.observation import refer as refer
from taskcal.measurement.observation.plane import Planes as Planes
from taskcal.measurement.observation.point import Point as Point
from taskcal.measurement.observation.pose import Pose as Pose
from taskcal.measurement.observation.socket import Sockets as Sockets
from taskcal.measurement.observation.ways import WAYS as WAYS
from taskcal.measurement.observation.ways import Way as Way

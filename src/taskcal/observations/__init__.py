"""Kinds of observation: what is measured of something on the tool, as a function of where it is and of unknowns of its own.

A kind is one class in one file. It says how many numbers it measures, what it predicts and how that moves, where to start
without a guess, and how sure it is; registration, fit, identifiability, reports and plans take it from there.
"""

from taskcal.observations.base import Compared as Compared
from taskcal.observations.base import Differential as Differential
from taskcal.observations.base import Measured as Measured
from taskcal.observations.base import Observation as Observation
from taskcal.observations.base import ObservedColumns as ObservedColumns
from taskcal.observations.base import Placed as Placed
from taskcal.observations.base import Read as Read
from taskcal.observations.base import Scene as Scene
from taskcal.observations.base import Stated as Stated
from taskcal.observations.base import TrackerNoise as TrackerNoise
from taskcal.observations.base import block_size as block_size
from taskcal.observations.base import error_lengths as error_lengths
from taskcal.observations.base import find_columns as find_columns
from taskcal.observations.base import instrument_of as instrument_of
from taskcal.observations.base import kind_of as kind_of
from taskcal.observations.base import kinds as kinds
from taskcal.observations.base import refer as refer
from taskcal.observations.board import BoardInstrument as BoardInstrument
from taskcal.observations.board import Boards as Boards
from taskcal.observations.board_drawing import board_pdf as board_pdf
from taskcal.observations.board_drawing import lay_out_board as lay_out_board
from taskcal.observations.calibration_board import Board as Board
from taskcal.observations.calibration_board import read_boards as read_boards
from taskcal.observations.camera_file import StatedCamera as StatedCamera
from taskcal.observations.camera_file import read_camera as read_camera
from taskcal.observations.cube import Cubes as Cubes
from taskcal.observations.distance import Lengths as Lengths
from taskcal.observations.distance import WireInstrument as WireInstrument
from taskcal.observations.instrument import Fixtures as Fixtures
from taskcal.observations.instrument import Instrument as Instrument
from taskcal.observations.instrument import instrument_class as instrument_class
from taskcal.observations.instrument import instrument_classes as instrument_classes
from taskcal.observations.instrument import load_fixtures as load_fixtures
from taskcal.observations.landmark import CameraInstrument as CameraInstrument
from taskcal.observations.landmark import Landmarks as Landmarks
from taskcal.observations.pixels import PixelInstrument as PixelInstrument
from taskcal.observations.pixels import Pixels as Pixels
from taskcal.observations.pixels import images_of as images_of
from taskcal.observations.pixels import pictures_of as pictures_of
from taskcal.observations.plane import Planes as Planes
from taskcal.observations.point import Point as Point
from taskcal.observations.pose import Pose as Pose
from taskcal.observations.socket import SocketInstrument as SocketInstrument
from taskcal.observations.socket import Sockets as Sockets
from taskcal.observations.standalone import Standalone as Standalone

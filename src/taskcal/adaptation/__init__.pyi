# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.adaptation.board_way import BoardWay as BoardWay
from taskcal.adaptation.camera_way import CameraWay as CameraWay
from taskcal.adaptation.default_standing import stand_by_default as stand_by_default
from taskcal.adaptation.expected_error import Design as Design
from taskcal.adaptation.expected_error import design as design
from taskcal.adaptation.fleet import Fleet as Fleet
from taskcal.adaptation.fleet import review_fleet as review_fleet
from taskcal.adaptation.fleet_campaigns import identify_campaigns as identify_campaigns
from taskcal.adaptation.fleet_files import find_fleet as find_fleet
from taskcal.adaptation.plan_options import PlanOptions as PlanOptions
from taskcal.adaptation.selection import NestedModel as NestedModel
from taskcal.adaptation.selection_options import SelectionOptions as SelectionOptions
from taskcal.adaptation.socket_way import SocketWay as SocketWay
from taskcal.adaptation.study_options import StudyOptions as StudyOptions
from taskcal.adaptation.wire_way import WireWay as WireWay

# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.planning.expected_error import Design as Design
from taskcal.planning.expected_error import design as design
from taskcal.planning.fleet import Fleet as Fleet
from taskcal.planning.fleet import find_fleet as find_fleet
from taskcal.planning.fleet import identify_campaigns as identify_campaigns
from taskcal.planning.fleet import review_fleet as review_fleet
from taskcal.planning.options import PlanOptions as PlanOptions
from taskcal.planning.options import SelectionOptions as SelectionOptions
from taskcal.planning.options import StudyOptions as StudyOptions
from taskcal.planning.selection import NestedModel as NestedModel

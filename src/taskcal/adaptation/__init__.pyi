# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.adaptation.expected_error import Design as Design
from taskcal.adaptation.expected_error import design as design
from taskcal.adaptation.plan_options import PlanOptions as PlanOptions
from taskcal.adaptation.selection import NestedModel as NestedModel
from taskcal.adaptation.selection_options import SelectionOptions as SelectionOptions
from taskcal.adaptation.study_options import StudyOptions as StudyOptions

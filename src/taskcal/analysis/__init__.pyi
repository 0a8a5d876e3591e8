# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.analysis.collinearity import Collinearity as Collinearity
from taskcal.analysis.distinguishable_directions import Direction as Direction
from taskcal.analysis.distinguishable_directions import ToldApart as ToldApart
from taskcal.analysis.elimination_table import published_kept as published_kept
from taskcal.analysis.identifiability import Identifiability as Identifiability
from taskcal.analysis.sensitivity import Sensitivity as Sensitivity
from taskcal.estimation.experiment_design import Observability as Observability

# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.analysis.identifiability import Collinearity as Collinearity
from taskcal.analysis.identifiability import Direction as Direction
from taskcal.analysis.identifiability import DistinguishableDirections as DistinguishableDirections
from taskcal.analysis.identifiability import Identifiability as Identifiability
from taskcal.analysis.identifiability import published_kept as published_kept
from taskcal.analysis.sensitivity import Sensitivity as Sensitivity
from taskcal.estimation.experiment_design import Observability as Observability

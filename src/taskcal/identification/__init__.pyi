# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.identification.effects import Explanation as Explanation
from taskcal.identification.effects import Stage as Stage
from taskcal.identification.effects import select_effects as select_effects
from taskcal.identification.held_out import Outlier as Outlier
from taskcal.identification.holdout import hold_out as hold_out
from taskcal.identification.hyperparameters import Hyperparameters as Hyperparameters
from taskcal.identification.identify import fit_nominal as fit_nominal
from taskcal.identification.measured_range import MeasuredRange as MeasuredRange
from taskcal.identification.options import EffectSearch as EffectSearch
from taskcal.identification.options import FitOptions as FitOptions
from taskcal.identification.options import Holdout as Holdout
from taskcal.identification.residual_analysis import ResidualAnalysis as ResidualAnalysis
from taskcal.identification.residual_analysis import analyse_residuals as analyse_residuals
from taskcal.identification.validation import Acceptance as Acceptance
from taskcal.identification.validation import Examination as Examination
from taskcal.identification.validation import accept as accept
from taskcal.identification.validation import examine as examine

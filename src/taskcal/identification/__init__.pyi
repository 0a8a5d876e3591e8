# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.identification.acceptance import Acceptance as Acceptance
from taskcal.identification.acceptance import accept as accept
from taskcal.identification.effect_search import EffectSearch as EffectSearch
from taskcal.identification.effect_selection import select_effects as select_effects
from taskcal.identification.examination import Examination as Examination
from taskcal.identification.examination import examine as examine
from taskcal.identification.explanation import Explanation as Explanation
from taskcal.identification.explanation import Stage as Stage
from taskcal.identification.field import ResidualField as ResidualField
from taskcal.identification.fit_options import FitOptions as FitOptions
from taskcal.identification.holdout import Holdout as Holdout
from taskcal.identification.holdout import hold_out as hold_out
from taskcal.identification.hyperparameters import Hyperparameters as Hyperparameters
from taskcal.identification.nominal_fit import fit_nominal as fit_nominal
from taskcal.identification.outlier import Outlier as Outlier
from taskcal.identification.residual_analysis import ResidualAnalysis as ResidualAnalysis
from taskcal.identification.residual_analysis import analyse_residuals as analyse_residuals

# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.estimation.matrices import single_threaded as single_threaded
from taskcal.estimation.prior import GaussianPrior as GaussianPrior

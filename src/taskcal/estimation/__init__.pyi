# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.estimation.blas import single_threaded as single_threaded
from taskcal.estimation.loss import Cauchy as Cauchy
from taskcal.estimation.loss import Huber as Huber
from taskcal.estimation.loss import Squared as Squared
from taskcal.estimation.prior import GaussianPrior as GaussianPrior

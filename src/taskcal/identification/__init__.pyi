# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.identification.explain import Explanation as Explanation
from taskcal.identification.explain import Stage as Stage
from taskcal.identification.field import ResidualField as ResidualField
from taskcal.identification.outlier import Outlier as Outlier
from taskcal.identification.remainder import Remainder as Remainder
from taskcal.identification.remainder import examine_remainder as examine_remainder

# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.tables.forms import BinaryForm as BinaryForm
from taskcal.tables.forms import TextForm as TextForm
from taskcal.tables.options import TableForm as TableForm
from taskcal.tables.table import Sheet as Sheet

# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.reading.options import ReadOptions as ReadOptions
from taskcal.tables.options import TableForm as TableForm

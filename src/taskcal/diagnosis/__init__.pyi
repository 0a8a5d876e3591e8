# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.diagnosis.diagnose import Diagnosis as Diagnosis
from taskcal.diagnosis.hypotheses import Finding as Finding

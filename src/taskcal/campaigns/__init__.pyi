# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.campaigns.drift import Drift as Drift
from taskcal.campaigns.drift import compensate_drift as compensate_drift

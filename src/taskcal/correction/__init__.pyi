# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.correction.cell import Measured as Measured
from taskcal.correction.correction import Deviations as Deviations
from taskcal.correction.motion import JointMotion as JointMotion
from taskcal.correction.part_placement import PartPlacements as PartPlacements
from taskcal.correction.part_placement import PlacedPart as PlacedPart
from taskcal.correction.part_placement import PlacementOptions as PlacementOptions
from taskcal.correction.part_placement import Region as Region
from taskcal.correction.part_placement import place as place
from taskcal.correction.placement import ToolJoints as ToolJoints
from taskcal.correction.placement import ToolPoses as ToolPoses
from taskcal.correction.placement import find_joints as find_joints
from taskcal.correction.placement import locate_tool as locate_tool
from taskcal.correction.placement import solve_calibrated as solve_calibrated
from taskcal.correction.spinning import with_spins as with_spins

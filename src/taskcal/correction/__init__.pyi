# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.correction.cell import Measured as Measured
from taskcal.correction.controller import JointMotion as JointMotion
from taskcal.correction.controller import read_controller as read_controller
from taskcal.correction.controller import with_spins as with_spins
from taskcal.correction.correction import Deviations as Deviations
from taskcal.correction.options import PlacementOptions as PlacementOptions
from taskcal.correction.part_placement import PartPlacements as PartPlacements
from taskcal.correction.part_placement import PlacedPart as PlacedPart
from taskcal.correction.part_placement import Region as Region
from taskcal.correction.part_placement import place as place
from taskcal.correction.tool_poses import ToolJoints as ToolJoints
from taskcal.correction.tool_poses import ToolPoses as ToolPoses
from taskcal.correction.tool_poses import find_joints as find_joints
from taskcal.correction.tool_poses import locate_tool as locate_tool
from taskcal.correction.tool_poses import solve_calibrated as solve_calibrated

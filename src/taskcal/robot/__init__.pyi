# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.robot.importers.base import RobotImporter as RobotImporter

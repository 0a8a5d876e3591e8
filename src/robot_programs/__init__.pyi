# The public names for type checkers; __init__.py loads them as they are used.

from robot_programs.core.plan import Conflict as Conflict
from robot_programs.core.plan import Plan as Plan
from robot_programs.core.plan import Wanted as Wanted
from robot_programs.core.plan import plan as plan
from robot_programs.core.program import Diagnostic as Diagnostic
from robot_programs.core.program import Edit as Edit
from robot_programs.core.program import Frame as Frame
from robot_programs.core.program import Language as Language
from robot_programs.core.program import Motion as Motion
from robot_programs.core.program import Program as Program
from robot_programs.core.program import Target as Target
from robot_programs.core.program import Zone as Zone
from robot_programs.core.robot import Robot as Robot
from robot_programs.core.source import Source as Source
from robot_programs.reading import compose_program as compose_program
from robot_programs.reading import motions_to_joints as motions_to_joints
from robot_programs.reading import read_program as read_program
from robot_programs.reading import write_program as write_program
from taskcal_groundwork.errors import FileError as FileError
from taskcal_groundwork.errors import InputError as InputError

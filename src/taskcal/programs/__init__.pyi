# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.programs.composing import compose_program as compose_program
from taskcal.programs.composing import moves_to_joints as moves_to_joints
from taskcal.programs.program import Frame as Frame
from taskcal.programs.program import Move as Move
from taskcal.programs.program import Program as Program
from taskcal.programs.program import Target as Target
from taskcal.programs.reading import read_program as read_program
from taskcal.programs.source import Source as Source
from taskcal.programs.spinning import with_spins as with_spins

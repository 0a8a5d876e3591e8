# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal.task.default_task import task_text as task_text
from taskcal.task.task import TaskPoses as TaskPoses
from taskcal.task.workspace import Orientation as Orientation
from taskcal.task.workspace import Workspace as Workspace

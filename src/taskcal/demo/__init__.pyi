# The public names of this folder, each once: __init__.py reads this list and loads them as they are used.

from taskcal_demo.closed_loop import LoopRun as LoopRun
from taskcal_demo.closed_loop import largest_errors as largest_errors
from taskcal_demo.closed_loop import prepare_closed_loop as prepare_closed_loop
from taskcal_demo.closed_loop import run_closed_loop as run_closed_loop
from taskcal_demo.closed_loop import run_closed_loops as run_closed_loops
from taskcal_demo.closed_loop import summarise_runs as summarise_runs
from taskcal_demo.closed_loop_report import draw_closed_loop as draw_closed_loop
from taskcal_demo.closed_loop_report import tabulate_closed_loop as tabulate_closed_loop
from taskcal_demo.procedure import ONE as ONE
from taskcal_demo.procedure import ROBOT as ROBOT
from taskcal_demo.procedure import reference_task as reference_task
from taskcal_demo.procedure import run_procedure as run_procedure
from taskcal_demo.procedure import try_models as try_models
from taskcal_demo.procedure_report import draw_error_over_angle as draw_error_over_angle
from taskcal_demo.true_robot import GEARS as GEARS
from taskcal_demo.true_robot import RIPPLE as RIPPLE
from taskcal_demo.true_robot import elastic_model as elastic_model

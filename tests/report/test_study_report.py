"""The page of a study."""

import numpy as np

from taskcal.report.study import study_page, tabulate_study
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task
from tests.report.small_study import study


def test_the_page_has_the_same_table():
    task = Task(name="milling", poses=np.eye(4)[None])
    page = study_page(ErrorModel(load_robot("ur5")), task, study(5.5e-5), version="0").html()
    table = tabulate_study(study(5.5e-5), "milling")
    assert all(cell in page for cell in (*table.header, *table.rows[0]))

"""The road: the pages in the order in which a user needs them. A page that is not there is not on it."""

from taskcal.studio.page_frame import Page
from taskcal.studio.pages import (
    identify_page,
    measurements_page,
    plan_page,
    program_page,
    report_page,
    result_page,
    robot_page,
    task_page,
    weight_page,
)

ROAD = (
    Page("robot", robot_page.build),
    Page("measurements", measurements_page.build),
    Page("task", task_page.build),
    Page("weight", weight_page.build),
    Page("plan", plan_page.build),
    Page("identify", identify_page.build),
    Page("result", result_page.build),
    Page("program", program_page.build),
    Page("report", report_page.build),
)

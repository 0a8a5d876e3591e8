"""The road: the pages in the order in which a user needs them. A page that is not there is not on it."""

from taskcal.studio.page_frame import Page
from taskcal.studio.pages import robot_page

ROAD = (Page("robot", robot_page.build),)

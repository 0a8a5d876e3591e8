"""The demonstration is a guest: what lies below it knows neither it nor its robot, its publication or its job."""

import re
from pathlib import Path

import taskcal
import taskcal_demo
from taskcal.robot.catalogue import catalogue_names

ROOT = Path(taskcal.__file__).parents[1]
ABOVE = {"taskcal/demo", "taskcal/cli", "taskcal/__init__.py", "taskcal/__main__.py"}
"""The names that it has for users, the command line, and the root, which names it lazily."""

BELOW = [
    path
    for package in ("taskcal", "taskcal_devices", "taskcal_groundwork")
    for path in sorted((ROOT / package).rglob("*.py"))
    if "/".join(path.relative_to(ROOT).parts[:2]) not in ABOVE
]
# a citation of a method's source may stand where the method is, so no author's name is here
OF_THE_GUEST = re.compile(
    r"irb.?6660|\bmilling (?:job|workspace)\b|\breference (?:task|machining)\b|\bthe publication\b|\btaskcal.demo\b"
)


def words_of_the_guest(path: Path) -> list[str]:
    """What a module says of the guest, or of any robot of the catalogue."""
    text = path.read_text(encoding="utf-8").casefold()
    return [*OF_THE_GUEST.findall(text), *(name for name in catalogue_names() if name.casefold() in text)]


def test_the_pattern_finds_the_guest_at_home():
    found = {word for path in Path(taskcal_demo.__file__).parent.glob("*.py") for word in words_of_the_guest(path)}
    assert {"irb 6660", "reference task", "reference machining", "the publication", "taskcal_demo"} <= found


def test_no_module_below_names_one_robot_publication_or_job():
    assert [(str(path.relative_to(ROOT)), word) for path in BELOW for word in words_of_the_guest(path)] == []

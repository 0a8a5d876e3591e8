"""The demonstration is a guest: what lies below it knows neither it nor its robot, its publication or its job."""

import ast
import re
from pathlib import Path

import taskcal
from taskcal.robot.catalogue import catalogue_names

ROOT = Path(taskcal.__file__).parent
ABOVE = {"demo", "studio", "cli", "__init__.py", "__main__.py"}
"""The guest, those above it, and the root that names it lazily for its users."""

BELOW = [path for path in sorted(ROOT.rglob("*.py")) if path.relative_to(ROOT).parts[0] not in ABOVE]
ROBOTS = "|".join(re.escape(name) for name in catalogue_names())
# a citation of a method's source may stand where the method is, so no author's name is here
OF_THE_GUEST = re.compile(
    rf"IRB.?6660|\bmilling (?:job|workspace)\b|\breference (?:task|machining)\b|\bthe publication\b|{ROBOTS}",
    re.IGNORECASE,
)


def test_the_pattern_finds_the_guest_at_home():
    at_home = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "demo").glob("*.py"))
    found = {word.casefold() for word in OF_THE_GUEST.findall(at_home)}
    assert {"irb 6660", "reference task", "reference machining", "the publication"} <= found


def test_no_module_below_names_one_robot_publication_or_job():
    found = []
    for path in BELOW:
        text = path.read_text(encoding="utf-8")
        imported = [n.module or "" for n in ast.walk(ast.parse(text)) if isinstance(n, ast.ImportFrom)]
        words = OF_THE_GUEST.findall(text) + [module for module in imported if module.startswith("taskcal.demo")]
        found += [(str(path.relative_to(ROOT)), word) for word in words]
    assert found == []

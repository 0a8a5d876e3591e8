"""What README and documentation claim with figures is on the page of validation, with a command and a test that exist."""

import importlib
import re
import shlex
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "docs"))

CLAIMS = importlib.import_module("claims").claims()

FIGURE = re.compile(r"\d+(?:\.\d+)?(?: to \d+(?:\.\d+)?)? (?:mm|µm|%|seconds|minutes)|\b\d+\.\d+\b")
GIVEN = {
    "README.md": (
        "Tested on Linux with Python 3.11, 3.12 and 3.13",
        "Numba also supports 3.14",
        "Python 3.11",
        "fits 70 % of the rows",
        "the held-out 30 %",
        "coverage of the 95 % regions",
        "in their 95 % region",
        "Apache License 2.0",
    )
}
"""Figures that are no measurement: versions, options of commands, definitions."""


def in_one_line(text: str) -> str:
    """With single spaces, so that a sentence is found however the lines break."""
    return re.sub(r"\s+", " ", text)


def prose(page: str) -> str:
    """A page without its code, in one line."""
    text = (ROOT / page).read_text(encoding="utf-8")
    text = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
    return in_one_line("\n".join(line for line in text.splitlines() if not line.startswith("    ")))


def unclaimed(text: str, says: list[str]) -> list[str]:
    """Figures of a text, with the words about them, that no claim has."""
    for words in sorted(says, key=len, reverse=True):
        text = text.replace(in_one_line(words), " ")
    return [text[max(0, at.start() - 40) : at.end() + 20] for at in FIGURE.finditer(text)]


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda claim: f"{claim.page}: {claim.says[0][:30]}")
def test_validation_page_states_claims_with_existing_evidence(claim) -> None:
    """The page states each claim, and the command and the test behind the claim exist."""
    text = in_one_line((ROOT / claim.page).read_text(encoding="utf-8"))
    for words in claim.says:
        assert in_one_line(words) in text
    assert _there(shlex.split(claim.command))
    if claim.held_by:
        path, _, name = claim.held_by.partition("::")
        assert f"def {name}" in (ROOT / path).read_text(encoding="utf-8")


def test_the_readme_states_no_figure_that_is_not_measured_there() -> None:
    says = [words for claim in CLAIMS if claim.page == "README.md" for words in claim.says]
    assert unclaimed(prose("README.md"), [*says, *GIVEN["README.md"]]) == []


def test_a_figure_that_nobody_claims_is_found() -> None:
    (found,) = unclaimed("It reaches 0.01 mm, and 0.02 mm at worst.", ["It reaches 0.01 mm"])
    assert "0.02 mm" in found


def _there(command: list[str]) -> bool:
    """Whether the program, the module, the test or the target that a command names exists."""
    match command:
        case ["make", target]:
            return f"\n{target}:" in (ROOT / "Makefile").read_text(encoding="utf-8")
        case ["taskcal", name, *_]:
            return (ROOT / f"src/taskcal/cli/commands/{name}.py").is_file()
        case ["python", "-m", "pytest", path, *_]:
            return (ROOT / path).is_file()
        case ["python", "-m", module, *_]:
            return (ROOT / f"{module.replace('.', '/')}.py").is_file()
        case ["python", path, *_]:
            return (ROOT / path).is_file()
        case _:
            return False

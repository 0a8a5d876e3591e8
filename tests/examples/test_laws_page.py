"""The page of laws and second opinions names tests that exist, for each of them at least one."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
TEST = re.compile(r"`(tests/[\w/]+\.py)::(test_\w+)`")


def missing(text: str) -> list[str]:
    """Tests that a text names and that are not there."""
    out = []
    for path, name in TEST.findall(text):
        file = ROOT / path
        if not file.is_file() or f"def {name}(" not in file.read_text(encoding="utf-8"):
            out.append(f"{path}::{name}")
    return out


def test_laws_page_names_existing_tests() -> None:
    """Every law and every independent check names tests that exist."""
    page = (ROOT / "docs/laws.md").read_text(encoding="utf-8")
    entries = re.findall(r"^- .*(?:\n  .*)*", page, flags=re.MULTILINE)
    assert len(entries) > 15
    assert [entry.split("**")[1] for entry in entries if not TEST.search(entry)] == []
    assert missing(page) == []


def test_a_test_that_is_not_there_is_found() -> None:
    assert missing("`tests/examples/test_laws_page.py::test_nothing`") == [
        "tests/examples/test_laws_page.py::test_nothing"
    ]

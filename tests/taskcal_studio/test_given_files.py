"""Only the project's own results are given out, and pages among them in an origin of their own."""

from pathlib import Path

import pytest
from starlette.requests import Request

from taskcal_studio.files import giver
from taskcal_studio.project import Project
from taskcal_studio.runs import Studio


def asked(query: str = "") -> Request:
    return Request({"type": "http", "method": "GET", "query_string": query.encode(), "headers": []})


@pytest.fixture
def studio(tmp_path: Path) -> Studio:
    for name in ("reports/a.html", "corrected/a.mod", "secret/a.txt"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("content")
    return Studio(Project(tmp_path))


def test_a_page_is_shown_where_it_cannot_reach_the_studio(studio: Studio) -> None:
    shown = giver(studio)("reports", "a.html", asked())
    assert shown.headers["content-security-policy"].startswith("sandbox allow-scripts ")
    assert "allow-same-origin" not in shown.headers["content-security-policy"]
    kept = giver(studio)("reports", "a.html", asked("keep=1"))
    assert kept.headers["content-disposition"] == 'attachment; filename="a.html"'


@pytest.mark.parametrize(
    ("folder", "name"),
    [("secret", "a.txt"), ("reports", "../project.toml"), ("..", "x"), ("corrected", "b.mod"), (".", "project.toml")],
)
def test_nothing_else_is_given(studio: Studio, folder: str, name: str) -> None:
    assert giver(studio)(folder, name, asked()).status_code == 404
    assert giver(studio)("corrected", "a.mod", asked()).status_code == 200

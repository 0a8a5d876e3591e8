"""What the pages point to is there; Sphinx holds the references between the pages of the documentation."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")] + sorted(
    (ROOT / "docs").rglob("*.md")
)
NAMED = re.compile(r"`((?:docs|examples|tests|benchmarks|src|\.ci)/[\w./-]*)`")
LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")
DOC = re.compile(r"\{doc\}`(?:[^`<]*<)?([^`>]+)>?`")


def anchored(page: Path, target: str, suffix: str = "") -> Path:
    """A target beside its page, or from the root of the documentation."""
    return (ROOT / "docs" / target[1:] if target.startswith("/") else page.parent / target).with_name(
        Path(target).name + suffix
    )


def missing(page: Path) -> list[str]:
    # what a code block shows is the user's, not the project's
    text = re.sub(r"```(?!\{).*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    files = [name for name in LINK.findall(text) if "://" not in name and not name.startswith("mailto:")]
    return [
        *(name for name in NAMED.findall(text) if not (ROOT / name).exists()),
        *(name for name in files if not anchored(page, name).exists()),
        *(name for name in DOC.findall(text) if not anchored(page, name, ".md").is_file()),
    ]


def test_every_file_and_page_that_is_named_exists() -> None:
    assert [(str(page.relative_to(ROOT)), name) for page in PAGES for name in missing(page)] == []


def test_a_link_to_nowhere_is_found(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "[a](gone.md) `docs/gone.md` {doc}`gone` {doc}`words <gone-too>` [web](https://example.org) `docs/index.md`"
    )
    assert sorted(missing(page)) == ["docs/gone.md", "gone", "gone-too", "gone.md"]

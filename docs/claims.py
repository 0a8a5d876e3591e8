"""What README and documentation claim with a measured figure, from ``claims.toml``."""

import tomllib
from dataclasses import dataclass
from pathlib import Path

DOCS = Path(__file__).parent


@dataclass(frozen=True, kw_only=True)
class Claim:
    """Words of a page that state measured figures, and where these come from."""

    page: str
    says: tuple[str, ...]
    """Parts of the page, word for word."""
    experiment: str
    on: str
    command: str
    held_by: str = ""
    """A test that fails where the figure is no longer reached; empty where none does."""
    made_by: tuple[str, ...] = ()
    """Functions of ``tests/realdata/figures.py`` that make the figures again, to the digits shown; empty where none does."""
    takes: str


def claims() -> list[Claim]:
    """In the order of the file."""
    tables = tomllib.loads((DOCS / "claims.toml").read_text(encoding="utf-8"))["claim"]
    return [
        Claim(**table | {"says": tuple(table["says"]), "made_by": tuple(table.get("made_by", ()))}) for table in tables
    ]

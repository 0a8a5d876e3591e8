"""Build the documents of this version into ``build/docs/VERSION``, beside those of others, and the page that lists all."""

import html
import shutil
import subprocess
import sys
from pathlib import Path

from packaging.version import Version

import taskcal

DOCS = Path(__file__).parent
OUT = DOCS.parent / "build" / "docs"


def index(names: list[str]) -> str:
    """The page that lists versions, the latest first, in the colours of the browser."""
    rows = [f'<li><a href="{html.escape(name)}/index.html">{html.escape(name)}</a></li>' for name in names]
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="color-scheme" content="light dark">'
        '<meta name="viewport" content="width=device-width"><title>Taskcal: versions of the documentation</title></head>'
        f'<body style="font-family: sans-serif; margin: 2rem"><h1>Taskcal: versions of the documentation</h1><ul>'
        f"{''.join(rows)}</ul></body></html>\n"
    )


def build() -> int:
    """Run Sphinx, and list what is there; its exit status."""
    shutil.rmtree(OUT / taskcal.__version__, ignore_errors=True)  # pages that are no longer
    options = ["-W", "--keep-going", "-q", "-b", "html", "-d", str(OUT / ".doctrees")]
    status = subprocess.run([sys.executable, "-m", "sphinx", *options, str(DOCS), str(OUT / taskcal.__version__)])
    built = [path.parent.name for path in OUT.glob("*/searchindex.js")]
    (OUT / "index.html").write_text(index(sorted(built, key=Version, reverse=True)), encoding="utf-8")
    return status.returncode


if __name__ == "__main__":
    sys.exit(build())

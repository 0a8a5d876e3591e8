"""What a release states of itself is stated alike wherever it is stated."""

import re
import tomllib
from pathlib import Path

import taskcal

ROOT = Path(__file__).parents[2]


def test_the_citation_names_the_version_and_the_licence_of_the_package():
    stated = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    cited = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    fields = dict(re.findall(r"^(version|license): (.+)$", cited, re.MULTILINE))
    assert fields == {"version": stated["version"], "license": stated["license"]}
    assert taskcal.__version__ == stated["version"]


def test_no_source_evaluates_or_unpickles_what_it_reads():
    """The linter refuses these names; this holds the list of the places where it was told to be quiet."""
    quiet = {
        (str(path.relative_to(ROOT)), code)
        for path in (ROOT / "src").rglob("*.py")
        for code in re.findall(r"# noqa: (S\d+)", path.read_text(encoding="utf-8"))
    }
    assert quiet == {("src/taskcal/geometry/kernel_cache.py", "S301"), ("src/taskcal/presentation/report.py", "S704")}

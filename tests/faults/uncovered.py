"""Commands whose processes may not write are not measured by coverage: it would have no place for what it saw, and say so."""

import os


def uncovered_environment() -> dict[str, str]:
    """This process's, without what starts coverage in another."""
    return {name: value for name, value in os.environ.items() if not name.startswith("COVERAGE_PROCESS")}

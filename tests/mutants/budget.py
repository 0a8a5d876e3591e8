"""A plugin of pytest: a run ends behind the test at which its process has taken `MUTANT_SECONDS` of processor time."""

import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # what makes the mistakes has no pytest
    import pytest

TIME_IS_UP = "the time of this mistake is up"


def pytest_runtest_teardown(item: "pytest.Item") -> None:
    """Counted in processor time, those of finished subprocesses included: it does not depend on what else the machine does."""
    if sum(os.times()[:4]) > float(os.environ["MUTANT_SECONDS"]):
        item.session.shouldstop = TIME_IS_UP

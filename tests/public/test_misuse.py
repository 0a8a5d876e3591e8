"""Wrong arguments of public functions and classes are refused by name, and right ones count in every form."""

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.public import misuse


@pytest.mark.slow
@pytest.mark.skipif(
    not hasattr(signal, "SIGALRM"), reason="calls that hang are ended by a signal that this system does not have"
)
def test_misuse_ends_in_a_result_or_a_refusal_by_name() -> None:
    """Whatever an argument is, a public function refuses it by its name, or gives the result of the same numbers in an array."""
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-m", misuse.__name__],
        capture_output=True,
        text=True,
        check=False,
        cwd=Path(__file__).parents[2],
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == {"leaked": [], "not called": []}

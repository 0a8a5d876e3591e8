"""Run tests, and show what they cost as shares of all processor time: `python -m tests.cost`, and pytest's own arguments."""

import sys

import pytest

sys.exit(pytest.main(["-p", "tests.cost.plugin", *sys.argv[1:]]))

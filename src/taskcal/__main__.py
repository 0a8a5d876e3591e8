"""``python -m taskcal``, the command line."""

from taskcal.cli import main

main()

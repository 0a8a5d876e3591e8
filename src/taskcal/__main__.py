"""``python -m taskcal``, the command line."""

import sys

from taskcal.cli import main

if __name__ == "__main__":
    sys.exit(main())

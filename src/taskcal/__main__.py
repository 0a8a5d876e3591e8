"""``python -m taskcal``, the command line."""

import gc
import signal
import sys

YOUNG_OBJECTS = 50_000
"""New objects after which circles of them are looked for, which a command that begins makes few of; every 700 by default."""


def main() -> int:
    """Run the command line; an interrupt while it is still being imported, or is ending, is said in a line as well."""
    gc.set_threshold(YOUNG_OBJECTS)  # a tenth of the time in which libraries are imported, or kernels compiled
    try:
        from taskcal.cli import main as run

        status = run()
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is written and said: only the interpreter has to end
    except KeyboardInterrupt:
        outputs = sys.modules.get("taskcal.cli.output")
        interrupted = getattr(outputs, "interrupted", None)  # not there while the module is being imported
        print(interrupted() if interrupted else "interrupted: nothing was written", file=sys.stderr)
        return 130
    return status


if __name__ == "__main__":
    sys.exit(main())

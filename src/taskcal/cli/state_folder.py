"""Where the commands keep what they remember from one run to the next."""

import os
from pathlib import Path


def state_folder() -> Path:
    """The folder that ``TASKCAL_STATE_DIR`` names, or the system's own for a user's programs."""
    import platformdirs

    return Path(os.environ.get("TASKCAL_STATE_DIR") or platformdirs.user_state_path("taskcal"))

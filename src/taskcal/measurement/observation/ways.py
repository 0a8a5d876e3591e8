"""Ways of measuring a robot, in the words of options and tables, and the kinds of observation that each of them gives."""

from typing import Literal

Way = Literal["tracker", "socket", "wire", "camera", "board"]

WAYS: dict[Way, tuple[str, ...]] = {
    "tracker": ("point", "pose"),
    "socket": ("socket",),
    "wire": ("distance",),
    "camera": ("landmark",),
    "board": ("board",),
}
"""Keys of the kinds that a campaign measured so may have."""

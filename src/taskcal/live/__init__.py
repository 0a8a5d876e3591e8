"""Measuring live: the loop that chooses, takes and judges one pose after another, and what it reads from.

A controller gives joints, an instrument gives points; each is one class in one file, and says how it is reached.
"""

from taskcal_groundwork.public_names import load_lazily

__getattr__, __dir__, __all__ = load_lazily(__name__, __file__)  # pyright: ignore[reportUnsupportedDunderAll]

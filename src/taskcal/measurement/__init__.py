"""Campaigns: reading them, tracker noise, registration without starting values, and the virtual cell."""

from taskcal.public_names import load_lazily

__getattr__, __dir__, __all__ = load_lazily(__name__, __file__)  # pyright: ignore[reportUnsupportedDunderAll]

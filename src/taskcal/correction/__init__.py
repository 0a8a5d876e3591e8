"""Correction of robot programs: what to tell a controller that takes its robot for nominal."""

from taskcal_groundwork.public_names import load_lazily

__getattr__, __dir__, __all__ = load_lazily(__name__, __file__)  # pyright: ignore[reportUnsupportedDunderAll]

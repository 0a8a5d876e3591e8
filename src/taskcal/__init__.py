"""Taskcal: makes industrial robots accurate where they work, from a laser tracker's file to a calibrated robot."""

from taskcal_groundwork.public_names import load_lazily

__getattr__, __dir__, __all__ = load_lazily(__name__, __file__)  # pyright: ignore[reportUnsupportedDunderAll]

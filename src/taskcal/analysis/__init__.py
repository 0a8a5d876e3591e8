"""Sensitivity of the tool to the parameters, and their identifiability at given poses."""

from taskcal_groundwork.public_names import load_lazily

__getattr__, __dir__, __all__ = load_lazily(__name__, __file__)  # pyright: ignore[reportUnsupportedDunderAll]

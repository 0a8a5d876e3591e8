"""Robots: their description and catalogue, the joint side, the error model, the mechanism's mobility."""

from taskcal_groundwork.public_names import load_lazily

__getattr__, __dir__, __all__ = load_lazily(__name__, __file__)  # pyright: ignore[reportUnsupportedDunderAll]

"""Diagnosis of a campaign: the usual mistakes, each undone and tested on held-out rows."""

from taskcal_groundwork.public_names import load_lazily

__getattr__, __dir__, __all__ = load_lazily(__name__, __file__)  # pyright: ignore[reportUnsupportedDunderAll]

"""Tables in files: the forms they come in, their cells, and the groups of columns that mean something together."""

from taskcal_groundwork.public_names import load_lazily

__getattr__, __dir__, __all__ = load_lazily(__name__, __file__)  # pyright: ignore[reportUnsupportedDunderAll]

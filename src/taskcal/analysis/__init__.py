"""What the parameters do to the tool, which of them the poses can tell apart, and how well."""

from taskcal.public_names import load_lazily

__getattr__, __dir__, __all__ = load_lazily(__name__, __file__)  # pyright: ignore[reportUnsupportedDunderAll]

"""From files of instruments and spreadsheets to a campaign, and from a campaign to a file."""

from taskcal_groundwork.public_names import load_lazily

__getattr__, __dir__, __all__ = load_lazily(__name__, __file__)  # pyright: ignore[reportUnsupportedDunderAll]

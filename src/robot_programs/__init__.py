"""Robot programs: RAPID, KRL, TP, URScript, APT and CSV, from text to motions and back."""

from taskcal_groundwork.public_names import load_lazily

__getattr__, __dir__, __all__ = load_lazily(__name__, __file__)  # pyright: ignore[reportUnsupportedDunderAll]

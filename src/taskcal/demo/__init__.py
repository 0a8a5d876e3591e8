"""The demonstration: a published procedure and a closed loop, on a virtual robot. A guest: nothing below it knows it."""

from taskcal_groundwork.public_names import load_lazily

__getattr__, __dir__, __all__ = load_lazily(__name__, __file__)  # pyright: ignore[reportUnsupportedDunderAll]

"""A calibrated robot for other programs and for controllers: URDF, tables, and what a controller alone can hold."""

from taskcal_groundwork.public_names import load_lazily

__getattr__, __dir__, __all__ = load_lazily(__name__, __file__)  # pyright: ignore[reportUnsupportedDunderAll]

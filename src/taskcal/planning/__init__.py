"""The model adapted to the task: expected task error, the choice of parameters and of measuring poses, studies."""

from taskcal_groundwork.public_names import load_lazily

__getattr__, __dir__, __all__ = load_lazily(__name__, __file__)  # pyright: ignore[reportUnsupportedDunderAll]

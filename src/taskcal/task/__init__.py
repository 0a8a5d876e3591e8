"""What the robot has to do: a workspace, a list of poses or a tool path, and the accuracy it needs."""

from taskcal.public_names import load_lazily

__getattr__, __dir__, __all__ = load_lazily(__name__, __file__)  # pyright: ignore[reportUnsupportedDunderAll]

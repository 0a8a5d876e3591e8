"""Help that ends with a list of the effects, those of imported modules among them; read when it is asked for."""

from typing import Any

from typer.core import TyperCommand


class NamesEffects(TyperCommand):
    """A command with an option ``--effects``."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help, and behind it what can be written for ``--effects``."""
        from taskcal.robot.effects import ways_to_write

        lines = [f"{text}: {meaning}" for text, meaning in ways_to_write().items()]
        self.epilog = "\n\n".join(["Effects:", *lines])
        super().format_help(ctx, formatter)

"""A command of the command line: its former option names still work, and its help ends with the effects it can take."""

from collections.abc import Iterable
from typing import Any

from typer import BadParameter
from typer.core import TyperCommand

from taskcal.cli.output import info, show_log
from taskcal.cli.usage_words import in_users_words

RENAMED = {
    "--accuracy": "--accuracy-mm",
    "--extend": "--campaign",
    "--model-error": "--model-error-mm",
    "--nests": "--reference-points",
    "--target-within": "--target-within-mm",
}
"""Former names of options, which still work for one release, and what they are called now."""


class Command(TyperCommand):
    """A command of Taskcal."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the options, those by a former name too."""
        typed = with_new_names(args, self._options())
        try:
            return super().parse_args(ctx, list(typed))
        except BadParameter as wrong:
            names = [] if wrong.param is None else wrong.param.opts
            wrong.message = in_users_words(wrong.message, names, typed)
            raise

    def invoke(self, ctx: Any) -> Any:
        """Run the command."""
        show_log()
        return super().invoke(ctx)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help, and behind it what can be written for ``--effects``, effects of imported modules among it."""
        if "--effects" in self._options():
            from taskcal.robot.effects import ways_to_write

            lines = [f"{text}: {meaning}" for text, meaning in ways_to_write().items()]
            self.epilog = "\n\n".join(["Effects:", *lines])
        super().format_help(ctx, formatter)

    def _options(self) -> set[str]:
        return {name for parameter in self.params for name in parameter.opts}


def with_new_names(arguments: Iterable[str], options: set[str]) -> list[str]:
    """Arguments in which former option names are replaced by those of today, with a warning for each.

    Args:
        arguments: as they were typed; behind ``--`` there are no options.
        options: those that the command has.
    """
    out: list[str] = []
    ended = False
    for argument in arguments:
        former, equals, value = argument.partition("=")
        name = RENAMED.get(former, former)
        ended = ended or argument == "--"
        if ended or name == former or former in options or name not in options:
            out.append(argument)
            continue
        info(f"warning: {former} is called {name} now; the old name goes with the next release")
        out.append(f"{name}{equals}{value}")
    return out

"""The command line: one subcommand per stage; each reads, makes one call and writes."""

from taskcal.cli.app import app, main

__all__ = ["app", "main"]

"""Options of commands that compute many things side by side."""

from dataclasses import dataclass
from typing import Annotated

import typer

ENGINES = ("loky", "threading", "sequential", "dask")

ADDRESSED = "dask:"
"""Begins an engine with its scheduler's address in one word, as Python has it."""


@dataclass(frozen=True, kw_only=True)
class EngineOptions:
    """Where many things are computed side by side.

    Raises:
        typer.BadParameter: there is no such engine, or a scheduler is lacking or has no use.
    """

    engine: Annotated[
        str,
        typer.Option(
            "--engine",
            metavar="ENGINE",
            help="loky (processes on this machine), threading, sequential, or dask (a cluster, see --scheduler).",
        ),
    ] = "loky"
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", metavar="ADDRESS", help="Scheduler of the Dask cluster, such as tcp://HOST:8786."),
    ] = None
    workers: Annotated[
        int | None, typer.Option("--workers", min=1, metavar="N", help="Parallel workers; by default one per core.")
    ] = None

    @property
    def engine_name(self) -> str:
        """The engine, with its scheduler."""
        return self.engine if self.scheduler is None else f"{ADDRESSED}{self.scheduler}"

    @property
    def most_workers(self) -> int:
        """How many, −1 for one per core."""
        return -1 if self.workers is None else self.workers

    def __post_init__(self) -> None:
        if self.engine not in ENGINES and not self.engine.startswith(ADDRESSED):
            raise typer.BadParameter(
                f"'{self.engine}' is not an engine; choose {', '.join(ENGINES[:-1])}, or dask with --scheduler ADDRESS",
                param_hint="--engine",
            )
        if self.engine == "dask" and not self.scheduler:
            raise typer.BadParameter(
                "which cluster? Name the address that 'dask scheduler' prints, such as tcp://HOST:8786",
                param_hint="--engine dask / --scheduler",
            )
        if self.engine != "dask" and self.scheduler is not None:
            raise typer.BadParameter(f"only --engine dask has one, not {self.engine}", param_hint="--scheduler")

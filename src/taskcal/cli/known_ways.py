"""Ways to measure that an option names."""

import typer


def known_ways(observe: str) -> str:
    """One or several with a plus between, all of them known.

    Raises:
        typer.BadParameter: there is no such way.
    """
    from taskcal.errors import CampaignError, UnknownName
    from taskcal.measurement.virtual_cell import SimulationOptions

    try:
        return SimulationOptions(observe=observe).observe
    except (UnknownName, CampaignError) as error:
        raise typer.BadParameter(str(error), param_hint="--observe") from error

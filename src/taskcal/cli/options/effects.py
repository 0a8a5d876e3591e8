"""Effects as the command line names them, and the table that says what each is worth."""

import math
import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import typer

from taskcal.campaigns.campaign import Campaign
from taskcal.cli.options.common import split_names
from taskcal.cli.output import show_facts, show_table
from taskcal.errors import TaskcalError
from taskcal.robot.effects import Effect, parse_effect

if TYPE_CHECKING:
    from taskcal.identification.effects import Explanation, Stage

STRONGEST = 12
"""How many harmonics are shown."""

MOST_NAMED = 3
"""Effects that are named as those worth most."""

REPEATED = 4
"""How many parameters that geometry nearly repeats are named."""


def read_effects(text: str) -> list[Effect] | None:
    """Effects named in a list with commas; None for ``auto``.

    Raises:
        typer.BadParameter: a name that means no effect, or one that stands twice.
    """
    names = split_names(text, "--effects") or []
    if names == ["auto"]:
        return None
    return [] if names == ["none"] else [_effect(name) for name in names]


def _effect(name: str) -> Effect:
    if name in ("auto", "none"):
        raise typer.BadParameter(f"'{name}' stands alone; give it without other effects", param_hint="--effects")
    try:
        return parse_effect(name)
    except TaskcalError as error:
        raise typer.BadParameter(f"{error}; or auto, or none", param_hint="--effects") from error


def refer_to(campaign: Campaign, effects: list[Effect] | None) -> list[Effect] | None:
    """The effects, each with what it refers to taken from the campaign.

    Raises:
        CampaignError: a row does not tell what an effect needs.
    """
    for effect in effects or ():
        campaign.check_told(effect.needs, effect.key)
    return None if effects is None else [effect.referred(campaign.conditions) for effect in effects]


def show_explanation(explanation: "Explanation") -> None:
    """Print what each step was worth, and what each effect is among all others."""
    header = ("beside what is above", "parameters", "left mm", "± 1σ mm", "taken", "because")
    title = "What explains the measurements: mean error in space on rows left out"
    show_table(title, header, [_row(stage, stage.cross_validated) for stage in explanation.steps], left=(0, 4, 5))
    if explanation.worths:
        header = ("effect among all others", "parameters", "worth mm", "± 1σ mm", "proven", "because")
        title = "What each effect is worth: how far that error rises without it"
        show_table(title, header, [_row(stage, stage.worth or 0.0) for stage in explanation.worths], left=(0, 4, 5))
    facts = [("explained", _sentence(explanation))]
    if explanation.collinearities:
        facts.append(("hardly told apart", _collinear(explanation)))
    if explanation.untried:
        facts.append(("not tried", "; ".join(f"{name}: {reason}" for name, reason in explanation.untried.items())))
    show_facts(facts)


def _row(stage: "Stage", metres: float) -> tuple[str, ...]:
    return (
        stage.name,
        str(stage.parameters),
        f"{metres * 1e3:.4f}",
        f"{stage.standard_error * 1e3:.4f}",
        "yes" if stage.accepted else "no",
        stage.reason,
    )


def collinearities_json(explanation: "Explanation") -> list[dict[str, Any]]:
    """Parameters of effects that geometry nearly repeats, for JSON; an infinite inflation is None."""
    return [
        {
            "name": near.name,
            "share": near.share,
            "variance_inflation": near.inflation if math.isfinite(near.inflation) else None,
            "explained_by": dict(near.by),
        }
        for near in explanation.collinearities
    ]


def _collinear(explanation: "Explanation") -> str:
    named = [
        f"{near.name} is {_percent(near.share)} explained by {', '.join(near.by)}"
        for near in explanation.collinearities
    ]
    more = f"; and {len(named) - REPEATED} more" if len(named) > REPEATED else ""
    return (
        f"at the fitted poses {'; '.join(named[:REPEATED])}{more}; what these share out between them is open, predictions among "
        "such poses are not"
    )


def _percent(share: float) -> str:
    """Rounded down, so that only an exact repeat is 100 %."""
    return f"{math.floor(min(share + 1e-9, 1.0) * 1e4) / 1e2:g} %"


def _sentence(explanation: "Explanation") -> str:
    first, *others = explanation.steps
    steps = [f"geometry leaves {first.cross_validated * 1e3:.4f} mm"]
    for stage in others:
        left = f"{stage.cross_validated * 1e3:.4f} mm"
        together = bool(explanation.worths) and stage is others[-1]
        name, takes = ("all effects together", "take") if together else (stage.name, "takes")
        steps.append(f"{name} {takes} it to {left}" if stage.accepted else f"{name} would leave {left}, not taken")
    most = [stage.name for stage in explanation.worths if stage.accepted][:MOST_NAMED]
    if most:
        steps.append(f"most of it by {' and '.join(most)}")
    return f"{', '.join(steps)}; the tracker alone would leave {explanation.tracker * 1e3:.4f} mm"


def strongest_harmonics(parameters: Sequence[Mapping[str, Any]]) -> list[tuple[str, float, float, float]]:
    """Joint, order, amplitude and its standard error, mrad, of the largest among cosines and sines; largest first."""
    parts: dict[tuple[str, float], list[Mapping[str, Any]]] = defaultdict(list)
    for parameter in parameters:
        match = _SHAPE.match(parameter["name"])
        if match is not None:
            parts[match[1], float(match[2])].append(parameter)
    harmonics: list[tuple[str, float, float, float]] = []
    for (joint, order), (a, b) in ((key, pair) for key, pair in parts.items() if len(pair) == 2):
        x, y = a["estimate_mrad"], b["estimate_mrad"]
        size = (x**2 + y**2) ** 0.5
        errors = a["standard_error_mrad"], b["standard_error_mrad"]
        spread = ((x * errors[0]) ** 2 + (y * errors[1]) ** 2) ** 0.5 / size if size else max(errors)
        harmonics.append((joint, order, size, spread))
    return sorted(harmonics, key=lambda row: -row[2])


_SHAPE = re.compile(r"(.+)\.(?:cos|sin)(\d+(?:\.\d+)?)$")


def is_harmonic(name: str) -> bool:
    """Whether a parameter is a cosine or sine of a joint's angle."""
    return _SHAPE.match(name) is not None


def show_harmonics(parameters: Sequence[Mapping[str, Any]]) -> None:
    """Print the strongest harmonics, if there are any."""
    harmonics = strongest_harmonics(parameters)
    if not harmonics:
        return
    title = "Harmonics of the joints' angles"
    if len(harmonics) > STRONGEST:
        title += f", the {STRONGEST} strongest of {len(harmonics)}"
    rows = [
        (joint, str(order), f"{size:.4f}", f"{error:.4f}", "mrad")
        for joint, order, size, error in harmonics[:STRONGEST]
    ]
    show_table(title, ("joint", "periods in a turn", "amplitude", "± 1σ", "unit"), rows, left=(0, 4))

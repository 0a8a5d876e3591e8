"""A publication's choice of parameters beside the exact repeats and the full elimination, parameter by parameter."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.analysis.identifiability import Identifiability, identifiability
from taskcal.robot.error_model import ErrorModel


@dataclass(frozen=True, kw_only=True)
class EliminationRow:
    """What is said of one parameter."""

    name: str
    symbol: str
    published: str
    """``zero``, ``redundant``, ``dropped``, ``redundant, kept`` or ``kept``; empty where nothing was published."""
    repeats: str
    """The one other parameter that it repeats, with the factor."""
    eliminated: Mapping[str, str]
    """For each set of poses: ``kept``, ``zero``, or the combination that it equals."""


@dataclass(frozen=True, eq=False, kw_only=True)
class EliminationTable:
    """All parameters, and the elimination for each set of poses."""

    rows: tuple[EliminationRow, ...]
    eliminations: Mapping[str, Identifiability]


def tabulate_elimination(model: ErrorModel, poses: Mapping[str, Float[np.ndarray, "n joints"]]) -> EliminationTable:
    """Eliminate for every named set of joint positions, and put what was published beside it.

    The repeats are those that hold for all sets together.
    """
    eliminations = {label: identifiability(model, q) for label, q in poses.items()}
    everywhere = identifiability(model, np.concatenate(list(poses.values())))
    label = {p.name: p.symbol or p.name for p in model.parameters}
    rows = tuple(
        EliminationRow(
            name=p.name,
            symbol=p.symbol,
            published="" if p.name in model.effect_names else _published(model, p.name),
            repeats=_repeat(everywhere, p.name, label),
            eliminated={key: _fate(found, p.name, label) for key, found in eliminations.items()},
        )
        for p in model.parameters
    )
    return EliminationTable(rows=rows, eliminations=eliminations)


def published_kept(model: ErrorModel) -> tuple[str, ...]:
    """Parameters of the reduced model that was published, which has no effects."""
    others = {*model.robot.published.dropped, *model.effect_names}
    return tuple(name for name in model.names if name not in others)


def _published(model: ErrorModel, name: str) -> str:
    said = model.robot.published
    if not said.source:
        return ""
    if name in said.zero:
        return "zero"
    if name in said.redundant:
        return "redundant" if name in said.dropped else "redundant, kept"
    return "dropped" if name in said.dropped else "kept"


def _repeat(found: Identifiability, name: str, label: Mapping[str, str]) -> str:
    if name in found.zero:
        return "zero"
    if name not in found.repeats:
        return ""
    other, factor = found.repeats[name]
    return describe_combination({other: factor}, label)


def _fate(found: Identifiability, name: str, label: Mapping[str, str]) -> str:
    if name in found.zero:
        return "zero"
    if name in found.dependent:
        return describe_combination(found.dependent[name], label)
    return "kept"


def describe_combination(terms: Mapping[str, float], label: Mapping[str, str]) -> str:
    """A linear combination in words, such as ``0.3·t1z + psi1 − 0.7·t2y``."""
    out = ""
    for name, c in terms.items():
        size = "" if abs(abs(c) - 1.0) < 5e-5 else f"{abs(c):.4g}·"
        sign = ("− " if c < 0 else "+ ") if out else ("−" if c < 0 else "")
        out += f"{' ' if out else ''}{sign}{size}{label.get(name, name)}"
    return out

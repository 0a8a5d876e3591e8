"""The file of stated distances between sockets."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import CampaignError, FileError, shown
from taskcal.observations.socket import CALLIPER, SocketDistance, Sockets
from taskcal.tables.forms import read_table
from taskcal.tables.table import Table

SMALLEST = 1e-4
"""Metres; sockets cannot be nearer to each other."""


def with_distances(campaign: Campaign, path: str | Path) -> Campaign:
    """A campaign with the distances of a file: columns ``socket_a``, ``socket_b``, ``distance_mm``, and optionally ``u_mm``.

    A socket is named as in the campaign: with its place as ``PLACE/SOCKET``, or without, which means both sockets wherever a
    block with them stood: the same block, whose stated distance errs alike at all its places.

    Raises:
        FileError: the file cannot be read, names a socket that the campaign does not have, or states a distance twice.
    """
    at = [t for t, kind in enumerate(campaign.observations) if isinstance(kind, Sockets)]
    if not at:
        raise FileError(
            Path(path), f"states distances of sockets, and {campaign.source or 'the campaign'} has no column socket"
        )
    kind = campaign.observations[at[0]]
    assert isinstance(kind, Sockets)
    stated = read_distances(path, kind.sockets)
    kinds = tuple(kind.with_distances(stated) if t == at[0] else one for t, one in enumerate(campaign.observations))
    return replace(campaign, observations=kinds)


def distances_text(campaign: Campaign) -> str:
    """A file from which `with_distances` reads the distances of a campaign; one line for those of a block at several places."""
    rows = {
        (*(name.rpartition("/")[2] if d.statement else name for name in (d.a, d.b)), d.distance, d.uncertainty)
        for kind in campaign.observations
        if isinstance(kind, Sockets)
        for d in kind.distances
    }
    lines = (f"{a},{b},{distance * 1e3:.6f},{u * 1e3:.6f}\n" for a, b, distance, u in sorted(rows))
    return "socket_a,socket_b,distance_mm,u_mm\n" + "".join(lines)


def read_distances(path: str | Path, sockets: tuple[str, ...]) -> tuple[SocketDistance, ...]:
    """Stated distances of some sockets, from a file as `with_distances` reads it.

    Raises:
        FileError: the file cannot be read, names a socket that is not there, or states a distance twice.
    """
    path = Path(path)
    table = read_table(path)
    a, b = table.texts("socket_a"), table.texts("socket_b")
    distance = table.numbers("distance_mm") * 1e-3
    uncertainty = table.numbers("u_mm", empty=True) * 1e-3 if "u_mm" in table else np.full(len(table), CALLIPER)
    uncertainty = np.where(np.isnan(uncertainty), CALLIPER, uncertainty)
    out: dict[frozenset[str], SocketDistance] = {}
    for row in range(len(table)):
        if distance[row] < SMALLEST:
            raise table.error(
                f"{distance[row] * 1e3:g} mm is not a distance of two sockets; give millimetres", row, "distance_mm"
            )
        if not uncertainty[row] > 0.0:
            raise table.error("give an uncertainty above zero, or leave the cell empty", row, "u_mm")
        for pair in _pairs(table, row, a[row], b[row], sockets):
            if frozenset(pair) in out:
                raise table.error(f"the distance of {pair[0]} and {pair[1]} is stated twice; keep one", row, "socket_a")
            out[frozenset(pair)] = SocketDistance(
                a=pair[0],
                b=pair[1],
                distance=float(distance[row]),
                uncertainty=float(uncertainty[row]),
                statement="" if pair == (a[row], b[row]) else f"{a[row]},{b[row]}",
            )
    if not out:
        raise FileError(path, "states no distance")
    return tuple(out.values())


def _pairs(table: Table, row: int, a: str, b: str, sockets: tuple[str, ...]) -> list[tuple[str, str]]:
    """The pairs of sockets that a row means."""
    if a == b:
        raise table.error(f"'{shown(a)}' is no distance from itself; name two sockets", row, "socket_b")
    if a in sockets and b in sockets:
        return [(a, b)]
    places = {name.rpartition("/")[0] for name in sockets if "/" in name}
    pairs = [(f"{p}/{a}", f"{p}/{b}") for p in sorted(places) if f"{p}/{a}" in sockets and f"{p}/{b}" in sockets]
    if pairs:
        return pairs
    known = {name.rpartition("/")[2] for name in sockets} | set(sockets)
    column, name = ("socket_a", a) if a not in known else ("socket_b", b)
    raise table.error(
        f"no block of the campaign has the sockets '{shown(a)}' and '{shown(b)}'; it has {', '.join(sockets)}"
        if {a, b} <= known
        else f"the campaign has no socket '{shown(name)}'; it has {', '.join(sockets)}",
        row,
        column,
    )


# A campaign whose instrument of lengths has an unknown scale.


def with_unknown_scale(campaign: Campaign) -> Campaign:
    """A campaign with the scale of its lengths unknown.

    Raises:
        CampaignError: it has no lengths.
    """
    scaled = [kind.with_unknown_scale() for kind in campaign.observations]
    if not any(scaled):
        raise CampaignError(f"{campaign.source or 'the campaign'} has no lengths (d_mm) whose scale could be unknown")
    kinds = tuple(own or kind for own, kind in zip(scaled, campaign.observations, strict=True))
    return replace(campaign, observations=kinds)

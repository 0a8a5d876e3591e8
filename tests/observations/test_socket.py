import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.observations import Measured, Sockets
from taskcal.observations.socket import SocketDistance

seeds = st.integers(0, 2**32 - 1)


def reached(seed, rows=40, sockets=3):
    """Poses of a tool whose ball is in one of several sockets."""
    rng = np.random.default_rng(seed)
    R, t, s = se3.exp(rng.uniform(-1.5, 1.5, (rows, 3))), rng.uniform(-0.3, 0.3, 3), rng.uniform(-1, 1, (sockets, 3))
    of = np.concatenate([np.arange(sockets), rng.integers(0, sockets, rows - sockets)])
    kind = Sockets(sockets=tuple("abc"[:sockets]), of=of)
    return rng, se3.pose(R, s[of] - R @ t), kind, t, s


def seated(rows):
    return Measured(np.zeros((rows, 3)))


@given(seeds)
def test_ball_and_sockets_are_found_without_a_guess(seed):
    _, tool, kind, t, s = reached(seed)
    placed = kind.place(tool, seated(len(tool)))
    np.testing.assert_allclose(placed.T_tool_target[:3, 3], t, atol=1e-9)
    np.testing.assert_allclose(placed.unknown.reshape(-1, 3), s, atol=1e-9)
    assert placed.distance.max() < 1e-9
    assert not placed.unobservable.any()


@given(seeds)
@settings(max_examples=20)
def test_they_are_found_although_some_rows_name_the_wrong_socket(seed):
    rng, tool, kind, t, s = reached(seed, rows=60)
    wrong = rng.choice(np.arange(3, 60), 5, replace=False)
    mixed = Sockets(sockets=kind.sockets, of=np.where(np.isin(np.arange(60), wrong), (kind.of + 1) % 3, kind.of))
    tool[:, :3, 3] += 3e-4 * rng.normal(size=(60, 3))
    placed = mixed.place(tool, seated(60))
    np.testing.assert_allclose(placed.T_tool_target[:3, 3], t, atol=2e-3)
    np.testing.assert_allclose(placed.unknown.reshape(-1, 3), s, atol=2e-3)
    assert set(np.flatnonzero(placed.distance > 0.02)) == set(wrong)


def test_in_one_orientation_the_ball_stays_at_the_tool_point():
    rng = np.random.default_rng(1)
    R = se3.exp(np.array([0.3, 0.1, 1.0]))
    tool = se3.pose(np.tile(R, (20, 1, 1)), 0.4 + 1e-4 * rng.normal(size=(20, 3)))
    placed = Sockets(sockets=("a",), of=np.zeros(20, dtype=int)).place(tool, seated(20))
    np.testing.assert_allclose(placed.unobservable, np.eye(3), atol=1e-9)
    np.testing.assert_allclose(placed.T_tool_target, np.eye(4), atol=1e-9)


def test_turned_about_one_axis_the_ball_is_not_located_along_it():
    tool = se3.pose(se3.exp(np.linspace(0, 2, 20)[:, None] * np.array([0.0, 0.0, 1.0])), np.zeros((20, 3)))
    placed = Sockets(sockets=("a",), of=np.zeros(20, dtype=int)).place(tool, seated(20))
    np.testing.assert_allclose(placed.unobservable, np.diag([0.0, 0.0, 1.0]), atol=1e-9)


@given(seeds)
@settings(max_examples=10)
def test_stated_distances_move_as_their_derivative_says(seed):
    _, _, kind, _, s = reached(seed)
    both = tuple(
        SocketDistance(a=a, b=b, distance=d, uncertainty=1e-5) for a, b, d in (("a", "b", 0.3), ("c", "a", 0.2))
    )
    kind, x = kind.with_distances(both), s.reshape(-1)
    at, h = kind.stated(x), 1e-7
    moved = np.stack(
        [(kind.stated(x - e).residual - kind.stated(x + e).residual) / (2 * h) for e in h * np.eye(9)], axis=1
    )
    np.testing.assert_allclose(at.by_unknown, moved, atol=1e-6)
    np.testing.assert_allclose(at.residual[0], 0.3 - np.linalg.norm(s[0] - s[1]))
    assert [one.found - one.stated for one in kind.compare(x)] == pytest.approx(list(-at.residual))


@given(seeds)
@settings(max_examples=10)
def test_shared_socket_distance_error_is_counted_once(seed):
    """Sockets as far apart as stated, plus one error at all places, say as much as one distance does, not as three."""
    rng, u = np.random.default_rng(seed), 3e-5
    names, centres = tuple(f"{p}/{s}" for p in "123" for s in "ab"), rng.normal(size=(6, 3))
    off = centres[1::2] - centres[::2]
    lengths = np.linalg.norm(off, axis=1)
    centres[1::2] = centres[::2] + off * (0.1 / lengths)[:, None]

    def stated(statement: str) -> Sockets:
        return Sockets(
            sockets=names,
            distances=tuple(
                SocketDistance(a=f"{p}/a", b=f"{p}/b", distance=0.1 + u, uncertainty=u, statement=statement)
                for p in "123"
            ),
        )

    def square(kind: Sockets) -> float:
        at = kind.stated(centres.reshape(-1))
        return float(np.sum((at.residual / at.uncertainty) ** 2))

    assert square(stated("")) == pytest.approx(3.0, rel=1e-6)
    assert square(stated("a,b")) == pytest.approx(1.0, rel=1e-2)
    # while one place that differs from the others tells against a block that moved
    centres[1] = centres[0] + off[0] * ((0.1 + u) / lengths[0])
    assert square(stated("a,b")) > 100.0


def test_take_keeps_sockets_and_distances_named_by_rows():
    """A subset of rows keeps only the sockets and distances that it names."""
    kind = Sockets(
        sockets=("a", "b", "c"),
        of=np.array([0, 1, 2, -1, 2]),
        distances=(
            SocketDistance(a="a", b="b", distance=0.1, uncertainty=1e-5),
            SocketDistance(a="a", b="c", distance=0.1, uncertainty=1e-5),
        ),
    )
    some = kind.take(np.array([4, 3, 0]))
    assert some.sockets == ("c", "a")
    assert some.of.tolist() == [0, -1, 1]
    assert [(d.a, d.b) for d in some.distances] == [("a", "c")]
    assert some.named_like(kind, np.arange(9.0)).tolist() == [6, 7, 8, 0, 1, 2]
    assert Sockets.of_description(kind.describe()).describe() == kind.describe()


def test_only_a_stated_distance_tells_the_scale():
    kind = Sockets(sockets=("a", "b"), of=np.array([0, 1]))
    assert not kind.tells_scale
    distance = SocketDistance(a="a", b="b", distance=0.1, uncertainty=1e-5)
    assert kind.with_distances((distance,)).tells_scale
    with pytest.raises(CampaignError, match="no row names socket 'x'; there are a, b"):
        kind.with_distances((SocketDistance(a="a", b="x", distance=0.1, uncertainty=1e-5),))

"""The choice of measurements against all choices there are, and its updates against matrices inverted afresh."""

import itertools
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taskcal.estimation import experiment_design
from taskcal.estimation.experiment_design import Candidates, Criterion, choose, choose_at_random
from tests.laws.robots import generators

CRITERIA = get_args(Criterion)

COUNT, OF = 6, 12
CLOSED = ("task", "A", "D")
"""Criteria of the covariance, whose change by a candidate has a closed form; the others are of the spectrum."""
SUBSETS = np.array(list(itertools.combinations(range(OF), COUNT)))


def random_candidates(rng: np.random.Generator, n: int = OF, d: int = 8, block: int = 3, known: int = 0) -> Candidates:
    """Directions and candidates of very different strength; `known` rows measured before."""
    rows = rng.normal(size=(n, block, d)) * rng.uniform(1, 10, (n, 1, 1)) * 10 ** rng.uniform(-1, 0.5, d)
    done, wanted = rng.normal(size=(known, d)), rng.normal(size=(3, d))
    signal = done.T @ done
    return Candidates(rows=rows, prior=np.eye(d) + signal, task=wanted.T @ wanted, signal=signal)


def values(candidates: Candidates, subsets: np.ndarray, criterion: str) -> np.ndarray:
    """The criterion of many choices from its definition, as a quantity of which less is better and zero is the least."""
    X = candidates.rows[subsets].reshape(len(subsets), -1, candidates.rows.shape[2])
    added = np.swapaxes(X, 1, 2) @ X
    d = added.shape[1]
    if criterion in CLOSED:
        C = np.linalg.inv(candidates.prior + added)
        if criterion == "D":
            return np.exp(np.linalg.slogdet(C)[1] / d)
        return np.sqrt((candidates.task * C).sum(axis=(1, 2))) if criterion == "task" else np.einsum("nii->n", C)
    s = np.sqrt(np.maximum(np.linalg.eigvalsh(candidates.signal + added), 0.0))
    low, high = s[:, 0], s[:, -1]
    index = {
        "E": low,
        "O1": s.prod(axis=1) ** (1 / d) / np.sqrt(subsets.shape[1]),
        "O2": low / high,
        "O3": low,
        "O4": low**2 / high,
        "O5": d / (1 / s).sum(axis=1),
    }
    return 1.0 / index[criterion]


@pytest.mark.parametrize("criterion", CRITERIA)
def test_the_choice_is_the_best_of_all_there_are(criterion):
    excess = []
    for seed in range(6 if criterion in CLOSED else 2):
        rng = np.random.default_rng(seed)
        candidates = random_candidates(rng, d=int(rng.choice([4, 8, 14])), known=int(rng.choice([0, 5])))
        found = choose(candidates, COUNT, criterion)
        assert len(set(found.chosen.tolist())) == COUNT
        own = values(candidates, found.chosen[None], criterion)[0]
        excess.append(own / values(candidates, SUBSETS, criterion).min() - 1.0)
    assert np.mean(np.array(excess) < 1e-6) >= 0.9, excess
    assert max(excess) < (0.01 if criterion in CLOSED else 0.1), excess


@pytest.mark.parametrize("criterion", CLOSED)
@given(generators)
@settings(max_examples=3)
def test_no_single_exchange_improves_the_choice(criterion, rng):
    candidates = random_candidates(rng, n=30)
    found = choose(candidates, 8, criterion, sweeps=20)
    own = values(candidates, found.chosen[None], criterion)[0]
    others = np.setdiff1d(np.arange(30), found.chosen)
    exchanged = np.array([np.where(found.chosen == old, new, found.chosen) for old in found.chosen for new in others])
    assert values(candidates, exchanged, criterion).min() > own * (1 - 1e-3)


@pytest.mark.parametrize("criterion", CRITERIA)
@given(generators, st.integers(1, 4), st.integers(1, 2))
@settings(max_examples=2)
def test_the_value_is_that_of_matrices_inverted_afresh(criterion, rng, block, known):
    """Blocks of several targets, and of one row; after all the updates on the way."""
    candidates = random_candidates(rng, n=15, d=6, block=block, known=known * 6)
    found = choose(candidates, 7, criterion)
    own = values(candidates, found.chosen[None], criterion)[0]
    expected = {"task": own, "A": own, "D": 6 * np.log(own)}.get(criterion, -1 / own)
    # E breaks ties at zero by a millionth of the sum of the singular values
    assert found.value == pytest.approx(expected, rel=1e-7, abs=1e-5 if criterion == "E" else 1e-9)


@pytest.mark.parametrize("criterion", ["E", "O1", "O2", "O4"])
def test_shortlist_without_current_candidate_does_no_harm(criterion, monkeypatch):
    """An exchange that turns out worse is taken back, so that the value stays that of the choice."""
    monkeypatch.setattr(experiment_design, "SHORTLIST_SIZE", 2)
    for seed in range(2):
        candidates = random_candidates(np.random.default_rng(seed), n=15, d=6)
        found = choose(candidates, 7, criterion)
        own = values(candidates, found.chosen[None], criterion)[0]
        assert found.value == pytest.approx(-1 / own, rel=1e-5)


@given(generators)
@settings(max_examples=5)
def test_the_greedy_curve_falls_by_what_each_candidate_is_worth(rng):
    candidates = random_candidates(rng, n=25)
    found = choose(candidates, 10, sweeps=0)
    assert np.all(np.diff(found.greedy) <= 1e-12)
    start = np.sqrt(np.trace(candidates.task @ np.linalg.inv(candidates.prior)))
    assert found.greedy[0] < start
    # the first step is the best single candidate, and the last error is that of all of them
    single = values(candidates, np.arange(25)[:, None], "task")
    assert found.greedy[0] == pytest.approx(single.min(), rel=1e-9)
    assert found.value <= found.greedy[-1] * (1 + 1e-9)


def test_the_exchange_improves_on_the_greedy_start():
    found = [choose(random_candidates(np.random.default_rng(seed), n=400, d=14), 14) for seed in range(5)]
    gains = [one.value / one.greedy[-1] for one in found]
    assert max(gains) <= 1 + 1e-9
    assert min(gains) < 0.99


@pytest.mark.parametrize("criterion", ["task", "E", "O2"])
def test_the_same_candidates_give_the_same_choice(criterion):
    first, second = (choose(random_candidates(np.random.default_rng(7), n=20), 7, criterion) for _ in range(2))
    np.testing.assert_array_equal(first.chosen, second.chosen)
    assert (first.value, first.exchanges) == (second.value, second.exchanges)


@pytest.mark.parametrize("criterion", CLOSED)
def test_weighing_a_pool_costs_no_more_than_one_percent(criterion, monkeypatch):
    """The pool is shrunk below the number of candidates, so that most of them are not weighed at most steps."""
    for seed in range(4):
        candidates = random_candidates(np.random.default_rng(seed), n=1500, d=12)
        monkeypatch.setattr(experiment_design, "POOL_SIZE", 10**9)
        everything = values(candidates, choose(candidates, 20, criterion).chosen[None], criterion)[0]
        monkeypatch.setattr(experiment_design, "POOL_SIZE", 150)
        pooled = values(candidates, choose(candidates, 20, criterion).chosen[None], criterion)[0]
        assert pooled <= 1.01 * everything


def test_what_is_known_already_is_not_measured_again():
    """Two directions matter alike; one is known from before, so that the choice goes to the other."""
    rows = np.zeros((20, 1, 2))
    rows[:10, 0, 0] = rows[10:, 0, 1] = np.linspace(1, 2, 10)
    none = np.zeros((2, 2))
    fresh = Candidates(rows=rows, prior=np.eye(2), task=np.eye(2), signal=none)
    known = np.diag([1e4, 0.0])
    extended = replace(fresh, prior=np.eye(2) + known, signal=known)
    for criterion in ("task", "D", "E", "O3"):
        assert sorted(choose(extended, 4, criterion).chosen) == [16, 17, 18, 19]
        assert sorted(choose(fresh, 4, criterion).chosen) == [8, 9, 18, 19]


@given(generators)
@settings(max_examples=4)
def test_prior_information_equals_rows_it_came_from(rng):
    """Extending a measured set gives the error of measured and chosen rows together."""
    candidates = random_candidates(rng, n=30, known=0)
    first = choose(candidates, 5)
    X = candidates.rows[first.chosen].reshape(-1, candidates.rows.shape[2])
    more = choose(replace(candidates, prior=candidates.prior + X.T @ X, signal=X.T @ X), 5)
    together = np.concatenate([first.chosen, more.chosen])[None]
    assert more.value == pytest.approx(values(candidates, together, "task")[0], rel=1e-8)


def test_nil_rows_are_the_last_to_be_chosen():
    """A pose at which no reflector is seen says nothing."""
    candidates = random_candidates(np.random.default_rng(3), n=20)
    rows = candidates.rows.copy()
    rows[::2] = 0.0
    assert np.all(choose(replace(candidates, rows=rows), 9).chosen % 2 == 1)


def test_more_than_there_are_means_all():
    candidates = random_candidates(np.random.default_rng(0), n=5)
    found = choose(candidates, 9)
    assert sorted(found.chosen) == [0, 1, 2, 3, 4]
    assert found.exchanges == 0


def test_e_optimality_ties_are_broken_towards_full_rank():
    """As long as some direction is unseen, E is zero whatever is chosen: what opens most new directions goes first."""
    rng = np.random.default_rng(0)
    d = 6
    basis = np.linalg.qr(rng.normal(size=(d, d)))[0]
    loud = np.stack([100.0 * rng.normal(size=(3, 2)) @ basis[:2] for _ in range(20)])
    halves = np.stack([2.0 * basis[:3], 2.0 * basis[3:]])
    rows = np.concatenate([loud, halves])
    zero = np.zeros((d, d))
    candidates = Candidates(rows=rows, prior=np.eye(d), task=np.eye(d), signal=zero)
    found = choose(candidates, 2, "E")
    assert sorted(found.started) == [20, 21]
    assert found.value == pytest.approx(-2.0, rel=1e-4)


def test_each_group_gets_its_minimum_and_rest_reduce_error():
    """Every group gets its minimum count, and the remaining rows go to those that reduce the error."""
    rng = np.random.default_rng(5)
    of = np.repeat([0, 1, 2], [40, 30, 20])
    rows = rng.normal(size=(90, 2, 5)) * np.array([3.0, 1.0, 0.1])[of, None, None]
    given = {"rows": rows, "prior": np.eye(5), "task": np.eye(5), "signal": np.zeros((5, 5))}
    free = choose(Candidates(**given), 12)
    assert np.bincount(of[free.chosen], minlength=3).min() < 3
    held = choose(Candidates(**given, of=of, fewest=3), 12)
    assert np.bincount(of[held.chosen]).min() == 3
    assert len(set(held.chosen)) == 12
    assert free.value <= held.value
    # groups that have enough anyway change nothing
    np.testing.assert_array_equal(choose(Candidates(**given, of=of * 0, fewest=3), 12).chosen, free.chosen)
    drawn = choose_at_random(Candidates(**given, of=of, fewest=3), 12, rng)
    assert np.bincount(of[drawn]).min() >= 3
    assert len(set(drawn)) == 12

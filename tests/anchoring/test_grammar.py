"""Grammars of symbols: estimated from sequences, and used to label others, against trying all."""

from __future__ import annotations

import json
from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kineme.anchoring.grammar import estimate_grammar, grammar_of_counts, in_order, most_probable, posterior
from kineme.errors import SpecificationError

SEQUENCES = [["reach", "grasp", "carry"], ["reach", "press", "reach", "press"], ["reach", "grasp", "carry"]]


def test_transitions_are_counted_with_begin_and_end():
    grammar = estimate_grammar(SEQUENCES, prior=1e-9)
    reach, grasp, press, carry = map(grammar.symbols.index, ("reach", "grasp", "press", "carry"))
    assert grammar.initial[reach] == pytest.approx(1.0)
    np.testing.assert_allclose(grammar.transitions[reach, [grasp, press]], [0.5, 0.5], atol=1e-6)
    np.testing.assert_allclose(grammar.transitions[press, [reach, -1]], [0.5, 0.5], atol=1e-6)
    assert grammar.transitions[carry, -1] == pytest.approx(1.0)
    assert grammar.counts.sum() == sum(len(sequence) + 1 for sequence in SEQUENCES)


@given(
    sequences=st.lists(st.lists(st.sampled_from("abcd"), max_size=5), min_size=1).filter(any),
    prior=st.floats(1e-3, 10.0),
)
def test_probabilities_are_above_0_and_sum_to_1(sequences, prior):
    grammar = estimate_grammar(sequences, prior=prior)
    assert grammar.transitions.min() > 0
    assert grammar.initial.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(grammar.transitions.sum(axis=1), 1.0)
    json.dumps(grammar.to_dict())


def test_symbols_are_in_the_order_in_which_they_come():
    assert in_order(SEQUENCES) == ["reach", "grasp", "press", "carry"]


def test_a_grammar_says_what_follows_what():
    text = str(estimate_grammar(SEQUENCES, prior=0.01))
    assert text.splitlines()[:2] == ["begin -> reach 1.00", "reach -> grasp 0.50, press 0.50"]


def _paths(grammar, log_likelihoods):
    """Every sequence of symbols with its log probability."""
    n, K = log_likelihoods.shape
    for path in product(range(K), repeat=n):
        logs = np.log(grammar.initial[path[0]]) + np.log(grammar.transitions[path[-1], -1])
        logs += sum(np.log(grammar.transitions[a, b]) for a, b in pairwise(path))
        yield path, logs + log_likelihoods[np.arange(n), path].sum()


@settings(max_examples=20, deadline=None)
@given(n=st.integers(1, 4), seed=st.integers(0, 10_000))
def test_viterbi_and_forward_backward_agree_with_trying_all(n, seed):
    rng = np.random.default_rng(seed)
    grammar = grammar_of_counts("abc", rng.integers(0, 5, (4, 4)).astype(float))
    logs = 3.0 * rng.normal(size=(n, 3))
    paths, totals = zip(*_paths(grammar, logs), strict=True)
    assert tuple(most_probable(grammar, logs)) == paths[int(np.argmax(totals))]
    result = posterior(grammar, logs)
    shares = np.exp(np.array(totals) - np.logaddexp.reduce(totals))
    expected = np.zeros((n, 3))
    for path, share in zip(paths, shares, strict=True):
        expected[np.arange(n), path] += share
    np.testing.assert_allclose(result.probabilities, expected, atol=1e-9)
    assert result.log_probability == pytest.approx(np.logaddexp.reduce(totals))
    assert result.counts.sum() == pytest.approx(n + 1)


def test_order_decides_where_likelihoods_do_not():
    """The piece in the middle looks like both."""
    grammar = estimate_grammar([["open", "lift", "close"]] * 5 + [["open", "lower", "close"]], prior=0.1)
    logs = np.full((3, 4), -9.0)
    logs[0, grammar.symbols.index("open")] = logs[2, grammar.symbols.index("close")] = 0.0
    logs[1] = -1.0
    labels = most_probable(grammar, logs)
    assert [grammar.symbols[k] for k in labels] == ["open", "lift", "close"]


def test_nothing_has_no_labels():
    grammar = estimate_grammar(SEQUENCES)
    assert len(most_probable(grammar, np.empty((0, 4)))) == 0
    assert posterior(grammar, np.empty((0, 4))).counts.sum() == 0


def test_what_is_no_grammar_is_refused():
    with pytest.raises(SpecificationError, match="expected sequences with symbols"):
        estimate_grammar([[]])
    with pytest.raises(SpecificationError, match="got 'wave'"):
        estimate_grammar([["wave"]], symbols=["nod"])
    with pytest.raises(SpecificationError, match="prior"):
        estimate_grammar(SEQUENCES, prior=0.0)
    with pytest.raises(SpecificationError, match="a column for each symbol"):
        most_probable(estimate_grammar(SEQUENCES), np.zeros((2, 3)))

"""What stands under a table follows from its numbers: change them, and the sentence changes."""

import pytest

from kineme_experiments.paper.conclusions import (
    Printed,
    listed,
    read_ahead,
    read_conventions,
    read_counts,
    read_left_out,
    read_nearer,
    read_order,
    read_penalty,
    read_perfect,
    read_placement,
    read_widths,
)


def test_counts_tell_multiples_from_others():
    assert read_counts([0.5, 0.333, 0.4], counted=4, drawn=3) == (
        "The paper counts 4 movements. Of its 3 accuracies in Tables 2 and 4, 1 are multiples of 1/3 and 1 are "
        "multiples of 1/4; 0.400 of neither."
    )
    assert "neither" not in read_counts([0.5, 0.25], counted=4, drawn=3)


@pytest.mark.parametrize(("value", "there"), [(0.5, True), (0.61, False), (0.39, False), (0.4005, True)])
def test_placement_is_the_range_of_the_draws(value, there):
    said = read_placement("RBF", {"w": value}, {"w": [0.4, 0.6]})
    assert said.startswith("RBF: our draws contain the paper's number in")
    assert ("every column" in said) is there
    assert (f"no column: w ({value:.3f} against 0.40-0.60)" in said) is not there


def test_placement_names_the_columns_on_both_sides():
    said = read_placement("RBF", {"w": 0.5, "f": 0.9}, {"w": [0.4, 0.6], "f": [0.4, 0.6]})
    assert said == "RBF: our draws contain the paper's number in w, but not in f (0.900 against 0.40-0.60)."


def test_nearer_goes_with_the_means():
    one, other = {"w": [0.1, 0.3]}, {"w": [0.9, 1.0]}
    assert read_nearer({"w": 0.3}, {"A": one, "B": other}) == "Nearest to the paper's accuracies: A in w."
    assert read_nearer({"w": 0.8}, {"A": one, "B": other}) == "Nearest to the paper's accuracies: B in w."
    assert not read_nearer({"w": 0.8}, {"A": one, "B": one})


def test_order_counts_draws():
    said = read_order("Original", ("f", "w"), [1.0, 0.5, 0.7], [0.9, 0.6, 0.7])
    assert said == "Original: f is ahead of w in 1 of 3 draws, behind in 1 (0.733 against 0.733)."
    assert "equal in all 2 draws" in read_order("Original", ("f", "w"), [1.0, 0.5], [1.0, 0.5])


def test_ahead_turns_round_with_the_means():
    a, b = {"w": [0.9], "f": [1.0]}, {"w": [0.4], "f": [1.0]}
    assert read_ahead("So", ("TrE", "RBF"), a, b) == (
        "So, TrE is ahead of RBF in w (0.900 against 0.400); TrE and RBF are equal in f."
    )
    assert "RBF is ahead of TrE in w (0.900 against 0.400)" in read_ahead("So", ("TrE", "RBF"), b, a)


def test_widths_are_alike_within_a_factor():
    said = read_widths("A", {"w": 100.0, "f": 10.0}, {"w": 140.0, "f": 16.0})
    assert said.endswith("in one of two columns; not in f (10 against 16).")
    assert read_widths("A", {"w": 100.0, "f": 10.0}, {"w": 70.0, "f": 14.0}).endswith("in two of two columns.")


def test_conventions_within_and_nearest():
    said = read_conventions(
        [Printed("w", 0.5, {"A": [0.4, 0.6], "B": [0.7]}), Printed("f", 0.9, {"A": [0.4], "B": [0.7]})]
    )
    assert said == (
        "Within the draws of a convention: w, 0.500 [A: 0.500 (0.40-0.60)]. "
        "Of none, with the nearest: f, 0.900 [B: 0.700 (0.70-0.70)]."
    )


def test_perfect_are_those_without_an_error_in_any_draw():
    assert read_perfect("Perfect", {"A": [1.0, 1.0], "B": [1.0, 0.9]}) == "Perfect: A."
    assert read_perfect("Perfect", {"A": [1.0, 0.9]}) == "Perfect: none."


def test_penalty_explains_a_fall_only_where_the_bound_is_reached():
    def read(low, share):
        return read_penalty({"RBF": {1.0: [low], 10.0: [1.0]}}, {"RBF": [share]}, n_classes=9)

    falls = "RBF falls from 1.000 at C = 10 to 0.200 at C = 1, where chance is 0.111"
    assert read(0.2, 0.88).startswith(f"{falls}: there 88% of the multipliers of the class that lost a movement")
    assert read(0.2, 0.1) == f"{falls}."
    assert read(0.95, 0.88) == "RBF does not fall: 0.950 at C = 1."


def test_left_out():
    assert not read_left_out([])
    assert read_left_out(["Spoon 3"]).startswith("Left out of all columns: Spoon 3. ")


def test_lists():
    assert [listed(items) for items in ([], ["a"], ["a", "b"], ["a", "b", "c"], ["a, x", "b", "c"])] == [
        "", "a", "a and b", "a, b and c", "a, x; b and c"
    ]  # fmt: skip

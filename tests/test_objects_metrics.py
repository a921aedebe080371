"""OSPA and identity metrics against cases worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shenron_rt.errors import InputError
from shenron_rt.objects import identity_metrics, ospa

NOTHING = np.zeros((0, 2))


def _line(*x: float) -> dict[int, np.ndarray]:
    return {i: np.array([v, 0.0]) for i, v in enumerate(x) if not math.isnan(v)}


# ---- OSPA
def test_equal_sets_in_any_order_have_no_distance(rng: np.random.Generator) -> None:
    places = rng.uniform(-50, 50, (6, 2))
    assert ospa(places[rng.permutation(6)], places).total == 0.0


def test_one_pair_is_its_distance_up_to_the_cutoff() -> None:
    origin = np.zeros((1, 2))
    assert ospa(np.array([[3.0, 4.0]]), origin, cutoff_m=7).total == pytest.approx(5.0)
    assert ospa(np.array([[30.0, 40.0]]), origin, cutoff_m=7).total == pytest.approx(7.0)


def test_a_missing_object_costs_the_cutoff_over_the_larger_number() -> None:
    truths = np.array([[0.0, 0.0], [10.0, 0.0], [20.0, 0.0]])
    found = ospa(truths[:2], truths, cutoff_m=6)
    assert found == pytest.approx((2.0, 0.0, 2.0))  # 6 x 1 missing / 3
    assert ospa(truths, truths[:2], cutoff_m=6) == pytest.approx((2.0, 0.0, 2.0))  # a surplus one costs the same
    assert ospa(NOTHING, truths, cutoff_m=6).total == pytest.approx(6.0)
    assert ospa(NOTHING, NOTHING).total == 0.0


def test_place_and_number_add_up_in_powers_of_the_order() -> None:
    truths = np.array([[0.0, 0.0], [9.0, 0.0]])
    found = ospa(np.array([[0.0, 3.0]]), truths, cutoff_m=4, order=2)
    # (3^2 + 4^2 x 1) / 2 under the root
    assert found.total == pytest.approx(math.sqrt((9 + 16) / 2))
    assert found.place**2 + found.number**2 == pytest.approx(found.total**2)


def test_the_assignment_is_the_best_one_not_the_first() -> None:
    # nearest first would pair 1 with 2 at 1 m and leave 0 with 10 at 10 m; the best is 2 m and 9 m, under the cutoff
    assert ospa(np.array([[1.0], [10.0]]), np.array([[0.0], [2.0]]), cutoff_m=100).total == pytest.approx((1 + 8) / 2)


def test_ospa_is_a_metric_on_random_sets(rng: np.random.Generator) -> None:
    for _ in range(50):
        a, b, c = (rng.uniform(-5, 5, (rng.integers(0, 5), 2)) for _ in range(3))
        ab, ba = ospa(a, b, order=2).total, ospa(b, a, order=2).total
        assert ab == pytest.approx(ba)
        assert ab <= ospa(a, c, order=2).total + ospa(c, b, order=2).total + 1e-12


def test_ospa_refuses_a_cutoff_of_nothing() -> None:
    with pytest.raises(InputError, match="cutoff_m must be > 0"):
        ospa(NOTHING, NOTHING, cutoff_m=0)


# ---- identity
def test_perfect_tracks_have_perfect_figures() -> None:
    frames = [_line(k, 50 - k) for k in range(10)]
    found = identity_metrics(frames, [{7 + i: p for i, p in f.items()} for f in frames])
    assert (found.matches, found.misses, found.false_tracks, found.switches, found.fragmentations) == (20, 0, 0, 0, 0)
    assert (found.mota, found.motp, found.idf1) == (1.0, 0.0, 1.0)


def test_a_track_that_is_replaced_half_way_is_one_switch_and_half_the_identity() -> None:
    truths = [_line(k) for k in range(10)]
    tracks = [{(1 if k < 5 else 2): np.array([k, 1.0])} for k in range(10)]
    found = identity_metrics(truths, tracks)
    assert (found.switches, found.fragmentations) == (1, 0)
    assert found.mota == pytest.approx(1 - 1 / 10)
    assert found.motp == pytest.approx(1.0)
    assert found.idf1 == pytest.approx(2 * 5 / (10 + 10))  # one of the two identities counts


def test_a_gap_is_a_fragmentation_but_no_switch_when_the_track_comes_back() -> None:
    truths = [_line(k) for k in range(10)]
    tracks = [{1: np.array([k, 0.0])} if k not in (4, 5) else {} for k in range(10)]
    found = identity_metrics(truths, tracks)
    assert (found.misses, found.fragmentations, found.switches) == (2, 1, 0)
    assert found.mota == pytest.approx(1 - 2 / 10)
    assert found.idf1 == pytest.approx(2 * 8 / (10 + 8))


def test_two_tracks_that_swap_are_two_switches() -> None:
    truths = [_line(0, 10) for _ in range(6)]
    tracks = [{1: f[0 if k < 3 else 1], 2: f[1 if k < 3 else 0]} for k, f in enumerate(truths)]
    assert identity_metrics(truths, tracks).switches == 2


def test_a_pair_that_matched_stays_matched_while_it_is_within_the_gate() -> None:
    # the second track comes nearer than the first, which is still good
    truths = [_line(0.0), _line(0.0)]
    tracks = [{1: np.array([1.0, 0])}, {1: np.array([1.5, 0]), 2: np.array([0.2, 0])}]
    found = identity_metrics(truths, tracks, gate_m=2)
    assert (found.switches, found.false_tracks) == (0, 1)


def test_as_many_pairs_as_possible_are_matched_before_distance_counts() -> None:
    # the nearest pair, 0 with 0.1, would leave 2.9 and 0 ... 2.95 outside the gate
    truths = [{0: np.array([0.0]), 1: np.array([3.0])}]
    tracks = [{5: np.array([0.1]), 6: np.array([-2.8])}]
    found = identity_metrics(truths, tracks, gate_m=2.95)
    assert found.matches == 2


def test_a_track_of_nothing_is_false_in_every_frame() -> None:
    found = identity_metrics([_line(0)] * 4, [{1: np.array([0.0, 0]), 9: np.array([80.0, 0])}] * 4)
    assert (found.matches, found.false_tracks) == (4, 4)
    assert found.mota == 0.0
    assert found.idf1 == pytest.approx(2 * 4 / (4 + 8))


def test_an_object_that_leaves_and_comes_back_has_no_gap() -> None:
    truths = [_line(0), {}, _line(0)]
    tracks = [{1: np.array([0.0, 0])}, {}, {1: np.array([0.0, 0])}]
    assert identity_metrics(truths, tracks).fragmentations == 0


def test_sequences_of_unequal_length_are_refused() -> None:
    with pytest.raises(InputError, match="1 frames of truth and 0 of tracks"):
        identity_metrics([{}], [])

"""Where members stand: every value in its place, whoever put it there."""

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seakeep.errors import RequestError
from seakeep.models import shelf, summaries
from seakeep.models.shelf import Layout, open_shelf

sizes = st.integers(1, 5)


@settings(max_examples=40, deadline=None)
@given(sizes, sizes, st.integers(1, 12), st.integers(1, 3), st.integers(1, 12), st.booleans())
def test_pieces_hold_what_was_put(windows, members, steps, channels, length, shared):
    layout = Layout(windows, members, steps, channels, min(length, steps))
    series = np.random.default_rng(0).normal(size=(members, windows, steps, channels))
    with open_shelf(layout, shared=shared) as kept:
        # A process that works for another has a copy.
        hand = pickle.loads(pickle.dumps(kept)) if shared else kept
        for member in reversed(range(members)):
            hand.put(member, series[member])
        for window in range(windows):
            for piece in range(layout.pieces):
                part = series[:, window, layout.instants(piece)]
                np.testing.assert_array_equal(kept.get(window, piece), part)
        if layout.pieces == 1:
            np.testing.assert_array_equal(kept.all(), series.swapaxes(0, 1))


def test_pieces_of_a_layout_fit_in_their_room(monkeypatch):
    monkeypatch.setattr(shelf, "CHUNK", 8 * 100)
    layout = Layout.in_pieces(2, 10, 23, 2, hands=1)
    assert layout.length == 5
    assert layout.pieces == 5
    assert layout.instants(4) == slice(20, 23)
    assert Layout.in_pieces(2, 10, 23, 2, hands=2).length == 2
    # One instant of all members is the least that can be reduced.
    assert Layout.in_pieces(2, 1000, 23, 2).length == 1


def test_few_members_stay_in_memory_and_many_do_not(monkeypatch, tmp_path):
    monkeypatch.setattr(shelf.tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(shelf, "HELD", 8 * 10)
    for steps, whole, shared, spilled in (
        (10, False, False, False),
        (11, False, False, True),
        (11, True, False, False),
        (10, True, True, True),
    ):
        with open_shelf(Layout(1, 1, steps, 1, steps), whole=whole, shared=shared) as kept:
            assert isinstance(kept, shelf._Spilled) == spilled
            assert bool(list(tmp_path.iterdir())) == shared  # else the file has no name
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("shared", [True, False])
def test_a_temporary_folder_that_cannot_be_used_is_told(monkeypatch, tmp_path, shared):
    monkeypatch.setattr(shelf.tempfile, "tempdir", str(tmp_path / "gone"))
    monkeypatch.setattr(shelf, "HELD", 0)
    with (
        pytest.raises(RequestError, match=r"cannot keep .* folder .*gone: No such file or direct"),
        open_shelf(Layout(1, 1, 4, 1, 4), shared=shared),
    ):
        pass


def test_a_shared_place_that_is_gone_is_told():
    layout = Layout(1, 1, 4, 1, 4)
    with open_shelf(layout, shared=True) as kept:
        hand = pickle.loads(pickle.dumps(kept))
    with pytest.raises(RequestError, match=r"cannot keep 0 MiB of members in the temporary folder"):
        hand.put(0, np.zeros((1, 4, 1)))


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 40), st.floats(0.01, 0.99), st.integers(0, 2**32 - 1))
def test_quantiles_are_those_of_numpy_to_the_last_bit(members, level, seed):
    values = np.random.default_rng(seed).normal(size=(members, 3, 2))
    probabilities = (0.5 - level / 2, 0.5 + level / 2)
    expected = np.quantile(values, probabilities, axis=0)
    np.testing.assert_array_equal(summaries._quantiles(values, probabilities), expected)
    many = np.random.default_rng(seed).normal(size=(summaries.SORTED + 1, 2))
    np.testing.assert_array_equal(
        summaries._quantiles(many, probabilities), np.quantile(many, probabilities, axis=0)
    )

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spectral_core.display.models.curves import ToneCurve
from spectral_core.display.models.lattice import LatticeTable, lattice
from spectral_core.errors import DisplayError


def bent(nodes: int, amount: float = 0.1) -> LatticeTable:
    """A table with channel interaction, its tetrahedra distorted but not folded."""
    at = lattice(nodes)
    return LatticeTable(at + amount * np.sin(2 * at[..., [1, 2, 0]]) * (1 - 0.5 * at))


def test_an_even_lattice_changes_nothing() -> None:
    colours = np.random.default_rng(0).uniform(-0.5, 1.5, (1000, 3))
    table = LatticeTable(lattice(5))
    np.testing.assert_allclose(table.forward(colours), colours, atol=1e-14)
    np.testing.assert_allclose(table.inverse(colours), colours, atol=1e-14)


def test_it_meets_its_nodes() -> None:
    table = bent(6)
    np.testing.assert_allclose(table.forward(lattice(6)), table.nodes, atol=1e-14)


def test_it_agrees_with_the_textbook() -> None:
    """Tetrahedral interpolation written out for one colour: along the lattice in falling order of the rests."""
    table = bent(4)
    for colour in np.random.default_rng(1).uniform(0, 1, (200, 3)):
        at = colour * 3
        cell = np.minimum(at.astype(int), 2)
        rest = at - cell
        corner, value = cell.copy(), table.nodes[tuple(cell)].copy()
        for axis in np.argsort(-rest):
            before = table.nodes[tuple(corner)]
            corner[axis] += 1
            value += rest[axis] * (table.nodes[tuple(corner)] - before)
        np.testing.assert_allclose(table.forward(colour), value, atol=1e-14)


@settings(max_examples=60, deadline=None)
@given(st.integers(2, 12), st.floats(-0.2, 0.2), st.integers(0, 2**32 - 1))
def test_the_inverse_is_exact(nodes: int, amount: float, seed: int) -> None:
    table = bent(nodes, amount)
    colours = np.random.default_rng(seed).uniform(0, 1, (300, 3))
    # Rounding of a solution of three equations.
    np.testing.assert_allclose(table.inverse(table.forward(colours)), colours, atol=1e-12)


def test_outside_it_goes_on_and_what_is_no_number_stays_none() -> None:
    table = bent(9)
    far = np.random.default_rng(2).uniform(-3, 4, (500, 3))
    assert np.isfinite(table.inverse(far)).all()
    assert np.isfinite(table.forward(far)).all()
    odd = np.array([[np.nan, 0.5, 0.5], [0.5, 0.5, 0.5]])
    assert np.isnan(table.inverse(odd)).any(axis=1).tolist() == [True, False]


def test_a_folded_table_is_refused() -> None:
    nodes = lattice(5).copy()
    nodes[2, 2, 2] = nodes[3, 3, 3]
    assert LatticeTable.unfolded(nodes) is None
    with pytest.raises(DisplayError, match="folds"):
        LatticeTable(nodes)


@settings(max_examples=60, deadline=None)
@given(st.integers(2, 400), st.floats(0.2, 6), st.integers(0, 60), st.integers(0, 2**32 - 1))
def test_curves_invert_whatever_their_shape(nodes: int, power: float, flat: int, seed: int) -> None:
    """Flat toes of a billionth a step and steep ends: the segment is found all the same."""
    steps = np.linspace(0, 1, nodes) ** power
    steps[: min(flat, nodes - 1)] = 0
    curve = ToneCurve(np.maximum.accumulate(steps) + 1e-9 * np.arange(nodes))
    drive = np.random.default_rng(seed).uniform(-0.1, 1.2, 500) * curve.values[-1]
    # Drives that lie between two nodes 1e-9 apart are told apart to 1e-16 / 1e-9 of a node.
    np.testing.assert_allclose(curve.forward(curve.inverse(drive)), drive, atol=1e-12)
    np.testing.assert_array_less(-1e-15, np.diff(curve.inverse(np.sort(drive))))

"""Points on every element, shared between neighbours."""

import numpy as np
import pytest

from anmstrip.fem.geometry import SECTION
from anmstrip.fem.sampling import patches, shape_of, unit_grid
from anmstrip.fem.strip import Material, Strip, grid, line

XS, STEEL = np.array([-1.0, -0.7, 0.0, 1.0]), Material(2e11, 0.3)
STRIPS = {
    "quad": Strip(grid(XS, np.array([-0.2, 0.1, 0.3])), 1e-3, STEEL),
    "triangle": Strip(grid(XS, np.array([-0.2, 0.1, 0.3])).to_meshtri(), 1e-3, STEEL),
    "line": Strip(line(XS), 1e-3, STEEL, SECTION),
}
LOCAL = {
    "quad": unit_grid(3, 3),
    "triangle": np.array([[0.0, 0.5, 1.0, 0.0, 0.5, 0.0], [0.0, 0.0, 0.0, 0.5, 0.5, 1.0]]),
    "line": unit_grid(3),
}
COUNTS = {"quad": 7 * 5, "triangle": 7 * 5, "line": 7}


@pytest.mark.parametrize("kind", STRIPS)
def test_neighbours_share_points(kind: str) -> None:
    strip = STRIPS[kind]
    patch = patches(strip, LOCAL[kind])
    assert shape_of(strip) == kind
    assert patch.reference.shape == (3, COUNTS[kind])
    assert set(patch.cells.ravel()) == set(range(COUNTS[kind]))
    places = strip.basis.mapping.F(LOCAL[kind])
    found = patch.reference[: len(places), patch.cells]
    np.testing.assert_allclose(found, places, atol=1e-12)


@pytest.mark.parametrize("kind", STRIPS)
def test_functions_add_up_to_one_at_every_point(kind: str) -> None:
    """The functions that belong to values alone are a partition of unity."""
    strip = STRIPS[kind]
    patch = patches(strip, LOCAL[kind])
    values = np.zeros(strip.scalars)
    values[strip.node_values] = 1.0
    total = np.einsum(
        "nep,ne->ep",
        np.stack([np.asarray(f) for f in patch.functions]),
        values[strip.basis.element_dofs],
    )
    np.testing.assert_allclose(total, 1.0, atol=1e-12)

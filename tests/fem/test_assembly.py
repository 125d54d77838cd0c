"""Tangents from derivatives at points, by machine code and by numpy, beside Lᵀ w J L."""

import numpy as np
import pytest

from anmstrip.fem import operators, sampling
from anmstrip.fem.geometry import SECTION
from anmstrip.fem.strip import Material, Strip, grid, line
from anmstrip.taylor.program import COMPILED

XS, STEEL = np.array([-0.5, -0.2, 0.0, 0.1, 0.5]), Material(2e9, 0.3)
MESH = grid(XS, np.array([-0.2, 0.1, 0.3]))
STRIPS = {
    "quad": Strip(MESH, 1e-3, STEEL),
    "triangle": Strip(MESH.to_meshtri(), 1e-3, STEEL),
    "line": Strip(line(XS), 1e-3, STEEL, SECTION),
}
OPERATORS = {
    "first": lambda strip: operators.CellOperator(strip, [1]),
    "both": lambda strip: operators.CellOperator(strip, (1, 2)),
    "contact": sampling.ContactOperator,
    "slopes": sampling.SlopeOperator,
}


def rows_of(parts, strip, points):
    """Return L, (rows, points, unknowns), and the weights of its rows, (rows, points)."""
    found, weights = {}, {}
    for part in parts:
        entries = part.matrix.toarray().reshape(-1, points, part.matrix.shape[1])
        for c in range(part.count):
            for k, each in enumerate(entries):
                whole = np.zeros((points, strip.unknowns))
                whole[:, c :: part.count] = each
                number = part.row + k * part.step + c * part.stride
                found[number] = whole
                weights[number] = part.weights.reshape(-1, points)[k]
    order = sorted(found)
    return np.array([found[n] for n in order]), np.array([weights[n] for n in order])


@pytest.fixture(params=[True, False], ids=["machine code", "numpy"])
def compiled(request, monkeypatch):
    for module in (operators, sampling):
        monkeypatch.setattr(module, "COMPILED", COMPILED and request.param)


@pytest.mark.parametrize("kind", OPERATORS)
@pytest.mark.parametrize("name", STRIPS)
@pytest.mark.usefixtures("compiled")
def test_tangent_is_the_product_of_its_factors(name, kind):
    strip = STRIPS[name]
    operator, pattern = OPERATORS[kind](strip), operators.Pattern(strip)
    parts, rng = operator.matrices, np.random.default_rng(3)
    given, _ = rows_of(parts[0], strip, operator.points)
    forces, weights = rows_of(parts[1], strip, operator.points)
    derivative = rng.standard_normal((len(given), len(forces), operator.points))
    shape = derivative.shape
    if kind in ("first", "both"):
        shape = (strip.count, operator.components) * 2 + shape[2:]
        if kind == "both":  # of a law with a potential
            operator.symmetric = True
            derivative = derivative + derivative.swapaxes(0, 1)
    wide = np.zeros((*derivative.shape[:2], operator.points + 3))  # as programs give it
    wide[..., : operator.points] = derivative
    blocks = pattern.zeros()
    operator.add_tangent(wide[..., : operator.points].reshape(shape), pattern, blocks)
    found = pattern.restricted(np.arange(strip.unknowns)).matrix(blocks).toarray()
    expected = np.einsum("ipm,ip,jip,jpn->mn", forces, weights, derivative, given, optimize=True)
    np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())

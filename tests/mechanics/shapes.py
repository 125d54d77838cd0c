"""States of a strip that are known in closed form, as unknowns."""

import numpy as np


def unknowns(strip, position, along, across, mixed):
    """Displacement from r, ∂r/∂x, ∂r/∂y, ∂²r/∂x∂y at the nodes, each (3, nodes)."""
    flat = [strip.nodes, np.eye(3)[:, :1], np.eye(3)[:, 1:2], np.zeros((3, 1))]
    u = np.zeros((strip.scalars, 3))
    for dofs, field, reference in zip(
        strip.basis.nodal_dofs, (position, along, across, mixed), flat, strict=True
    ):
        u[dofs] = (np.asarray(field) - reference).T
    return u.ravel()


def linear(strip, matrix, offset=(0.0, 0.0, 0.0)):
    """r = A X + b."""
    matrix, offset = np.asarray(matrix), np.asarray(offset)[:, None]
    nothing = np.zeros((3, 1))
    return unknowns(strip, matrix @ strip.nodes + offset, matrix[:, :1], matrix[:, 1:2], nothing)


def rolled(strip, radius):
    """Bent, without stretch, over a cylinder along y with its top at the origin."""
    x, y, _ = strip.nodes
    angle, zero = x / radius, np.zeros_like(x)
    position = np.stack([radius * np.sin(angle), y, radius * (np.cos(angle) - 1.0)])
    along = np.stack([np.cos(angle), zero, -np.sin(angle)])
    return unknowns(strip, position, along, np.array([[0.0], [1.0], [0.0]]), np.zeros((3, 1)))


def rotation(rng):
    """A random finite rotation."""
    q, r = np.linalg.qr(rng.standard_normal((3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.sign(np.linalg.det(q))

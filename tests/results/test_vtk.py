"""States are read by VTK as they were written."""

import numpy as np
import pytest

from anmstrip.mechanics.roller import Roller
from anmstrip.results.vtk import (
    LAGRANGE_ORDER,
    TRIANGLE_LATTICE,
    TRIANGLE_ORDER,
    read_surface,
    roller_surface,
    subdivide,
    write_rollers,
    write_surface,
)
from wrapped_strip import RADIUS, lattice, tensor_grids, triangular_lattices

pyvista = pytest.importorskip("pyvista", exc_type=ImportError, reason="VTK cannot be imported")


def height(x, y):
    """A bicubic without symmetry, so that any exchange of two nodes shows."""
    return x**3 - 0.3 * x**2 * y + 0.7 * x * y**3 + 0.2 * y**2


@pytest.fixture
def patch(tmp_path):
    """A file with two cubic cells on the graph of `height`, and what went into it."""
    x, y = lattice(2, 1, (0.0, 2.0), (0.0, 1.0))
    points = np.column_stack([x, y, height(x, y)])
    fields = {"gap": x * y, "velocity": points**2}
    write_surface(tmp_path / "patch.vtu", points, tensor_grids(2, 1), fields)
    return tmp_path / "patch.vtu", points, fields


def smooth(path):
    grid = pyvista.read(path)
    return grid.extract_surface(nonlinear_subdivision=4, algorithm="dataset_surface")


def triangle_areas(points, cells):
    """Vectors (m, 3): half the cross product of the diagonals."""
    quads = points[cells]
    return 0.5 * np.cross(quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1])


def test_the_order_of_nodes_is_a_permutation_with_corners_first():
    assert sorted(LAGRANGE_ORDER) == list(range(16))
    assert list(LAGRANGE_ORDER[:4]) == [0, 3, 15, 12]


def test_vtk_draws_a_bicubic_exactly(patch):
    path, _, _ = patch
    assert list(pyvista.read(path).celltypes) == [70, 70]
    surface = smooth(path)
    x, y, z = surface.points.T.astype(float)
    assert len(x) > 300
    np.testing.assert_allclose(z, height(x, y), atol=2e-6)
    np.testing.assert_allclose(surface["gap"], x * y, atol=2e-6)


def test_vtk_finds_the_area_of_a_cylindrical_patch(tmp_path):
    s, y = lattice(2, 1, (-0.3, 0.3), (0.0, 1.0))
    points = np.column_stack([RADIUS * np.sin(s / RADIUS), y, RADIUS * np.cos(s / RADIUS)])
    write_surface(tmp_path / "arc.vtu", points, tensor_grids(2, 1), {})
    assert smooth(tmp_path / "arc.vtu").area == pytest.approx(0.6, rel=1e-4)


def test_vtk_reads_points_and_fields_to_the_last_bit(patch):
    path, points, fields = patch
    grid = pyvista.read(path)
    np.testing.assert_array_equal(grid.points, points)
    assert set(grid.point_data) == set(fields)
    for name, values in fields.items():
        np.testing.assert_array_equal(grid[name], values)


def test_a_surface_is_read_back_as_it_was_written(patch):
    path, points, fields = patch
    surface = read_surface(path)
    np.testing.assert_array_equal(surface.points, points)
    np.testing.assert_array_equal(surface.cells, tensor_grids(2, 1))
    assert set(surface.fields) == set(fields)
    for name, values in fields.items():
        np.testing.assert_array_equal(surface.fields[name], values)


def test_a_subdivided_patch_keeps_its_area_and_its_side():
    x, y = lattice(2, 3, (0.0, 2.0), (0.0, 3.0))
    cells = subdivide(tensor_grids(2, 3))
    areas = triangle_areas(np.column_stack([x, y, 0.0 * x]), cells)
    assert cells.shape == (54, 4)
    np.testing.assert_allclose(areas, np.tile([0.0, 0.0, 1.0 / 9.0], (54, 1)), atol=1e-14)


def test_a_subdivided_patch_is_written_as_plain_quadrilaterals(patch, tmp_path):
    _, points, fields = patch
    cells = subdivide(tensor_grids(2, 1))
    write_surface(tmp_path / "plain.vtu", points, cells, fields)
    grid = pyvista.read(tmp_path / "plain.vtu")
    assert list(grid.celltypes) == [9] * 18
    np.testing.assert_array_equal(grid.cells.reshape(-1, 5)[:, 1:], cells)
    np.testing.assert_array_equal(read_surface(tmp_path / "plain.vtu").cells, cells)


def quintic(x, y):
    """Without symmetry, of full degree in every direction."""
    return x**5 - 0.6 * x**4 * y + 0.8 * x**2 * y**3 + 0.5 * x * y**4 - 0.7 * y**5 + x * y


@pytest.fixture
def triangles(tmp_path):
    """A file with four quintic triangles on the graph of `quintic`, and what went into it."""
    x, y, cells = triangular_lattices(2, 1, (0.0, 2.0), (0.0, 1.0))
    points = np.column_stack([x, y, quintic(x, y)])
    write_surface(tmp_path / "triangles.vtu", points, cells, {"gap": x * y, "velocity": points})
    return tmp_path / "triangles.vtu", points, cells


def test_the_order_of_a_triangle_s_nodes_is_that_of_vtk():
    vtk = pytest.importorskip("vtkmodules.vtkCommonDataModel")
    cell, lattice_points = vtk.vtkLagrangeTriangle(), TRIANGLE_LATTICE
    cell.GetPointIds().SetNumberOfIds(21)
    cell.GetPoints().SetNumberOfPoints(21)
    cell.Initialize()
    for k, place in enumerate(TRIANGLE_ORDER):
        index = [0, 0, 0]
        cell.ToBarycentricIndex(k, index)
        np.testing.assert_allclose(lattice_points[:, place], index[:2])


def test_vtk_draws_a_quintic_exactly(triangles):
    path, _, _ = triangles
    assert list(pyvista.read(path).celltypes) == [69] * 4
    surface = smooth(path)
    x, y, z = surface.points.T.astype(float)
    assert len(x) > 300
    np.testing.assert_allclose(z, quintic(x, y), atol=1e-5)
    np.testing.assert_allclose(surface["gap"], x * y, atol=2e-6)


def test_triangles_are_read_back_as_they_were_written(triangles):
    path, points, cells = triangles
    surface = read_surface(path)
    np.testing.assert_array_equal(surface.points, points)
    np.testing.assert_array_equal(surface.cells, cells)
    np.testing.assert_array_equal(surface.fields["velocity"], points)


def test_subdivided_triangles_keep_their_area_and_their_side(triangles):
    _, points, cells = triangles
    pieces = subdivide(cells)
    assert pieces.shape == (100, 3)
    np.testing.assert_array_equal(np.unique(pieces), np.arange(84))
    first, second = (points[pieces[:, k], :2] - points[pieces[:, 0], :2] for k in (1, 2))
    doubled = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    np.testing.assert_allclose(doubled, 1.0 / 25.0, atol=1e-14)


def test_subdivided_triangles_are_written_as_plain_ones(triangles, tmp_path):
    _, points, cells = triangles
    pieces = subdivide(cells)
    write_surface(tmp_path / "plain.vtu", points, pieces, {})
    grid = pyvista.read(tmp_path / "plain.vtu")
    assert list(grid.celltypes) == [5] * 100
    np.testing.assert_array_equal(grid.cells.reshape(-1, 4)[:, 1:], pieces)
    surface = read_surface(tmp_path / "plain.vtu")
    np.testing.assert_array_equal(surface.cells, pieces)
    np.testing.assert_array_equal(subdivide(surface.cells), pieces)


@pytest.mark.parametrize(
    ("points", "cells", "fields", "about"),
    [
        (np.zeros((4, 2)), [[0, 1, 2, 3]], {}, "points"),
        (np.zeros((4, 3)), [[0, 1]], {}, "cells"),
        (np.zeros((4, 3)), [[0, 1, 2, 3]], {"gap": np.zeros(5)}, "gap"),
    ],
)
def test_shapes_that_do_not_fit_are_refused(tmp_path, points, cells, fields, about):
    with pytest.raises(ValueError, match=about):
        write_surface(tmp_path / "bad.vtu", points, cells, fields)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9])
def test_a_damaged_file_is_named(patch, share):
    path, _, _ = patch
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(ValueError, match=r"patch\.vtu is damaged"):
        read_surface(path)


def test_a_cylinder_is_closed_and_faces_outwards():
    centre, sectors = np.array([1.0, 2.0, 3.0]), 48
    roller = roller_surface(Roller("r", 0.5, centre, (0.0, 2.0, 0.0)), 1.2, sectors=sectors)
    areas = triangle_areas(roller.points, roller.cells)
    outwards = roller.points[roller.cells].mean(axis=1) - centre
    assert np.all(np.sum(areas * outwards, axis=1) > 0.0)
    np.testing.assert_allclose(areas.sum(axis=0), 0.0, atol=1e-14)
    turn = 2.0 * np.pi / sectors
    mantle, end = 2.0 * sectors * 0.5 * np.sin(turn / 2.0) * 1.2, sectors / 8.0 * np.sin(turn)
    assert np.linalg.norm(areas, axis=1).sum() == pytest.approx(mantle + 2.0 * end)


def test_a_profile_is_drawn():
    """A frustum of radii 0.4 and 0.6: volume π h (a² + a b + b²)/3 by the divergence theorem."""
    cone = roller_surface(Roller("r", 0.5, (0.0, 0.0, 0.0), crown=(0.1,)), 2.0)
    areas = triangle_areas(cone.points, cone.cells)
    middles = cone.points[cone.cells].mean(axis=1)
    assert np.abs(areas.sum(axis=0)).max() < 1e-14
    assert (areas * middles).sum() / 3.0 == pytest.approx(np.pi * 2.0 * 0.76 / 3.0, rel=2e-3)


@pytest.mark.parametrize("axis", [(0.0, 1.0, 0.0), (0.1, 1.0, 0.2), (0.0, 0.0, 1.0)])
def test_a_cylinder_turns_right_handed_and_carries_its_paint(axis):
    roller = Roller("r", 0.5, (0.0, 0.0, 0.0), axis)
    still, turned = roller_surface(roller, 1.2), roller_surface(roller, 1.2, angle=1e-4)
    np.testing.assert_array_equal(turned.fields["surface_angle"], still.fields["surface_angle"])
    along = np.array(axis) / np.linalg.norm(axis)
    np.testing.assert_allclose(
        turned.points - still.points, 1e-4 * np.cross(along, still.points), atol=1e-8
    )


def test_the_top_of_a_roller_moves_towards_the_exit():
    roller = roller_surface(Roller("r", 0.5, (0.0, 0.0, 0.0)), 1.0, angle=0.1)
    mark = roller.points[1]
    assert roller.fields["surface_angle"][1] == 0.0
    np.testing.assert_allclose(mark, [0.5 * np.sin(0.1), -0.5, 0.5 * np.cos(0.1)])


def test_all_rollers_of_a_state_share_a_file(tmp_path):
    rollers = [Roller("r", 0.5, (x, 0.0, 0.0)) for x in (0.0, 2.0, 5.0)]
    write_rollers(tmp_path / "rollers.vtu", rollers, [0.0] * 3, 1.0)
    surface = read_surface(tmp_path / "rollers.vtu")
    for k, x in enumerate((0.0, 2.0, 5.0)):
        cells = surface.cells[np.all(surface.fields["roller"][surface.cells] == k, axis=1)]
        assert len(cells) == 3 * 96
        low, high = (bound(surface.points[cells][..., 0]) for bound in (np.min, np.max))
        assert (low, high) == (pytest.approx(x - 0.5), pytest.approx(x + 0.5))

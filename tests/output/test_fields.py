"""Labels, units and the numbers that colour a picture."""

import numpy as np
import pytest

from anmstrip.pictures.render import choices, title
from anmstrip.results.vtk import FIELDS, scalars


@pytest.mark.parametrize(
    ("name", "largest", "expected"),
    [
        ("normal_pressure", 2.0e4, ("normal pressure [kPa]", 1e-3)),
        ("normal_pressure", 0.0, ("normal pressure [Pa]", 1.0)),
        ("von_mises", 3.0e8, ("von Mises stress, top [MPa]", 1e-6)),
        ("displacement", 2.0e-3, ("displacement [mm]", 1e3)),
        ("membrane_force", 999.0, ("membrane force, xx [N/m]", 1.0)),
        ("membrane_force.xy", 1000.0, ("membrane force, xy [kN/m]", 1e-3)),
        ("mean_curvature", 5.0e3, ("mean curvature [1/m]", 1.0)),
        ("gap", 1.0e-30, ("gap [µm]", 1e6)),
        ("home_made", 5.0e3, ("home made", 1.0)),
    ],
)
def test_the_title_has_a_unit_for_numbers_below_a_thousand(name, largest, expected):
    label, factor = title(name, largest)
    assert label == expected[0]
    assert factor == pytest.approx(expected[1])


def test_every_field_of_a_state_has_a_unit():
    fields = """displacement velocity normal_pressure friction_traction slip_velocity gap
        membrane_force bending_moment von_mises mean_curvature"""
    assert all(FIELDS[name].unit for name in fields.split())


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("velocity", np.sqrt([14.0, 77.0])),
        ("velocity.y", [2.0, 5.0]),
        ("bending_moment", [1.0, 4.0]),
        ("bending_moment.xy", [3.0, 6.0]),
    ],
)
def test_a_field_becomes_one_number_per_point(name, expected):
    values = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    np.testing.assert_allclose(scalars(name, values), expected)


def test_components_can_be_asked_for():
    assert choices(["gap", "membrane_force"]) == [
        "gap",
        "membrane_force",
        "membrane_force.xx",
        "membrane_force.yy",
        "membrane_force.xy",
    ]

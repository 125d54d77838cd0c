"""anmstrip: thin metal strip over rollers, with contact and friction, by Taylor series.

These are the public names.  Code, messages and documentation share the notation:

======  =====================  =====================================  ======  ======================
symbol  name                   meaning                                unit    where
======  =====================  =====================================  ======  ======================
u       displacement           of the mid-surface from the reference  m       fem.strip
v       velocity               du/dt                                  m/s     timestepping.formulas
a       path parameter         of a series                            1       continuation.path
λ       control                load factor, or share of a stage       1       continuation.path
N       order                  highest order of the series            1       continuation.expansion
E, ν    young, poisson         elasticity of the material             Pa, 1   fem.strip
t       thickness              of the strip                           m       fem.strip
D       bending stiffness      E t³ / 12 (1 − ν²)                     N m     mechanics.shell
T       tension                force per width                        N/m     results.state
r       radius                 of a roller                            m       mechanics.roller
n       normal                 of a roller, towards the strip         1       mechanics.roller
h       gap                    distance to a roller, negative inside  m       mechanics.roller
R_N     pressure, reaction     of a roller or obstacle, normal to it  Pa, N   mechanics.laws
p₀, w   pressure, width        R_N = p₀ exp(−h/w), the default        Pa, m   mechanics.laws
K       stiffness              of a penalty, R_N (R_N/K + h) = η δ    Pa/m    mechanics.laws
η, δ    eta, delta             of a penalty; η (δ − h) in eq. (5c)    Pa, m   mechanics.laws
R_T     traction               −f R_N ‖v‖^(q−1) v_s / V_c^q, (5d)     Pa, N   mechanics.laws
v_s     slip                   tangential velocity on a roller        m/s     mechanics.contact
f, q    coefficient, exponent  of friction                            1       mechanics.laws
ω, V_c  omega, speed           corner and characteristic speed        1, m/s  mechanics.laws
======  =====================  =====================================  ======  ======================

Modules in the last column are those of ``anmstrip`` that define or compute the quantity.
Equation numbers are those of Béchet, Lejeune & Potier-Ferry (2010).
"""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import version
from typing import Any

_NAMES = {
    "continuation.bifurcations": "switch_branch watch_singular_points",
    "continuation.follow": "Settings follow",
    "continuation.path": "Branch Equations Path",
    "driver.accuracy": "Accuracy accuracy",
    "driver.run": "Run",
    "driver.scene": "Scene",
    "errors": "InputError",
    "fem.geometry": "reference_surface",
    "fem.sampling": "ContactOperator",
    "fem.strip": "Material Strip grid",
    "linalg.solvers": "DenseSolver Remembering SparseSolver",
    "mechanics.effects": "Effect LawEffect",
    "mechanics.laws": "Algebraic ContactLaw FrictionLaw NortonHoff Tanh "
    "Signorini RepulsiveSignorini GradedSignorini",
    "mechanics.plasticity": "FlowLaw",
    "mechanics.roller": "Roller",
    "taylor.series": "Series record taylor_series",
}
_DOORS = {name: f"anmstrip.{module}" for module, names in _NAMES.items() for name in names.split()}

__all__ = sorted(_DOORS)  # noqa: PLE0605


def __getattr__(name: str) -> Any:
    """Import what is asked for, when it is asked for."""
    if name == "__version__":
        return version(__name__)
    if name not in _DOORS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_DOORS[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_DOORS])

"""anmstrip: thin metal strip over rollers, with contact and friction, by Taylor series.

The public door.  Notation, shared by code, messages and documentation:

======  ====================  ==========================================  ======  ===============
symbol  name                  meaning                                     unit    where
======  ====================  ==========================================  ======  ===============
u       displacement          of the mid-surface from the flat strip      m       strip
v       velocity              du/dt                                       m/s     implicit_dae
a       path parameter        of a series                                 1       expansion
λ       control               load factor, or share of a time step        1       continuation
N       order                 highest order of the series                 1       expansion
E, ν    young, poisson        elasticity of the material                  Pa, 1   strip
t       thickness             of the strip                                m       strip
D       bending stiffness     E t³ / 12 (1 − ν²)                          N m     bending
T       tension               force per width                             N/m     measures
r       radius                of a roller                                 m       roller
n       normal                of a roller, towards the strip              1       roller
h       gap                   distance to a roller, negative inside       m       roller
R_N     pressure, reaction    R (R/K + h) = η δ or η (δ − h), eq. (5c)    Pa, N   signorini
K       stiffness             of contact                                  Pa/m    signorini
η, δ    eta, delta            regularisation of contact                   Pa, m   signorini
p₀, w   pressure, onset       R_N = p₀ (√(h² + w²) − h)² / w²             Pa, m   signorini
R_T     traction              −f R_N |v_s|^(q−1) v_s / V_c^q, (2), (5d)   Pa, N   friction
v_s     slip                  tangential velocity relative to a surface   m/s     contact
f, q    coefficient, exponent of friction                                 1       friction
ω, V_c  omega, speed          corner and characteristic speed             1, m/s  friction
======  ====================  ==========================================  ======  ===============

Equation numbers are those of Béchet, Lejeune & Potier-Ferry (2010).
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

_DOORS = {
    "Scene": "anmstrip.driver.scene",
    "InputError": "anmstrip.errors",
    "Roller": "anmstrip.mechanics.roller",
    "Material": "anmstrip.fem.strip",
    "Run": "anmstrip.driver.run",
    "Effect": "anmstrip.mechanics.effects",
    "LawEffect": "anmstrip.mechanics.effects",
    "ContactLaw": "anmstrip.mechanics.laws",
    "FrictionLaw": "anmstrip.mechanics.laws",
    "ContactOperator": "anmstrip.fem.sampling",
    "Strip": "anmstrip.fem.strip",
    "grid": "anmstrip.fem.strip",
    "Signorini": "anmstrip.mechanics.laws",
    "RepulsiveSignorini": "anmstrip.mechanics.laws",
    "GradedSignorini": "anmstrip.mechanics.laws",
    "NortonHoff": "anmstrip.mechanics.laws",
    "Tanh": "anmstrip.mechanics.laws",
    "Series": "anmstrip.taylor.series",
    "record": "anmstrip.taylor.series",
    "taylor": "anmstrip.taylor.series",
    "Branch": "anmstrip.continuation.path",
    "Path": "anmstrip.continuation.path",
    "Settings": "anmstrip.continuation.follow",
    "follow": "anmstrip.continuation.follow",
    "reference_surface": "anmstrip.fem.geometry",
    "Remembering": "anmstrip.linalg.solvers",
    "watched": "anmstrip.continuation.bifurcations",
    "switched": "anmstrip.continuation.bifurcations",
}

__all__ = sorted(_DOORS)  # noqa: PLE0605


def __getattr__(name: str) -> Any:
    """Import what is asked for, when it is asked for."""
    if name not in _DOORS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_DOORS[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_DOORS])

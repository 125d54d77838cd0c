"""Finite elements: C1 elements, the strip's mesh, operators and constraints."""

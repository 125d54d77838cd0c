"""Numerical continuation: solution paths R(u, λ) = 0 as series, branch after branch."""

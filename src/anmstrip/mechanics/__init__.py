"""Mechanics: what strains, loads and rollers do to a strip."""

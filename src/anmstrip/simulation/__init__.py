"""Simulation: from a scene to equations, and along them through its stages."""

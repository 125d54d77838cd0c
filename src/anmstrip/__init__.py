"""anmstrip."""

"""A run from its warnings to its outcome."""

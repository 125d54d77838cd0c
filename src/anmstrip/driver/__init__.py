"""A run from its warnings to its outcome, and studies of many."""

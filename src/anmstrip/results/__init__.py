"""Results: what is read off a state, and the files that hold it."""

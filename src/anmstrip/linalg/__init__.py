"""Linear algebra: one factorisation, many right-hand sides."""

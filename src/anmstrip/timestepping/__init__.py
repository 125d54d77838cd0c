"""Time integration of index-1 systems R(u, v, t) = 0 with u' = v."""

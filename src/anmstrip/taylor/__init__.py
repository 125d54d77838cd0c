"""Truncated power series of numpy expressions, recorded once and computed order by order.

A law is a plain function of arrays.  :func:`anmstrip.taylor.series.record` calls it once on
:class:`~anmstrip.taylor.series.Series`, which note the operations on a
:class:`~anmstrip.taylor.tape.Tape`.  The result is a :class:`~anmstrip.taylor.program.Program`:
scalar instructions on rows, where a row is one component at all points.  Started at a state, it
gives order after order, and the derivative.  Two executors run the same instructions: loops
that numba compiles (:mod:`~anmstrip.taylor.kernels`), and numpy.  What depends on polynomials
alone, values and roots, is in :mod:`~anmstrip.taylor.polynomials`.
"""

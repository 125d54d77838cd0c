"""Truncated power series on which plain numpy expressions run.

A law written for floats, ``law(x)``, is called once on :class:`Series` made by
a :class:`Tape`.  The call computes order 0 and records the operations; the tape
then finds order after order, each from the ones below, by the classical
recurrences (see :mod:`anmstrip.series.recurrences` and its neighbours).  All orders up to N cost
O(N²) multiplications, and nothing is traced again.

Every recurrence splits an order into what is known from the orders below, and
a part that is linear in the same order of the operands.  The split gives three
things from one recording:

* the order-k coefficient as if the input's were zero (:meth:`Tape.advance`),
  which is a right-hand side of the asymptotic numerical method,
* the completion by the input's coefficient once it is solved for
  (:meth:`Tape.correct`),
* the derivative of the law (:meth:`Tape.derivative`), from which the tangent
  is assembled: the same linear part, seeded with unit vectors.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .arrangements import Index, LinearMap, Sum
from .dispatch import COMPARISONS, FUNCTIONS, UFUNCS
from .recurrences import Operation

Array = NDArray[np.float64]


class Series(np.lib.mixins.NDArrayOperatorsMixin):
    """An array whose entries are truncated power series of one parameter.

    A series lives as long as its tape is kept.

    Attributes
    ----------
    coefficients : ndarray, shape (order + 1, *shape)
        Taylor coefficients; ``coefficients[0]`` is the value.
    value : ndarray
        Order 0.
    operation : Operation or None
        How the series is computed; ``None`` for an input.
    shape, ndim
        Of one coefficient.
    """

    __slots__ = ("_coefficients", "_tape", "known", "ndim", "operation", "shape", "value")
    __array_priority__ = 1000
    __hash__ = object.__hash__

    def __init__(self, tape: Tape, value: Array, operation: Operation | None = None) -> None:
        self._tape = weakref.ref(tape)  # no cycle: memory is free as soon as the tape is
        self._coefficients: Array | None = None
        self.value = value
        self.operation = operation
        self.shape, self.ndim = value.shape, value.ndim
        self.known: Array | None = None

    @property
    def tape(self) -> Tape:
        """Where the operations on this series are recorded."""
        tape = self._tape()
        if tape is None:
            raise ReferenceError("the tape of this series has gone; keep it while using the series")
        return tape

    @property
    def coefficients(self) -> Array:
        """Taylor coefficients, made when they are asked for."""
        if self._coefficients is None:
            self._coefficients = np.zeros((self.tape.order + 1, *self.shape))
            self._coefficients[0] = self.value
        return self._coefficients

    def __repr__(self) -> str:
        return f"Series(shape={self.shape}, order={self.tape.order})"

    def __getitem__(self, index: Any) -> Series:
        return self.tape.record(Index(self, index))

    def sum(self, axis: int | None = None) -> Series:
        """Sum along one axis, or over all of them."""
        return self.tape.record(Sum(self, axis))

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        if method != "__call__" or options:
            return NotImplemented
        if ufunc in COMPARISONS:
            return ufunc(*(x.value if isinstance(x, Series) else x for x in inputs))
        build = UFUNCS.get(ufunc)
        return NotImplemented if build is None else build(self.tape, *inputs)

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> Any:
        build = FUNCTIONS.get(function)
        return NotImplemented if build is None else build(self.tape, *args, **kwargs)


class Tape:
    """Record of the operations of a law, advanced order by order.

    Parameters
    ----------
    order : int
        Highest order N.

    Examples
    --------
    The series of sqrt(1 + a):

    >>> tape = Tape(order=3)
    >>> x = tape.variable(1.0)
    >>> y = np.sqrt(x)
    >>> x.coefficients[1] = 1.0
    >>> for k in (1, 2, 3):
    ...     tape.advance(k)
    >>> [float(c) for c in y.coefficients]
    [1.0, 0.5, -0.125, 0.0625]
    """

    def __init__(self, order: int) -> None:
        self.order = order
        self.inputs: list[Series] = []
        self.computed: list[tuple[Series, Operation]] = []
        self.places: dict[Series, int] = {}
        self.needs: list[tuple[int, ...]] = []
        self.bound = False

    @property
    def nbytes(self) -> int:
        """Memory of all recorded coefficients (bytes)."""
        recorded = [*self.inputs, *(series for series, _ in self.computed)]
        return sum(series.coefficients.nbytes for series in recorded)

    def variable(self, value: ArrayLike) -> Series:
        """New input; its higher coefficients are the caller's to set."""
        series = Series(self, np.array(value, dtype=float))
        self.inputs.append(series)
        self.places[series] = -len(self.inputs)
        return series

    def record(self, operation: Operation) -> Series:
        """Compute order 0 of an operation and remember it."""
        series = Series(self, operation.start(), operation)
        operation.value = series.value
        self.places[series] = len(self.computed)
        self.needs.append(tuple(self.places[x] for x in operation.operands))
        self.computed.append((series, operation))
        return series

    def advance(self, k: int) -> None:
        """Compute order k of all recorded series from the inputs' order k as it stands."""
        self._bind()
        for series in self.inputs:
            coefficient = series.coefficients[k]
            series.known = coefficient if coefficient.any() else None
        for series, operation in self.computed:
            known = operation.at(k, [x.known for x in operation.operands])
            series.coefficients[k] = 0.0 if known is None else known
            series.known = known

    def correct(self, k: int, changes: Mapping[Series, Array]) -> None:
        """Add ``changes`` to order k of inputs and carry them through, order k only."""
        self._bind()
        for series, given in changes.items():
            series.coefficients[k] += given
        for (series, _), change in zip(self.computed, self._propagated(changes), strict=False):
            if change is not None:
                series.coefficients[k] += change

    def derivative(self, output: Series, seeds: Mapping[Series, Array]) -> Array:
        """Directional derivatives of ``output`` at order 0.

        Parameters
        ----------
        output : Series
            Recorded series.
        seeds : mapping
            Input → directions, shape (*input.shape) or (batch, *input.shape).

        Returns
        -------
        ndarray, shape (*output.shape) or (batch, *output.shape)
        """
        change = self._propagated(seeds)[self.places[output]]
        if change is not None:
            return change
        batch = next((s.shape[: s.ndim - x.ndim] for x, s in seeds.items()), ())
        return np.zeros((*batch, *output.shape))

    def _bind(self) -> None:
        """Give the operations their coefficients, when the orders begin."""
        if not self.bound:
            for series, operation in self.computed:
                operation.result = series.coefficients
            self.bound = True

    def _propagated(self, changes: Mapping[Series, Array]) -> list[Array | None]:
        """Changes of all computed series, then of the inputs, the last one first."""
        found: list[Array | None] = [None] * (len(self.computed) + len(self.inputs))
        for series, change in changes.items():
            found[self.places[series]] = np.asarray(change)
        for place, ((_, operation), needs) in enumerate(
            zip(self.computed, self.needs, strict=True)
        ):
            found[place] = operation.linear([found[i] for i in needs])
        return found


class Recorded:
    """Orders of one series of a tape, interpreted in numpy.

    Parameters
    ----------
    tape : Tape
    output : Series
        The series that is asked for.
    """

    def __init__(self, tape: Tape, output: Series) -> None:
        self.tape, self.output = tape, output

    def advance(self, k: int) -> Array:
        """Order k of the output as if the inputs' order k were zero."""
        self.tape.advance(k)
        return self.output.coefficients[k]

    def correct(self, k: int, changes: Mapping[Series, Array]) -> None:
        """Fix order k of the inputs."""
        self.tape.correct(k, changes)

    def derivative(self, seeds: Mapping[Series, Array]) -> Array:
        """Directional derivatives of the output, as :meth:`Tape.derivative`."""
        return self.tape.derivative(self.output, seeds)


def taylor(law: Callable[..., Series], *inputs: ArrayLike) -> Array:
    """Taylor coefficients of ``law`` along inputs given by theirs.

    Parameters
    ----------
    law : callable
        Function of as many arrays as there are inputs, written in numpy.
    *inputs : array_like, shape (order + 1, ...)
        Coefficients of each argument.

    Returns
    -------
    ndarray, shape (order + 1, ...)

    Examples
    --------
    >>> taylor(np.exp, [0.0, 1.0, 0.0])
    array([1. , 1. , 0.5])
    """
    given = [np.asarray(c, dtype=float) for c in inputs]
    tape = Tape(len(given[0]) - 1)
    arguments = [tape.variable(c[0]) for c in given]
    output = law(*arguments)
    for argument, coefficients in zip(arguments, given, strict=True):
        argument.coefficients[:] = coefficients
    for k in range(1, tape.order + 1):
        tape.advance(k)
    return output.coefficients


def value_at(coefficients: Array, a: float) -> Any:
    """Value of a series at parameter ``a``; ``coefficients`` has the orders first.

    What order 0 is changed by is summed first, so that it is rounded once.
    """
    if coefficients.ndim == 1:
        value = 0.0
        for c in reversed(coefficients.tolist()):
            value = value * a + c
        return value
    powers = a ** np.arange(1.0, len(coefficients))
    changes = coefficients[1:].reshape(len(powers), coefficients[0].size)
    return coefficients[0] + (powers @ changes).reshape(coefficients.shape[1:])


def derivative_coefficients(coefficients: Array) -> Array:
    """Coefficients of the derivative of a series, one order less."""
    orders = np.arange(1, len(coefficients))
    return coefficients[1:] * orders.reshape((-1,) + (1,) * (coefficients.ndim - 1))


def linear_map(operator: Callable[[Array], Array], x: Series) -> Series:
    """Image of a series under a linear function of arrays (constant, no offset).

    ``operator`` is called on one coefficient at a time.
    """
    return x.tape.record(LinearMap(operator, x))

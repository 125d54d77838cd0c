"""Machine code of the kernels: made by numba once, kept in files, and loaded without numba.

To import numba and to let it find its own files takes half a second, more than a small strip; the
machine code alone needs llvmlite, a library of mathematics, and 0.06 s.
"""

from __future__ import annotations

import ctypes
import hashlib
import logging
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite
import llvmlite.binding as llvm
import numpy as np

from anmstrip.arrays import Array, Index
from anmstrip.taylor.tape import ADVANCE, ASSEMBLE, CALL, DERIVATIVES, Tables

RETURN_BUFFER = ctypes.create_string_buffer(16)
"""Where numba's functions put that they have nothing to return, and no error."""

DIGEST_SIZE = hashlib.sha256().digest_size
LOADED_CODE: list[Any] = []
"""Loaded code, which goes with its engine."""

CACHE_FAILURES: list[str] = []
"""Why machine code cannot be kept, once that was told."""


def directories() -> list[Path]:
    """Return where machine code may be kept, the best place first."""
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        return [Path(chosen)]
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser())
    return [Path(__file__).parent / "__pycache__", home / "anmstrip"]


@cache
def compiled_run() -> Callable[..., None]:
    """Return :func:`anmstrip.taylor.kernels.run`, as a function of addresses and numbers."""
    for initialise in (llvm.initialize_native_target, llvm.initialize_native_asmprinter):
        initialise()
    target = llvm.Target.from_default_triple()
    cpu, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    machine = target.create_target_machine(cpu=cpu, features=features, opt=3)
    code = machine_code(machine, f"{llvmlite.__version__} {cpu} {features}")
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    LOADED_CODE.append(engine)
    types = [*3 * [ctypes.c_void_p], *4 * [ctypes.c_int64]]
    return ctypes.CFUNCTYPE(None, *types)(engine.get_function_address("run"))


def machine_code(machine: llvm.TargetMachine, host: str) -> bytes:
    """Return the code for this processor, as an object file, kept or made."""
    here = Path(__file__).parent
    texts = [(here / module).read_bytes() for module in ("kernels.py", "tape.py")]
    key = hashlib.sha256(b"".join([host.encode(), *texts])).hexdigest()[:16]
    places = [directory / f"anmstrip-{key}.o" for directory in directories()]
    for place in places:
        with suppress(OSError):
            kept = place.read_bytes()
            if hashlib.sha256(kept[DIGEST_SIZE:]).digest() == kept[:DIGEST_SIZE]:
                return kept[DIGEST_SIZE:]
    code = portable_code(machine)
    store(hashlib.sha256(code).digest() + code, places)
    return code


def portable_code(machine: llvm.TargetMachine) -> bytes:
    """Return the code, with nothing of numba's own."""
    from anmstrip.taylor.kernels import instructions

    text, native = instructions()
    module = llvm.parse_assembly(text)
    for function in module.functions:
        if not function.is_declaration and function.name != native:
            function.linkage = "internal"
    module.get_function(native).name = "run"
    passes = llvm.create_new_module_pass_manager()
    passes.add_global_dead_code_eliminate_pass()
    passes.run(module, llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options()))
    code: bytes = machine.emit_object(module)
    return code


def store(content: bytes, places: list[Path]) -> None:
    """Write a file to the first place where that can be done whole, or tell that there is none."""
    reason = "neither the package nor the home directory can be written"
    for place in places:
        aside = place.with_suffix(f".{os.getpid()}")
        try:
            place.parent.mkdir(parents=True, exist_ok=True)
            aside.write_bytes(content)
            aside.replace(place)
            return
        except OSError as error:
            reason = str(error)
            with suppress(OSError):
                aside.unlink()
    if not CACHE_FAILURES:
        CACHE_FAILURES.append(reason)
        logging.getLogger(__name__).warning(
            "Compiled kernels cannot be kept (%s): each run compiles them again. "
            "Set NUMBA_CACHE_DIR to a directory that can be written.",
            reason,
        )


def addresses(*arrays: Any) -> list[int]:
    """Return where the entries of arrays are."""
    return [x.__array_interface__["data"][0] for x in arrays]


def table_of(calls: Sequence[Sequence[int]]) -> Array:
    """Return calls as rows of numbers, see :func:`anmstrip.taylor.kernels.run`."""
    return np.array([[*call, *(CALL - len(call)) * [0]] for call in calls], dtype=np.int64)


def script(table: Array) -> Callable[..., None]:
    """Return what makes the calls of a table one after the other.

    It is given an order, and the address of coefficients and how many orders they have.
    """
    run, address, count = compiled_run(), table.ctypes.data, len(table)

    def make_calls(k: int, w: int = 0, orders: int = 0, kept: Array = table) -> None:
        run(RETURN_BUFFER, RETURN_BUFFER, address, count, k, w, orders)

    return make_calls


def add_blocks(
    table: Array, weights: Array, derivative: Array, places: Index, pairs: Array, symmetric: bool
) -> None:
    """Add the element matrices ∫ Bᵀ J B to entries of a tangent.

    Parameters
    ----------
    table : ndarray, shape (elements, points, components, functions)
        B: derivatives of the functions of each element at its points.
    weights : ndarray, shape (elements · points,)
    derivative : ndarray, shape (count · components · count · components, elements · points)
        J[j, b, i, a]: change of force (i, a) with derivative (j, b).
    places : ndarray of int, shape (elements, functions²)
        Where each entry of an element's matrix, by row and column, belongs.
    pairs : ndarray, shape (count, count, couplings)
        By row and column component; changed in place.
    symmetric : bool
        Whether J[j, b, i, a] is J[i, a, j, b].
    """
    if derivative.strides[1] != derivative.itemsize:
        derivative = derivative.copy()
    table, weights = map(np.ascontiguousarray, (table, weights))
    places = np.ascontiguousarray(places, dtype=np.int64)
    count, components, functions = len(pairs), *table.shape[2:]
    stride = derivative.strides[0] // derivative.itemsize
    sizes = np.array([*table.shape, count, pairs.shape[2], stride, symmetric])
    inside = np.empty((table.shape[1] * components, functions)), np.empty(functions)
    given = addresses(table, weights, derivative, places, pairs, *inside, sizes)
    script(table_of([[ASSEMBLE, *given]]))(0)


class CompiledExecutor:
    """Runs the instructions of a program in compiled loops."""

    block = 512
    """Points that are treated at once: loops over them outlast what surrounds them, and what is
    kept of them still fits in a core's cache (measured; 64 takes 1.4 times as long)."""

    def __init__(self, tables: Tables) -> None:
        self.tables = tables
        count, blocks, lanes = tables.constants.shape
        rows, inputs, outputs = len(tables.kept), len(tables.inputs), len(tables.outputs)
        places = int(tables.kept.max(initial=-1)) + 1
        sizes = [len(tables.code), rows, inputs, outputs, blocks, lanes, places, count]
        self.sizes = np.array(sizes, dtype=np.int64)
        self.now, self.change = np.zeros((2, rows, lanes))
        self.fixed = addresses(*tables, self.sizes)
        self.inside = addresses(self.now, self.change)

    def advancing(self, given: int, changes: int, found: int, pending: bool) -> list[int]:
        """Call that completes an order by changes if they are pending, and finds the next one."""
        return [ADVANCE, *self.fixed, given, changes, found, *self.inside, pending]

    def changing(self, seeds: int, found: int, most: int) -> list[int]:
        """Call that finds first changes of the outputs."""
        return [DERIVATIVES, *self.fixed, seeds, found, self.inside[1], most]

    def advance(self, w: Array, k: int, given: Array, changes: Array | None) -> Array:
        """Order k of the outputs, see :class:`anmstrip.taylor.program.Executor`."""
        found, pending = np.empty((len(self.tables.outputs), *given.shape[1:])), changes is not None
        begin, changed, end = addresses(given, given if changes is None else changes, found)
        call = table_of([self.advancing(begin, changed, end, pending)])
        script(call)(k, w.ctypes.data, w.shape[2])
        return found

    def derivative(self, w: Array, seeds: Array) -> Array:
        """Changes of the outputs, see :class:`anmstrip.taylor.program.Executor`."""
        found = np.empty((len(seeds), len(self.tables.outputs), *seeds.shape[2:]))
        begin, end = addresses(seeds, found)
        call = table_of([self.changing(begin, end, len(seeds))])
        script(call)(1, w.ctypes.data, w.shape[2])
        return found

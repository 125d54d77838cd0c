"""Rollers that touch the faces of the strip, half its thickness from the mid-surface."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from threaded import ended, roller, scene_of, values

from anmstrip.advice.preview import Preview
from anmstrip.advice.warnings import warnings
from anmstrip.driver.scene import Scene
from anmstrip.errors import InputError
from anmstrip.fem.sampling import ContactOperator
from anmstrip.simulation.problem import Assembly, flat_gap

THICKNESS = 4e-3


def pinch(distance: float, faces: bool) -> Scene:
    """A flat strip between two rollers whose axes are so far apart."""
    rollers = [
        {"name": "below", "radius": 0.2, "centre": (0.0, 0.0, -0.5 * distance)},
        {"name": "above", "radius": 0.2, "centre": (0.0, 0.0, 0.5 * distance)},
    ]
    return Scene.model_validate({
        "strip": {"kinematics": "section", "length": 1.0, "width": 0.5, "thickness": THICKNESS,
                  "cells": (20, 1)},
        "material": {"young": 2e11, "poisson": 0.3},
        "contact": {"onset": 1e-5, "pressure": 1e4, "faces": faces},
        "rollers": rollers,
        "edges": {"entry": {"fixed": ["x", "z"]}, "exit": {"fixed": ["z"]}},
        "stages": [{"duration": 1.0, "exit": {"force": [1e4, 0.0, 0.0]}}],
    })  # fmt: skip


@pytest.mark.parametrize("spare", [0.0, 1e-4])
def test_the_gap_of_facing_rollers_is_the_strip_and_what_is_spare(spare: float) -> None:
    """The nip is r + r + t wide between the axes, and half of the spare room is on either side."""
    assembly = Assembly(pinch(0.4 + THICKNESS + spare, True))
    operator = ContactOperator(assembly.strip)
    middle = int(np.abs(operator.reference[0]).argmin())
    still = operator.apply(np.zeros(assembly.strip.unknowns))
    for contact, own in zip(assembly.contact.by_roller.values(), assembly.rollers, strict=True):
        controls = {f"rollers.{own.name}.centre": np.array(own.centre)}
        gap = contact.seen(still, controls).gap
        assert gap[middle] == pytest.approx(0.5 * spare, abs=1e-15)
        assert flat_gap(assembly.strip, own) == pytest.approx(0.5 * spare, abs=1e-15)


def test_a_strip_does_not_go_through_a_gap_that_is_too_narrow() -> None:
    with pytest.raises(InputError, match=r"inside|outside"):
        _ = Assembly(pinch(0.4 + 0.9 * THICKNESS, True)).strip
    assert Assembly(pinch(0.4 + 0.9 * THICKNESS, False)).strip


@pytest.mark.parametrize(
    ("gap", "faces", "words"),
    [
        (1.0 * THICKNESS, False, ""),
        (0.5 * THICKNESS, False, "leave a gap of 0.002 m to a strip of 0.004 m, and touch its"),
        (1.0 * THICKNESS, True, "leave a gap of 0.004 m to a strip of 0.004 m, and press it"),
        (1.1 * THICKNESS, True, ""),
    ],
)
def test_a_nip_no_wider_than_the_strip_is_told(gap: float, faces: bool, words: str) -> None:
    told = [w for w in warnings(Preview.of(Assembly(pinch(0.4 + gap, faces)))) if "gap" in w]
    assert bool(told) == bool(words)
    assert words in "".join(told)


def bridle(faces: bool, apart: float) -> dict[str, Any]:
    """An S-wrap of two rollers whose surfaces are so far apart."""
    distance = 0.4 + apart
    return {
        "strip": {"thickness": THICKNESS, "refined": 0.02},
        "contact": {"stiffness": None, "eta": None, "delta": None, "faces": faces},
        "threading": {"tension": 1e5, "entry": (-1.0, 0.0, 0.2), "exit": (1.0, 0.0, -0.2)},
        "rollers": [roller("a", 0.0, 0.0, 0.2, "over"), roller("b", 0.0, -distance, 0.2, "under")],
    }


def test_a_threaded_strip_is_wrapped_half_its_thickness_away() -> None:
    """Its mid-surface at r + t/2, up to the contact's onset; runs between circles of that size."""
    tables = bridle(True, 0.3)
    tables["contact"] = {
        "onset": 1e-5,
        "stiffness": None,
        "eta": None,
        "delta": None,
        "faces": True,
    }
    run, state = ended(scene_of(tables))
    at = values(run, state)
    for one in run.scene.rollers:
        away = np.hypot(at[0] - one.centre[0], at[2] - one.centre[2])
        on = np.abs(away - 0.2) < 0.5 * THICKNESS + 2e-5
        assert on.sum() > 5
        assert away.min() == pytest.approx(0.2 + 0.5 * THICKNESS, abs=5e-5)
    path = run.assembly.thread.middle
    radius = 0.2 + 0.5 * THICKNESS
    inner = np.sqrt(0.7**2 - (2.0 * radius) ** 2)
    assert np.diff(path.starts[:, 0])[2] == pytest.approx(inner, rel=1e-12)


def test_a_strip_needs_room_between_rollers_that_it_passes_between() -> None:
    for faces, apart, fits in ((True, 1.01, True), (True, 0.99, False), (False, 0.99, True)):
        assembly = Assembly(scene_of(bridle(faces, apart * THICKNESS)))
        if fits:
            assert assembly.thread is not None
            continue
        with pytest.raises(InputError, match="wrap on a or b, which press the strip between them"):
            _ = assembly.thread


def test_pinch_rolls_at_pass_line_are_proposed_without_a_wrap() -> None:
    """The strip, half its thickness above the deflector, passes a quarter of it above the lower."""
    tables: dict[str, Any] = {
        "strip": {"thickness": 1e-3},
        "contact": {"faces": True},
        "threading": {"tension": 4e3, "entry": (-1.0, 0.0, -0.4), "exit": (3.0, 0.0, 0.0)},
        "rollers": [
            roller("deflector", 0.0, -0.2, 0.2, "over"),
            roller("lower", 1.5, -0.1005, 0.1, "over"),
            {"name": "upper", "radius": 0.1, "centre": [1.5, 0.0, 0.1005]},
        ],
    }
    with pytest.raises(
        InputError, match=r"no wrap: the strip passes between it and upper, or wrap"
    ):
        _ = Assembly(scene_of(tables)).thread
    del tables["rollers"][1]["wrap"]
    thread = Assembly(scene_of(tables)).thread
    assert thread is not None and list(thread.turns) == ["deflector"]

"""Strips that are bent by their buckling mode, and what is told of wrinkles."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse.linalg import ArpackError
from threaded import ONE, ended, scene_of

from anmstrip.advice.warnings import buckled_section
from anmstrip.driver.explain import explain
from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.errors import InputError
from anmstrip.fem.sampling import l2_projection, quadrature_points
from anmstrip.results.fields import FieldSampler
from anmstrip.results.wrinkles import Wrinkling
from anmstrip.simulation.march import imperfection_of

LENGTH, WIDTH, THICKNESS, YOUNG = 1.0, 0.4, 1e-3, 2e11
EULER = np.pi**2 * YOUNG * THICKNESS**3 / 12.0 / LENGTH**2
"""Of the strip as a beam, N/m; ν is 0."""

HEIGHT = 1e-6


def pressed(share: float, **strip: object) -> Scene:
    """A strip between two edges that are held in z, pressed by a share of Euler's force."""
    force = [-share * EULER, 0.0, 0.0]
    return Scene.model_validate(
        {
            "strip": {
                "length": LENGTH, "width": WIDTH, "thickness": THICKNESS, "cells": [8, 2], **strip
            },
            "material": {"young": YOUNG, "poisson": 0.0},
            "edges": {"entry": {"fixed": ["x", "z"], "centred": True},
                      "exit": {"fixed": ["z"], "centred": True}},
            "stages": [{"name": "press", "duration": 1.0, "exit": {"force": force}}],
        }
    )  # fmt: skip


def bent(mode: int = 1, amplitude: float = HEIGHT) -> dict[str, object]:
    return {"mode": mode, "amplitude": amplitude}


def middle(full, strip) -> float:
    """Largest height of the nodes (m)."""
    return float(np.abs(full.reshape(-1, 3)[strip.node_values, 2]).max())


@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
def test_imperfection_grows_as_the_load_nears_its_limit(share):
    """Height a / (1 − N/N_c): mean curvature a q² makes moments that N amplifies."""
    run, state = ended(pressed(share, imperfection=bent()))
    height = middle(state.full, run.assembly.strip)
    assert height == pytest.approx(HEIGHT / (1.0 - share), rel=1e-3)


@pytest.mark.parametrize("mode", [1, 2, 3])
def test_shape_is_a_mode_of_the_amplitude_that_was_asked_for(mode):
    scene = pressed(0.5, imperfection=bent(mode, 3e-4))
    shape = imperfection_of(scene).reshape(-1, 3)
    strip = scene.run().assembly.strip
    nodes = shape[strip.node_values]
    assert np.abs(shape[:, :2]).max() == 0.0
    assert np.abs(nodes[:, 2]).max() == pytest.approx(3e-4, rel=0.02)
    waves = np.sin(mode * np.pi * (strip.nodes[0] / LENGTH + 0.5))
    expected = waves * np.sign(waves @ nodes[:, 2]) * 3e-4
    np.testing.assert_allclose(nodes[:, 2], expected, atol=0.02 * 3e-4)


def test_perfect_strip_stays_flat_and_bends_isometrically():
    run, state = ended(pressed(0.9))
    assert middle(state.full, run.assembly.strip) == 0.0
    assert run.assembly.imperfection is None


def test_nothing_that_compresses_is_refused():
    with pytest.raises(InputError, match="nothing compresses") as error:
        pressed(-0.5, imperfection=bent()).run()
    assert error.value.mistakes[0].key == "strip.imperfection"


def test_compression_far_from_buckling_is_refused(monkeypatch):
    """Half of Euler's force has to grow twofold."""
    monkeypatch.setattr("anmstrip.simulation.march.MAX_COMPRESSION_GROWTH", 1.9)
    with pytest.raises(InputError, match="would take 2 times as much to buckle it"):
        pressed(0.5, imperfection=bent()).run()
    monkeypatch.setattr("anmstrip.simulation.march.MAX_COMPRESSION_GROWTH", 2.1)
    assert pressed(0.5, imperfection=bent()).run().assembly.imperfection is not None


@pytest.mark.parametrize(
    ("others", "words"),
    [
        ({"kinematics": "plate"}, '"shell" or "section" with'),
        ({"bending": False}, "without bending does nothing"),
        ({"feed": True}, "fresh strip is flat"),
        ({"imperfection": {"amplitude": 0.0}}, "strip.imperfection.amplitude"),
        ({"imperfection": {"mode": 0, "amplitude": 1e-4}}, "strip.imperfection.mode"),
    ],
)
def test_what_cannot_be_is_refused(others, words):
    with pytest.raises(ValueError, match=words):
        pressed(0.5, **({"imperfection": bent()} | others))


def test_explain_names_the_imperfection_and_solves_nothing():
    text = explain(pressed(0.5, imperfection=bent(2, 1e-4)))
    assert "Bent without stress by 0.0001 m, by mode 2 of buckling" in text
    assert "Bent" not in explain(pressed(0.5))


def test_moments_count_from_the_imperfect_strip():
    """N times the height in the middle, of a strip that is bent without moments."""
    run, state = ended(pressed(0.6, imperfection=bent()))
    surface = FieldSampler(run.assembly.strip)
    moments = np.abs(surface.sample(state)["bending_moment"][:, 0])
    assert moments.max() == pytest.approx(0.6 * EULER * HEIGHT / 0.4, rel=0.02)


# what is told -----------------------------------------------------------------------


def wavy(height: float, waves: int = 4):
    """A flat strip at rest, lifted by waves across that fade along, tilted and bowed."""
    run = pressed(0.5, cells=[8, 24]).run()
    *_, last = run
    strip = run.assembly.strip
    x, y, _ = quadrature_points(strip)
    wave = height * np.cos(2.0 * waves * np.pi * y / WIDTH) * np.cos(np.pi * x / LENGTH)
    lifted = np.stack([0.0 * x, 0.0 * x, wave + 0.1 * x + 0.01 * y + 0.02 * y**2])
    return replace(last.state, full=l2_projection(strip, run.assembly.pattern, lifted))


def test_amplitude_is_that_of_the_waves_alone():
    height, spacing = Wrinkling(wavy(1e-4)).wave()
    assert height == pytest.approx(1e-4, rel=0.1)
    assert spacing == pytest.approx(WIDTH / 4, rel=0.05)
    assert Wrinkling(wavy(0.0)).wave()[0] < 1e-12


def test_span_is_told_with_its_compression():
    """Along, all of the width; it bears Euler's force, as its ends may turn."""
    _, state = ended(pressed(0.4))
    (span,) = Wrinkling(state).spans
    assert span.points.all()  # no side force acts on the nodes that are centred
    assert (span.before, span.after) == ("the entry", "the exit")
    assert span.compression == pytest.approx(0.4 * EULER, rel=1e-3)
    assert span.share == pytest.approx(1.0)
    assert span.bearable == pytest.approx(EULER, rel=1e-3)
    assert Wrinkling(state).warnings == []
    _, near = ended(pressed(0.9))
    assert (
        f"by a rule of thumb it wrinkles above about {EULER:.3g} N/m" in Wrinkling(near).warnings[0]
    )


def test_compression_by_a_node_that_is_centred_is_left_out():
    """A strip in tension that is pulled to the side: 1.4, 3.0 and 6.3 kN/m on these meshes."""
    force, found = [1e4, 300.0, 0.0], list[float]()
    for cells in ((8, 4), (16, 8), (32, 16)):
        tables = pressed(0.5, cells=cells).model_dump(exclude_unset=True)
        tables["edges"]["exit"]["centred"] = False
        tables["stages"] = [{"name": "pull", "duration": 1.0, "exit": {"force": force}}]
        _, state = ended(Scene.model_validate(tables))
        found.append(Wrinkling(state).compression)
        assert Wrinkling(state).warnings == []
    assert found[2] < 1.2 * found[0]
    assert found[2] < 1.7 * force[1]


def test_spans_lie_between_rollers():
    _, state = ended(scene_of(ONE, "shell", strip={"cells": (16, 2), "refined": 0.02}))
    spans = Wrinkling(state).spans
    assert [(s.before, s.after) for s in spans] == [("the entry", "a"), ("a", "the exit")]
    assert spans[0].end < spans[1].start
    assert Wrinkling(state).warnings == []


def test_summary_of_a_shell_tells_of_wrinkles(tmp_path):
    run = pressed(2.5).run(tmp_path)
    for _ in run:
        pass
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert summary["wrinkle_amplitude"] == pytest.approx(0.0, abs=1e-12)
    assert summary["compressive_membrane_force"] == pytest.approx(2.5 * EULER, rel=1e-3)
    assert summary["warnings"] == run.warnings
    unstable, near = run.warnings
    assert "not stable" in unstable
    assert "by a rule of thumb it wrinkles above" in near


@pytest.mark.parametrize(
    ("share", "coil_set", "yields", "told"),
    [(0.9, 0.0, False, 0), (1.5, 0.0, False, 1), (1.5, 1e-3, False, 0), (1.5, 0.0, True, 1)],
)
def test_a_straight_section_is_told_that_it_has_buckled(
    share: float, coil_set: float, yields: bool, told: int
) -> None:
    """Above Euler's force between two ends that turn; one that is bowed may bear more.

    Strip that can yield may have lost the bow that is proposed of other strip.
    """
    shape = {"coil_set": coil_set} if coil_set else {}
    tables = pressed(share, kinematics="section", **shape).model_dump(exclude_unset=True)
    tables["edges"] = {"entry": {"fixed": ["x", "z"]}, "exit": {"fixed": ["z"]}}
    if yields:
        tables["material"] |= {"yield_stress": 3e8, "plasticity": {}}
    run, state = ended(Scene.model_validate(tables))
    found = list(buckled_section(state, run.scene))
    assert ["bears unbuckled" in words for words in found] == [True] * told
    assert ["coil_set" in words for words in found] == [not yields] * told


def test_a_section_that_has_buckled_in_an_earlier_stage_is_told(tmp_path) -> None:
    """Pressed and pulled again, by a run that is resumed while it is pulled: its end is stable."""
    tables = pressed(1.5, kinematics="section").model_dump(exclude_unset=True)
    tables["edges"] = {"entry": {"fixed": ["x", "z"]}, "exit": {"fixed": ["z"]}}
    tables["stages"] = [*tables["stages"], {"name": "pull", "exit": {"force": [1e3, 0.0, 0.0]}}]
    run = Run(Scene.model_validate(tables), tmp_path)
    for step in run:
        if step.state.plan.name == "pull":
            break
    run.interrupted()
    run = Run(Scene.model_validate(tables), tmp_path, resume=True)
    for _ in run:
        pass
    (words,) = (each for each in run.warnings if "bears unbuckled" in each)
    assert words.startswith("at the end of stage press the strip is pressed")


@pytest.mark.parametrize(("length", "heat"), [(0.5, 200.0), (3.0, 20.0)])
def test_a_heated_section_buckles_as_it_is_told_to_be_typed(length: float, heat: float) -> None:
    """Heat that is held back is hundreds of times what it bears: steps left the buckled branch.

    On it the column bears Euler's π² D/L², a little less while it is bowed from the beginning.
    """
    tables = {
        "strip": {"kinematics": "section", "length": length, "width": 0.1, "thickness": 1e-3,
                  "bending": "kirchhoff-love"},
        "material": {"young": 2e11, "poisson": 0.3, "expansion": 1.2e-5},
        "edges": {name: {"fixed": ["x", "z"]} for name in ("entry", "exit")},
        "stages": [{"name": "heat", "strip": {"temperature": heat}}],
    }  # fmt: skip
    scene = Scene.from_tables(tables, "column.toml")
    _, straight = ended(scene)
    (words,) = buckled_section(straight, scene)
    scene = Scene.from_tables(tables, "column.toml", re.findall(r"--set (\S+)", words))
    run, bowed = ended(scene)
    euler = np.pi**2 * 2e11 * 1e-9 / 12.0 / 0.91 / length**2
    assert not list(buckled_section(bowed, scene)) and run.cost.expansions <= 40
    assert -bowed.membrane_forces[0, 0].mean() == pytest.approx(euler, rel=0.03)


def test_section_does_not_pay(tmp_path, monkeypatch):
    """Neither in words nor in time: nothing looks for wrinkles."""
    for name in ("Wrinkling", "WrinkleWatch"):
        monkeypatch.setattr(f"anmstrip.driver.run.{name}", None)
    for _ in pressed(0.5, kinematics="section").run(tmp_path):
        pass
    assert not json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))["warnings"]


def test_modes_that_are_not_found_end_no_run(tmp_path, monkeypatch):
    """Past buckling as if the strip were perfect, where ARPACK gives up; it is told how often."""

    def failing(*given, **ways):
        raise ArpackError(3)

    scene = pressed(1.2)
    assert any(told["kind"] == "wrinkles" for told in run_of(scene, tmp_path / "found").wrinkles)
    monkeypatch.setattr("anmstrip.results.wrinkles.eigsh", failing)
    run = run_of(scene, tmp_path / "missed")
    assert run.outcome.done
    assert run.wrinkles == []
    assert run.onsets is not None
    sentence = f"Buckling modes were not found in {run.onsets.missed} states"
    assert any(told.startswith(sentence) for told in run.warnings)


def run_of(scene, directory):
    run = scene.run(directory)
    list(run)
    return run

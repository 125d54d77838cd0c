"""Reports of runs and studies: one HTML file with tables, plots and a view that turns."""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Iterable, Mapping
from html import escape
from importlib.resources import files
from itertools import takewhile
from math import isfinite
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anmstrip.errors import InputError, Mistake
from anmstrip.results import vtk
from anmstrip.results.files import AnyPath, atomic_write, error_rows, read_history, read_json

MAX_TIMES, MAX_STATIONS, MAX_HISTORY_STEPS, MAX_SURFACE_POINTS = 40, 400, 2000, 12_000
"""Instants and stations of profiles, steps of the history and points of the surface that a report
keeps: with ten rollers these make about 3 MB, beside the 4.8 MB of plotly's own code."""

Columns = Mapping[str, NDArray[np.float64] | list[str]]
"""Of a table, by their names."""

PLOT_DIGITS = 5
"""Significant digits of numbers in plots; the files of the run have all of them."""

COLUMN_UNITS = {
    **dict.fromkeys(("arc_length", "x", "y", "z"), "m"),
    **dict.fromkeys(("tension", "tension_min", "tension_max", "line_load"), "N/m"),
    **{"pressure": "Pa", "slip": "m/s", "cone_share": "1", "curvature": "1/m", "moment": "N"},
    **{"time": "s", "normal_force": "N", "drag": "N", "wrap": "rad", "max_slip": "m/s"},
    **{"surface_speed": "m/s", "torque": "N m"},
}
"""Unit of a column of ``profile.csv`` or ``history.csv``, by the end of its name."""

ROLLER_TABLE = {
    "wrap": ("wrap", "°", 180.0 / np.pi),
    "tension_in": ("tension in", "N/m", 1.0),
    "tension_out": ("tension out", "N/m", 1.0),
    "tension_ratio": ("ratio", "", 1.0),
    "normal_force": ("normal force", "N", 1.0),
    "torque": ("torque", "N\N{NO-BREAK SPACE}m", 1.0),
    "surface_speed": ("surface speed", "m/s", 1.0),
    "max_slip": ("largest slip", "m/s", 1.0),
    "slip_arc": ("slides over", "°", 180.0 / np.pi),
    "capacity_used": ("friction used", "%", 100.0),
    "offset": ("offset", "mm", 1e3),
}
"""Columns of the table of rollers: entry of ``summary.json``, head, unit and factor."""

BEND_TABLE = {
    "curvature": ("curvature", "1/m", 1.0),
    "moment": ("moment", "N", 1.0),
    "plastic_share": ("plastic share", "%", 100.0),
    "curl_on_roller": ("curl if unloaded there", "1/m", 1.0),
    "crossbow_on_roller": ("crossbow if unloaded there", "1/m", 1.0),
    "curl": ("curl behind", "1/m", 1.0),
    "crossbow": ("crossbow behind", "1/m", 1.0),
    "elongation": ("elongation", "", 1.0),
    "yield_power": ("power", "W", 1.0),
}
"""The same of the table of bends of strip that can yield."""

STUDY_TABLES = {
    "sweep": "status", "map": "entry_tension", "response": "gain", "accuracy": "tolerance",
}  # fmt: skip
"""Tables of studies, and their first columns that are not varied."""

DRAWN_RESULTS = ("tension_ratio", "true_tension", "entry_tension", "gain")
"""Ends of the names of results of which the first to be found is drawn."""


def write_report(directory: AnyPath) -> Path:
    """Write ``report.html`` of a run or a study, from the files that it has written so far.

    The page opens without a network. Of a run it has, as far as the run has got: its outcome,
    warnings and errors; tables of rollers, ends and stages; what is along the strip and over time;
    the last state in space; and the scene with all defaults. Of a sweep, an accuracy study, a map
    or a frequency response it has the table, the figure and plots of any column over any other.

    Parameters
    ----------
    directory : path
        Where the run or the study left its results.

    Returns
    -------
    Path
        The report, at most 8 MB large.

    Raises
    ------
    InputError
        There are no results in the directory.
    OSError
        The report cannot be written.
    """
    folder = Path(directory)
    history = folder / "history.csv"
    study = next((p for name in STUDY_TABLES if (p := folder / f"{name}.csv").is_file()), None)
    found: dict[str, Any] = {"units": COLUMN_UNITS}
    if history.is_file():
        known = read_json(folder / "summary.json") or {}
        body = html_tables(known)
        found["along"] = written_profiles(folder / "profile.csv")
        found["over"] = history_columns(history)
        found["space"] = last_surface(folder)
    elif study is not None:
        known, rows = read_json(study.with_suffix(".json")) or {}, read_history(study)
        body = study_tables(study, rows)
        found |= {"study": study_plots(study, rows)}
    else:
        expected = "the history of a run, or the table of a sweep or another study"
        hint = "anmstrip run SCENE.toml -o DIR, then anmstrip report DIR"
        raise InputError([Mistake(str(history), "", "no such file", expected, hint)])
    scene = json.dumps(known.get("input", {}), indent=1, ensure_ascii=False)
    page = Template((files("anmstrip.pictures") / "report.html").read_text("utf-8"))
    text = page.substitute(
        title=escape(known.get("input", {}).get("title") or folder.absolute().name),
        outcome=escape(known.get("message", "" if study else "The run has not ended.")),
        tables="\n".join(body),
        scene=escape(scene) if "input" in known else "",
        data=json.dumps(found, ensure_ascii=False).replace("</", "<\\/"),
        plotly=(files("plotly") / "package_data" / "plotly.min.js").read_text("utf-8"),
    )
    target = folder / "report.html"
    with atomic_write(target) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return target


def study_plots(path: Path, rows: Columns) -> dict[str, Any]:
    """Return what the plots of a study draw.

    Returns
    -------
    dict
        Columns by name; the names of what is varied and of what was found; the pair that is drawn
        first; and for every row a label, and the group whose points a line joins.
    """
    varied = list(takewhile(lambda name: name != STUDY_TABLES[path.stem], rows))
    numbers = {name: round_digits(c) for name, c in rows.items() if not isinstance(c, list)}
    known = {name: c for name, c in numbers.items() if any(v is not None for v in c)}
    found = [name for name in known if name not in varied]
    first = [name for end in DRAWN_RESULTS for name in found if name.endswith(end)]
    over, joined = varied[0], varied[1:]
    if path.stem == "accuracy" and "seconds" in known:
        over, joined = "seconds", varied[:1]
    columns = {name: rows[name] for name in varied if isinstance(rows[name], list)} | known
    count = range(len(rows[over]))
    return {
        "columns": columns,
        "over": [over, *(name for name in columns if name != over)],
        "found": [*first[:1], *(name for name in found if name not in first[:1])],
        "labels": [", ".join(f"{name} = {rows[name][row]}" for name in varied) for row in count],
        "groups": [", ".join(f"{rows[name][row]}" for name in joined) for row in count],
    }


def study_tables(path: Path, rows: Columns) -> Iterable[str]:
    """Yield the figure and the table of a study, and links to the reports of its scenes."""
    if statuses := list(rows.get("status", ())):
        yield f"<p>{statuses.count('done')} of {len(statuses)} scenes done.</p>"
    if (picture := path.with_suffix(".png")).is_file():
        image = b64encode(picture.read_bytes()).decode()
        yield f'<img alt="{path.stem}" src="data:image/png;base64,{image}">'
    cells = [c if isinstance(c, list) else [format_number(v) for v in c] for c in rows.values()]
    yield html_table(path.name, rows, zip(*cells, strict=True))
    for name in dict.fromkeys(map(str, rows.get("directory", ()))):
        if (path.parent / name / "report.html").is_file():
            yield f'<p><a href="{escape(name)}/report.html">{escape(name)}</a></p>'


def round_digits(values: ArrayLike) -> list[float | None]:
    """Return numbers with few digits, None for those that are not finite."""
    x = np.asarray(values, dtype=float).ravel()
    with np.errstate(all="ignore"):
        power = np.clip(PLOT_DIGITS - 1.0 - np.floor(np.log10(np.abs(x))), -300.0, 300.0)
        unit = 10.0 ** np.abs(power)  # of few digits, which one over it need not be
        found = np.where(power > 0.0, np.round(x * unit) / unit, np.round(x / unit) * unit)
    return [v if isfinite(v) else None for v in found.tolist()]


def spread_places(count: int, most: int) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Return at most so many evenly spread places of a list, both ends among them."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))


def written_profiles(path: Path) -> list[dict[str, Any]]:
    """Return profiles at some of the written times: the time, and columns by name."""
    if not path.is_file():
        return []
    with path.open(encoding="utf-8") as file:  # of a long line most rows are left out
        lines = (line for line in file if line.endswith("\n"))
        next(lines, None)
        times = np.array([float(line.partition(",")[0]) for line in lines])
    instants = np.unique(times)
    shown = instants[spread_places(len(instants), MAX_TIMES)]
    stations = (np.flatnonzero(times == time) for time in shown)
    parts = [rows[spread_places(len(rows), MAX_STATIONS)] for rows in stations]
    table = read_history(path, set(np.concatenate([np.zeros(0, dtype=int), *parts]).tolist()))
    table.pop("time", None)
    begin, found = 0, []
    for time, rows in zip(shown, parts, strict=True):
        part = slice(begin, begin := begin + len(rows))
        columns = {name: round_digits(np.asarray(column)[part]) for name, column in table.items()}
        found.append({"time": float(f"{time:.{PLOT_DIGITS}g}"), "columns": columns})
    return found


def history_columns(path: Path) -> dict[str, list[Any]]:
    """Return the columns of the history that are numbers, of some of the steps."""
    table = read_history(path)
    kept = {name: np.asarray(c) for name, c in table.items() if not isinstance(c, list)}
    count = len(next(iter(kept.values()), ()))
    rows = spread_places(count, MAX_HISTORY_STEPS)
    return {name: round_digits(column[rows]) for name, column in kept.items()}


def last_surface(folder: Path) -> dict[str, Any] | None:
    """Return the last state: points, triangles, fields, and the rollers; None without one."""
    if not (entries := vtk.read_collection(folder / "strip.pvd")):
        return None
    surface = vtk.read_surface(folder / entries[-1].file)
    fine = len(surface.points) <= MAX_SURFACE_POINTS
    corners = {16: [0, 3, 15, 12], 21: [0, 5, 20]}.get(surface.cells.shape[1])
    cells = vtk.subdivide(surface.cells) if fine or corners is None else surface.cells[:, corners]
    used, cells = np.unique(cells, return_inverse=True)
    fields = {}
    for name, found in surface.fields.items():
        values = vtk.scalars(name, found[used])
        if name not in ("normal", "arc_length") and np.any(np.nan_to_num(values)):
            known, told = vtk.FIELDS[name], round_digits(values)
            fields[name] = {"label": known.label, "unit": known.unit, "values": told}
    space = {"time": entries[-1].time, "fields": fields, **triangulate(surface.points[used], cells)}
    if rollers := vtk.read_collection(folder / "rollers.pvd"):
        body = vtk.read_surface(folder / rollers[-1].file)
        tones = np.repeat(vtk.sector_tones(body), 2)
        space["rollers"] = triangulate(body.points, body.cells) | {"tones": tones.tolist()}
    return space


def triangulate(points: np.ndarray[Any, Any], cells: np.ndarray[Any, Any]) -> dict[str, Any]:
    """Return coordinates x, y, z and triangles i, j, k; every quadrilateral makes two in turn."""
    cells = cells.reshape(-1, cells.shape[-1])
    if cells.shape[1] == 4:
        cells = cells[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    corners = dict(zip("ijk", cells.T.tolist(), strict=True))
    return {axis: round_digits(points[:, n]) for n, axis in enumerate("xyz")} | corners


def html_tables(summary: Mapping[str, Any]) -> Iterable[str]:
    """Yield warnings and the tables of rollers, ends, errors and stages, as HTML."""
    for warning in summary.get("warnings", ()):
        yield f'<p class="warning">{escape(warning)}</p>'
    rollers = summary.get("rollers") or {}
    if rollers:
        yield rows_by_roller("Rollers", rollers, ROLLER_TABLE)
    if bends := {name: r["bend"] for name, r in rollers.items() if r.get("bend")}:
        title = "Sharpest bends, and the curl and crossbow of unloaded strip behind the roller"
        yield rows_by_roller(title, bends, BEND_TABLE)
    if edges := summary.get("edges"):
        heads = ["edge", "tension (N/m)", "force x (N)", "y (N)", "z (N)", "moment (N)"]
        read = ((n, e.get("tension"), *e["force"], e.get("moment")) for n, e in edges.items())
        rows = ([name, *map(format_number, values)] for name, *values in read)
        yield html_table("Edges", heads, rows)
    if errors := summary.get("errors"):
        yield html_table("Estimated errors, the largest of each kind", *error_rows(errors))
    if stages := summary.get("stages"):
        rows = ([n, s["steps"], s["tangents"], f"{s['seconds']:.3g}"] for n, s in stages.items())
        yield html_table("Stages", ["stage", "steps", "tangents", "seconds"], rows)


def rows_by_roller(title: str, rollers: Mapping[str, Any], shown: Mapping[str, Any]) -> str:
    """Return a table of what is shown of every roller: by entry its head, unit and factor."""
    heads = (f"{head} ({unit})" if unit else head for head, unit, _ in shown.values())
    rows = (
        [name, *(format_number(r.get(k), f) for k, (*_, f) in shown.items())]
        for name, r in rollers.items()
    )
    return html_table(title, ["roller", *heads], rows)


def format_number(value: float | None, factor: float = 1.0) -> str:
    """Return a number of a table; a dash where there is none."""
    return "–" if value is None or not np.isfinite(value) else f"{factor * value:.6g}"


def html_table(title: str, heads: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """Return a table as HTML, its first column as it is and the others to the right."""
    lines = ["".join(f"<th>{escape(text)}</th>" for text in heads)]
    lines += ["".join(f"<td>{escape(str(cell))}</td>" for cell in row) for row in rows]
    body = "\n".join(f"<tr>{line}</tr>" for line in lines)
    return f'<h2>{escape(title)}</h2>\n<div class="wide"><table>\n{body}\n</table></div>'

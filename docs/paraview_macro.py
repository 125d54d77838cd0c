"""Open a run in ParaView: the strip by tension, its contact status, and the rollers.

The run is the directory that the environment variable ``ANMSTRIP_RUN`` names, else the current one.
With ``ANMSTRIP_SCREENSHOT=1`` in ``pvbatch`` it writes ``paraview.png`` there.
"""

import os
from math import dist, pi
from pathlib import Path

from paraview.simple import (
    ColorBy,
    GetActiveCamera,
    GetActiveViewOrCreate,
    GetAnimationScene,
    GetColorTransferFunction,
    GetScalarBar,
    PVDReader,
    ResetCamera,
    SaveScreenshot,
    Show,
    WarpByVector,
)

INSET = 5.0e-4
"""Rollers are drawn smaller by this share of the scene; else they show through the strip."""

GREYS, SECTORS = (0.55, 0.67), 12
"""Tones of the sectors of a roller, which show how it turns, and how many sectors there are."""

TITLES = {
    "tension": "tension (N/m)",
    "contact_status": "contact (0 free, 1 touches, 2 slips)",
    "surface_angle": "angle of the surface (rad)",
}

run = Path(os.environ.get("ANMSTRIP_RUN", "."))
view = GetActiveViewOrCreate("RenderView")
shown = {}
for name, field in (
    ("rollers", "surface_angle"),
    ("strip", "tension"),
    ("strip", "contact_status"),
):
    file = run / f"{name}.pvd"
    if file.is_file():
        drawn = f"{name} by {field}"
        read = "rollers as computed" if name == "rollers" else drawn
        source = PVDReader(registrationName=read, FileName=str(file))
        if name == "rollers":
            source.UpdatePipeline()
            bounds = source.GetDataInformation().GetBounds()
            source = WarpByVector(registrationName=drawn, Input=source)
            source.Vectors = ["POINTS", "normal"]
            source.ScaleFactor = -INSET * dist(bounds[::2], bounds[1::2])
        shown[field] = Show(source, view)
GetAnimationScene().UpdateAnimationUsingDataTimeSteps()
GetAnimationScene().GoToLast()
for field, display in shown.items():
    display.NonlinearSubdivisionLevel = 3
    ColorBy(display, ("POINTS", field))
    display.RescaleTransferFunctionToDataRange(False)
    colours = GetColorTransferFunction(field)
    if field == "surface_angle":
        edges = [2.0 * pi * k / SECTORS for k in range(SECTORS + 1)]
        ends = [(edges[k + side], 3 * [GREYS[k % 2]]) for k in range(SECTORS) for side in (0, 1)]
        colours.RGBPoints = [number for angle, grey in ends for number in (angle, *grey)]
    else:
        colours.ApplyPreset("Viridis (matplotlib)", True)
    bar = GetScalarBar(colours, view)
    bar.Title, bar.ComponentTitle = TITLES[field], ""
    bar.WindowLocation, bar.TitleFontSize, bar.LabelFontSize = "Lower Right Corner", 14, 14
    bar.RangeLabelFormat = "%.0f"
    display.SetScalarBarVisibility(view, field == "tension")
    display.Visibility = field != "contact_status"  # its eye in the pipeline browser shows it
view.CameraPosition, view.CameraFocalPoint = [-3.2, -8.0, 5.0], [0.0, 0.0, 0.0]
view.CameraViewUp = [0.0, 0.0, 1.0]
ResetCamera(view)
GetActiveCamera().Dolly(1.5)
if os.environ.get("ANMSTRIP_SCREENSHOT"):
    view.ViewSize = [1400, 800]
    SaveScreenshot(str(run / "paraview.png"), view, ImageResolution=[1400, 800])

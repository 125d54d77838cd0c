"""Open a run in ParaView: the strip by tension, its contact status, and the rollers.

The run is the directory that the environment variable ``ANMSTRIP_RUN`` names, else the current one.
With ``ANMSTRIP_SCREENSHOT=1`` in ``pvbatch`` it writes ``paraview.png`` there.
"""

import os
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
)

PRESETS = {"surface_angle": "Grayscale", "tension": "Viridis (matplotlib)"}
PRESETS["contact_status"] = PRESETS["tension"]

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
        reader = PVDReader(registrationName=f"{name} by {field}", FileName=str(file))
        shown[field] = Show(reader, view)
GetAnimationScene().UpdateAnimationUsingDataTimeSteps()
GetAnimationScene().GoToLast()
for field, display in shown.items():
    display.NonlinearSubdivisionLevel = 3
    ColorBy(display, ("POINTS", field))
    display.RescaleTransferFunctionToDataRange(False)
    colours = GetColorTransferFunction(field)
    colours.ApplyPreset(PRESETS[field], True)
    bar = GetScalarBar(colours, view)
    bar.Title, bar.ComponentTitle = "tension (N/m)" if field == "tension" else field, ""
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

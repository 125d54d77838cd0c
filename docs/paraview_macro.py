"""Open a run in ParaView: the strip by tension, its contact status, and the rollers.

The run is the directory that the environment variable ``ANMSTRIP_RUN`` names, else the current one.
``pvbatch docs/paraview_macro.py`` writes ``paraview.png`` there.
"""

import os
import sys
from pathlib import Path

from paraview.simple import (
    ColorBy,
    GetActiveViewOrCreate,
    GetAnimationScene,
    PVDReader,
    Render,
    ResetCamera,
    SaveScreenshot,
    Show,
)

run = Path(os.environ.get("ANMSTRIP_RUN", "."))
view = GetActiveViewOrCreate("RenderView")
for name, field in (
    ("rollers", "surface_angle"),
    ("strip", "tension"),
    ("strip", "contact_status"),
):
    if not (run / f"{name}.pvd").is_file():
        continue
    shown = Show(
        PVDReader(registrationName=f"{name} {field}", FileName=str(run / f"{name}.pvd")), view
    )
    shown.NonlinearSubdivisionLevel = 3
    ColorBy(shown, ("POINTS", field))
    shown.RescaleTransferFunctionToDataRange(True)
    shown.SetScalarBarVisibility(view, name == "strip")
    shown.Visibility = field != "contact_status"
GetAnimationScene().UpdateAnimationUsingDataTimeSteps()
GetAnimationScene().GoToLast()
ResetCamera(view)
Render(view)
if "pvbatch" in sys.executable or os.environ.get("ANMSTRIP_SCREENSHOT"):
    SaveScreenshot(str(run / "paraview.png"), view, ImageResolution=[1400, 800])

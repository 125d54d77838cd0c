"""What all hard cases have in common."""

import numpy as np

from motions import Trial


def right(trial: Trial, allowed: float, tangents: int) -> None:
    """What holds for all: the end is reached, at the answer, with bounded work."""
    assert trial.outcome == "done"
    assert np.isfinite([trial.found, trial.exact]).all()
    assert trial.error <= allowed
    assert 0 < trial.steps <= trial.tangents <= tangents

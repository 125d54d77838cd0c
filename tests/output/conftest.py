"""Results of a run."""

import pytest
from wrapped_strip import write_state

from anmstrip.results.vtk import Collection


@pytest.fixture
def run(tmp_path):
    """Results of a run with three states."""
    contents = {name: Collection(tmp_path / f"{name}.pvd") for name in ("strip", "rollers")}
    for k, share in enumerate((0.0, 0.5, 1.0)):
        write_state(tmp_path, k, share)
        for name, collection in contents.items():
            collection.add(0.5 * k, f"{name}_{k}.vtu")
    return tmp_path

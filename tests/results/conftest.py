"""Results of a run."""

import pytest

from wrapped_strip import write_run


@pytest.fixture
def run(tmp_path):
    """Directory with a run of three states."""
    write_run(tmp_path)
    return tmp_path

"""A checkpoint comes back whole or is refused."""

import random

import numpy as np
import pytest

from anmstrip.errors import InputError
from anmstrip.results.files import load_checkpoint, save_checkpoint

ARRAYS = {
    "positions": np.random.default_rng(0).random((30, 3)),
    "file": np.arange(4),
    "facts": np.array([np.nan, -0.0, np.inf]),
    "slipping": np.array([True, False]),
    "empty": np.zeros((0, 3)),
}
FACTS = {"stage": "turn µ", "time": 0.1 + 0.2, "step": np.int64(7), "largest": np.inf, "ids": [1]}


@pytest.fixture
def path(tmp_path):
    save_checkpoint(tmp_path / "checkpoint.npz", ARRAYS, FACTS)
    return tmp_path / "checkpoint.npz"


def check(arrays, facts):
    assert facts == FACTS
    assert set(arrays) == set(ARRAYS)
    for name, values in ARRAYS.items():
        assert arrays[name].dtype == values.dtype
        np.testing.assert_array_equal(arrays[name], values)


def test_everything_comes_back_to_the_last_bit(path):
    check(*load_checkpoint(path))


def test_saving_again_replaces_the_file(path):
    save_checkpoint(path, {"positions": np.zeros(3)}, {"step": 8})
    arrays, facts = load_checkpoint(path)
    assert (list(arrays), facts) == (["positions"], {"step": 8})
    assert list(path.parent.iterdir()) == [path]


def test_a_missing_checkpoint_is_an_input_error(tmp_path):
    with pytest.raises(InputError, match="without --resume"):
        load_checkpoint(tmp_path / "checkpoint.npz")


@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, 0.99])
def test_a_truncated_checkpoint_is_an_input_error(path, share):
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(InputError, match=r"checkpoint\.npz[\s\S]*without --resume"):
        load_checkpoint(path)


@pytest.mark.parametrize("content", [b"not an archive", b"\x93NUMPY\x01\x00", b"PK\x03\x04"])
def test_a_file_of_another_kind_is_an_input_error(path, content):
    path.write_bytes(content)
    with pytest.raises(InputError, match="damaged"):
        load_checkpoint(path)


def test_a_flipped_bit_never_changes_a_value(path):
    content, chance, refused = path.read_bytes(), random.Random(2), 0
    for _ in range(100):
        damaged = bytearray(content)
        damaged[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
        path.write_bytes(damaged)
        try:
            check(*load_checkpoint(path))
        except InputError:
            refused += 1
    assert refused > 30


def test_arrays_of_objects_are_refused(path):
    with pytest.raises(TypeError, match="laws"):
        save_checkpoint(path, {"laws": np.array([{}, None])}, {})
    check(*load_checkpoint(path))

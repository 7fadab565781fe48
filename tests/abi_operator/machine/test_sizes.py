"""How many columns are taken together: on this CPU, and where there is another device."""

import jax
import numpy as np
import pytest

from abi_operator.machine import backend, sizes

ASKED = {
    "solver": lambda: sizes.tile_size(8, np.float64),
    "grounds": sizes.tile_of_grounds,
    "optics": lambda: sizes.chunks_to_read()[-1],
    "pixels": sizes.chunk_of_pixels,
    "pixels to read": sizes.chunk_of_pixels_to_read,
}


@pytest.mark.parametrize("name", ASKED)
def test_another_device_takes_thousands_and_a_cpu_fewer(name, monkeypatch):
    monkeypatch.setattr(jax, "default_backend", lambda: "cpu")
    assert ASKED[name]() <= 1024
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")
    assert ASKED[name]() == (32768 if name == "solver" else 4096)


@pytest.mark.parametrize("backend", ["cpu", "gpu"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("num_streams", [2, 4, 8, 16, 32])
def test_chunks_are_whole_tiles_and_rise(num_streams, dtype, backend, monkeypatch):
    monkeypatch.setattr(jax, "default_backend", lambda: backend)
    tile = sizes.tile_size(num_streams, dtype)
    states = sizes.tile_of_states(28, num_streams, dtype)
    for size, chunks in (
        (tile, sizes.chunks_of_columns(num_streams, dtype)),
        (tile, sizes.chunks_of_columns(num_streams, dtype, in_order=True)),
        (states, sizes.chunks_of_states(states)),
    ):
        assert size % sizes.VECTOR == 0
        assert list(chunks) == sorted(set(chunks))
        if backend == "cpu":
            assert all(width % size == 0 or width < size for width in chunks[1:])
            assert all(width % sizes.VECTOR == 0 for width in chunks[1:])
        else:  # each is compiled for half a minute, and a tile is large
            assert chunks[2] == size and chunks[:2] == (size // 16, size // 4)
            assert all(width % size == 0 for width in chunks[2:])


@pytest.mark.parametrize("num_streams", [4, 8, 16, 32])
def test_slopes_of_a_layer_alone_are_tiled_by_more(num_streams):
    """Where a tile has few, up to 16 streams; and chunks are whole tiles of these as well."""
    alone, tile = (sizes.tile_size(num_streams, np.float64, alone=x) for x in (True, False))
    assert alone > tile if num_streams in (8, 16) else alone == tile
    widths = sizes.chunks_of_columns(num_streams, np.float64)
    assert all(width % alone == 0 or width < alone for width in widths)


def test_a_state_of_many_columns_is_tiled_by_a_vector_at_least():
    assert sizes.tile_of_states(10**6, 8, np.float64) == sizes.VECTOR


def test_what_computes_is_named(monkeypatch):
    monkeypatch.setattr(backend, "usable_cores", lambda: 2)
    assert backend.device_in_words() == "2 cores"
    monkeypatch.setattr(backend, "usable_cores", lambda: 1)
    assert backend.device_in_words() == "1 core"
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")
    assert backend.device_in_words() == jax.local_devices()[0].device_kind

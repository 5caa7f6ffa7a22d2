"""Writes the HDF5 files of these tests, with h5py 3.16 and hdf5plugin 7.1: python write.py

The events are those of `pattern` in hdf5.rs.
"""

import struct
from pathlib import Path

import h5py
import hdf5plugin
import numpy as np

FOLDER = Path(__file__).parent
ECF = 0x8ECF


def pattern(count):
    """Events 0 to count - 1: t, x, y and p, regular in time and place, with a pause every 1000 events."""
    i = np.arange(count, dtype=np.int64)
    return 7 * i + 40_000 * (i // 1000), i % 640, i // 640 % 480, (i * i // 5) % 2


def arrays(name, count, kinds, libver="earliest"):
    """A file with an array each for t, x, y and p: type and compression of `kinds`."""
    with h5py.File(FOLDER / name, "w", libver=libver) as file:
        group = file.create_group("events")
        for (field, (dtype, options)), values in zip(kinds.items(), pattern(count)):
            group.create_dataset(field, data=values.astype(dtype), **options)
        return file.filename


def blosc(name, chunk, shuffle=hdf5plugin.Blosc.SHUFFLE):
    return {"chunks": (chunk,), **hdf5plugin.Blosc(cname=name, clevel=5, shuffle=shuffle)}


def dsec():
    zstd = blosc("zstd", 1024)
    kinds = {"t": ("<u4", zstd), "x": ("<u2", zstd), "y": ("<u2", zstd), "p": ("u1", zstd)}
    with h5py.File(arrays("dsec.h5", 1500, kinds), "a") as file:
        t = file["events/t"][:]
        file["ms_to_idx"] = np.searchsorted(t, 1000 * np.arange(t[-1] // 1000 + 1)).astype("<u8")
        file["t_offset"] = np.int64(49_599_300_523)


def ecf(t, x, y, p):
    """A chunk of ECF with pixels and polarities together."""
    chunk = bytearray(struct.pack("<IQ", len(t) << 2 | 2, t[0]))
    now = t[0]
    for time in t:
        step, now = max(time - now, 0), max(time, now)
        if step >= 15:
            while step > 0:
                chunk.append(0xF0 | step & 15)
                step >>= 4
        chunk.append(step << 4 | 1)
    words = [(y << 12 | x << 1 | p) for x, y, p in zip(x, y, p)]
    words += [0] * (-len(words) % 4)
    for a, b, c, d in zip(*[iter(words)] * 4):
        chunk += struct.pack("<III", a << 8 | b & 0xFF, b >> 8 << 16 | c & 0xFFFF, c >> 16 << 24 | d)
    return bytes(chunk)


def prophesee(count=600, chunk=256):
    record = np.dtype(
        {"names": ["x", "y", "p", "t"], "formats": ["<u2", "<u2", "<i2", "<i8"], "offsets": [0, 2, 4, 8], "itemsize": 16}
    )
    with h5py.File(FOLDER / "prophesee.h5", "w") as file:
        file.attrs["format"], file.attrs["geometry"] = "ECF", "640x480"
        settings = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        settings.set_chunk((chunk,))
        settings.set_filter(ECF, h5py.h5z.FLAG_OPTIONAL, ())
        space = h5py.h5s.create_simple((count,), (h5py.h5s.UNLIMITED,))
        group = file.create_group("CD").id
        events = h5py.h5d.create(group, b"events", h5py.h5t.py_create(record), space, settings)
        for start in range(0, count, chunk):
            fields = [values[start : start + chunk].tolist() for values in pattern(count)]
            # The last chunk is whole, as every chunk of HDF5.
            fields = [values + [0] * (chunk - len(values)) for values in fields]
            events.write_direct_chunk((start,), ecf(*fields))


def main():
    dsec()
    prophesee()
    codecs = {
        "t": ("<u4", blosc("zstd", 50_000)),
        "x": ("<u2", blosc("lz4", 50_000)),
        "y": ("<u2", blosc("zlib", 50_000)),
        "p": ("u1", blosc("zstd", 50_000, hdf5plugin.Blosc.NOSHUFFLE)),
    }
    arrays("codecs.h5", 100_003, codecs, "latest")
    deflate = {"chunks": (300,), "compression": "gzip", "shuffle": True, "fletcher32": True}
    kinds = {"t": (">i8", deflate), "x": (">u2", {}), "y": ("<i4", {"chunks": (300,)}), "p": (bool, blosc("lz4", 300))}
    arrays("types.h5", 1000, kinds, "latest")
    with h5py.File(FOLDER / "stored.h5", "w", libver="latest") as file:
        # Incompressible times: Blosc stores them as they are.
        times = np.random.default_rng(1).integers(0, 1 << 32, 64).astype("<u4")
        times[0] = 5
        for field, values in zip("txyp", (times, *[np.arange(64).astype("<u2")] * 2, np.ones(64, "u1"))):
            file.create_dataset(f"events/{field}", data=values, **blosc("zstd", 64))
    for name, codec, shuffle in [("bits.h5", "zstd", 2), ("blosclz.h5", "blosclz", 1)]:
        options = blosc(codec, 1000, shuffle)
        arrays(name, 1000, {field: ("<u4", options) for field in "txyp"}, "latest")
    with h5py.File(FOLDER / "other.h5", "w", libver="latest") as file:
        file["images"], file["poses/t"] = [1, 2], [3]
    with h5py.File(FOLDER / "uneven.h5", "w", libver="latest") as file:
        for length, field in enumerate("txyp"):
            file[f"events/{field}"] = np.arange(4 - length // 3)
    with h5py.File(FOLDER / "floats.h5", "w", libver="latest") as file:
        for field in "txyp":
            file[f"events/{field}"] = np.arange(4.0)
    arrays("empty.h5", 0, {field: ("<u4", {}) for field in "txyp"}, "latest")


main()

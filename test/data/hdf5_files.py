#!/usr/bin/env python3
"""HDF5 in every layout that h5py writes: what `heft log -o` makes of each is what went in, to the last bit.

usage: hdf5_files.py HEFT
Exit code 77: h5py is not installed (pip install h5py).
"""
import itertools
import pathlib
import subprocess
import sys
import tempfile

try:
    import h5py
    import numpy as np
except ImportError as missing:
    print(f"not checked: {missing}")
    sys.exit(77)

heft = sys.argv[1]
random = np.random.default_rng(1)
ROWS, JOINTS = 900, 3
time = np.arange(ROWS) * 0.008
q = np.cumsum(random.normal(0.0, 0.01, (ROWS, JOINTS)), axis=0)
tau = random.normal(0.0, 5.0, (ROWS, JOINTS))

# By where the values lie: in one piece, in the header, in chunks that are found by each of the indexes there are (a single
# chunk, a list, a list in pages, one that grows, a tree, none).
LAYOUTS = {
    "contiguous": {},
    "compact": {"compact": True},
    "one chunk": {"chunks": "all"},
    "chunks": {"chunks": 64},
    "many chunks": {"chunks": 1},
    "grows": {"chunks": 64, "maxshape": 1},
    "grows, many chunks": {"chunks": 1, "maxshape": 1},
    "grows both ways": {"chunks": 64, "maxshape": 2},
}
FILTERS = {
    "plain": {},
    "gzip": {"compression": "gzip"},
    "shuffled gzip": {"compression": "gzip", "shuffle": True},
    "checksum": {"fletcher32": True},
}
VERSIONS = {"earliest": ("earliest", "v108"), "v108": ("v108", "v108"), "v110": ("v110", "v110"), "v112": ("v112", "v112"),
            "latest": "latest"}


def is_known(version):
    """Older HDF5 does not write the layouts of newer ones."""
    try:
        h5py.File("probe", "w", libver=version, driver="core", backing_store=False).close()
        return True
    except (KeyError, ValueError):
        return False


VERSIONS = {name: version for name, version in VERSIONS.items() if is_known(version)}
TYPES = {"double": np.float64, "single": np.float32, "big endian": ">f8"}


def options_of(values, chunks=None, maxshape=0, compact=False):
    rest = values.shape[1:]
    options = {}
    if compact:
        options["dcpl"] = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        options["dcpl"].set_layout(h5py.h5d.COMPACT)
    if chunks:
        options["chunks"] = values.shape if chunks == "all" else (chunks, *rest)
    if maxshape == 1:
        options["maxshape"] = (None, *rest)
    elif maxshape == 2:
        options["maxshape"] = (None,) * values.ndim
    return options


def expected(values, kind):
    return values.astype(kind).astype(np.float64)


def read_back(path, folder):
    done = subprocess.run([heft, "log", str(path), "-o", str(folder / "out.csv")], capture_output=True, text=True)
    if done.returncode:
        return None, done.stderr.strip()
    table = np.genfromtxt(folder / "out.csv", delimiter=",", names=True)
    return {name: np.column_stack([table[f"{name}{j + 1}"] for j in range(JOINTS)]) for name in ("q", "tau")} | {
        "time": table["time"]}, ""


def write(path, version, layout, filters, kind):
    with h5py.File(path, "w", libver=version) as file:
        for name, values in (("time", time), ("q", q), ("tau", tau)):
            stored = values if name == "time" else values.astype(kind)
            file.create_dataset(name, data=stored, **options_of(values, **layout), **filters)


failed = count = 0
with tempfile.TemporaryDirectory() as folder:
    folder = pathlib.Path(folder)
    cases = [(v, l, f, "double") for v, l, f in itertools.product(VERSIONS, LAYOUTS, FILTERS)
             if not (FILTERS[f] and l in ("contiguous", "compact"))]
    cases += [(v, l, f, k) for v, l, f, k in itertools.product(VERSIONS, ["contiguous", "compact", "grows"], ["plain", "shuffled gzip"],
                                                               ["single", "big endian"])
              if not (FILTERS[f] and l in ("contiguous", "compact"))]
    for version, layout, filters, kind in cases:
        count += 1
        path = folder / "run.h5"
        write(path, VERSIONS[version], LAYOUTS[layout], FILTERS[filters], TYPES[kind])
        found, why = read_back(path, folder)
        what = f"{version}, {layout}, {filters}, {kind}"
        if found is None:
            print(f"{what}: {why}")
            failed += 1
        elif not (np.array_equal(found["time"], time) and np.array_equal(found["q"], expected(q, TYPES[kind]))
                  and np.array_equal(found["tau"], expected(tau, TYPES[kind]))):
            print(f"{what}: other values")
            failed += 1
print(f"{count - failed} of {count} files read to the last bit")
sys.exit(bool(failed) or count < 64)

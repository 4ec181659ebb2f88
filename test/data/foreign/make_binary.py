#!/usr/bin/env python3
"""Writes one log in the binary formats that heft reads, by the libraries of those formats.

usage: make_binary.py RUN.csv FOLDER

RUN.csv is a log of six joints with q, qd and tau (binary/run.csv: 40 rows of `heft simulate`). FOLDER gets the files that
test/data/binary_formats_test.cpp reads. Needs mcap, mcap-ros2-support, rosbags, numpy, scipy, h5py and zstandard from PyPI.
"""
import csv
import pathlib
import shutil
import sqlite3
import sys
import tempfile
import zipfile

import h5py
import mcap.writer
import mcap_ros2.writer
import numpy as np
import scipy.io
import zstandard
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

NAMES = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"]
EPOCH = 1_700_000_000_123_456_789  # [ns] of the first row: a double would lose its last digits
TYPES = get_typestore(Stores.ROS2_HUMBLE)
STATE = TYPES.types["sensor_msgs/msg/JointState"]
STRING = TYPES.types["std_msgs/msg/String"]
HEADER = TYPES.types["std_msgs/msg/Header"]
TIME = TYPES.types["builtin_interfaces/msg/Time"]
SCHEMA = """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


def read(path):
    with open(path) as file:
        rows = list(csv.reader(file))
    table = np.array([[float(field) for field in row] for row in rows[1:]])
    group = lambda prefix: table[:, [rows[0].index(f"{prefix}{j}") for j in range(1, 7)]]
    return table[:, rows[0].index("time")], group("q"), group("qd"), group("tau")


def joint_state(stamp, names, position, velocity, effort):
    header = HEADER(stamp=TIME(sec=stamp // 10**9, nanosec=stamp % 10**9), frame_id="base_link")
    arrays = [np.ascontiguousarray(a, dtype=np.float64) for a in (position, velocity, effort)]
    return STATE(header=header, name=list(names), position=arrays[0], velocity=arrays[1], effort=arrays[2])


class Run:
    """The log as messages: (time [ns], message)."""

    def __init__(self, path):
        self.time, self.q, self.qd, self.tau = read(path)
        self.stamps = [EPOCH + round(t * 1e9) for t in self.time]

    def messages(self, velocity=True, effort=True, names=NAMES):
        for k, stamp in enumerate(self.stamps):
            yield stamp, joint_state(stamp, names, self.q[k], self.qd[k] if velocity else [],
                                     self.tau[k] if effort else [])

    def shuffled(self):
        """Other joints between those of the arm, and another order in every message."""
        random = np.random.default_rng(1)
        for k, stamp in enumerate(self.stamps):
            rows = list(zip(NAMES, self.q[k], self.qd[k], self.tau[k])) + [("gripper_finger", 0.01, 0.0, 5.0)]
            rows = [rows[i] for i in random.permutation(len(rows))]
            yield stamp, joint_state(stamp, *zip(*rows))


def write_mcap(path, topics, compression, little_endian=True, recorded_after=1_500_000, **options):
    """topics: {name: messages}, written in order of time."""
    with open(path, "wb") as file:
        writer = mcap.writer.Writer(file, compression=compression, **options)
        writer.start(profile="ros2", library="make_binary.py")
        state = writer.register_schema("sensor_msgs/msg/JointState", "ros2msg", SCHEMA.encode())
        text = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
        all_messages = []
        for name, messages in topics.items():
            schema = text if name == "/rosout" else state
            channel = writer.register_channel(name, "cdr", schema)
            kind = "std_msgs/msg/String" if name == "/rosout" else "sensor_msgs/msg/JointState"
            for stamp, message in messages:
                data = bytes(TYPES.serialize_cdr(message, kind, little_endian=little_endian))
                all_messages.append((stamp + recorded_after, channel, data))
        for sequence, (stamp, channel, data) in enumerate(sorted(all_messages, key=lambda m: m[0])):
            writer.add_message(channel, stamp, data, stamp, sequence)
        writer.finish()


def write_ros2_mcap(path, run, compression):
    """The same by mcap-ros2-support, which serialises by itself."""
    with open(path, "wb") as file:
        writer = mcap_ros2.writer.Writer(file, chunk_size=4096, compression=compression)
        text = writer.register_msgdef("std_msgs/msg/String", "string data\n")
        state = writer.register_msgdef("sensor_msgs/msg/JointState", SCHEMA)
        for k, stamp in enumerate(run.stamps):
            header = {"stamp": {"sec": stamp // 10**9, "nanosec": stamp % 10**9}, "frame_id": "base_link"}
            message = {"header": header, "name": NAMES, "position": run.q[k].tolist(), "velocity": run.qd[k].tolist(),
                       "effort": run.tau[k].tolist()}
            writer.write_message("/joint_states", state, message, stamp + 1_500_000)
            if k % 10 == 0:
                writer.write_message("/rosout", text, {"data": f"line {k}"}, stamp + 1_600_000)
        writer.finish()


def write_mcaps(folder, run):
    none, lz4, zstd = mcap.writer.CompressionType.NONE, mcap.writer.CompressionType.LZ4, mcap.writer.CompressionType.ZSTD
    rosout = [(run.stamps[k] + 700, STRING(data=f"line {k}")) for k in range(0, len(run.stamps), 10)]
    small = {"chunk_size": 4096}
    write_mcap(folder / "none.mcap", {"/joint_states": run.messages(), "/rosout": rosout}, none, **small)
    write_mcap(folder / "lz4.mcap", {"/joint_states": run.messages(), "/rosout": rosout}, lz4, **small)
    write_ros2_mcap(folder / "zstd.mcap", run, zstd)
    bare = {"use_chunking": False, "use_statistics": False, "use_summary_offsets": False, "repeat_channels": False,
            "repeat_schemas": False, "index_types": mcap.writer.IndexType.NONE}
    write_mcap(folder / "no_summary.mcap", {"/joint_states": run.messages(), "/rosout": rosout}, none, **bare)
    write_mcap(folder / "big_endian.mcap", {"/joint_states": run.messages()}, zstd, little_endian=False)
    write_mcap(folder / "shuffled.mcap", {"/joint_states": run.shuffled()}, zstd)
    write_mcap(folder / "two_topics.mcap",
               {"/left/joint_states": run.messages(), "/right/joint_states": list(run.messages(effort=False))[::2]}, zstd)


def write_bag(folder, run, plugin, rows, compressed=False):
    writer = Writer(folder, version=8, storage_plugin=plugin)
    if compressed:
        writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    with writer:
        states = writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=TYPES)
        other = writer.add_connection("/rosout", "std_msgs/msg/String", typestore=TYPES)
        for k, (stamp, message) in enumerate(run.messages()):
            if k not in rows:
                continue
            writer.write(states, stamp + 1_500_000, TYPES.serialize_cdr(message, "sensor_msgs/msg/JointState"))
            if k % 10 == 0:
                writer.write(other, stamp + 1_600_000, TYPES.serialize_cdr(STRING(data="x"), "std_msgs/msg/String"))


def pack(path):
    """Smaller pages: those of rosbags are mostly empty in so short a bag."""
    database = sqlite3.connect(path)
    database.executescript("PRAGMA journal_mode = DELETE; PRAGMA page_size = 1024; VACUUM;")
    database.close()


def write_bags(folder, run):
    rows = range(len(run.stamps))
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        write_bag(scratch / "bag", run, StoragePlugin.SQLITE3, rows)
        bag = next((scratch / "bag").glob("*.db3"))
        pack(bag)
        shutil.copy(bag, folder / "rosbag2.db3")
        shutil.copy(bag, folder / "old.db3")
        database = sqlite3.connect(folder / "old.db3")  # as rosbag2 wrote it before ROS 2 Galactic
        columns = [row[1] for row in database.execute("PRAGMA table_info(topics)")]
        for column in columns:
            if column not in ("id", "name", "type", "serialization_format"):
                database.execute(f"ALTER TABLE topics DROP COLUMN {column}")
        for table in ("schema", "metadata"):
            database.execute(f"DROP TABLE IF EXISTS {table}")
        database.execute("DROP INDEX IF EXISTS timestamp_idx")
        database.commit()
        database.close()
        pack(folder / "old.db3")
        write_bag(scratch / "packed", run, StoragePlugin.SQLITE3, rows, compressed=True)
        shutil.copy(next((scratch / "packed").glob("*.db3")), folder / "messages.db3")
        pack(folder / "messages.db3")
        (folder / "rosbag2.db3.zstd").write_bytes(zstandard.ZstdCompressor().compress(bag.read_bytes()))
        shutil.rmtree(folder / "two_files", ignore_errors=True)
        (folder / "two_files").mkdir()
        for number, part in ((9, rows[:20]), (10, rows[20:])):
            write_bag(scratch / f"part{number}", run, StoragePlugin.MCAP, part)
            shutil.copy(next((scratch / f"part{number}").glob("*.mcap")), folder / f"two_files/run_{number}.mcap")
            shutil.copy(scratch / f"part{number}/metadata.yaml", folder / "two_files/metadata.yaml")


def write_numpy(folder, run):
    np.savez(folder / "stored.npz", time=run.time, q=run.q, qd=np.asfortranarray(run.qd), tau=run.tau, rate=500.0)
    np.savez_compressed(folder / "deflated.npz", t=run.time, q=run.q.T, qd=np.asfortranarray(run.qd), tau=run.tau,
                        robot="ur5e", picture=np.zeros((3, 4, 5)))
    limit, zipfile.ZIP64_LIMIT = zipfile.ZIP64_LIMIT, 100  # every file is a large one
    np.savez_compressed(folder / "zip64.npz", time=run.time, q=run.q, qd=run.qd, tau=run.tau)
    zipfile.ZIP64_LIMIT = limit
    np.savez_compressed(folder / "other_types.npz", time=np.array(run.stamps), q=run.q.astype(">f8"),
                        qd=run.qd.astype(np.float32), tau=np.round(run.tau).astype(np.int16),
                        phase=np.exp(1j * run.time))
    np.savez_compressed(folder / "cut_tail.npz", time=np.arange(1000) / 125, q=np.zeros((1000, 6)), tau=np.ones((995, 6)))
    np.savez_compressed(folder / "other_rate.npz", time=np.arange(1000) / 125, q=np.zeros((1000, 6)), tau=np.ones((500, 6)))
    table = np.zeros(len(run.time), dtype=[("time", "<f8"), ("q", ">f8", (6,)), ("note", "S3"), ("tau", "<f8", (6,))])
    table["time"], table["q"], table["tau"] = run.time, run.q, run.tau
    np.save(folder / "structured.npy", table)
    np.save(folder / "matrix.npy", run.q)


def write_mat(folder, run):
    flat = {"time": run.time[:, None], "q": run.q, "qd": run.qd, "tau": run.tau, "robot": "ur5e", "rate": 500.0}
    scipy.io.savemat(folder / "plain.mat", flat)
    scipy.io.savemat(folder / "compressed.mat", {**flat, "q": run.q.T, "z": np.exp(1j * run.time)}, do_compression=True)
    scipy.io.savemat(folder / "struct.mat",
                     {"data": {"t": run.time, "q": run.q, "qd": run.qd, "tau": run.tau, "joints": np.array(NAMES, object)}},
                     do_compression=True)
    # As MATLAB's save -v7.3: HDF5 behind a header of 512 bytes, matrices transposed, their class as an attribute.
    for name, chunked in (("v73.mat", False), ("v73_chunked.mat", True)):
        with h5py.File(folder / name, "w", userblock_size=512) as file:
            group = file if not chunked else file.create_group("data")
            if chunked:
                group.attrs["MATLAB_class"] = np.bytes_("struct")
            clock = np.array(run.stamps) if chunked else run.time
            for key, value in {"time": clock[:, None], "q": run.q, "qd": run.qd, "tau": run.tau}.items():
                options = {"chunks": (min(4, value.shape[1]), 16), "compression": "gzip", "shuffle": key == "q",
                           "fletcher32": key == "tau"} if chunked else {}
                group.create_dataset(key, data=value.T, **options).attrs["MATLAB_class"] = np.bytes_("double")
            text = group.create_dataset("robot", data=np.array([[ord(c)] for c in "ur5e"], dtype=np.uint16))
            text.attrs["MATLAB_class"] = np.bytes_("char")
        with open(folder / name, "r+b") as file:
            header = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Mon Nov 23 12:00:00 2026 HDF5 schema 1.00 ."
            file.write(header.ljust(124) + b"\x00\x02IM")


def write_latest(folder, run):
    """Newer structures: an index of chunks each, links in the group's header and, where they are many, in a heap."""
    packed = {"compression": "gzip", "shuffle": True}
    for name, version, options in (("latest.h5", "latest", packed), ("v110.h5", ("v110", "v110"), {})):
        with h5py.File(folder / name, "w", libver=version) as file:
            group = file.create_group("run") if options else file
            group.create_dataset("time", data=run.time, chunks=(16,), maxshape=(None,), **options)  # extensible array
            group.create_dataset("q", data=run.q, chunks=(7, 6), **options)  # fixed array
            group.create_dataset("qd", data=run.qd, chunks=(16, 4), maxshape=(None, None), **options)  # B-tree
            group.create_dataset("tau", data=run.tau, chunks=run.tau.shape, **options)  # one chunk
            for number in range(0 if options else 8):
                group.create_dataset(f"setting_{number}", data=float(number))
            if options:
                continue
            early = h5py.h5p.create(h5py.h5p.DATASET_CREATE)  # chunks one behind the other, without index
            early.set_chunk((16, 3))
            early.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
            space = h5py.h5s.create_simple(run.q.shape)
            set_ = h5py.h5d.create(group.id, b"qref", h5py.h5t.NATIVE_DOUBLE, space, early)
            set_.write(h5py.h5s.ALL, h5py.h5s.ALL, np.ascontiguousarray(run.q))
    with h5py.File(folder / "pages.h5", "w", libver=("v110", "v110")) as file:  # an index in pages
        rows = np.arange(1100)
        file.create_dataset("time", data=rows / 125, chunks=(1,), maxshape=(None,))
        file.create_dataset("q", data=rows.astype(np.int16), chunks=(1,))


def main():
    run, folder = Run(sys.argv[1]), pathlib.Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    write_mcaps(folder, run)
    write_bags(folder, run)
    write_numpy(folder, run)
    write_mat(folder, run)
    write_latest(folder, run)


if __name__ == "__main__":
    main()

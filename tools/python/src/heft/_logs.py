"""Logs from wherever they are: what C++ reads, data frames, and formats that other people's packages read."""
import os
import re

import numpy as np

from ._heft import DataError, Log
from ._heft import read_log as _read


def from_frame(frame, name="data frame"):
    """A log from columns time, q1.., tau1.., qd1.., qdd1.., i1..; other numeric columns are carried along."""
    columns = {str(column): np.asarray(frame[column]) for column in frame.columns}
    if "time" not in columns:
        raise DataError(f"{name}: column 'time' is missing; found {', '.join(list(columns)[:30])}; expected a column time [s]")
    joints = 0
    while f"q{joints + 1}" in columns:
        joints += 1
    if joints == 0:
        raise DataError(f"{name}: column 'q1' is missing; found {', '.join(list(columns)[:30])}; expected q1, q2, ... [rad, m]")

    def channel(prefix):
        names = [f"{prefix}{j}" for j in range(1, joints + 1)]
        if not all(column in columns for column in names):
            return None
        return np.column_stack([columns.pop(column).astype(float) for column in names])

    time = columns.pop("time").astype(float)
    q, tau, qd, qdd, current = (channel(prefix) for prefix in ("q", "tau", "qd", "qdd", "i"))
    extra = {key: values.astype(float) for key, values in columns.items() if np.issubdtype(values.dtype, np.number)}
    for key, values in (("q", q), ("tau", tau), ("time", time)):
        if values is not None and not np.isfinite(values).all():
            raise DataError(f"{name}: {key} holds NaN or infinity; expected finite numbers; drop those rows")
    return Log(time, q, tau, qd, qdd, current, extra, name)


def log_of(log):
    """A path for files that C++ reads piece by piece, otherwise a log in memory."""
    if isinstance(log, Log):
        return log
    if isinstance(log, (str, os.PathLike)):
        path = os.fspath(log)
        return read_log(path) if re.search(r"\.(parquet|bag|h5|hdf5)$", path) else path
    if hasattr(log, "columns"):
        return from_frame(log)
    raise TypeError(f"found {type(log).__name__}; expected a path, a heft.Log or a pandas data frame")


def read_log(path, *, topic="", joints=(), map=None):
    """Reads a log whole: what the command reads, and by other people's packages Parquet (pyarrow; LeRobot's columns
    observation.state and timestamp too), ROS 1 bags (rosbags) and HDF5 (h5py; datasets time, q, tau, ...).

    topic: of a bag with several of joint states. joints: the robot's names of them, base first, where a log names its joints.
    map: columns by the file's names, as the command's --map: {"tau": "effort", "time": "500Hz"}. The latter two are for what
    the command reads, too.
    """
    path = os.fspath(path)
    if path.endswith(".parquet"):
        return _parquet(path)
    if path.endswith(".bag"):
        return _ros1(path, topic or None)
    if path.endswith((".h5", ".hdf5")):
        return _hdf5(path)
    return _read(path, topic, list(joints), [f"{ours}={theirs}" for ours, theirs in (map or {}).items()])


def _parquet(path):
    import pyarrow.parquet as parquet

    table = parquet.read_table(path)
    names = table.column_names
    if "q1" in names:
        return from_frame(table.to_pandas(), path)
    if "observation.state" in names and "timestamp" in names:
        q = np.stack([np.asarray(row, float) for row in table["observation.state"].to_pylist()])
        log = {f"q{j + 1}": q[:, j] for j in range(q.shape[1])}
        log["time"] = np.asarray(table["timestamp"].to_pylist(), float)
        for column, prefix in (("observation.effort", "tau"), ("observation.current", "i"), ("observation.velocity", "qd")):
            if column in names:
                values = np.stack([np.asarray(row, float) for row in table[column].to_pylist()])
                log.update({f"{prefix}{j + 1}": values[:, j] for j in range(values.shape[1])})
        import pandas

        return from_frame(pandas.DataFrame(log), path)
    raise DataError(f"{path}: found columns {', '.join(names[:30])}; expected time and q1.., or LeRobot's timestamp and "
                    "observation.state")


def _ros1(path, topic):
    from rosbags.highlevel import AnyReader
    import pathlib

    rows, names = [], None
    with AnyReader([pathlib.Path(path)]) as reader:
        found = [c for c in reader.connections if c.msgtype.endswith("JointState") and topic in (None, c.topic)]
        topics = sorted({c.topic for c in found})
        if len(topics) != 1:
            raise DataError(f"{path}: found topics of joint states: {', '.join(topics) or 'none'}; expected one; name it with topic=")
        for connection, _, raw in reader.messages(connections=found):
            message = reader.deserialize(raw, connection.msgtype)
            names = names or list(message.name)
            order = [list(message.name).index(name) for name in names]
            stamp = message.header.stamp
            rows.append((stamp.sec * 10**9 + stamp.nanosec, message.position[order],
                         message.velocity[order] if len(message.velocity) else None,
                         message.effort[order] if len(message.effort) else None))
    time = np.array([(row[0] - rows[0][0]) * 1e-9 for row in rows])
    stack = lambda k: None if rows[0][k] is None else np.stack([row[k] for row in rows])
    return Log(time, stack(1), stack(3), stack(2), None, None, {}, path)


def _hdf5(path):
    import h5py

    with h5py.File(path) as file:
        data = {name: np.asarray(file[name], float) for name in file if isinstance(file[name], h5py.Dataset)}
    if "time" not in data or "q" not in data:
        raise DataError(f"{path}: found datasets {', '.join(data) or 'none'}; expected time and q at least")
    rows = len(data["time"])
    shaped = lambda name: None if name not in data else data[name] if data[name].shape[0] == rows else data[name].T
    return Log(data["time"].ravel(), shaped("q"), shaped("tau"), shaped("qd"), shaped("qdd"), shaped("i"), {}, path)

"""Logs that other people's packages read."""
import pathlib

import numpy as np
import pytest

import heft


@pytest.fixture(scope="module")
def log(logs):
    return heft.read_log(str(logs / "train.csv"))


def same(a, b):
    return np.array_equal(a.q, b.q) and np.array_equal(a.tau, b.tau) and np.allclose(a.time, b.time, atol=1e-9)


def test_parquet(log, tmp_path):
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    columns = {"time": log.time} | {f"{name}{j + 1}": values[:, j] for name, values in (("q", log.q), ("tau", log.tau))
                                    for j in range(4)}
    pandas.DataFrame(columns).to_parquet(tmp_path / "run.parquet")
    assert same(heft.read_log(tmp_path / "run.parquet"), log)
    pandas.DataFrame({"timestamp": log.time, "observation.state": list(log.q), "observation.effort": list(log.tau)}).to_parquet(
        tmp_path / "lerobot.parquet")
    assert same(heft.read_log(tmp_path / "lerobot.parquet"), log)
    pandas.DataFrame({"a": [1.0]}).to_parquet(tmp_path / "other.parquet")
    with pytest.raises(heft.DataError, match="expected time and q1"):
        heft.read_log(tmp_path / "other.parquet")


def test_ros1_bags(log, tmp_path):
    pytest.importorskip("rosbags")
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    State, Header, Time = (store.types[name] for name in ("sensor_msgs/msg/JointState", "std_msgs/msg/Header",
                                                          "builtin_interfaces/msg/Time"))
    names = [f"joint_{j}" for j in range(4)]
    with Writer(tmp_path / "run.bag") as bag:
        arm, other = (bag.add_connection(topic, State.__msgtype__, typestore=store) for topic in ("/joint_states", "/gripper"))
        for k, time in enumerate(log.time):
            order = [j for j in range(4)] if k % 2 == 0 else [2, 0, 3, 1]  # a message may name its joints in another order
            stamp = 10**18 + round(1e9 * time)
            header = Header(k, Time(stamp // 10**9, stamp % 10**9), "")
            state = State(header, [names[j] for j in order], log.q[k][order], np.zeros(0), log.tau[k][order])
            bag.write(arm, stamp, store.serialize_ros1(state, State.__msgtype__))
        bag.write(other, stamp, store.serialize_ros1(state, State.__msgtype__))
    read = heft.read_log(tmp_path / "run.bag", topic="/joint_states")
    assert np.array_equal(read.q, log.q) and np.array_equal(read.tau, log.tau)
    assert np.allclose(read.time, log.time - log.time[0], atol=1e-9)
    with pytest.raises(heft.DataError, match="/gripper, /joint_states; expected one; name it with topic="):
        heft.read_log(tmp_path / "run.bag")


def test_what_a_file_does_not_say_is_told():
    foreign = pathlib.Path(__file__).parents[3] / "test/data/foreign"
    with pytest.raises(heft.DataError, match="--topic"):
        heft.read_log(foreign / "binary/two_topics.mcap")
    first, second = (heft.read_log(foreign / "binary/two_topics.mcap", topic=topic) for topic in
                     ("/left/joint_states", "/right/joint_states"))
    assert (len(first), len(second)) == (40, 20)
    own = heft.read_log(foreign / "own.csv", map={"time": "k", "q": "pose", "tau": "load"})
    assert len(own) == 120 and own.tau.shape == (120, 4)


def test_hdf5(log, tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file["time"], file["q"], file["tau"] = log.time, log.q, log.tau.T  # either way round
    assert same(heft.read_log(tmp_path / "run.h5"), log)


def test_data_frames_with_gaps_are_refused(log):
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame({"time": log.time} | {f"q{j + 1}": log.q[:, j] for j in range(4)})
    frame.loc[3, "q2"] = np.nan
    with pytest.raises(heft.DataError, match="NaN"):
        heft.identify("scara", frame)

"""Logs that other people's packages read."""
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

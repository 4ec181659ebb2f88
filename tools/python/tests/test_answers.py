"""The answers are those of the command, to the last digit, and behave as Python's users expect."""
import json
import signal
import threading

import numpy as np
import pytest

import heft
from conftest import SCENARIO


def result_of(command, folder, *arguments):
    return json.loads(command(*arguments, "--json", "-", cwd=folder))


def test_identify_gives_the_numbers_of_the_command(logs, command, monkeypatch):
    monkeypatch.chdir(logs)
    found = heft.identify("scara", "train.csv", validate="judge.csv")
    assert found.to_dict() == result_of(command, logs, "identify", "--urdf", "scara", "--log", "train.csv", "--validate",
                                        "judge.csv")
    assert found.verdict == found.to_dict()["verdict"]
    assert found.brief() in str(found)


def test_diagnose_gives_the_numbers_of_the_command(logs, command, monkeypatch):
    monkeypatch.chdir(logs)
    found = heft.diagnose("scara", "train.csv", validate="judge.csv")
    expected = result_of(command, logs, "diagnose", "--urdf", "scara", "--log", "train.csv", "--validate", "judge.csv")
    assert expected.pop("command").startswith("heft diagnose") and found.to_dict().pop("command") == ""
    assert {key: value for key, value in found.to_dict().items() if key != "command"} == expected


def test_validate_and_payload_give_the_numbers_of_the_command(logs, command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    heft.identify("scara", str(logs / "train.csv"), validate=str(logs / "judge.csv")).save("arm.json")
    judge = str(logs / "judge.csv")
    assert heft.validate("arm.json", judge).to_dict() == result_of(command, tmp_path, "validate", "--model", "arm.json",
                                                                   "--log", judge)
    carrying_run().write("carrying.csv")
    train = str(logs / "train.csv")
    assert heft.payload("scara", "carrying.csv", baseline=train).to_dict() == result_of(
        command, tmp_path, "payload", "--urdf", "scara", "--log", "carrying.csv", "--baseline", train)


def carrying_run():
    carrying = json.loads(json.dumps(SCENARIO))
    carrying["payload"] = [{"event": "grasp", "time": 0.0, "mass": 1.5, "com": [0.02, 0.0, 0.03]}]
    return heft.simulate(carrying).log


def test_models_go_from_one_question_to_the_next(logs, tmp_path):
    found = heft.identify("scara", str(logs / "train.csv"), validate=str(logs / "judge.csv"))
    found.save(str(tmp_path / "arm.json"))
    judged = heft.validate(str(tmp_path / "arm.json"), str(logs / "judge.csv"))
    assert judged.usable
    assert found.robot.num_joints == 4
    page = found._repr_html_()
    assert page.startswith("<iframe srcdoc=") and "&lt;" not in page[:200]
    with pytest.raises(heft.DataError, match="fitted to"):
        heft.validate(str(tmp_path / "arm.json"), str(logs / "train.csv"))


def test_logs_in_memory_and_data_frames_give_what_files_give(logs):
    pandas = pytest.importorskip("pandas")
    file = heft.identify("scara", str(logs / "train.csv"), validate=str(logs / "judge.csv")).to_dict()
    for reader in (heft.read_log, pandas.read_csv):
        again = heft.identify("scara", reader(str(logs / "train.csv")), validate=reader(str(logs / "judge.csv"))).to_dict()
        assert again["rmse"] == pytest.approx(file["rmse"], rel=1e-9)
        assert [p["value"] for p in again["base_parameters"]] == pytest.approx(
            [p["value"] for p in file["base_parameters"]], rel=1e-9, abs=1e-12)


def test_a_log_hands_out_views_and_no_copies(logs):
    log = heft.read_log(str(logs / "train.csv"))
    assert np.shares_memory(log.q, log.q) and log.q.shape == (len(log), 4)
    q = log.q
    del log
    assert np.isfinite(q).all(), "the columns keep their log alive"


def test_payload_and_live_load(logs, tmp_path):
    carrying_run().write(str(tmp_path / "carrying.csv"))
    load = heft.payload("scara", str(tmp_path / "carrying.csv"), baseline=str(logs / "train.csv"))
    assert load.to_dict()["mass"]["value"] == pytest.approx(1.5, abs=0.1)
    live = heft.LiveLoad("scara", baseline=str(logs / "train.csv"))
    log = heft.read_log(str(tmp_path / "carrying.csv"))
    events = [event for row in zip(log.time, log.q, log.tau) if (event := live.push(*row))]
    assert events and events[0]["mass"]["value"] == pytest.approx(1.5, rel=0.15)


def test_dynamics_take_arrays(logs):
    robot = heft.Robot("panda")
    q, qd, qdd = np.random.default_rng(1).uniform(-1, 1, (3, 50, 7))
    torque = robot.inverse_dynamics(q, qd, qdd)
    expected = [robot.mass_matrix(q[k]) @ qdd[k] + robot.inverse_dynamics(q[k:k + 1], qd[k:k + 1], 0 * qdd[k:k + 1])[0]
                for k in range(50)]
    assert np.allclose(torque, expected, atol=1e-10)
    assert robot.regressor(q[0], qd[0], qdd[0]).shape == (7, 98)
    assert "<mujoco" in robot.export("mjcf")


def test_errors_are_exceptions_with_the_messages_of_the_command(logs):
    with pytest.raises(heft.DataError, match="cannot read the log"):
        heft.identify("scara", "nowhere.csv")
    with pytest.raises(heft.InputError, match="method"):
        heft.identify("scara", str(logs / "train.csv"), method="magic")
    with pytest.raises(heft.NotIdentifiableError):
        still = heft.read_log(str(logs / "train.csv"))
        heft.identify("scara", heft.Log(still.time, np.zeros_like(still.q) + still.q[:1], np.array(still.tau)), split=0,
                      accept_torque=True)


def test_progress_is_told_and_can_stop_the_work(logs):
    told = []
    heft.identify("scara", str(logs / "train.csv"), progress=lambda what, done: told.append(done))
    assert told and all(0 <= done <= 1 for done in told)

    def stop(what, done):
        raise ValueError("enough")

    with pytest.raises(ValueError, match="enough"):
        heft.identify("scara", str(logs / "train.csv"), progress=stop)


def test_control_c_ends_the_work(logs):
    threading.Timer(0.2, lambda: signal.raise_signal(signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        for _ in range(100):
            heft.diagnose("scara", str(logs / "train.csv"), validate=str(logs / "judge.csv"))


def test_other_threads_run_meanwhile(logs):
    ticks = []
    stop = threading.Event()

    def tick():
        while not stop.is_set():
            ticks.append(1)
            stop.wait(0.002)

    thread = threading.Thread(target=tick)
    thread.start()
    before = len(ticks)
    heft.diagnose("scara", str(logs / "train.csv"), validate=str(logs / "judge.csv"))
    during = len(ticks) - before
    stop.set()
    thread.join()
    assert during > 20, "the interpreter's lock is released"

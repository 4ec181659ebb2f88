import json
import os
import pathlib
import shutil
import subprocess

import pytest

import heft

SCENARIO = {
    "robot": "scara", "duration": 24.0, "sample_rate": 1000, "log_rate": 200, "seed": 1,
    "friction": {"coulomb": [4.0, 2.0, 12.0, 0.15], "viscous": [2.0, 1.0, 40.0, 0.05]},
    "controller": {"kind": "pd_gravity", "kp": [3000, 1500, 20000, 50], "kd": [150, 80, 900, 2]},
    "sensors": {"encoder_resolution": [2e-5, 2e-5, 2e-6, 2e-5], "torque_noise": [0.15, 0.1, 0.5, 0.02]},
    "reference": {"kind": "fourier", "q0": [0.1, -0.2, 0.1, 0.2],
                  "amplitude": [[0.8, 0.3, 0.2], [0.7, 0.4, 0.15], [0.05, 0.02, 0.01], [0.9, 0.4, 0.2]],
                  "frequency_hz": [[0.15, 0.5, 1.1], [0.2, 0.45, 1.0], [0.25, 0.6, 1.2], [0.3, 0.7, 1.3]],
                  "phase": [[0, 1, 2], [0.5, 0, 1], [1, 2, 0.3], [1.5, 0.3, 0.9]], "ramp": 1.5, "start": [0, 0, 0.1, 0]},
    "rotor_inertia": [0.05, 0.03, 2.0, 0.01],
}


@pytest.fixture(scope="session")
def logs(tmp_path_factory):
    """Simulated logs of a SCARA: one to fit to, one of another motion to judge on."""
    folder = tmp_path_factory.mktemp("logs")
    first = heft.simulate(SCENARIO)
    first.log.write(str(folder / "train.csv"))
    other = json.loads(json.dumps(SCENARIO))
    other["seed"] = 2
    other["reference"]["phase"] = [[1, 2, 0], [2, 0.5, 1], [0.3, 1, 2], [0.9, 1.5, 0.3]]
    heft.simulate(other).log.write(str(folder / "judge.csv"))
    return folder


@pytest.fixture(scope="session")
def command():
    path = os.environ.get("HEFT_COMMAND") or shutil.which("heft")
    if not path:
        pytest.skip("the command is not installed; HEFT_COMMAND names it")

    def run(*arguments, cwd=None):
        done = subprocess.run([path, *map(str, arguments)], cwd=cwd, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run

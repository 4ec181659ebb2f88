"""Sums of logs give the same model whatever the split; the arm that differs from the rest is named, and no other."""
import json
import pickle
import random

import numpy as np
import pytest

import heft
from conftest import SCENARIO


def run_of_arm(seed, coulomb=None):
    """A log of one arm of the type: friction of its own within some percent, motion of its own."""
    rng = np.random.default_rng(seed)
    scenario = json.loads(json.dumps(SCENARIO))
    scenario.update(seed=int(seed) + 1, duration=16.0, log_rate=100)
    scenario["reference"]["phase"] = rng.uniform(0, 6, (4, 3)).tolist()
    for kind in ("coulomb", "viscous"):
        scenario["friction"][kind] = (np.array(scenario["friction"][kind]) * rng.normal(1.0, 0.03, 4)).tolist()
    if coulomb:
        joint, factor = coulomb
        scenario["friction"]["coulomb"][joint] *= factor
    log = heft.simulate(scenario).log
    log.name = f"arm-{seed}"
    return log


@pytest.fixture(scope="module")
def parts():
    return [heft.sums("scara", run_of_arm(seed)) for seed in range(12)]


def parameters(fit):
    return np.array([p["value"] for p in fit.to_dict()["base_parameters"]])


def test_the_parameters_are_the_same_whatever_the_split(parts):
    whole = parameters(heft.identify("scara", heft.merge(parts)))
    for seed in range(5):
        shuffled = random.Random(seed).sample(parts, len(parts))
        groups = [shuffled[k::1 + seed] for k in range(1 + seed)]
        again = parameters(heft.identify("scara", heft.merge(heft.merge(group) for group in groups)))
        assert np.abs(again - whole).max() <= 1e-10 * np.abs(whole).max()


def test_they_are_those_of_the_logs():
    logs = [run_of_arm(seed) for seed in range(3)]
    direct = parameters(heft.identify("scara", logs))
    assert np.abs(parameters(heft.identify("scara", heft.sums("scara", logs))) - direct).max() <= 1e-10 * np.abs(direct).max()


def test_sums_pickle_and_are_saved(parts, tmp_path):
    again = pickle.loads(pickle.dumps(parts[0]))
    assert bytes(again) == bytes(parts[0]) and again.nbytes == len(bytes(again)) and again.logs == ["arm-0"]
    again.save(str(tmp_path / "arm.sums"))
    assert bytes(heft.read_sums(tmp_path / "arm.sums")) == bytes(again)


def test_sums_of_another_robot_or_twice_the_same_log_are_refused(parts):
    with pytest.raises(heft.DataError, match="other joint frames"):
        heft.identify("panda", parts[0])
    with pytest.raises(heft.DataError, match="is in both"):
        heft.merge([parts[0], parts[1], parts[0]])
    with pytest.raises(heft.InputError, match="at least one"):
        heft.merge([])
    with pytest.raises(heft.InputError, match="sums hold none"):
        heft.identify("scara", parts[0], method="irls")


@pytest.mark.parametrize("odd", [3, 8])
def test_the_arm_with_altered_friction_is_named_and_no_other(parts, odd):
    altered = heft.sums("scara", run_of_arm(odd, coulomb=(1, 1.5)))
    fits = {f"arm-{k}": heft.identify("scara", altered if k == odd else part) for k, part in enumerate(parts)}
    found = heft.fleet(fits)
    assert found.to_dict()["odd_arms"] == [f"arm-{odd}"]
    first = found.to_dict()["deviations"][0]
    assert (first["parameter"], first["joint"]) == ("Fc2", 2)
    assert f"arm-{odd}: joint 2: Coulomb friction" in found.brief()


def test_nobody_is_named_where_arms_differ_as_arms_do(parts):
    found = heft.fleet({f"arm-{k}": heft.identify("scara", part) for k, part in enumerate(parts)})
    assert found.to_dict()["odd_arms"] == []

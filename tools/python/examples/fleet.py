"""One robot type from the logs of 50 arms on a local Dask cluster, and the arm that differs from the rest.

    pip install "./tools/python[fleet]" && python fleet.py               # --table: time, bytes, agreement

Workers turn logs into sums and add these up; only sums travel.
"""
import argparse
import tempfile
import time

import numpy as np

import heft

TYPE = "scara"
ODD_ARM, ODD_JOINT, ODD_FACTOR = 17, 1, 1.5  # joint 2 of arm 17 has half as much friction again


def run_of_arm(arm, run=0, odd=True):
    """A log of an arm. Simulated here; in a plant, the file that its controller wrote."""
    own = np.random.default_rng([arm, 1])  # friction of arms of one type differs by some percent
    motion = np.random.default_rng([arm, run, 2])
    coulomb = np.array([4.0, 2.0, 12.0, 0.15]) * own.normal(1.0, 0.03, 4)
    viscous = np.array([2.0, 1.0, 40.0, 0.05]) * own.normal(1.0, 0.03, 4)
    if odd and arm == ODD_ARM:
        coulomb[ODD_JOINT] *= ODD_FACTOR
    log = heft.simulate({
        "robot": TYPE, "duration": 16.0, "sample_rate": 1000, "log_rate": 100, "seed": 1000 * arm + run + 1,
        "friction": {"coulomb": coulomb.tolist(), "viscous": viscous.tolist()},
        "controller": {"kind": "pd_gravity", "kp": [3000, 1500, 20000, 50], "kd": [150, 80, 900, 2]},
        "sensors": {"encoder_resolution": [2e-5, 2e-5, 2e-6, 2e-5], "torque_noise": [0.15, 0.1, 0.5, 0.02]},
        "reference": {"kind": "fourier", "q0": [0.1, -0.2, 0.1, 0.2],
                      "amplitude": [[0.8, 0.3, 0.2], [0.7, 0.4, 0.15], [0.05, 0.02, 0.01], [0.9, 0.4, 0.2]],
                      "frequency_hz": [[0.15, 0.5, 1.1], [0.2, 0.45, 1.0], [0.25, 0.6, 1.2], [0.3, 0.7, 1.3]],
                      "phase": motion.uniform(0.0, 6.0, (4, 3)).tolist(), "ramp": 1.5, "start": [0, 0, 0.1, 0]},
        "rotor_inertia": [0.05, 0.03, 2.0, 0.01],
    }).log
    log.name = f"arm-{arm:02d}-run-{run}"
    return log


def sums_of_run(arm, run=0):
    return heft.sums(TYPE, run_of_arm(arm, run))


def add(parts):
    """Sums of sums, and the bytes that came in."""
    return heft.merge(sums for sums, _ in parts), sum(sums.nbytes + count for sums, count in parts)


def reduced(client, leaves, width=8):
    """A tree: each node adds up to `width` values, where most of them are."""
    level = [client.submit(lambda sums: (sums, 0), leaf) for leaf in leaves]
    while len(level) > 1:
        level = [client.submit(add, level[k:k + width]) for k in range(0, len(level), width)]
    return level[0].result()


def parameters(fit):
    return np.array([parameter["value"] for parameter in fit.to_dict()["base_parameters"]])


def cluster_of(workers):
    from dask.distributed import Client, LocalCluster

    return Client(LocalCluster(n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None))


def find_the_odd_arm(workers=2, arms=50):
    with cluster_of(workers) as client:
        leaves = client.map(sums_of_run, range(arms))
        whole, _ = reduced(client, leaves)
        fits = {f"arm-{arm:02d}": heft.identify(TYPE, sums) for arm, sums in enumerate(client.gather(leaves))}
    print(f"{TYPE}, {len(whole)} logs, {whole.nbytes / 1e3:.0f} kB of sums:", heft.identify(TYPE, whole).brief())
    found = heft.fleet(fits)
    print(found.brief())
    assert found.to_dict()["odd_arms"] == [f"arm-{ODD_ARM:02d}"]


def write_run(folder, arm, run):
    path = f"{folder}/arm-{arm:02d}-run-{run}.csv"
    run_of_arm(arm, run).write(path)
    return path


def sums_of_file(path):
    return heft.sums(TYPE, path)


def wait(futures):
    for future in futures:
        future.result()


def processor_time(client):
    return sum(client.run(time.process_time).values())


def print_table(counts=(1, 10, 300), workers=(1, 2, 4)):
    """Logs are files that lie there; making them is not counted."""
    with tempfile.TemporaryDirectory() as folder:
        begin = time.process_time()
        paths = [write_run(folder, k % 50, 1 + k // 50) for k in range(max(counts))]
        print(f"{len(paths)} logs of 16 s at 100 Hz simulated in {time.process_time() - begin:.1f} s of processor time\n")
        print("| logs | workers | time [s] | processor time of the workers [s] | sums added up [MB] | a log's [kB] | "
              "largest difference of a parameter |")
        print("| --- | --- | --- | --- | --- | --- | --- |")
        expected = {}
        for number in workers:
            with cluster_of(number) as client:
                wait(client.map(sums_of_file, paths[:2 * number], pure=False))  # workers have started
                for count in counts:
                    begin, spent = time.perf_counter(), processor_time(client)
                    leaves = client.map(sums_of_file, paths[:count], pure=False)
                    whole, moved = reduced(client, leaves)
                    seconds, spent = time.perf_counter() - begin, processor_time(client) - spent
                    found = [parameters(heft.identify(TYPE, whole))]
                    if number == workers[0]:  # another split: one value after the other
                        found.append(parameters(heft.identify(TYPE, heft.merge(client.gather(leaves)))))
                    reference = expected.setdefault(count, found[0])
                    difference = max(np.abs(each - reference).max() for each in found) / np.abs(reference).max()
                    print(f"| {count} | {number} | {seconds:.2f} | {spent:.2f} | {moved / 1e6:.2f} | "
                          f"{leaves[0].result().nbytes / 1e3:.0f} | {difference:.1g} |", flush=True)
                    assert difference <= 1e-10


def count_false_alarms(arms=600, sizes=(12, 50)):
    """Fleets without an odd arm in which one is named all the same. Each size divides the same arms into fleets of its own."""
    fits = {f"arm-{k}": heft.identify(TYPE, heft.sums(TYPE, run_of_arm(1000 + k, odd=False))) for k in range(arms)}
    names = list(fits)
    for size in sizes:
        fleets = [names[k:k + size] for k in range(0, arms - size + 1, size)]
        found = [heft.fleet({name: fits[name] for name in fleet}).to_dict()["odd_arms"] for fleet in fleets]
        print(f"fleets of {size} arms without an odd one: an arm was named in {sum(map(bool, found))} of {len(fleets)}, "
              f"{sum(map(len, found))} of {size * len(fleets)} arms", flush=True)


if __name__ == "__main__":
    asked = argparse.ArgumentParser()
    asked.add_argument("--table", action="store_true")
    asked.add_argument("--false-alarms", action="store_true")
    asked = asked.parse_args()
    if asked.table:
        print_table()
    elif asked.false_alarms:
        count_false_alarms()
    else:
        find_the_odd_arm()

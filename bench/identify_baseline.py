#!/usr/bin/env python3
"""What a plain script takes for the fit that `heft identify` makes: the comparison of identify_bench.

Pinocchio's regressor at every sample, SciPy's filtfilt on all columns and the torque, every k-th row, NumPy's QR, weights
of the joints from a first fit. No intervals, no bias test, no checks, no validation.

    python3 -m venv venv && venv/bin/pip install pin scipy numpy
    venv/bin/python bench/identify_baseline.py urdf/ur10e.urdf log.csv [CUTOFF_HZ]

The log is heft's CSV with time, q1.., tau1... Prints samples of log a second, processor time.
"""
import sys
import time

import numpy as np
import pinocchio as pin
from scipy.signal import butter, filtfilt


def base_columns(model, data, extra):
    """Columns that random states show to be independent, by QR in the order of the columns."""
    rng = np.random.default_rng(1)
    rows = []
    for _ in range(200):
        q, v, a = rng.uniform(-np.pi, np.pi, model.nq), rng.standard_normal(model.nv), rng.standard_normal(model.nv)
        rows.append(np.hstack([pin.computeJointTorqueRegressor(model, data, q, v, a), extra(v, a)]))
    R = np.linalg.qr(np.vstack(rows), mode="r")
    kept, basis = [], np.zeros((R.shape[0], 0))
    for column in range(R.shape[1]):
        left = R[:, column] - basis @ (basis.T @ R[:, column])
        if np.linalg.norm(left) > 1e-8 * max(1.0, np.linalg.norm(R[:, column])):
            kept.append(column)
            basis = np.column_stack([basis, left / np.linalg.norm(left)])
    return kept


def main():
    urdf, log = sys.argv[1], sys.argv[2]
    cutoff = float(sys.argv[3]) if len(sys.argv) > 3 else 5.0
    begin = time.process_time()
    model = pin.buildModelFromUrdf(urdf)
    data = model.createData()
    n = model.nv
    table = np.loadtxt(log, delimiter=",", skiprows=1)
    samples = len(table)
    t, q, tau = table[:, 0], table[:, 1 : 1 + n], table[:, 1 + n : 1 + 2 * n]
    rate = (samples - 1) / (t[-1] - t[0])
    b, a = butter(4, cutoff / (0.5 * rate))
    q = filtfilt(b, a, q, axis=0)
    qd = np.gradient(q, t, axis=0)
    qdd = np.gradient(qd, t, axis=0)

    def extra(v, acceleration):
        return np.hstack([np.diag(acceleration), np.diag(np.sign(v)), np.diag(v), np.eye(n)])

    kept = base_columns(model, data, extra)
    step = max(1, int(rate / (4 * cutoff)))
    rows, torque = [], []
    # A minute at a time, as far as memory goes.
    for first in range(0, samples, 60_000):
        part = slice(first, min(samples, first + 60_000))
        Y = np.empty((part.stop - part.start, n, len(kept)))
        for k in range(part.start, part.stop):
            full = np.hstack([pin.computeJointTorqueRegressor(model, data, q[k], qd[k], qdd[k]), extra(qd[k], qdd[k])])
            Y[k - part.start] = full[:, kept]
        Y = filtfilt(b, a, Y, axis=0)[::step]
        rows.append(Y)
        torque.append(filtfilt(b, a, tau[part], axis=0)[::step])
    W, y = np.concatenate(rows), np.concatenate(torque)
    weights = np.ones(n)
    for _ in range(2):
        Q, R = np.linalg.qr((W * weights[:, None]).reshape(-1, len(kept)))
        beta = np.linalg.lstsq(R, Q.T @ (y * weights).reshape(-1), rcond=None)[0]
        weights = 1.0 / np.std(y - W @ beta, axis=0)
    seconds = time.process_time() - begin
    print(f"{samples} samples, {len(kept)} base parameters: {seconds:.1f} s of processor, {samples / seconds:.0f} samples/s")


if __name__ == "__main__":
    main()

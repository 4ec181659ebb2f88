#!/usr/bin/env python3
"""Writes run.csv (simulated: heft simulate) in the text dialects of other programs, by Python's csv, gzip, NumPy and pandas.

usage: make.py [FOLDER]      (default: the folder of this script, which holds run.csv)

run.csv holds time, q1..q4, qd1..qd4, tau1..tau4 of a SCARA arm: joint 3 is prismatic (m, m/s, N).
"""
import csv
import gzip
import math
import pathlib
import sys

import numpy as np
import pandas as pd

folder = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else __file__).resolve()
folder = folder if folder.is_dir() else folder.parent
joints = ["shoulder_joint", "elbow_joint", "lift_joint", "roll_joint"]  # of urdf/scara.urdf
run = pd.read_csv(folder / "run.csv")
text = pd.read_csv(folder / "run.csv", dtype=str)
n = 4
q, qd, tau = ([f"{group}{j + 1}" for j in range(n)] for group in ("q", "qd", "tau"))


def write(name, header, rows, **dialect):
    with open(folder / name, "w", newline="", encoding=dialect.pop("encoding", "utf-8")) as file:
        csv.writer(file, **dialect).writerows([header, *rows])


# Spreadsheets on a computer whose language has decimal commas: byte-order mark, Windows line ends.
german = text.map(lambda number: number.replace(".", ","))
write("semicolon.csv", text.columns, german.values, delimiter=";", lineterminator="\r\n", encoding="utf-8-sig")
run.to_csv(folder / "tabs.txt", sep="\t", index=False)
run.to_csv(folder / "index.csv", quoting=csv.QUOTE_NONNUMERIC)  # pandas' default: row numbers in a nameless first column
with gzip.GzipFile(folder / "run.csv.gz", "wb", mtime=0) as file:
    file.write((folder / "run.csv").read_bytes())
np.savetxt(folder / "savetxt.txt", run.values, fmt="%.6f", header="one run\n" + " ".join(run.columns))

# Universal Robots' record.py: blanks, joints from 0.
rtde = {"timestamp": "time"}
for j in range(n):
    rtde |= {f"target_q_{j}": q[j], f"actual_q_{j}": q[j], f"actual_qd_{j}": qd[j], f"target_moment_{j}": tau[j],
             f"actual_current_as_torque_{j}": tau[j]}
write("rtde.csv", rtde, text[list(rtde.values())].values, delimiter=" ")

# libfranka's logToCSV: milliseconds; a row holds command n and state n + 1.
franka = [("state.q", q), ("state.q_d", q), ("state.dq", qd), ("state.tau_J", tau), ("cmd.q_d", q)]
header = ["time", "success_rate"] + [f"{name}[{j}]" for name, _ in franka for j in range(n)]
rows = [[round(1000 * run["time"][k]), 1] +
        [text[column][k + 1 if name == "cmd.q_d" and k + 1 < len(run) else k] for name, columns in franka for column in columns]
        for k in range(len(run))]
write("libfranka.csv", header, rows)

# ROS: time since 1970.
start = 1_700_000_000_123_456_789
stamps = [start + round(t * 1e9) for t in run["time"]]
header = ["%time", "field.header.seq", "field.header.stamp", "field.header.frame_id"]
header += [f"field.{group}{j}" for group in ("name", "position", "velocity", "effort") for j in range(n)]
rows = [[stamp + 150_000, k, stamp, ""] + joints + list(text.loc[k, q + qd + tau]) for k, stamp in enumerate(stamps)]
write("rostopic.csv", header, rows)
header = ["header.stamp.sec", "header.stamp.nanosec"]
header += [f"{group}[{j}]" for group in ("position", "velocity", "effort") for j in range(n)]
write("ros2.csv", header, [[stamp // 10**9, stamp % 10**9] + list(text.loc[k, q + qd + tau]) for k, stamp in enumerate(stamps)])
# PlotJuggler: a series a joint, in the order of their names.
series = {f"/joint_states/{joint}/{group}": column[j]
          for j, joint in enumerate(joints) for group, column in (("position", q), ("velocity", qd), ("effort", tau))}
write("plotjuggler.csv", ["__time", *sorted(series)], [[text["time"][k]] + [text[series[name]][k] for name in sorted(series)] for k in range(len(run))])

# Units in the header, and in a line below it.
prismatic = 2
units = {"time [ms]": run["time"] * 1e3}
for j in range(n):
    units |= {f"q{j + 1} [{'mm' if j == prismatic else 'deg'}]": run[q[j]] * (1e3 if j == prismatic else 180 / math.pi)}
for j in range(n):
    units |= {f"qd{j + 1} ({'mm/s' if j == prismatic else 'rpm'})": run[qd[j]] * (1e3 if j == prismatic else 30 / math.pi)}
for j in range(n):
    units |= {f"tau{j + 1} [{'kN' if j == prismatic else 'mNm'}]": run[tau[j]] * (1e-3 if j == prismatic else 1e3)}
pd.DataFrame(units).to_csv(folder / "units.csv", index=False, float_format="%.12g")
symbols = ["ms"] + ["mm" if j == prismatic else "deg" for j in range(n)] + ["mm/s" if j == prismatic else "deg/s" for j in range(n)]
symbols += ["N" if j == prismatic else "Nm" for j in range(n)]
scale = [1e3] + [1e3 if j == prismatic else 180 / math.pi for j in range(n)] * 2 + [1] * n
rows = [[f"{value * factor:.12g}".replace(".", ",") for value, factor in zip(row, scale)] for row in run.values]
write("unit_line.csv", ["Time"] + [f"{name} {j + 1}" for name in ("Position", "Speed", "Torque") for j in range(n)], [symbols, *rows],
      delimiter=";")

# One file a signal, written by recorders of their own: stamps half a millisecond late, the last rows missing.
write("q.csv", ["time"] + [f"q_{j}" for j in range(n)], text[["time"] + q].values)
write("tau.csv", ["time"] + [f"torque_{j}" for j in range(n)],
      [[f"{run['time'][k] + 0.0005:.6f}"] + list(text.loc[k, tau]) for k in range(len(run) - 1)])

# No time, and names that say nothing.
write("lbr.csv", [f"{group}_{j}" for group in ("q", "tau", "tau_ext") for j in range(n)],
      [list(text.loc[k, q + tau]) + ["0"] * n for k in range(len(run))])
write("own.csv", ["k"] + [f"pose_{j}" for j in range(n)] + [f"load_{j}" for j in range(n)],
      [[text["time"][k]] + list(text.loc[k, q + tau]) for k in range(len(run))])

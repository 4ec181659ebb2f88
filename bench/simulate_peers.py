#!/usr/bin/env python3
"""The closed loop of simulate_bench without friction in MuJoCo and with Pinocchio's forward dynamics.

    simulate_bench --motion referee.csv
    pip install mujoco pin numpy
    simulate_peers.py urdf/ur10e.urdf referee.csv

The same arm, controller (position-velocity feedback with gravity torque, held over 1 ms) and reference; the error is the largest of a joint
position against the referee of simulate_bench. Pinocchio has no integrator of its own: the classical Runge-Kutta method, one step a
sample, is the one that heft's first pair uses. Python calls both libraries, which costs some microseconds a call, so times are also given
for the library's part alone: of the evaluations (Pinocchio) or the steps (MuJoCo) made without anything in between."""
import csv
import re
import sys
import time

import numpy as np

ROTOR = np.array([2.0, 2.0, 1.2, 0.3, 0.3, 0.3])
KP = np.array([12000.0, 12000.0, 6000.0, 600.0, 600.0, 600.0])
KD = np.array([600.0, 600.0, 300.0, 30.0, 30.0, 30.0])
STEP = 1e-3


def read(path):
    with open(path, newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    table = np.array(rows[1:], dtype=float)
    return {name: table[:, 1 + 6 * k : 7 + 6 * k] for k, name in enumerate(["q", "qd", "tau", "qref", "qdref"])}


def run(referee, limit, gravity, step):
    """Closed loop; gravity(q), step(q, qd, tau) -> q, qd."""
    q, qd = referee["q"][0].copy(), referee["qd"][0].copy()
    worst = 0.0
    begin = time.process_time()
    for k in range(len(referee["q"]) - 1):
        tau = KP * (referee["qref"][k] - q) + KD * (referee["qdref"][k] - qd) + gravity(q)
        q, qd = step(q, qd, np.clip(tau, -limit, limit))
        worst = max(worst, np.abs(q - referee["q"][k + 1]).max())
    return time.process_time() - begin, worst


def tell(name, seconds, worst, alone):
    print(f"{name:<34} {1e3 * seconds:9.0f} {1e3 * alone:12.1f} {worst:12.1e}")


def pinocchio(urdf, referee):
    import pinocchio as pin

    model = pin.buildModelFromUrdf(urdf)
    model.armature = ROTOR
    data = model.createData()

    def step(q, qd, tau):
        h = STEP
        a1 = pin.aba(model, data, q, qd, tau).copy()
        v2 = qd + 0.5 * h * a1
        a2 = pin.aba(model, data, q + 0.5 * h * qd, v2, tau).copy()
        v3 = qd + 0.5 * h * a2
        a3 = pin.aba(model, data, q + 0.5 * h * v2, v3, tau).copy()
        v4 = qd + h * a3
        a4 = pin.aba(model, data, q + h * v3, v4, tau).copy()
        return q + h / 6 * (qd + 2 * v2 + 2 * v3 + v4), qd + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)

    seconds, worst = run(referee, model.effortLimit, lambda q: pin.computeGeneralizedGravity(model, data, q), step)
    q, qd, tau = referee["q"][5000], referee["qd"][5000], referee["tau"][5000]
    count = 4 * (len(referee["q"]) - 1)
    begin = time.process_time()
    for _ in range(count):
        pin.aba(model, data, q, qd, tau)
    tell(f"Pinocchio {pin.__version__}, RK4", seconds, worst, time.process_time() - begin)


def mujoco(urdf, referee):
    import mujoco as mj

    with open(urdf, encoding="utf-8") as file:
        text = file.read()
    limit = np.array([float(x) for x in re.findall(r'effort="([^"]+)"', text)])[:6]
    # Bodies alone: shapes do not matter to the dynamics, and static bodies stay as they are written.
    text = re.sub(r"<(visual|collision)[ >].*?</\1>", "", text, flags=re.S)
    text = text.replace("</robot>", '<mujoco><compiler fusestatic="true" balanceinertia="false" angle="radian"/></mujoco></robot>')
    for name in ["RK4", "IMPLICITFAST", "EULER"]:
        model = mj.MjModel.from_xml_string(text)
        model.opt.integrator = getattr(mj.mjtIntegrator, "mjINT_" + name)
        model.opt.timestep = STEP
        model.opt.gravity[:] = [0, 0, -9.81]
        model.opt.disableflags |= mj.mjtDisableBit.mjDSBL_CONTACT | mj.mjtDisableBit.mjDSBL_LIMIT
        model.dof_armature[:] = ROTOR
        model.dof_damping[:] = 0
        model.dof_frictionloss[:] = 0
        data, still = mj.MjData(model), mj.MjData(model)

        def gravity(q):
            still.qpos[:] = q
            still.qvel[:] = 0
            mj.mj_forward(model, still)
            return still.qfrc_bias.copy()

        def step(q, qd, tau):
            data.qpos[:], data.qvel[:], data.qfrc_applied[:] = q, qd, tau
            mj.mj_step(model, data)
            return data.qpos.copy(), data.qvel.copy()

        seconds, worst = run(referee, limit, gravity, step)
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = referee["q"][0], 0, referee["tau"][0]
        begin = time.process_time()
        mj.mj_step(model, data, nstep=len(referee["q"]) - 1)
        tell(f"MuJoCo {mj.__version__}, {name}", seconds, worst, time.process_time() - begin)


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    referee = read(sys.argv[2])
    print(f"{'':<34} {'time [ms]':>9} {'alone [ms]':>12} {'error [rad]':>12}")
    for peer in [pinocchio, mujoco]:
        try:
            peer(sys.argv[1], referee)
        except ImportError as missing:
            print(f"{peer.__name__}: not installed ({missing})")


if __name__ == "__main__":
    main()

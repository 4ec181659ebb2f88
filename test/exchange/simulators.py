#!/usr/bin/env python3
"""An identified UR5e in MuJoCo and Pinocchio: the torque of the files that `heft export` writes against heft's own.

usage: simulators.py HEFT
Exit code 77: mujoco or pinocchio is not installed (pip install mujoco pin).
"""
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET

try:
    import mujoco
    import numpy as np
    import pinocchio as pin
except ImportError as missing:
    print(f"not checked: {missing}")
    sys.exit(77)

heft = sys.argv[1]


def run(*arguments):
    return subprocess.run([heft, *arguments], check=True, stdout=subprocess.PIPE, text=True).stdout


def pinocchio_of_sdf(text):
    """Links and joints as SDF 1.7 says, read by Python's XML parser, as a Pinocchio model."""
    model = pin.Model()
    sdf = ET.fromstring(text).find("model")
    numbers = lambda element: np.array([float(x) for x in element.text.split()])
    place = lambda p: pin.SE3(pin.rpy.rpyToMatrix(p[3:]), p[:3])
    links = {link.get("name"): link for link in sdf.findall("link")}
    ids = {sdf.find("link").get("name"): 0}
    for joint in sdf.findall("joint"):
        if joint.get("type") == "fixed":
            continue
        parent, child = joint.find("parent").text, joint.find("child").text
        axis = numbers(joint.find("axis/xyz"))
        kind = pin.JointModelRevoluteUnaligned if joint.get("type") == "revolute" else pin.JointModelPrismaticUnaligned
        pose = links[child].find("pose")
        assert pose.get("relative_to") == parent
        ids[child] = model.addJoint(ids[parent], kind(axis), place(numbers(pose)), joint.get("name"))
        inertial = links[child].find("inertial")
        com = numbers(inertial.find("pose"))
        entry = {name: float(inertial.find(f"inertia/{name}").text) for name in "ixx ixy ixz iyy iyz izz".split()}
        tensor = np.array([[entry["ixx"], entry["ixy"], entry["ixz"]], [entry["ixy"], entry["iyy"], entry["iyz"]],
                           [entry["ixz"], entry["iyz"], entry["izz"]]])
        rotation = pin.rpy.rpyToMatrix(com[3:])
        body = pin.Inertia(float(inertial.find("mass").text), com[:3], rotation @ tensor @ rotation.T)
        model.appendBodyToJoint(ids[child], body, pin.SE3.Identity())
    return model


with tempfile.TemporaryDirectory() as folder:
    folder = pathlib.Path(folder)
    scenario = re.sub(r"//[^\n]*", "", run("simulate", "--example"))
    scenario = json.loads(scenario)
    scenario.update(payload=[], effects=[], duration=12.0)
    (folder / "s.json").write_text(json.dumps(scenario))
    run("simulate", "--scenario", str(folder / "s.json"), "-o", str(folder / "log.csv"))
    model = folder / "model.json"
    subprocess.run([heft, "identify", "--urdf", "ur5e", "--log", str(folder / "log.csv"), "--method", "physical", "-o",
                    str(model)], check=False, capture_output=True)
    joints = json.loads(model.read_text())["joints"]
    column = lambda key: np.array([joint[key] for joint in joints])

    random = np.random.default_rng(1)
    rows = 200
    q, qd, qdd = (random.uniform(-size, size, (rows, 6)) for size in (3.0, 2.0, 8.0))
    header = ",".join(["time"] + [f"{name}{j}" for name in ("q", "qd", "qdd") for j in range(1, 7)])
    whole = []
    for at in range(0, rows, 9):  # states that no motion connects: heft takes fewer than ten rows as such
        part = np.column_stack([q, qd, qdd])[at:at + 9]
        np.savetxt(folder / "states.csv", np.column_stack([np.arange(len(part)), part]), delimiter=",", header=header,
                   comments="", fmt="%.17g")
        run("dynamics", "--model", str(model), "--log", str(folder / "states.csv"), "-o", str(folder / "torque.csv"))
        torque = np.genfromtxt(folder / "torque.csv", delimiter=",", names=True)
        whole += [[torque[f"tau{j}"][k] for j in range(1, 7)] for k in range(len(part))]
    whole = np.array(whole)
    coulomb = column("coulomb_friction") * np.sign(qd) + column("friction_offset")
    viscous, rotor = column("viscous_friction") * qd, column("rotor_inertia") * qdd

    failed = False

    def check(what, found, expected):
        global failed
        error = np.abs(found - expected).max() / np.abs(expected).max()
        print(f"{what}: {error:.1e} of the largest torque")
        failed |= not error < 1e-9

    run("export", "--model", str(model), "--format", "mjcf", "-o", str(folder / "arm.xml"))
    m = mujoco.MjModel.from_xml_path(str(folder / "arm.xml"))
    check("frictionloss in MuJoCo", m.dof_frictionloss, column("coulomb_friction"))
    m.dof_frictionloss[:] = 0.0  # a soft constraint there, not sign(velocity)
    m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data = mujoco.MjData(m)
    found = np.empty_like(whole)
    for k in range(rows):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[k], qd[k], qdd[k]
        mujoco.mj_inverse(m, data)
        found[k] = data.qfrc_inverse
    check("MuJoCo, MJCF, inverse dynamics", found, whole - coulomb)

    rigid = whole - coulomb - viscous - rotor
    for name, read in (("urdf", lambda path: pin.buildModelFromUrdf(str(path))),
                       ("sdf", lambda path: pinocchio_of_sdf(path.read_text()))):
        path = folder / f"arm.{name}"
        run("export", "--model", str(model), "--format", name, "-o", str(path))
        p = read(path)
        d = p.createData()
        check(f"Pinocchio, {name.upper()}, inverse dynamics",
              np.array([pin.rnea(p, d, q[k], qd[k], qdd[k]) for k in range(rows)]), rigid)
    sys.exit(failed)

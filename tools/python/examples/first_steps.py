# %% [markdown]
# From a simulated log to a model, and to what the model lacks. Runs as a script, and cell by cell in an editor.

# %%
import heft

scenario = {
    "robot": "scara", "duration": 24.0, "sample_rate": 1000, "log_rate": 200, "seed": 1,
    "friction": {"coulomb": [4.0, 2.0, 12.0, 0.15], "viscous": [2.0, 1.0, 40.0, 0.05]},
    "controller": {"kind": "pd_gravity", "kp": [3000, 1500, 20000, 50], "kd": [150, 80, 900, 2]},
    "sensors": {"encoder_resolution": [2e-5, 2e-5, 2e-6, 2e-5], "torque_noise": [0.15, 0.1, 0.5, 0.02]},
    "reference": {"kind": "fourier", "q0": [0.1, -0.2, 0.1, 0.2],
                  "amplitude": [[0.8, 0.3, 0.2], [0.7, 0.4, 0.15], [0.05, 0.02, 0.01], [0.9, 0.4, 0.2]],
                  "frequency_hz": [[0.15, 0.5, 1.1], [0.2, 0.45, 1.0], [0.25, 0.6, 1.2], [0.3, 0.7, 1.3]],
                  "phase": [[0, 1, 2], [0.5, 0, 1], [1, 2, 0.3], [1.5, 0.3, 0.9]], "ramp": 1.5, "start": [0, 0, 0.1, 0]},
    "rotor_inertia": [0.05, 0.03, 2.0, 0.01],
    "effects": [{"kind": "spring", "joint": 1, "k": 8.0, "q0": 0.3}],
}
train = heft.simulate(scenario).log
scenario["seed"] = 2
scenario["reference"]["phase"] = [[1, 2, 0], [2, 0.5, 1], [0.3, 1, 2], [0.9, 1.5, 0.3]]
judge = heft.simulate(scenario).log
print(train)

# %% The columns are NumPy arrays, views of the log.
print("largest torque [N·m, N]:", abs(train.tau).max(axis=0))

# %% A model, judged on the other motion.
fit = heft.identify("scara", train, validate=judge)
print(fit.brief())

# %% What it lacks. In a notebook the object itself shows the page.
diagnosis = heft.diagnose("scara", train, validate=judge)
print(diagnosis.brief())
assert any(effect["kind"] == "spring" and effect["joint"] == 1 for effect in diagnosis.to_dict()["effects"])

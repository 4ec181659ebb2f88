/// @file
/// What `heft simulate --example` prints.
#pragma once

namespace heft::tools {

/// A scenario that runs as given, with every key explained; src/sim/README.md has the whole format.
inline constexpr const char* kExampleScenario = R"json({
  // A scenario of heft simulate and heft track. Comments like this one are allowed. SI units: m, N, s, kg, rad.
  // "Per joint": a list with one number a joint, or one number for all. Joints count from 1.
  "robot": "ur5e",            // name of a robot of heft, or a URDF next to this file
  "duration": 8.0,            // [s]
  "sample_rate": 1000,        // of controller and sensors [Hz]
  "log_rate": 500,            // rows a second; left out: every sample
  "seed": 7,                  // of all noise: the same seed gives the same log
  "truth": false,             // true adds columns q_true1.., tau_true1.., energies
  "rotor_inertia": [0.7, 0.7, 0.7, 0.12, 0.12, 0.12],  // per joint, behind the gear [kg m²]

  // What the arm is to follow: "hold", "fourier", "quintic" or "waypoints".
  "reference": {
    "kind": "fourier",        // q = q0 + sum of A sin(2 pi f t + phase), a row per joint
    "q0": [0.1, -1.1, 1.1, -0.4, 0.6, 0.0],
    "amplitude": [[0.4, 0.1], [0.3, 0.1], [0.3, 0.1], [0.5, 0.1], [0.5, 0.1], [0.8, 0.1]],
    "frequency_hz": [[0.2, 0.9], [0.25, 0.8], [0.3, 0.7], [0.35, 0.9], [0.4, 0.8], [0.45, 0.7]],
    "phase": [[0.0, 1.0], [0.5, 0.0], [1.0, 2.0], [1.5, 0.3], [2.0, 0.1], [2.5, 1.2]],
    "ramp": 1.5,              // [s] from rest at "start" into the motion
    "start": [0.0, -1.2, 1.0, -0.4, 0.6, 0.0]
  },
  "initial": {"position": [0.0, -1.2, 1.0, -0.4, 0.6, 0.0]},  // left out: where the reference starts

  // "pd", "pd_gravity" or "none"; heft track brings its own controllers and takes "track".
  "controller": {
    "kind": "pd_gravity",
    "kp": [3000, 3000, 2000, 300, 300, 300],   // [N m/rad]
    "kd": [150, 150, 100, 15, 15, 15]          // [N m s/rad]
  },
  "torque_limit": "robot",    // the URDF's effort limits; or per joint [N m], or "none"

  "friction": {
    "model": "stick_slip",    // or "smooth", "none"
    "coulomb": [5, 5, 4, 1.5, 1.5, 1.2],
    "breakaway": [6, 6, 5, 1.8, 1.8, 1.5],
    "viscous": [2, 2, 1.5, 0.5, 0.5, 0.4]
  },
  "sensors": {
    "encoder_resolution": 2e-5,                // [rad]
    "velocity": "differenced",                 // or "exact"
    "velocity_cutoff_hz": 100,
    "torque_noise": [0.5, 0.5, 0.5, 0.1, 0.1, 0.1]  // standard deviation [N m]
  },
  "payload": [
    {"event": "grasp", "time": 3.0, "mass": 2.5, "com": [0.0, 0.12, 0.01],
     "inertia": [0.004, 0, 0.003, 0, 0, 0.004]},    // Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the centre of mass
    {"event": "release", "time": 6.0}
  ],
  // What a model of rigid bodies and friction does not know, for heft diagnose to find.
  "effects": [
    {"kind": "stribeck", "joint": 2, "Fs": 3.0, "vs": 0.05}
  ]
}
)json";

/// The keys in short, for help texts.
inline constexpr const char* kScenarioKeys =
    "SCENARIO.json, SI units; lists per joint may be one number for all:\n"
    "  robot, duration  name or URDF of the arm; length [s] (both required)\n"
    "  reference        what to follow: kind hold, fourier, quintic or waypoints\n"
    "  controller       kind none, pd, pd_gravity (kp, kd per joint); track for heft track\n"
    "  initial          position, velocity; left out: where the reference starts\n"
    "  sample_rate, log_rate, seed, truth\n"
    "  torque, torque_limit, rotor_inertia, gravity, base_tilt\n"
    "  friction         model stick_slip, smooth or none; coulomb, breakaway, viscous, offset\n"
    "  sensors          encoder_resolution, velocity, acceleration, torque_noise, ...\n"
    "  payload          list of events grasp (mass, com, inertia) and release\n"
    "  effects          list of stribeck, ripple, elasticity, delay, contact, ...\n"
    "  solver           method, relative_tolerance, absolute_tolerance, max_step\n"
    "heft simulate --example prints one that runs, with comments; src/sim/README.md explains every key.\n";

}  // namespace heft::tools

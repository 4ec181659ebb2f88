// Writes the log that image and host replay: 20 s at 1 kHz of exciting motion of Kawasaki and Nishimura's arm with a
// load, with noise on the measured acceleration and torque.
//   firmware_make_log OUTPUT
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <numbers>
#include <random>

#include "firmware/arms.hpp"
#include "firmware/log_table.hpp"
#include "heft/core/arm_geometry.hpp"
#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/friction/friction.hpp"

namespace {

using namespace heft::firmware;

constexpr std::uint32_t kSamples = 20'000;
constexpr std::uint32_t kPeriodUs = 1'000;
constexpr double kLag = 0.002;              // of the arm behind its reference, s
constexpr double kAccelerationNoise = 3.0;  // rad/s²
constexpr double kTorqueNoise = 0.002;      // N·m

using Vector = heft::JointVector<double, kNumJoints>;

struct Motion {
  Vector q = Vector::Zero();
  Vector qd = Vector::Zero();
  Vector qdd = Vector::Zero();
};

// Six sines a joint between 0.25 and 1.7 Hz, no frequency twice, of equal part in the acceleration.
Motion motion_at(double time) {
  constexpr std::array<double, kNumJoints> kAcceleration = {3, 4, 5, 12, 9, 14};  // rms, rad/s²
  constexpr int kSines = 6;
  Motion motion;
  for (int joint = 0; joint < kNumJoints; ++joint) {
    for (int sine = 0; sine < kSines; ++sine) {
      const double omega = 2.0 * std::numbers::pi * (0.25 + 0.24 * sine + 0.037 * joint);
      const double peak = kAcceleration[joint] * std::sqrt(2.0 / kSines);
      const double phase = 1.3 * joint + 2.1 * sine + 0.7 * joint * sine;
      motion.qdd[joint] += peak * std::sin(omega * time + phase);
      motion.qd[joint] -= peak / omega * std::cos(omega * time + phase);
      motion.q[joint] -= peak / (omega * omega) * std::sin(omega * time + phase);
    }
  }
  return motion;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fputs("usage: firmware_make_log OUTPUT\n", stderr);
    return 2;
  }
  std::ofstream file(argv[1], std::ios::binary);
  const LogHeader header{kLogMagic, kSamples, sizeof(LogRow), kPeriodUs};
  file.write(reinterpret_cast<const char*>(&header), sizeof(header));

  const heft::ArmModel<double, kNumJoints> model = loaded_arm();
  const heft::DynamicArm<double, kNumJoints> arm(model);
  std::mt19937 generator(1984);
  std::normal_distribution<double> normal;
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    const double time = 1e-6 * kPeriodUs * i;
    const Motion reference = motion_at(time);
    const Motion motion = motion_at(time - kLag);
    const Vector tau = heft::inverse_dynamics(arm, motion.q, motion.qd, motion.qdd);
    LogRow row{};
    for (int joint = 0; joint < kNumJoints; ++joint) {
      const double friction = heft::friction_torque(model.actuation[joint], motion.qd[joint], 0.0);
      row.q[joint] = static_cast<float>(motion.q[joint]);
      row.qd[joint] = static_cast<float>(motion.qd[joint]);
      row.qdd[joint] = static_cast<float>(motion.qdd[joint] + kAccelerationNoise * normal(generator));
      row.q_ref[joint] = static_cast<float>(reference.q[joint]);
      row.qd_ref[joint] = static_cast<float>(reference.qd[joint]);
      row.qdd_ref[joint] = static_cast<float>(reference.qdd[joint]);
      row.tau[joint] = static_cast<float>(tau[joint] + friction + kTorqueNoise * normal(generator));
    }
    file.write(reinterpret_cast<const char*>(&row), sizeof(row));
  }
  file.close();
  if (!file) {
    std::fprintf(stderr, "firmware_make_log: %s could not be written\n", argv[1]);
    return 1;
  }
  return 0;
}

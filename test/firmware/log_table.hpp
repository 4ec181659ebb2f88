/// @file
/// The log that image and host replay: a small binary table, the same bytes on both sides.
#pragma once

#include <cstdint>

namespace heft::firmware {

inline constexpr int kNumJoints = 6;

/// One sample, in single precision as a drive would deliver it. Both double and float replays read these.
struct LogRow {
  float q_ref[kNumJoints];    ///< desired joint angle [rad]
  float qd_ref[kNumJoints];   ///< desired joint velocity [rad/s]
  float qdd_ref[kNumJoints];  ///< desired joint acceleration, the instrument [rad/s²]
  float q[kNumJoints];        ///< joint angle [rad]
  float qd[kNumJoints];       ///< joint velocity [rad/s]
  float qdd[kNumJoints];      ///< measured joint acceleration, noisy [rad/s²]
  float tau[kNumJoints];      ///< measured joint torque [N·m]
};

/// Start of the table; `samples` rows follow.
struct LogHeader {
  std::uint32_t magic;
  std::uint32_t samples;
  std::uint32_t row_bytes;
  std::uint32_t period_us;  ///< sample time [µs]
};

inline constexpr std::uint32_t kLogMagic = 0x54464548;  // "HEFT"

/// Rows of the table at `bytes`, null when that is no such table. `bytes` is aligned to 4.
inline const LogRow* rows_of(const void* bytes) noexcept {
  const auto* header = static_cast<const LogHeader*>(bytes);
  if (header->magic != kLogMagic || header->row_bytes != sizeof(LogRow)) return nullptr;
  return reinterpret_cast<const LogRow*>(header + 1);
}

}  // namespace heft::firmware

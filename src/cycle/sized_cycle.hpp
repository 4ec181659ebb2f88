/// @file
/// The cycle of an arm of so many joints.
#pragma once

#include <memory>
#include <optional>

#include "heft/cycle/cycle.hpp"
#include "heft/model/model_file.hpp"
#include "heft/monitor/monitor.hpp"

namespace heft::cycle {

class Cycle::Sized {
 public:
  virtual ~Sized() = default;
  virtual int num_joints() const noexcept = 0;
  virtual bool watches_contacts() const noexcept = 0;
  virtual void reset() noexcept = 0;
  /// Vectors have n entries.
  virtual Status inverse_dynamics(const double* q, const double* qd, const double* qdd, double period,
                                  double* tau) noexcept = 0;
  virtual Status update(const double* q, const double* qd, const double* tau, double period,
                        Output& out) noexcept = 0;
};

/// @param robot       that is moved: its motor torque is commanded
/// @param measured    the same as its torque is measured
/// @param thresholds  of contacts; none: they are not watched
/// @throws ModelError when core refuses one of them
std::unique_ptr<Cycle::Sized> make_sized(const model::Robot& robot, const model::Robot& measured,
                                         const std::optional<monitor::Thresholds>& thresholds,
                                         bool follow_load);

}  // namespace heft::cycle

#include "heft/data/log_checks.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "heft/host/error.hpp"
#include "log_check_impl.hpp"

namespace heft::data {
namespace {

using Eigen::Index;

constexpr double kFullTurn = 2.0 * std::numbers::pi;

/// A stretch over which a rate is compared with the change of what it is the rate of.
constexpr int kStretchRows = 4;
constexpr double kStretchTime = 0.05;
/// A step in time this many times the mean step so far, and longer than a stretch, is a gap: nobody knows the rate in it.
constexpr double kGapInSteps = 10.0;

}  // namespace

LogCheck::LogCheck(std::string path, int num_joints)
    : impl_(std::make_unique<Impl>(std::move(path), num_joints)) {}
LogCheck::~LogCheck() = default;
LogCheck::LogCheck(LogCheck&&) noexcept = default;
LogCheck& LogCheck::operator=(LogCheck&&) noexcept = default;

void LogCheck::add(const Eigen::Ref<const Eigen::VectorXd>& time, const Eigen::Ref<const Eigen::MatrixXd>& q,
                   const Eigen::Ref<const Eigen::MatrixXd>& qd, const Eigen::Ref<const Eigen::MatrixXd>& qdd,
                   const Eigen::Ref<const Eigen::MatrixXd>& tau) {
  Impl& s = *impl_;
  s.has_velocity = qd.cols() == s.n;
  s.has_acceleration = qdd.cols() == s.n;
  s.has_torque = tau.cols() == s.n;
  const Index count = time.size();
  if (count == 0) return;
  s.low = s.low.min(q.colwise().minCoeff().transpose().array());
  s.high = s.high.max(q.colwise().maxCoeff().transpose().array());
  if (s.has_torque) {
    s.least_torque = s.least_torque.min(tau.colwise().minCoeff().transpose().array());
    s.most_torque = s.most_torque.max(tau.colwise().maxCoeff().transpose().array());
  }

  // Joint by joint over the rows of this part, which is fast for matrices in columns; where stretches end,
  // and whether a row is the one before, is the same for all joints and found first.
  const auto n_rows = static_cast<std::size_t>(count);
  Impl::Part part;
  part.from_start = s.rows == 0;
  part.times.resize(n_rows + 1);
  part.times[0] = part.from_start ? time[0] : s.last_time;
  std::copy(time.data(), time.data() + count, part.times.begin() + 1);
  part.repeats.resize(n_rows, 1);
  part.ends.resize(n_rows, 0);
  part.gaps.resize(n_rows, 0);
  s.find_stretches(part);

  // A column with the row before the part in front.
  std::vector<double> position(n_rows + 1), speed(n_rows + 1), rate(n_rows + 1);
  const auto load = [&](std::vector<double>& to, const Eigen::Ref<const Eigen::MatrixXd>& from, int joint,
                        Eigen::ArrayXd& last) {
    if (part.from_start) last[joint] = from(0, joint);
    to[0] = last[joint];
    std::copy(from.col(joint).data(), from.col(joint).data() + count, to.begin() + 1);
    last[joint] = to[n_rows];
    for (std::size_t k = 0; k < n_rows; ++k)
      part.repeats[k] = static_cast<char>(part.repeats[k] & (to[k + 1] == to[k]));
  };
  for (int joint = 0; joint < s.n; ++joint) {
    load(position, q, joint, s.last_q);
    if (s.has_torque) {
      load(rate, tau, joint, s.last_tau);
      s.add_torque(joint, part, position, rate);
    }
    if (s.has_velocity) load(speed, qd, joint, s.last_qd);
    if (s.has_acceleration) {
      std::copy(qdd.col(joint).data(), qdd.col(joint).data() + count, rate.begin() + 1);
      rate[0] = part.from_start ? rate[1] : s.last_qdd[joint];
      s.last_qdd[joint] = rate[n_rows];
    }
    if (part.from_start) {
      s.stretch_q[joint] = position[0];
      if (s.has_velocity) s.stretch_qd[joint] = speed[0];
    }
    s.add_joint(joint, part, position, speed, rate);
  }
  s.count_repetition(part);
  s.last_time = time[count - 1];
  s.rows += count;
}

/// Where stretches end, and in which rows time has a gap.
void LogCheck::Impl::find_stretches(Part& part) {
  const std::vector<double>& times = part.times;
  if (part.from_start) {
    begin = times[0];
    stretch_time = times[0];
    stretch_rows = 0;
  }
  part.first_stretch_time = stretch_time;
  for (std::size_t k = part.second(); k < part.rows(); ++k) {
    const double step = times[k + 1] - times[k];
    const bool gap = regular_steps >= 10 && step > kStretchTime &&
                     step > kGapInSteps * stepped / static_cast<double>(regular_steps);
    if (gap) {
      part.gaps[k] = part.ends[k] = 1;
      stretch_time = times[k + 1];
      stretch_rows = 0;
      late_stamps.interrupt();
      continue;
    }
    late_stamps.add(step, times[k]);
    stepped += step;
    ++regular_steps;
    ++stretch_rows;
    if (stretch_rows < kStretchRows || times[k + 1] - stretch_time < kStretchTime) continue;
    part.ends[k] = 1;
    stretch_time = times[k + 1];
    stretch_rows = 0;
  }
}

/// @param position, speed, rate  of the row before, then of the rows
void LogCheck::Impl::add_joint(int joint, const Part& part, const std::vector<double>& position,
                               const std::vector<double>& speed, const std::vector<double>& rate) {
  const auto j = static_cast<std::size_t>(joint);
  const std::vector<double>& times = part.times;
  double begin_time = part.first_stretch_time;
  double position_change = claimed_q[joint];
  double speed_change = claimed_qd[joint];
  bool skip = skip_stretch[j] != 0;
  for (std::size_t k = part.second(); k < part.rows(); ++k) {
    const double period = times[k + 1] - times[k];
    const bool turn = add_step(j, position[k], position[k + 1], times[k + 1]);
    if (turn) skip = true;
    if (turn || part.gaps[k] != 0) {
      positions[j].interrupt();
    } else {
      positions[j].add(position[k], position[k + 1], times[k + 1], period);
    }
    if (has_velocity) position_change += 0.5 * period * (speed[k] + speed[k + 1]);
    if (has_acceleration) speed_change += 0.5 * period * (rate[k] + rate[k + 1]);
    if (part.ends[k] == 0) continue;
    if (!skip && part.gaps[k] == 0) {
      const double duration = times[k + 1] - begin_time;
      velocity[j].add(position_change, position[k + 1] - stretch_q[joint], duration);
      if (has_velocity && has_acceleration) {
        acceleration[j].add(speed_change, speed[k + 1] - stretch_qd[joint], duration);
      }
    }
    begin_time = times[k + 1];
    stretch_q[joint] = position[k + 1];
    if (has_velocity) stretch_qd[joint] = speed[k + 1];
    position_change = speed_change = 0.0;
    skip = false;
  }
  claimed_q[joint] = position_change;
  claimed_qd[joint] = speed_change;
  skip_stretch[j] = skip ? 1 : 0;
}

/// @param position, torque  of the row before, then of the rows
void LogCheck::Impl::add_torque(int joint, const Part& part, const std::vector<double>& position,
                                const std::vector<double>& torque) {
  HeldTorque& held = torques[static_cast<std::size_t>(joint)];
  TorqueSpikes& spikes = torque_spikes[static_cast<std::size_t>(joint)];
  for (std::size_t k = part.second(); k < part.rows(); ++k) {
    spikes.add(torque[k], torque[k + 1], part.times[k + 1]);
    if (part.gaps[k] != 0) {
      held.interrupt();
    } else {
      held.add(torque[k], torque[k + 1], position[k], position[k + 1], part.times[k + 1],
               part.times[k + 1] - part.times[k]);
    }
  }
}

/// A change of position from row to row. @return whether it is a jump by a whole turn
bool LogCheck::Impl::add_step(std::size_t joint, double from, double to, double time) {
  const auto j = static_cast<Index>(joint);
  const double step = std::abs(to - from);
  if (step > 0.0) {
    least_step[j] = std::min(least_step[j], step);
    ++steps[j];
    if (step > 5.9 && (std::abs(step / kFullTurn - 1.0) < 0.05 || std::abs(step / 360.0 - 1.0) < 0.05)) {
      Jump& jump = jumps[joint];
      if (jump.count++ == 0) {
        jump.size = to - from;
        jump.time = time;
      }
      return true;
    } else {
      step_sum[j] += step;
    }
  } else {
    ++rests[j];
  }
  return false;
}

/// Rows that repeat the one before.
void LogCheck::Impl::count_repetition(const Part& part) {
  for (std::size_t k = part.second(); k < part.rows(); ++k) {
    if (part.repeats[k] != 0) {
      ++run;
    } else {
      if (run <= kLongestRepetition) repeated += run;
      run = 0;
    }
  }
}

std::vector<LogFinding> check_log(const Log& log, const JointLimits& limits) {
  LogCheck check(log.path, log.num_joints());
  check.add(log.time, log.q, log.qd, log.qdd, log.tau);
  return check.findings(limits);
}

void refuse_errors(const std::vector<LogFinding>& findings) {
  for (const LogFinding& finding : findings) {
    if (finding.severity == Severity::kError) throw DataError(finding.message);
  }
}

}  // namespace heft::data

#include "encoder_stretches.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "heft/data/differentiate.hpp"

namespace heft::stiffness {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// Lost samples of less than this are bridged for the filter's sake, and not used [s].
constexpr double kBridged = 0.25;

}  // namespace

const VectorXd* link_column(const data::Log& log, int joint) {
  const std::string name = fmt::format("qlink{}", joint + 1);
  for (const auto& [header, values] : log.extra) {
    if (header == name) return &values;
  }
  return nullptr;
}

std::vector<Stretch> stretches_of(const data::Log& log, int index, int joint, const MatrixXd* model) {
  const VectorXd& qlink = *link_column(log, joint);
  std::vector<Index> rows;
  for (Index k = 0; k < log.num_samples(); ++k) {
    if (std::isfinite(log.time[k]) && std::isfinite(log.q(k, joint)) && std::isfinite(qlink[k]) &&
        std::isfinite(log.tau(k, joint)) && (model == nullptr || std::isfinite((*model)(k, joint))))
      rows.push_back(k);
  }
  std::vector<Stretch> result;
  if (log.num_samples() < 2) return result;
  const double period = 1.0 / data::median_sample_rate(log.time);
  const double gap = std::max(5.0 * period, kBridged);
  for (std::size_t begin = 0; begin < rows.size();) {
    std::size_t end = begin + 1;
    while (end < rows.size() && log.time[rows[end]] - log.time[rows[end - 1]] <= gap) ++end;
    const double duration = log.time[rows[end - 1]] - log.time[rows[begin]];
    if (duration >= kShortestStretch && end - begin >= 10) {
      const Index m = static_cast<Index>(end - begin);
      VectorXd time(m);
      MatrixXd raw(m, model == nullptr ? 3 : 4);
      for (Index i = 0; i < m; ++i) {
        const Index k = rows[begin + static_cast<std::size_t>(i)];
        time[i] = log.time[k];
        raw(i, 0) = log.q(k, joint);
        raw(i, 1) = qlink[k];
        raw(i, 2) = log.tau(k, joint);
        if (model != nullptr) raw(i, 3) = (*model)(k, joint);
      }
      Stretch s;
      s.log = index;
      const Index n = static_cast<Index>(std::llround(duration / period)) + 1;
      s.rate = static_cast<double>(n - 1) / duration;
      s.time = VectorXd::LinSpaced(n, time[0], time[m - 1]);
      s.measured.assign(static_cast<std::size_t>(n), 0);
      for (const double t : time) {
        const Index at = std::clamp<Index>(std::llround((t - time[0]) * s.rate), 0, n - 1);
        s.measured[static_cast<std::size_t>(at)] = 1;
      }
      const MatrixXd even = m == n && data::is_uniform(time) ? raw : data::resample(time, raw, s.time);
      s.q = even.col(0);
      s.qlink = even.col(1);
      s.tau = even.col(2);
      if (model != nullptr) s.model = even.col(3);
      result.push_back(std::move(s));
    }
    begin = end;
  }
  return result;
}

VectorXd smooth(const VectorXd& signal, double rate, double cutoff) {
  return cutoff < 0.4 * rate ? VectorXd(data::low_pass_zero_phase(signal, rate, cutoff)) : signal;
}

double bandwidth_of(const data::Log& log) {
  Index best = 0, best_begin = 0, begin = 0;
  for (Index k = 0; k <= log.num_samples(); ++k) {
    if (k < log.num_samples() && log.q.row(k).allFinite() && std::isfinite(log.time[k])) continue;
    if (k - begin > best) {
      best = k - begin;
      best_begin = begin;
    }
    begin = k + 1;
  }
  if (best < 10) return 0.0;
  const VectorXd time = log.time.segment(best_begin, best);
  const VectorXd even = VectorXd::LinSpaced(best, time[0], time[best - 1]);
  const MatrixXd q = data::resample(time, log.q.middleRows(best_begin, best), even);
  return data::motion_bandwidth(q, static_cast<double>(best - 1) / (even[best - 1] - even[0]));
}

void filter(Stretch& s, double cutoff, double rotor_inertia, const JointEncoderOptions& options) {
  s.q_smooth = smooth(s.q, s.rate, cutoff);
  s.qlink_smooth = smooth(s.qlink, s.rate, cutoff);
  s.qd = data::differentiate(s.time, s.q_smooth);
  const VectorXd qdd = data::differentiate(s.time, s.qd);
  // The sign of the motion is taken where reversals are still sharp, and then filtered like the deflection.
  const double fast = std::min(4.0 * cutoff, 0.39 * s.rate);
  const VectorXd quick = data::differentiate(s.time, smooth(s.q, s.rate, fast));
  s.direction = smooth((quick.array() / options.sign_width).tanh().matrix(), s.rate, cutoff);
  const VectorXd tau = smooth(s.tau, s.rate, cutoff);
  // What the motor feeds into the gear: τ − ρ² I_r q̈.
  const VectorXd measured = tau - rotor_inertia * qdd;
  if (options.torque == GearTorque::kMeasured) {
    s.torque = s.instrument = measured;
  } else {
    s.instrument = smooth(s.model, s.rate, cutoff);
    s.torque = options.torque == GearTorque::kModel ? s.instrument : measured;
  }
  // What tau holds just above the filter's band, noise or not, is as much in every Hz below it at most: torque spectra
  // fall. Ripple far above says nothing.
  if (options.torque == GearTorque::kMeasured && 4.0 * cutoff < 0.4 * s.rate) {
    const VectorXd above = smooth(s.tau, s.rate, 4.0 * cutoff) - smooth(s.tau, s.rate, 2.0 * cutoff);
    s.torque_noise = above.squaredNorm() / static_cast<double>(above.size()) / 2.0;
  }
}

}  // namespace heft::stiffness

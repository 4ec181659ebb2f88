#include "operation_count_line.hpp"

#include <array>
#include <cmath>

#include <fmt/format.h>

#include "counting_scalar.hpp"
#include "heft/core/estimate/terminal_link_estimator.hpp"
#include "heft/model/named_arms.hpp"

namespace heft::studies {

std::string operation_count_line() {
  using bench::Counted;
  using Arm = StaticArm<Counted, model::KawasakiArm>;
  using Vector = Arm::Vector;
  TerminalLinkEstimator<Arm, 4> estimator;
  ReducedParameters<Counted, model::KawasakiArm> nominal;
  const auto links = reduced_links(model::KawasakiArm::kModel);
  for (std::size_t j = 0; j < links.size(); ++j) {
    for (std::size_t i = 0; i < links[j].size(); ++i) {
      nominal.links[j][i] = Counted(links[j][i]);
    }
  }
  TerminalLinkEstimator<Arm, 4>::Config config;
  // Counts do not depend on the data; the checks are to let the steady state come soon.
  config.max_amplification = Counted(1e9);
  config.max_amplification_least_squares = Counted(1e9);
  config.gate = Counted(1e6);
  const Vector zero = Vector::Constant(Counted(0.0));
  if (estimator.configure(config, nominal, zero, zero) != Status::kOk) {
    return {};
  }
  TerminalLinkEstimator<Arm, 4>::Record record;
  bench::OperationCount total;
  int counted = 0;
  for (int n = 0; n < 2000 && counted < 200; ++n) {
    Vector q, qd, qdd, instrument, tau;
    for (int i = 0; i < 6; ++i) {
      const double phase = 0.05 * n * (1 + 0.37 * i) + i;
      q[i] = Counted(std::sin(phase));
      qd[i] = Counted(2 * std::cos(1.3 * phase));
      instrument[i] = Counted(-5 * std::sin(1.7 * phase));
      qdd[i] = Counted(-5 * std::sin(1.7 * phase) + 0.5 * std::sin(91.0 * n + i));
      tau[i] = Counted(std::cos(0.7 * phase));
    }
    const bool steady = estimator.source() == EstimateSource::kInstrumental;
    const bench::OperationCount before = bench::counter();
    if (estimator.update(q, qd, qdd, instrument, tau, record) != Status::kOk) {
      return {};
    }
    // Whole periods of the solve: 200 samples are four of them.
    if (steady) {
      total += bench::counter() - before;
      ++counted;
    }
  }
  if (counted == 0) {
    return {};
  }
  return fmt::format(
      "one estimator sample (6 joints, k = 5, 18 parameters): {:.1f} multiplications, {:.1f} additions, "
      "solves included; Kawasaki and Nishimura (1984): about 1800 and 1500",
      static_cast<double>(total.mul) / counted, static_cast<double>(total.add) / counted);
}

}  // namespace heft::studies

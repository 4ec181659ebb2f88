/// @file
/// The terminal-link estimator under glitches, in both precisions: runs, and the torque error that the loop would see.
#pragma once

#include <cmath>
#include <type_traits>
#include <vector>

#include "support/terminal_link_run.hpp"

namespace heft::test {

/// An estimator of rows 5 and 6 in a precision and a form.
template <typename ScalarType, EstimatorForm FormValue>
struct TerminalLinkCase {
  using Scalar = ScalarType;
  using Arm = StaticArm<Scalar, model::KawasakiArm>;
  using Vector = typename Arm::Vector;
  using Estimator = TerminalLinkEstimator<Arm, 4, FormValue>;
  using Config = typename Estimator::Config;
  static constexpr EstimatorForm kForm = FormValue;

  static Status configure(Estimator& estimator, const Config& config) {
    ReducedParameters<Scalar, model::KawasakiArm> nominal;
    const auto links = reduced_links(model::KawasakiArm::kModel);
    for (std::size_t j = 0; j < 6; ++j) {
      for (std::size_t i = 0; i < 10; ++i) nominal.links[j][i] = static_cast<Scalar>(links[j][i]);
    }
    return estimator.configure(config, nominal, nominal_coulomb().cast<Scalar>().eval(), Vector::Zero());
  }

  static Status update(Estimator& estimator, const TerminalLinkSample& s) {
    typename Estimator::Record record;
    return estimator.update(s.q.cast<Scalar>(), s.qd.cast<Scalar>(), s.measured.cast<Scalar>(),
                            s.qdd.cast<Scalar>(), s.tau.cast<Scalar>(), record);
  }

  /// RMS error of the torque of rows 5 and 6 over the RMS torque, on samples without acceleration noise.
  static double torque_error(const Estimator& estimator, const std::vector<TerminalLinkSample>& judged) {
    double error = 0, torque = 0;
    for (const TerminalLinkSample& s : judged) {
      std::array<TerminalRows<double, TerminalLayout<Arm6, 4>>, 1> rows{};
      terminal_rows<Arm6, 4, 1>(terminal_trigonometry<Arm6, 4>(s.q), s.q, s.qd, {s.qdd}, 0.0, rows);
      for (std::size_t r = 0; r < 2; ++r) {
        double predicted = 0;
        for (std::size_t c = 0; c < rows[0][r].size(); ++c) {
          predicted += rows[0][r][c] * static_cast<double>(estimator.estimate()[c]);
        }
        error += std::pow(s.tau[4 + static_cast<int>(r)] - predicted, 2);
        torque += std::pow(s.tau[4 + static_cast<int>(r)], 2);
      }
    }
    return std::sqrt(error / torque);
  }
};

using TerminalLinkCases = ::testing::Types<
    TerminalLinkCase<double, EstimatorForm::kInformation>, TerminalLinkCase<double, EstimatorForm::kFactored>,
    TerminalLinkCase<float, EstimatorForm::kInformation>, TerminalLinkCase<float, EstimatorForm::kFactored>>;

/// Which number of a sample a glitch strikes.
enum class Glitch { kTorque, kMeasured, kInstrument };

/// The sample with one number of joint 6 struck.
inline TerminalLinkSample struck(TerminalLinkSample s, Glitch glitch, double size) {
  (glitch == Glitch::kTorque ? s.tau : glitch == Glitch::kMeasured ? s.measured : s.qdd)[5] = size;
  return s;
}

}  // namespace heft::test

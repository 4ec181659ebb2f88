// Springs between motors and links.
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "../arm_search.hpp"
#include "../deflection.hpp"
#include "heft/model/batch_dynamics.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Mass matrices along the motion: for each joint its column of M, m × n.
std::vector<MatrixXd> inertia_of(const Workbench& bench) {
  const int n = bench.table->num_joints;
  MatrixXd all(bench.table->rows(), n * n);
  model::BatchDynamics(*bench.robot).mass_matrix(bench.motion->q, all);
  std::vector<MatrixXd> inertia;
  for (int j = 0; j < n; ++j) inertia.push_back(all.middleCols(n * j, n));
  return inertia;
}

/// One joint: the spring by the frequency at which its link swings with the motor locked, then the damping.
class SpringSearch {
 public:
  /// @param inertia  the joint's column of M, m × n
  SpringSearch(const Workbench& bench, int joint, const MatrixXd& inertia)
      : bench_(bench), joint_(joint), inertia_(inertia), own_(inertia.col(joint)), mean_(own_.mean()) {}

  Candidate run() const {
    Candidate c(ElasticJoint{});
    c.joint = joint_;
    if (!(own_.minCoeff() > 0.0)) {
      c.refused = "the fitted inertia about this joint is not positive";
      return c;
    }
    double frequency = 0.0, ratio = 0.02;
    c.tried = kSteps;
    if (!search(frequency, ratio)) {
      c.refused = "explains nothing";
      return c;
    }
    c.shape = stiffness_of(frequency);
    c.second = damping_of(c.shape, ratio);
    const VectorXd acceleration = acceleration_of(c.shape, c.second);
    c.columns = columns_of(acceleration, true);
    c.trial = judge(bench_, c);
    if (!c.trial.valid) {
      c.columns = columns_of(acceleration, false);
      c.trial = judge(bench_, c);
    }
    if (c.trial.valid && c.trial.coefficients[0] < 0.3)
      c.refused = "the joint would have to deflect against the load";
    if (c.trial.valid && c.trial.coefficients.size() > 1 && c.trial.coefficients[1] < -2.0 * c.trial.std[1]) {
      c.refused = "the motor's inertia would be negative";
    }
    return c;
  }

 private:
  static constexpr int kSteps = 14;

  /// @return whether any spring explains something
  bool search(double& frequency, double& ratio) const {
    double best_gain = 0.0;
    constexpr double kFrom = 3.0, kTo = 45.0;  // [Hz]
    const double step = std::pow(kTo / kFrom, 1.0 / (kSteps - 1));
    const auto take_best_of = [&](const auto& shapes, const auto& spring_of, double& best) {
      MatrixXd accelerations(bench_.table->rows(), static_cast<Index>(shapes.size()));
      for (std::size_t k = 0; k < shapes.size(); ++k) {
        const auto [stiffness, damping] = spring_of(shapes[k]);
        accelerations.col(static_cast<Index>(k)) = acceleration_of(stiffness, damping);
      }
      const auto write = [&](int joint, Index from, Eigen::Ref<MatrixXd> values) {
        values = -(accelerations.middleRows(from, values.rows()).array().colwise() *
                   inertia_.col(joint).segment(from, values.rows()).array());
      };
      take_best(bench_, shapes, write, best, best_gain);
    };
    const auto at_frequency = [&](double hz) {
      return std::pair(stiffness_of(hz), damping_of(stiffness_of(hz), ratio));
    };
    std::array<double, kSteps> frequencies{};
    for (int k = 0; k < kSteps; ++k) frequencies[static_cast<std::size_t>(k)] = kFrom * std::pow(step, k);
    take_best_of(frequencies, at_frequency, frequency);
    if (frequency == 0.0) return false;
    double width = step;
    for (int pass = 0; pass < 5; ++pass) {
      width = std::sqrt(width);
      take_best_of(std::array{frequency / width, frequency * width}, at_frequency, frequency);
    }
    const double stiffness = stiffness_of(frequency);
    take_best_of(
        std::array{0.005, 0.01, 0.04, 0.08},
        [&](double other) { return std::pair(stiffness, damping_of(stiffness, other)); }, ratio);
    return true;
  }

  double stiffness_of(double hz) const { return std::pow(2.0 * std::numbers::pi * hz, 2) * mean_; }
  double damping_of(double stiffness, double ratio) const {
    return 2.0 * ratio * std::sqrt(stiffness * mean_);
  }

  VectorXd acceleration_of(double stiffness, double damping) const {
    return deflection(*bench_.table, bench_.load->col(joint_), own_, stiffness, damping).acceleration;
  }

  /// @param acceleration  of the deflection
  /// @param motor  with a column of the motor's inertia
  Columns columns_of(const VectorXd& acceleration, bool motor) const {
    const int n = bench_.table->num_joints;
    Columns columns;
    columns.joints = all_joints(n);
    for (int i = 0; i < n; ++i) {
      MatrixXd value = MatrixXd::Zero(bench_.table->rows(), motor ? 2 : 1);
      value.col(0) = -inertia_.col(i).cwiseProduct(acceleration);
      if (motor && i == joint_) value.col(1) = bench_.motion->qdd.col(joint_);
      columns.values.push_back(std::move(value));
    }
    return columns;
  }

  const Workbench& bench_;
  int joint_;
  const MatrixXd& inertia_;
  VectorXd own_;  ///< M_jj along the motion
  double mean_;
};

std::vector<Candidate> propose_spring(const Workbench& bench, const std::vector<bool>& joints) {
  const std::vector<MatrixXd> inertia = inertia_of(bench);
  std::vector<Candidate> found;
  for (int j = 0; j < bench.table->num_joints; ++j) {
    if (joints[static_cast<std::size_t>(j)] && !bench.springs[static_cast<std::size_t>(j)])
      found.push_back(SpringSearch(bench, j, inertia[static_cast<std::size_t>(j)]).run());
  }
  return found;
}

/// @param c  motor inertia, or none
void apply_spring(const Candidate& effect, const VectorXd& c, model::Robot& robot) {
  robot.elasticities.push_back({effect.joint, effect.shape, effect.second, c.size() > 0 ? c[0] : 0.0});
}

void describe_spring(const Candidate& effect, const VectorXd& c, const model::Robot&, Finding& finding) {
  finding.parameters = {
      {"stiffness", effect.shape}, {"damping", effect.second}, {"motor_inertia", c.size() > 0 ? c[0] : 0.0}};
}

}  // namespace

ArmSearch search_of(ElasticJoint) { return {propose_spring, apply_spring, describe_spring}; }

}  // namespace heft::diagnose

#include "payload_run.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include <fmt/format.h>

#include "beyond_regressor.hpp"
#include "change_detector.hpp"
#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/statistics/block_jackknife.hpp"
#include "heft/statistics/distributions.hpp"
#include "load_geometry.hpp"
#include "load_recursion.hpp"
#include "recursive_fit.hpp"
#include "torque_scales.hpp"

namespace heft::payload {
namespace {

/// A parameter counts as identified when the data have reduced its prior standard deviation to less than
/// this share.
constexpr double kIdentified = 0.1;
/// A mass below this many half-widths of its interval says nothing of the joints' torque scales.
constexpr double kClearLoad = 3.0;
/// Length of the shortest blocks that sums are kept for [s].
constexpr double kFineBlock = 0.5;

void check(const model::Robot& robot, const data::Log& log, const PayloadRunOptions& options) {
  const int n = robot.num_joints();
  if (options.first_joint < 1 || options.first_joint > n) {
    throw DataError(fmt::format("rows from joint {}: robot \"{}\" has {} joints; expected 1 to {}",
                                options.first_joint, robot.name, n, n));
  }
  if (log.num_joints() != n || log.tau.cols() != n) {
    throw DataError(
        fmt::format("{}: {} joint positions and {} torques; expected {} of each, as robot \"{}\" has",
                    log.path, log.num_joints(), log.tau.cols(), n, robot.name));
  }
  if (log.num_samples() < 2)
    throw DataError(fmt::format("{}: {} samples; expected at least 2", log.path, log.num_samples()));
}

class Run {
  /// Stretch of the log under one load.
  struct Segment {
    double begin;
    std::vector<int> blocks;
  };

 public:
  Run(const model::Robot& robot, data::Log log, const PayloadRunOptions& options)
      : dynamics_(robot),
        log_(std::move(log)),
        options_(options),
        x_(dynamics_.parameters()),
        T_(to_flange(robot)) {}

  PayloadRun run() {
    PayloadRun result;
    result.first_joint = options_.first_joint;
    result.samples = log_.num_samples();
    result.cutoff = options_.cutoff > 0             ? options_.cutoff
                    : options_.residual.has_value() ? options_.residual->cutoff
                                                    : choose_cutoff(log_);
    if (!(result.cutoff > 0)) result.cutoff = choose_cutoff(log_);
    cutoff_ = result.cutoff;
    result.mass_visible = mass_is_visible(dynamics_, options_.first_joint - 1);
    period_ =
        (log_.time[log_.num_samples() - 1] - log_.time[0]) / static_cast<double>(log_.num_samples() - 1);

    if (options_.residual) {
      residual_ = *options_.residual;
    } else {
      learn_residual();
    }
    pass(result, 1.0);
    conclude(result);
    return result;
  }

 private:
  bool is_used(int i) const { return i >= options_.first_joint - 1; }

  /// Without statistics of the model: run once with the noise guessed, and take the scatter of the
  /// innovations.
  void learn_residual() {
    residual_.std.resize(n_);
    residual_.correlation_time = Eigen::VectorXd::Constant(n_, 0.5);
    for (int i = 0; i < n_; ++i) residual_.std[i] = 0.05 * log_.tau.col(i).cwiseAbs().maxCoeff() + 1e-6;
    PayloadRun scratch;
    pass(scratch, 0.5);
    for (int i = 0; i < n_; ++i) {
      double squares = 0.0;
      long count = 0;
      for (const double e : innovations_.col(i)) {
        if (!std::isfinite(e)) continue;
        squares += e * e;
        ++count;
      }
      if (count > 100) residual_.std[i] = std::max(1e-6, std::sqrt(squares / static_cast<double>(count)));
      residual_.correlation_time[i] = statistics::correlation_time(innovations_.col(i), period_);
    }
  }

  /// The recursion over the log.
  void pass(PayloadRun& result, double progress_share) {
    const std::unique_ptr<Recursion> recursion = make_recursion(dynamics_, cutoff_, 1.0 / period_);
    if (recursion->configure(recursion_settings()) != Status::kOk) {
      throw Error("payload: the estimator refused its settings; the gate must not be negative");
    }
    begin_pass(*recursion, result);
    ChangeDetector<model::kMaxJoints> detector;
    Innovation innovation;
    double spread = 1.0;  // robust standard deviation of the mass over the recursion's own
    int last_block = -1;
    double previous = log_.time[0];
    for (Eigen::Index k = 0; k < log_.num_samples(); ++k) {
      show_progress(k, progress_share);
      const double time = log_.time[k];
      const double step = time - previous;
      previous = time;
      const Taken taken = recursion->take(log_, k);
      if (taken == Taken::kRefused) ++result.left_out;
      if (taken != Taken::kReady) continue;
      if (recursion->update(x_, innovation) != Status::kOk) {
        ++result.left_out;
        continue;
      }
      const int block = block_at(time);
      const std::optional<double> changed = take_rows(*recursion, innovation, k, step, detector, result);
      if (block != last_block) {
        segments_.back().blocks.push_back(block);
        last_block = block;
        spread = running_spread(recursion->mass_std());
      }
      if (changed) {
        begin_segment(*changed, block);
        recursion->restart();
        detector.reset();
      }
      if (!segments_.back().blocks.empty() && segments_.back().blocks.back() <= skip_until_)
        segments_.back().blocks.clear();
      result.mass_history[k] = recursion->mass();
      const double own = recursion->mass_std();
      if (own < kIdentified * std::sqrt(prior_variance_[0])) result.mass_std_history[k] = spread * own;
    }
  }

  RecursionSettings recursion_settings() const {
    RecursionSettings config;
    config.first_row = options_.first_joint - 1;
    config.noise_std = residual_.std;
    config.correlated_samples = residual_.correlated_samples(period_);
    config.gate = options_.gate;
    config.standstill_speed = options_.standstill_speed;
    config.estimate_friction = !options_.torque_at_joint;
    config.friction_prior = friction_prior(dynamics_.robot(), 0, residual_.std, false);
    config.drive_scale = Eigen::VectorXd::Ones(n_);
    for (std::size_t i = 0; i < options_.drive_scale.size(); ++i)
      config.drive_scale[static_cast<Eigen::Index>(i)] = options_.drive_scale[i].value;
    return config;
  }

  /// Empties what a pass fills.
  void begin_pass(const Recursion& recursion, PayloadRun& result) {
    prior_variance_ = Eigen::VectorXd::Constant(parameters_, 0.0);
    for (int i = 0; i < parameters_; ++i) prior_variance_[i] = recursion.prior_variance(i);
    jackknife_ =
        std::make_unique<statistics::BlockJackknife>(Eigen::VectorXd::Zero(parameters_), prior_variance_);
    scales_ = std::make_unique<TorqueScales>(n_);
    segments_ = {{log_.time[0], {}}};
    innovations_ = Eigen::MatrixXd::Constant(log_.num_samples(), n_, kNaN);
    for (Eigen::VectorXi* count : {&result.rows_used, &result.rows_rejected, &result.rows_at_rest})
      count->setZero(n_);
    result.time = log_.time;
    result.mass_history = Eigen::VectorXd::Constant(log_.num_samples(), kNaN);
    result.mass_std_history = result.mass_history;
    result.left_out = 0;
  }

  void show_progress(Eigen::Index k, double share) const {
    if (!options_.progress || k % 256 != 0) return;
    options_.progress(1.0 - share + share * static_cast<double>(k) / static_cast<double>(log_.num_samples()));
  }

  int block_at(double time) const { return static_cast<int>((time - log_.time[0]) / kFineBlock); }

  /// Counts the rows of a sample, watches them for another load and adds them to the sums of their block.
  /// @param step  since the sample before [s]
  /// @return since when the load is another one [s], where the rows show that
  std::optional<double> take_rows(const Recursion& recursion, const Innovation& innovation, Eigen::Index k,
                                  double step, ChangeDetector<model::kMaxJoints>& detector,
                                  PayloadRun& result) {
    const double time = log_.time[k];
    std::optional<double> changed;
    for (int i = 0; i < n_; ++i) {
      const auto at = static_cast<std::size_t>(i);
      if (!is_used(i)) continue;
      if (!(innovation.variance[i] > 0)) {
        ++result.rows_at_rest[i];
        detector.rest(i);
        continue;
      }
      ++(innovation.used[at] ? result.rows_used : result.rows_rejected)[i];
      if (innovation.used[at]) innovations_(k, i) = innovation.value[i];
      if (detector.take(i, innovation.value[i] / std::sqrt(innovation.variance[i]), time, step)) {
        changed = std::min(changed.value_or(time), detector.since());
      }
      if (innovation.used[at]) add_row(recursion, i, block_at(time), innovation.residual[i]);
    }
    return changed;
  }

  /// Adds a row to the sums of its block.
  void add_row(const Recursion& recursion, int i, int block, double residual) {
    const double noise = residual_.std[i] * residual_.std[i] * residual_.correlated_samples(period_);
    const Eigen::VectorXd w = recursion.row(i);
    const Eigen::Vector2d friction = w.segment(10 + 2 * i, 2);
    jackknife_->add(block, w, residual, noise);
    scales_->add(block, i, w.head(10), friction, residual);
    if (!options_.model_covariance) return;
    jackknife_->add_dependence(block, w, recursion.arm_row(i), noise);
    scales_->add_dependence(i, w.head(10), friction, recursion.arm_row(i));
  }

  /// Another load from a time on. Blocks in which the old load and the new one may be mixed belong to neither.
  void begin_segment(double since, int block) {
    const int mixed = block_at(since);
    std::erase_if(segments_.back().blocks, [&](int b) { return b >= mixed; });
    segments_.push_back({since, {}});
    skip_until_ = block;
  }

  /// How much wider the mass scatters than the recursion believes, from the blocks so far; at least 1.
  /// @param own  what it believes
  double running_spread(double own) const {
    if (!(own < kIdentified * std::sqrt(prior_variance_[0]))) return 1.0;
    const int neighbours = merge(segments_.back());
    const auto solution = jackknife_->solve(segments_.back().blocks, neighbours);
    if (solution.blocks < 3) return 1.0;
    const double variance = solution.covariance(0, 0) * residual_.edge_factor(neighbours * kFineBlock);
    return std::max(1.0, std::sqrt(variance) / own * solution.interval_factor / statistics::kNormal95);
  }

  /// Short blocks that make one block which may count as independent.
  int merge(const Segment& segment) const {
    const double duration = kFineBlock * static_cast<double>(segment.blocks.size());
    return std::max(1, static_cast<int>(std::lround(residual_.block_length(duration) / kFineBlock)));
  }

  struct Solved {
    statistics::BlockJackknife::Result jackknife;
    Eigen::MatrixXd covariance;  ///< residual and model
    Eigen::MatrixXd model_part;
    Eigen::MatrixXd gain;        ///< ∂x/∂ln s, p × n
    double scale_variance{0.0};  ///< of the mass, from the torque scale of the joints [kg²]
    bool has_mass{false};
    double mass{0.0}, std{kNaN};
  };

  Solved solve(const Segment& segment) const {
    Solved solved;
    solved.jackknife = jackknife_->solve(segment.blocks, merge(segment));
    solved.jackknife.covariance *= residual_.edge_factor(merge(segment) * kFineBlock);
    solved.covariance = solved.jackknife.covariance;
    solved.model_part = Eigen::MatrixXd::Zero(parameters_, parameters_);
    if (options_.model_covariance) {
      const Eigen::MatrixXd G = jackknife_->dependence(segment.blocks);
      if (G.size() > 0) solved.model_part = G * *options_.model_covariance * G.transpose();
    }
    solved.covariance += solved.model_part;
    const double together = residual_.correlated_samples(period_);
    solved.gain =
        scales_->gain_sensitivity(segment.blocks, solved.jackknife.estimate.head(10),
                                  solved.jackknife.information_inverse, residual_.std.cwiseAbs2() * together);
    for (std::size_t i = 0; i < options_.drive_scale.size(); ++i) {
      const statistics::Interval& scale = options_.drive_scale[i];
      const Eigen::VectorXd moved = solved.gain.col(static_cast<Eigen::Index>(i)) * (scale.std / scale.value);
      solved.covariance += moved * moved.transpose();
      solved.scale_variance += moved[0] * moved[0];
    }
    solved.mass = solved.jackknife.estimate[0];
    solved.std = std::sqrt(solved.covariance(0, 0) + options_.zero_mass_std * options_.zero_mass_std);
    solved.has_mass = identified(solved, Eigen::VectorXd::Unit(parameters_, 0));
    return solved;
  }

  /// Whether the combination a·x is determined by the data: prior shrunk enough, in theory and as it scatters.
  bool identified(const Solved& solved, const Eigen::VectorXd& a) const {
    const double prior = a.dot(prior_variance_.cwiseProduct(a));
    const double told = a.dot(solved.jackknife.information_inverse * a);
    const double scatter = a.dot(solved.covariance * a);
    return solved.jackknife.blocks >= 3 && told < kIdentified * kIdentified * prior &&
           scatter < kIdentified * kIdentified * prior;
  }

  /// Whether two stretches carry different loads, by the mass and first moments that both determine; true where
  /// there is nothing to compare.
  bool differ(const Solved& before, const Solved& after) const {
    bool comparable = false;
    for (Eigen::Index i = 0; i < 4; ++i) {
      const Eigen::VectorXd unit = Eigen::VectorXd::Unit(parameters_, i);
      if (!identified(before, unit) || !identified(after, unit)) continue;
      comparable = true;
      const double scatter = std::sqrt(before.covariance(i, i) + after.covariance(i, i));
      // The larger of four at 4 standard deviations: one in four thousand by chance.
      if (std::abs(after.jackknife.estimate[i] - before.jackknife.estimate[i]) > 4.0 * scatter) return true;
    }
    return !comparable;
  }

  bool tells_something(const Solved& solved) const {
    for (Eigen::Index i = 0; i < 4; ++i) {
      if (identified(solved, Eigen::VectorXd::Unit(parameters_, i))) return true;
    }
    return false;
  }

  void conclude(PayloadRun& result) {
    // An alarm that did not move the load was none (a contact, friction): put the parts together. A part
    // between two alarms that determines nothing is left out; the last one counts in any case, since it is what
    // holds now.
    std::vector<Segment> segments;
    std::vector<Solved> solved;
    for (std::size_t s = 0; s < segments_.size(); ++s) {
      const Solved present = solve(segments_[s]);
      if (s + 1 < segments_.size() && !tells_something(present)) continue;
      if (!segments.empty() && !differ(solved.back(), present)) {
        segments.back().blocks.insert(segments.back().blocks.end(), segments_[s].blocks.begin(),
                                      segments_[s].blocks.end());
        solved.back() = solve(segments.back());
        continue;
      }
      segments.push_back(segments_[s]);
      solved.push_back(present);
    }
    for (std::size_t s = 1; s < segments.size(); ++s) {
      const auto mass = [](const Solved& part) { return part.has_mass ? part.mass : kNaN; };
      result.changes.push_back({segments[s].begin, mass(solved[s - 1]), mass(solved[s]),
                                solved[s].has_mass ? solved[s].std : kNaN});
    }
    const Solved& final_state = solved.back();
    result.load_since = segments.back().begin;
    state(result, final_state);
    result.torque_scale = scales_->solve(segments.back().blocks, merge(segments.back()),
                                         residual_.edge_factor(merge(segments.back()) * kFineBlock),
                                         final_state.jackknife.estimate.head(10), options_.model_covariance);
    // A load that hardly exceeds its interval is made of the residual itself: the joints have nothing to agree about.
    if (result.mass.identifiable && std::abs(result.mass.value) < kClearLoad * result.mass.half_width()) {
      for (Estimated& scale : result.torque_scale) scale.identifiable = false;
    }
    result.block = merge(segments.back()) * kFineBlock;
    result.blocks = final_state.jackknife.blocks;
    find_convergence(result);
    if (!result.mass.identifiable) explain(result, segments.size() > 1);
  }

  void state(PayloadRun& result, const Solved& solved) const {
    const Eigen::VectorXd& x = solved.jackknife.estimate;
    const double factor = solved.jackknife.interval_factor;
    for (std::size_t i = 0; i < 10; ++i) result.on_last_link[i] = x[static_cast<Eigen::Index>(i)];
    Eigen::MatrixXd F = Eigen::MatrixXd::Zero(10, parameters_);
    F.leftCols(10) = T_;
    Eigen::MatrixXd covariance = solved.covariance;
    covariance(0, 0) += options_.zero_mass_std * options_.zero_mass_std;

    const auto estimated = [&](const Eigen::RowVectorXd& row) -> Estimated {
      const bool known = identified(solved, row.transpose());
      const double std = known ? std::sqrt(row * covariance * row.transpose()) : kNaN;
      return {statistics::Interval::around(row * x, std, factor), known};
    };
    const auto all = [&](const Eigen::MatrixXd& rows) {
      std::vector<Estimated> list;
      for (Eigen::Index r = 0; r < rows.rows(); ++r) list.push_back(estimated(rows.row(r)));
      return list;
    };
    result.parameters = F * x;
    result.covariance = F * covariance * F.transpose();
    result.interval_factor = factor;
    result.mass = estimated(F.row(0));
    result.first_moment = all(F.middleRows(1, 3));
    result.inertia = all(F.bottomRows(6));
    Eigen::MatrixXd coulomb = Eigen::MatrixXd::Zero(n_, parameters_), viscous = coulomb;
    for (int i = 0; i < n_; ++i) {
      coulomb(i, 10 + 2 * i) = 1.0;
      viscous(i, 11 + 2 * i) = 1.0;
    }
    result.coulomb_change = all(coulomb);
    result.viscous_change = all(viscous);

    result.mass_std_residual = std::sqrt(solved.jackknife.covariance(0, 0));
    result.mass_std_model = std::sqrt(solved.model_part(0, 0));
    result.mass_std_zero = options_.zero_mass_std;
    result.mass_std_scale = std::sqrt(solved.scale_variance);
    if (result.mass.identifiable && std::abs(result.mass.value) > kClearLoad * result.mass.half_width())
      result.gain_share = -solved.gain.row(0).transpose() / result.mass.value;

    result.com.assign(3, {});
    if (!result.mass.identifiable || std::abs(result.mass.value) <= result.mass.half_width()) return;
    for (std::size_t r = 0; r < 3; ++r) {
      if (!result.first_moment[r].identifiable) continue;
      result.com[r] = {centre_of_mass(result.parameters, result.covariance, 1 + static_cast<Eigen::Index>(r),
                                      result.mass, factor),
                       true};
    }
  }

  void find_convergence(PayloadRun& result) const {
    if (!result.mass.identifiable) return;
    const double m = result.mass.value;
    const double tolerance = std::max(result.mass.half_width(), 0.05 * std::abs(m));
    std::optional<double> since;
    for (Eigen::Index k = 0; k < result.time.size(); ++k) {
      if (result.time[k] < result.load_since || std::isnan(result.mass_history[k])) continue;
      const bool there =
          std::isfinite(result.mass_std_history[k]) && std::abs(result.mass_history[k] - m) <= tolerance;
      if (!there) since.reset();
      else if (!since) since = result.time[k];
    }
    result.converged_at = since;
  }

  void explain(PayloadRun& result, bool after_change) const {
    const int k = options_.first_joint;
    const bool has_moment = std::all_of(result.first_moment.begin(), result.first_moment.end(),
                                        [](const Estimated& moment) { return moment.identifiable; });
    if (!result.mass_visible) {
      result.missing = hidden_mass(k, n_);
      if (has_moment) return;
      result.missing += "; and ";
    }
    std::string still, moving;
    for (int i = k - 1; i < n_; ++i) {
      std::string& list = result.rows_used[i] * period_ < 2.0 ? still : moving;
      list += fmt::format("{}{}", list.empty() ? "" : ", ", i + 1);
    }
    if (moving.empty()) {
      result.missing += fmt::format(
          "the arm does not move ({} not faster than {:g} rad/s for 2 s), and at rest friction hides the "
          "load; record a motion in which the joints turn both ways and the load changes its attitude to "
          "gravity",
          joint_range(k, n_), options_.standstill_speed);
    } else if (!still.empty()) {
      result.missing += fmt::format(
          "{} at rest; {} moving alone does not separate the mass from the load's first moment; record a "
          "motion in which several joints, the wrist among them, turn both ways at the same time",
          named(still), named(moving));
    } else {
      result.missing += fmt::format(
          "{} the motion is too small or too short to separate the mass from the rest; record a longer "
          "motion, with larger angles, in which the load changes its attitude to gravity",
          after_change ? "after the last change of load" : "as recorded,");
    }
  }

  static std::string named(const std::string& list) {
    return (list.find(',') == std::string::npos ? "joint " : "joints ") + list;
  }

  model::Dynamics dynamics_;
  const int n_{dynamics_.num_joints()};
  const int parameters_{10 + 2 * n_};  ///< of the load, and the change of friction of each joint
  data::Log log_;
  PayloadRunOptions options_;
  Eigen::VectorXd x_;
  Eigen::Matrix<double, 10, 10> T_;
  statistics::ResidualStatistics residual_;
  double cutoff_{0.0}, period_{0.0};
  int skip_until_{-1};
  Eigen::VectorXd prior_variance_;
  std::unique_ptr<statistics::BlockJackknife> jackknife_;
  std::unique_ptr<TorqueScales> scales_;
  std::vector<Segment> segments_;
  Eigen::MatrixXd innovations_;
};

}  // namespace

PayloadRun run_payload(const model::Robot& robot, const data::Log& log, const PayloadRunOptions& options) {
  check(robot, log, options);
  return Run(robot, with_late_motion(log, robot.torque_delay), options).run();
}

}  // namespace heft::payload

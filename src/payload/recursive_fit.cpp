#include "recursive_fit.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <random>

#include <fmt/format.h>

#include "beyond_regressor.hpp"
#include "causal_signals.hpp"
#include "heft/core/estimate/recursive_least_squares.hpp"
#include "heft/data/differentiate.hpp"
#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/model/at_sensor.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/model/physical_links.hpp"
#include "heft/model/sized.hpp"
#include "heft/statistics/block_jackknife.hpp"

namespace heft::payload {
namespace {

/// A parameter counts as determined when the data have reduced its prior variance to less than this share.
constexpr double kDetermined = 0.01;
/// Least time a joint must move for its friction and load to be separated [s].
constexpr double kLeastMoving = 2.0;

void check(const model::Robot& robot, const std::vector<data::Log>& logs) {
  if (logs.empty()) throw DataError("fit: no log given; expected at least one with joint torques");
  for (const data::Log& log : logs) {
    if (log.num_joints() != robot.num_joints() || log.tau.cols() != robot.num_joints()) {
      throw DataError(
          fmt::format("{}: {} joint positions and {} torques; expected {} of each, as robot \"{}\" has",
                      log.path, log.num_joints(), log.tau.cols(), robot.num_joints(), robot.name));
    }
    if (log.num_samples() < 2)
      throw DataError(fmt::format("{}: {} samples; expected at least 2", log.path, log.num_samples()));
  }
}

/// Standard deviations of the prior, 14n, from the size of the arm and of the torques.
Eigen::VectorXd prior_deviations(const model::Robot& robot, const std::vector<data::Log>& logs,
                                 bool torque_at_joint) {
  constexpr double kWide = 3.0;
  const int n = robot.num_joints();
  double total = 0.0, reach = 0.0;
  for (const model::RobotJoint& joint : robot.joints) {
    total += std::max(0.0, joint.link[kMass]);
    reach += Eigen::Map<const Eigen::Vector3d>(joint.joint.position.data()).norm();
  }
  const double typical = std::max(total / n, 0.1);
  reach = std::max(reach, 0.1);
  Eigen::VectorXd deviation(14 * n);
  for (int i = 0; i < n; ++i) {
    const auto& link = robot.joints[static_cast<std::size_t>(i)].link;
    double length = 0.2 * reach;
    if (i + 1 < n) {
      length = std::max(length, Eigen::Map<const Eigen::Vector3d>(
                                    robot.joints[static_cast<std::size_t>(i + 1)].joint.position.data())
                                    .norm());
    }
    const double mass = kWide * std::max(link[kMass], typical);
    deviation[10 * i] = mass;
    deviation.segment(10 * i + 1, 3).setConstant(mass * length);
    deviation.segment(10 * i + 4, 6).setConstant(mass * length * length);
    double torque = 0.0, speed = 0.0;
    for (const data::Log& log : logs) {
      torque = std::max(torque, log.tau.col(i).cwiseAbs().maxCoeff());
      speed = std::max(speed, (log.q.col(i).maxCoeff() - log.q.col(i).minCoeff()) /
                                  std::max(1e-3, log.time[log.num_samples() - 1] - log.time[0]));
    }
    torque = std::max(torque, 1e-3);
    const bool revolute = robot.joints[static_cast<std::size_t>(i)].joint.type == JointType::kRevolute;
    // A torque sensor behind the gear sees neither rotor nor friction: the columns stay, held at zero.
    const double drive = torque_at_joint ? 1e-6 : 1.0;
    deviation[10 * n + i] = drive * kWide * total * (revolute ? reach * reach : 1.0) + 1e-9;
    deviation[11 * n + i] = drive * torque;
    deviation[12 * n + i] = drive * kWide * torque / std::max(speed, 1e-3);
    deviation[13 * n + i] = torque;
  }
  return deviation;
}

/// Combinations that any motion of the arm could determine: rank of the regressor over random states.
int count_determinable(const model::Dynamics& dynamics, bool torque_at_joint) {
  const int n = dynamics.num_joints();
  std::mt19937 generator(1);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(14 * n, 14 * n);
  Eigen::VectorXd q(n), qd(n), qdd(n);
  for (int k = 0; k < 40 * n; ++k) {
    for (int i = 0; i < n; ++i) {
      q[i] = 3.0 * uniform(generator);
      qd[i] = 2.0 * uniform(generator);
      qdd[i] = 5.0 * uniform(generator);
    }
    Eigen::MatrixXd Y = dynamics.regressor(q, qd, qdd);
    if (torque_at_joint) Y.middleCols(10 * n, 3 * n).setZero();
    gram.selfadjointView<Eigen::Lower>().rankUpdate(Y.transpose());
  }
  gram = gram.selfadjointView<Eigen::Lower>();
  // Columns that are zero but for rounding must not be scaled up.
  const double least = 1e-20 * gram.diagonal().maxCoeff();
  const Eigen::VectorXd scale =
      gram.diagonal().unaryExpr([least](double d) { return d > least ? 1.0 / std::sqrt(d) : 0.0; });
  const Eigen::VectorXd values = eigenvalues_of(scale.asDiagonal() * gram * scale.asDiagonal());
  return static_cast<int>((values.array() > 1e-11 * values.maxCoeff()).count());
}

void check_ok(Status status) {
  if (status != Status::kOk) throw Error(fmt::format("recursive fit: {}", to_string(status)));
}

/// A sample behind the filters, valid until the next one.
class Sample {
 public:
  virtual ~Sample() = default;
  virtual Taken take(const data::Log& log, Eigen::Index k) = 0;
  virtual double velocity(int i) const = 0;
  virtual double sign(int i) const = 0;
  virtual double tau(int i) const = 0;
  virtual Eigen::VectorXd row(int i) const = 0;  ///< of the regressor, 14n
};

/// Filters and recursive least squares, whose sizes are fixed, behind sizes of run time.
class Recursion {
 public:
  virtual ~Recursion() = default;
  virtual std::unique_ptr<Sample> make_sample(const model::Dynamics& dynamics, double cutoff,
                                              double sample_rate) const = 0;
  virtual void start(const Eigen::VectorXd& prior, const Eigen::VectorXd& variance) = 0;
  virtual void update(const Eigen::VectorXd& w, double tau, double noise_variance) = 0;
  virtual Eigen::VectorXd solution() const = 0;
  virtual double variance(int i) const = 0;
};

template <int N>
class SizedSample final : public Sample {
 public:
  SizedSample(const model::Dynamics& dynamics, double cutoff, double sample_rate)
      : signals_(dynamics, cutoff, sample_rate) {}
  Taken take(const data::Log& log, Eigen::Index k) override { return signals_.take(log, k); }
  double velocity(int i) const override { return signals_.velocity(i); }
  double sign(int i) const override { return signals_.sign(i); }
  double tau(int i) const override { return signals_.tau()[i]; }
  Eigen::VectorXd row(int i) const override { return signals_.regressor().row(i).transpose(); }

 private:
  CausalSignals<N> signals_;
};

template <int N>
class SizedRecursion final : public Recursion {
  static constexpr int kP = 14 * N;
  using Estimator = RecursiveLeastSquares<double, kP>;
  using Row = typename Estimator::Row;

 public:
  std::unique_ptr<Sample> make_sample(const model::Dynamics& dynamics, double cutoff,
                                      double sample_rate) const override {
    return std::make_unique<SizedSample<N>>(dynamics, cutoff, sample_rate);
  }
  void start(const Eigen::VectorXd& prior, const Eigen::VectorXd& variance) override {
    check_ok(estimator_.configure({}, to_row(prior), to_row(variance)));
  }
  void update(const Eigen::VectorXd& w, double tau, double noise_variance) override {
    typename Estimator::Record record;
    check_ok(estimator_.update(to_row(w), tau, noise_variance, record));
  }
  Eigen::VectorXd solution() const override {
    return Eigen::Map<const Eigen::VectorXd>(estimator_.solution().data(), kP);
  }
  double variance(int i) const override { return estimator_.variance(i); }

 private:
  static Row to_row(const Eigen::VectorXd& v) {
    Row row;
    std::copy_n(v.data(), kP, row.begin());
    return row;
  }

  Estimator estimator_;
};

std::unique_ptr<Recursion> make_recursion(const model::Robot& robot) {
  return model::with_joint_count(robot.num_joints(), robot.name,
                                 [](auto joints) -> std::unique_ptr<Recursion> {
                                   return std::make_unique<SizedRecursion<decltype(joints)::value>>();
                                 });
}

/// What a fit leaves of one log, samples × n.
struct LogResidual {
  Eigen::MatrixXd torque;          ///< NaN where the joint does not move [N·m, N]
  Eigen::MatrixXd sign, velocity;  ///< filtered, see CausalSignals

  LogResidual(Eigen::Index samples, int joints)
      : torque(Eigen::MatrixXd::Constant(samples, joints, std::numeric_limits<double>::quiet_NaN())),
        sign(Eigen::MatrixXd::Zero(samples, joints)),
        velocity(sign) {}

  /// The residual of a joint less what a change of its Coulomb and viscous friction explains.
  Eigen::VectorXd beyond_friction(Eigen::Index joint) const {
    const Eigen::VectorXd e = torque.col(joint);
    Eigen::MatrixXd information = Eigen::MatrixXd::Zero(2, 2);
    Eigen::VectorXd change = Eigen::VectorXd::Zero(2);
    for (Eigen::Index k = 0; k < e.size(); ++k) {
      if (!std::isfinite(e[k])) continue;
      const Eigen::Vector2d w(sign(k, joint), velocity(k, joint));
      information += w * w.transpose();
      change += w * e[k];
    }
    if (!solve_positive(information, change)) return e;
    return e - change[0] * sign.col(joint) - change[1] * velocity.col(joint);
  }
};

void raise(double& to, double value) { to = std::max(to, value); }

class Fit {
 public:
  Fit(const model::Robot& robot, const std::vector<data::Log>& logs, const RecursiveFitOptions& options)
      : dynamics_(model::as_measured(robot, options.torque_at_joint, nullptr)),
        logs_(logs),
        options_(options),
        recursion_(make_recursion(dynamics_.robot())) {
    for (data::Log& log : logs_) log = with_late_motion(std::move(log), dynamics_.robot().torque_delay);
  }

  RecursiveFit run() {
    RecursiveFit fit;
    fit.residual.cutoff = options_.cutoff;
    if (!(fit.residual.cutoff > 0)) {
      for (const data::Log& log : logs_)
        fit.residual.cutoff = std::max(fit.residual.cutoff, choose_cutoff(log));
    }
    cutoff_ = fit.residual.cutoff;
    const model::Robot& robot = dynamics_.robot();
    prior_ = dynamics_.parameters();
    const Eigen::VectorXd variance = prior_deviations(robot, logs_, options_.torque_at_joint).cwiseAbs2();

    // 1. A first fit with one twentieth of the torque as the noise.
    Eigen::VectorXd noise(n_);
    for (int i = 0; i < n_; ++i) {
      double squares = 0.0;
      Eigen::Index count = 0;
      for (const data::Log& log : logs_) {
        squares += log.tau.col(i).squaredNorm();
        count += log.tau.rows();
      }
      noise[i] = 0.05 * std::sqrt(squares / static_cast<double>(count)) + 1e-6;
    }
    recurse(variance, noise, 1.0, 0.0);
    measure_residual(fit);

    // 2. The fit, rows weighted by what the first one left.
    const double together = whole_.correlated_samples(mean_period());
    noise = fit.residual.std;
    recurse(variance, noise, together, 0.4);
    measure_residual(fit);

    // 3. Covariance, from blocks in time.
    statistics::BlockJackknife jackknife(prior_, variance);
    const double block = whole_.block_length(duration());
    for_each_sample(
        [&](std::size_t log, Eigen::Index k, const Sample& sample) {
          const int b = first_block_of(log, block) +
                        static_cast<int>((logs_[log].time[k] - logs_[log].time[0]) / block);
          for (int i = 0; i < n_; ++i) {
            if (!moves(sample, i)) continue;
            jackknife.add(b, sample.row(i), sample.tau(i), noise[i] * noise[i] * together);
          }
        },
        0.8);
    const statistics::BlockJackknife::Result spread = jackknife.solve();

    fit.model = fitted_model();
    Eigen::VectorXd deviation = (whole_.edge_factor(block) * spread.covariance.diagonal()).cwiseSqrt();
    for (int i = 0; i < 14 * n_; ++i) {
      if (!(recursion_->variance(i) < kDetermined * variance[i]) || spread.blocks < 2) {
        deviation[i] = std::numeric_limits<double>::quiet_NaN();
      }
    }
    fit.model.standard_deviations = deviation;
    if (spread.blocks >= 2) fit.model.covariance = spread.covariance * whole_.edge_factor(block);
    for (const data::Log& log : logs_) fit.model.provenance.logs.push_back(log.path);

    // Directions in which the data have shrunk the prior: eigenvalues of P₀^½ A P₀^½ above the threshold.
    const Eigen::VectorXd root = variance.cwiseSqrt();
    const Eigen::MatrixXd posterior =
        root.cwiseInverse().asDiagonal() * spread.information_inverse * root.cwiseInverse().asDiagonal();
    const Eigen::VectorXd shares = eigenvalues_of(posterior);
    fit.determined = static_cast<int>((shares.array() < kDetermined).count());
    fit.determinable = count_determinable(dynamics_, options_.torque_at_joint);
    find_missing(fit);
    fit.model.provenance.notes.push_back(
        fmt::format("causal low-pass {:.4g} Hz; {} of {} determinable combinations of parameters determined; "
                    "what the data do "
                    "not determine keeps the value of the URDF",
                    cutoff_, fit.determined, fit.determinable));
    return fit;
  }

 private:
  /// Calls f(log, k, sample) for every sample after the filters have settled.
  void for_each_sample(const std::function<void(std::size_t, Eigen::Index, const Sample&)>& f,
                       double progress_from) {
    left_out_ = 0;
    Eigen::Index done = 0;
    for (std::size_t l = 0; l < logs_.size(); ++l) {
      const data::Log& log = logs_[l];
      const std::unique_ptr<Sample> sample =
          recursion_->make_sample(dynamics_, cutoff_, data::median_sample_rate(log.time));
      for (Eigen::Index k = 0; k < log.num_samples(); ++k, ++done) {
        if (options_.progress && done % 256 == 0) {
          options_.progress(progress_from +
                            (progress_from < 0.8 ? 0.4 : 0.2) * static_cast<double>(done) / num_samples());
        }
        const Taken taken = sample->take(log, k);
        if (taken == Taken::kRefused) ++left_out_;
        if (taken == Taken::kReady) f(l, k, *sample);
      }
    }
  }

  bool moves(const Sample& sample, int i) const {
    return std::abs(sample.velocity(i)) >= options_.standstill_speed;
  }

  void recurse(const Eigen::VectorXd& variance, const Eigen::VectorXd& noise, double together,
               double progress_from) {
    recursion_->start(prior_, variance);
    for_each_sample(
        [&](std::size_t, Eigen::Index, const Sample& sample) {
          for (int i = 0; i < n_; ++i) {
            if (moves(sample, i))
              recursion_->update(sample.row(i), sample.tau(i), noise[i] * noise[i] * together);
          }
        },
        progress_from);
  }

  /// Residual of the present estimate over all samples: scatter, correlation time, rows, time in motion.
  ///
  /// Friction differs from one log to the next, which counts as correlated for as long as a log lasts: so it does for this fit, which
  /// has one friction for all (whole_). The estimate of a load solves for that change itself and has to reckon with what remains
  /// (fit.residual). Of a single log the fit has taken it out.
  void measure_residual(RecursiveFit& fit) {
    const Eigen::VectorXd x = recursion_->solution();
    std::vector<LogResidual> residual;
    for (const data::Log& log : logs_) residual.emplace_back(log.num_samples(), n_);
    fit.rows = Eigen::VectorXi::Zero(n_);
    fit.moving = Eigen::VectorXd::Zero(n_);
    for_each_sample(
        [&](std::size_t l, Eigen::Index k, const Sample& sample) {
          for (int i = 0; i < n_; ++i) {
            if (!moves(sample, i)) continue;
            residual[l].torque(k, i) = sample.tau(i) - sample.row(i).dot(x);
            residual[l].sign(k, i) = sample.sign(i);
            residual[l].velocity(k, i) = sample.velocity(i);
            ++fit.rows[i];
            if (k > 0) fit.moving[i] += logs_[l].time[k] - logs_[l].time[k - 1];
          }
        },
        0.4);
    fit.samples = static_cast<int>(num_samples());
    fit.left_out = left_out_;
    fit.residual.std.resize(n_);
    fit.residual.correlation_time.setZero(n_);
    whole_ = fit.residual;
    for (int i = 0; i < n_; ++i) {
      double squares = 0.0;
      for (const LogResidual& of_log : residual) {
        for (const double e : of_log.torque.col(i)) squares += std::isfinite(e) ? e * e : 0.0;
        raise(whole_.correlation_time[i], statistics::correlation_time(of_log.torque.col(i), mean_period()));
        raise(fit.residual.correlation_time[i],
              statistics::correlation_time(of_log.beyond_friction(i), mean_period()));
      }
      // A joint that never moved has no scatter of its own; what it may have must not be zero.
      const double largest = logs_.front().tau.col(i).cwiseAbs().maxCoeff();
      const double floor = 1e-6 * largest + 1e-9;
      fit.residual.std[i] =
          fit.rows[i] > 0 ? std::max(floor, std::sqrt(squares / fit.rows[i])) : 0.05 * largest + floor;
    }
    if (logs_.size() == 1 || options_.torque_at_joint)
      fit.residual.correlation_time = whole_.correlation_time;
  }

  /// The model with the parameters found. Behind the gears, where the drives' columns were held at zero, they are zero.
  model::ModelFile fitted_model() const {
    model::Robot robot = dynamics_.robot();
    const Eigen::VectorXd x = recursion_->solution();
    for (int i = 0; i < n_; ++i) {
      model::RobotJoint& joint = robot.joints[static_cast<std::size_t>(i)];
      std::copy_n(x.data() + 10 * i, 10, joint.link.begin());
      joint.actuation.friction_offset = x[13 * n_ + i];
      if (!options_.torque_at_joint)
        joint.actuation = {x[10 * n_ + i], x[11 * n_ + i], x[12 * n_ + i], x[13 * n_ + i]};
    }
    model::ModelFile file = model::make_model(robot);
    file.provenance.method = "recursive-least-squares";
    if (!options_.torque_at_joint) return file;
    // Without a record the offsets would be taken for those of motors.
    model::FitRecord& record = file.fit.emplace();
    record.method = file.provenance.method;
    record.torque_at = "joint";
    record.condition_number = std::numeric_limits<double>::quiet_NaN();
    record.physically_consistent = model::is_physically_consistent(robot);
    record.samples = num_samples();
    return file;
  }

  void find_missing(RecursiveFit& fit) const {
    std::string still;
    for (int i = 0; i < n_; ++i) {
      if (fit.moving[i] < kLeastMoving) still += fmt::format("{}{}", still.empty() ? "" : ", ", i + 1);
    }
    if (!still.empty()) {
      fit.missing.push_back(fmt::format(
          "joint {} moving for less than {:g} s: the friction there and the torque it carries stay "
          "unknown; record a motion in which every joint turns both ways, faster than {:g} rad/s",
          still, kLeastMoving, options_.standstill_speed));
    }
  }

  Eigen::Index num_samples() const {
    Eigen::Index count = 0;
    for (const data::Log& log : logs_) count += log.num_samples();
    return count;
  }
  double duration() const {
    double sum = 0.0;
    for (const data::Log& log : logs_) sum += log.time[log.num_samples() - 1] - log.time[0];
    return sum;
  }
  double mean_period() const {
    return duration() / static_cast<double>(std::max<Eigen::Index>(
                            1, num_samples() - static_cast<Eigen::Index>(logs_.size())));
  }
  int first_block_of(std::size_t log, double block) const {
    int first = 0;
    for (std::size_t l = 0; l < log; ++l) {
      first += static_cast<int>((logs_[l].time[logs_[l].num_samples() - 1] - logs_[l].time[0]) / block) + 1;
    }
    return first;
  }

  model::Dynamics dynamics_;
  const int n_{dynamics_.num_joints()};
  std::vector<data::Log> logs_;
  RecursiveFitOptions options_;
  std::unique_ptr<Recursion> recursion_;
  Eigen::VectorXd prior_;
  statistics::ResidualStatistics whole_;
  double cutoff_{0.0};
  int left_out_{0};
};

}  // namespace

double choose_cutoff(const data::Log& log) {
  constexpr double kLeast = 3.0;
  if (log.num_samples() < 3) return kLeast;
  const double rate = data::median_sample_rate(log.time);
  data::Log positions;
  positions.time = log.time;
  positions.q = log.q;
  const double bandwidth = data::motion_bandwidth(data::resample_uniform(positions).q, rate);
  return std::min(std::max(kLeast, 10.0 * bandwidth), 0.25 * rate);
}

RecursiveFit fit_recursively(const model::Robot& robot, const std::vector<data::Log>& logs,
                             const RecursiveFitOptions& options) {
  check(robot, logs);
  return Fit(robot, logs, options).run();
}

}  // namespace heft::payload

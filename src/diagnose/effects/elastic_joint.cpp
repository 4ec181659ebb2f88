// Springs between motors and links.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include "../arm_search.hpp"
#include "../deflection.hpp"
#include "../peak.hpp"
#include "heft/host/parallel.hpp"
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

/// A spring by the frequency at which its link swings with all motors locked, and the part of critical damping.
struct Swing {
  double hz{0.0}, ratio{0.02};
};

Swing swing_of(const Candidate& spring) {
  return {std::sqrt(spring.shape / spring.inertia) / (2.0 * std::numbers::pi),
          0.5 * spring.second / std::sqrt(spring.shape * spring.inertia)};
}

/// Springs of one joint or of two, next to those in place: the frequencies, then the damping.
class SpringSearch {
 public:
  /// @param inertia  see inertia_of()
  /// @param joints   one or two, which have no spring
  SpringSearch(const Workbench& bench, const std::vector<MatrixXd>& inertia, std::vector<int> joints)
      : bench_(bench), inertia_(inertia), joints_(std::move(joints)) {
    std::vector<double> stiffness, damping;
    for (int j = 0; j < bench.table->num_joints; ++j) {
      const Candidate* spring = bench.springs[static_cast<std::size_t>(j)];
      if (spring == nullptr) continue;
      elastic_.push_back(j);
      stiffness.push_back(spring->shape);
      damping.push_back(spring->second);
    }
    placed_ = static_cast<Index>(elastic_.size());
    elastic_.insert(elastic_.end(), joints_.begin(), joints_.end());
    stiffness_ = VectorXd::Zero(count());
    damping_ = VectorXd::Zero(count());
    std::copy(stiffness.begin(), stiffness.end(), stiffness_.begin());
    std::copy(damping.begin(), damping.end(), damping_.begin());
    for (const int j : joints_) mean_.push_back(column(j).col(j).mean());
    set_up_motion();
  }

  /// @param near  two joints: the first one's spring found alone
  Candidate run(const Swing& near = {}) const {
    Candidate c(ElasticJoint{});
    c.joint = joints_.front();
    for (const int j : joints_) {
      if (!(column(j).col(j).minCoeff() > 0.0)) {
        c.refused = "the fitted inertia about this joint is not positive";
        return c;
      }
    }
    Found found;
    if (joints_.size() > 1) {
      search_two(near, found);
    } else {
      search_one(kTo, found);
    }
    put_found(found, c);
    // Masses that are off look like a stiff spring that deflects against the load: a soft one may stand behind it.
    // It is one if the motor's inertia, which comes with it, explains less than this part of what both do.
    constexpr double kSofter = 1.5, kMostByMotor = 0.9;
    const bool against = c.trial.valid && c.trial.coefficients[0] < kAtLeast;
    if (joints_.size() > 1 || !against || found.swings[0].hz < kSofter * kSofter * kFrom) return c;
    Found softer;
    search_one(found.swings[0].hz / kSofter, softer);
    Candidate other(ElasticJoint{});
    other.joint = c.joint;
    put_found(softer, other);
    other.tried += c.tried;
    const bool found_one = other.refused.empty() && other.trial.valid && kMostByMotor * other.trial.cv_gain > gain_of_motor();
    return found_one ? other : c;
  }

 private:
  static constexpr double kFrom = 3.0, kTo = 45.0;  // [Hz]
  /// The deflection has to be about what the masses ask for: next to it stands the motor's inertia, which may be all that
  /// there is.
  static constexpr double kAtLeast = 0.3, kAtMost = 3.0;
  using Swings = std::array<Swing, 2>;  ///< of the joints; one joint: the first one counts
  struct Found {
    Swings swings{};
    double gain{0.0};
    int tried{0};
    bool of_use{true};  ///< see Workbench::least_gain
  };

  Index count() const { return static_cast<Index>(elastic_.size()); }
  int elastic(Index a) const { return elastic_[static_cast<std::size_t>(a)]; }
  /// A joint's column of M along the motion, m × n.
  const MatrixXd& column(int joint) const { return inertia_[static_cast<std::size_t>(joint)]; }

  /// What the motor's inertia alone explains.
  double gain_of_motor() const {
    const Trial trial = judge(bench_, motor_alone(joints_.front(), bench_.motion->qdd.col(joints_.front())));
    return trial.valid ? trial.cv_gain : 0.0;
  }

  /// @param gain  of the deflection; the motor's inertia, which comes with it, may explain more
  bool is_of_use(double gain) const {
    const int joint = joints_.front();
    const double least = bench_.least_gain_of(joint);
    if (gain >= least) return true;
    const Candidate motor = motor_alone(joint, bench_.motion->qdd.col(joint));
    return gain + bench_.problem->gain(bench_.problem->moments(motor.columns)) >= least;
  }

  void put_found(const Found& found, Candidate& c) const {
    c.tried = found.tried;
    if (!(found.gain > 0.0) || !found.of_use) {
      c.refused = found.of_use ? "explains nothing" : kOfNoUse;
      return;
    }
    put_columns(found.swings, c);
    if (c.trial.valid && c.trial.coefficients[0] < kAtLeast) c.refused = "the joint would have to deflect against the load";
    if (c.trial.valid && c.trial.coefficients[0] > kAtMost) c.refused = "the joint would have to deflect by more than its load explains";
  }

  /// What deflects the joints, and what those in place do without the others.
  void set_up_motion() {
    load_.resize(bench_.table->rows(), count());
    shared_.resize(bench_.table->rows(), count() * count());
    for (Index a = 0; a < count(); ++a) {
      load_.col(a) = bench_.load->col(elastic(a));
      for (Index b = 0; b < count(); ++b) shared_.col(a * count() + b) = column(elastic(b)).col(elastic(a));
      // The load is that of the links; motors whose springs are in place accelerate more: τ(θ..) = τ(x..) + M ë.
      for (Index b = 0; b < placed_; ++b) {
        const int j = elastic(b);
        load_.col(a) +=
            shared_.col(a * count() + b).cwiseProduct(bench_.motion->qdd.col(j) - bench_.motion->link_qdd.col(j));
      }
    }
    if (placed_ == 0) return;
    MatrixXd own(bench_.table->rows(), placed_ * placed_);
    for (Index a = 0; a < placed_; ++a) own.middleCols(a * placed_, placed_) = shared_.middleCols(a * count(), placed_);
    before_ = deflections(*bench_.table, load_.leftCols(placed_), own, stiffness_.head(placed_), damping_.head(placed_))
                  .acceleration;
  }

  /// Takes the best of several where it is better than what there is.
  /// @return gain of each
  std::vector<double> take_best_of(const std::vector<Swings>& several, Found& found) const {
    const auto tried = static_cast<Index>(several.size());
    MatrixXd all(bench_.table->rows(), count() * tried);
    for (Index s = 0; s < tried; ++s)
      all.middleCols(count() * s, count()) = accelerations(several[static_cast<std::size_t>(s)]);
    const auto write = [&](int joint, Index from, Eigen::Ref<MatrixXd> values) {
      values.setZero();
      for (Index s = 0; s < values.cols(); ++s) {
        for (Index b = 0; b < count(); ++b) {
          values.col(s).array() -= all.col(count() * s + b).segment(from, values.rows()).array() *
                                   column(elastic(b)).col(joint).segment(from, values.rows()).array();
        }
      }
    };
    found.tried += static_cast<int>(tried);
    return take_best(bench_, several, write, found.swings, found.gain);
  }

  /// @param to  the highest frequency [Hz]
  void search_one(double to, Found& found) const {
    constexpr int kSteps = 14;
    const double width = std::log(kTo / kFrom) / (kSteps - 1);
    Peak peak;  // by the logarithm of the frequency
    const auto look_at = [&](const std::vector<double>& places) {
      std::vector<Swings> several;
      for (const double x : places) several.push_back({Swing{std::exp(x)}});
      const std::vector<double> gains = take_best_of(several, found);
      for (std::size_t k = 0; k < places.size(); ++k) peak.add(places[k], gains[k]);
    };
    std::vector<double> grid;
    for (double x = std::log(kFrom); x < std::log(to) + 1e-4; x += width) grid.push_back(x);
    look_at(grid);
    if (!(found.gain > 0.0)) return;
    found.of_use = is_of_use(found.gain);
    if (!found.of_use) return;
    double x = peak.best(), step = width / 3.0;
    look_at({x - 2.0 * step, x - step, x + step, x + 2.0 * step});
    x = peak.vertex(), step /= 4.0;
    look_at({x - step, x, x + step});
    find_damping({std::exp(peak.vertex())}, found);
    found.tried = static_cast<int>(grid.size());  // what is found near the best is no new chance
  }

  /// @param near  of the first joint alone, which gives more than it does together with the other one
  void search_two(const Swing& near, Found& found) const {
    constexpr int kSteps = 12;
    double width = std::pow(kTo / kFrom, 1.0 / (kSteps - 1));
    std::vector<Swings> several;
    for (const double stiffer : {1.0, 1.1, 1.22, 1.4, 1.7}) {
      for (int k = 0; k < kSteps; ++k) several.push_back({Swing{near.hz * stiffer}, Swing{kFrom * std::pow(width, k)}});
    }
    take_best_of(several, found);
    const int tried = found.tried;
    if (!(found.gain > 0.0)) return;
    width = std::sqrt(width);
    for (int pass = 0; pass < 4; ++pass) {
      width = std::sqrt(width);
      several.clear();
      for (const double a : {1.0 / width, 1.0, width}) {
        for (const double b : {1.0 / width, 1.0, width})
          several.push_back({Swing{found.swings[0].hz * a}, Swing{found.swings[1].hz * b}});
      }
      take_best_of(several, found);
    }
    find_damping({found.swings[0].hz, found.swings[1].hz}, found);
    found.tried = tried;
  }

  /// @param hz  of the joints
  void find_damping(const std::array<double, 2>& hz, Found& found) const {
    std::vector<Swings> several;
    for (const double ratio : {0.005, 0.01, Swing{}.ratio, 0.04, 0.08}) several.push_back({Swing{hz[0], ratio}, Swing{hz[1], ratio}});
    take_best_of(several, found);
  }

  double stiffness_of(const Swing& swing, std::size_t which) const {
    return std::pow(2.0 * std::numbers::pi * swing.hz, 2) * mean_[which];
  }
  double damping_of(const Swing& swing, std::size_t which) const {
    return 2.0 * swing.ratio * std::sqrt(stiffness_of(swing, which) * mean_[which]);
  }

  /// What the deflections of all springs accelerate by, less what those in place do alone, m × k.
  MatrixXd accelerations(const Swings& swings) const {
    VectorXd stiffness = stiffness_, damping = damping_;
    for (std::size_t w = 0; w < joints_.size(); ++w) {
      stiffness[placed_ + static_cast<Index>(w)] = stiffness_of(swings[w], w);
      damping[placed_ + static_cast<Index>(w)] = damping_of(swings[w], w);
    }
    MatrixXd found = deflections(*bench_.table, load_, shared_, stiffness, damping).acceleration;
    // Fitted masses that are physically impossible together.
    if (found.rows() == 0) return MatrixXd::Zero(bench_.table->rows(), count());
    if (before_.rows() > 0) found.leftCols(placed_) -= before_;
    return found;
  }

  /// Puts columns of the springs into a candidate, with those of as many motors' inertias as this motion tells from the links'
  /// and does not make negative, and judges it. Two springs become its parts.
  void put_columns(const Swings& swings, Candidate& c) const {
    const MatrixXd acceleration = accelerations(swings);
    using Motors = std::vector<bool>;
    const std::vector<Motors> ways =
        joints_.size() > 1 ? std::vector<Motors>{{true, true}, {false, true}, {true, false}, {false, false}}
                           : std::vector<Motors>{{true}, {false}};
    const auto is_negative = [&] {
      for (Index k = 1; k < c.trial.coefficients.size(); ++k) {
        if (c.trial.coefficients[k] < -2.0 * c.trial.std[k]) return true;
      }
      return false;
    };
    Motors motors;
    for (const Motors& way : ways) {
      motors = way;
      c.columns = columns_of(acceleration, 0, count(), way);
      c.trial = judge(bench_, c, bench_.least_gain);
      if (c.trial.valid && !is_negative()) break;
    }
    if (joints_.size() == 1) {
      put_shape(swings[0], 0, c);
      return;
    }
    for (std::size_t w = 0; w < joints_.size(); ++w) {
      Candidate part(ElasticJoint{});
      part.joint = joints_[w];
      put_shape(swings[w], w, part);
      Motors own(joints_.size(), false);
      own[w] = motors[w];
      part.columns = columns_of(acceleration, placed_ + static_cast<Index>(w), 1, own);
      part.trial = c.trial;
      c.parts.push_back(std::move(part));
    }
    c.shape = c.parts.front().shape;
  }

  void put_shape(const Swing& swing, std::size_t which, Candidate& c) const {
    c.shape = stiffness_of(swing, which);
    c.second = damping_of(swing, which);
    c.inertia = mean_[which];
  }

  /// @param acceleration   see accelerations()
  /// @param from, springs  which of the deflections
  /// @param motors         joints with a column of the motor's inertia
  Columns columns_of(const MatrixXd& acceleration, Index from, Index springs, const std::vector<bool>& motors) const {
    const int n = bench_.table->num_joints;
    Columns columns;
    columns.joints = all_joints(n);
    for (int i = 0; i < n; ++i) {
      MatrixXd value = MatrixXd::Zero(bench_.table->rows(), 1);
      for (Index b = from; b < from + springs; ++b) value.col(0) -= column(elastic(b)).col(i).cwiseProduct(acceleration.col(b));
      columns.values.push_back(std::move(value));
    }
    for (std::size_t w = 0; w < joints_.size(); ++w) {
      if (motors[w]) append_motor(columns, joints_[w], bench_.motion->qdd.col(joints_[w]));
    }
    return columns;
  }

  const Workbench& bench_;
  const std::vector<MatrixXd>& inertia_;
  std::vector<int> joints_, elastic_;  ///< the new ones; all of them, those in place first
  Index placed_{0};                    ///< how many are in place
  VectorXd stiffness_, damping_;       ///< of all; of the new ones 0
  std::vector<double> mean_;           ///< of M_jj, of the new ones
  MatrixXd load_, shared_;             ///< see deflections()
  MatrixXd before_;                    ///< see accelerations()
};

/// A search with the masses of the given robot in place of the fitted ones, which oscillations of a link can bias until an inertia
/// is negative.
class GivenMasses {
 public:
  explicit GivenMasses(const Workbench& bench)
      : bench_(bench), robot_(bench.base->robot(bench.base->prior())) {
    VectorXd links = bench.base->prior();
    for (int c = 0; c < bench.base->columns(); ++c) {
      if (!bench.base->is_link(c)) links[c] = 0.0;
    }
    load_ = bench.base->torque(*bench.rows, links);
    bench_.robot = &robot_;
    bench_.load = &load_;
    inertia_ = inertia_of(bench_);
  }
  GivenMasses(const GivenMasses&) = delete;  // the workbench points into it
  GivenMasses& operator=(const GivenMasses&) = delete;

  Candidate run(int joint) const { return SpringSearch(bench_, inertia_, {joint}).run(); }

 private:
  Workbench bench_;
  model::Robot robot_;
  MatrixXd load_;
  std::vector<MatrixXd> inertia_;
};

std::vector<Candidate> propose_spring(const Workbench& bench, const std::vector<bool>& joints) {
  const std::vector<MatrixXd> inertia = inertia_of(bench);
  std::optional<GivenMasses> given;
  std::vector<Candidate> found;
  for (int j = 0; j < bench.table->num_joints; ++j) {
    if (!joints[static_cast<std::size_t>(j)] || !bench.may_have_spring(j)) continue;
    found.push_back(SpringSearch(bench, inertia, {j}).run());
    if ((found.back().refused.empty() && found.back().trial.valid) || found.back().refused == kOfNoUse) continue;
    if (!given) given.emplace(bench);
    Candidate other = given->run(j);
    other.tried += found.back().tried;
    if (other.refused.empty() && other.trial.valid) found.back() = std::move(other);
  }
  return found;
}

/// @param c  motor inertia, or none
void apply_spring(const Candidate& effect, const VectorXd& c, model::Robot& robot) {
  robot.elasticities.push_back({effect.joint, effect.shape, effect.second, c.size() > 0 ? c[0] : 0.0});
}

void describe_spring(const Candidate& effect, const VectorXd& c, const model::Robot&, Finding& finding) {
  // Without a number of its own the motor's inertia is part of the link's.
  const double motor = c.size() > 0 ? c[0] : std::numeric_limits<double>::quiet_NaN();
  finding.parameters = {{"stiffness", effect.shape}, {"damping", effect.second}, {"motor_inertia", motor}};
}

}  // namespace

void append_motor(Columns& columns, int joint, const VectorXd& acceleration) {
  for (std::size_t k = 0; k < columns.joints.size(); ++k) {
    MatrixXd& values = columns.values[k];
    values.conservativeResize(Eigen::NoChange, values.cols() + 1);
    values.rightCols(1).setZero();
    if (columns.joints[k] == joint) values.rightCols(1) = acceleration;
  }
}

void remove_motor(Columns& columns) {
  for (MatrixXd& values : columns.values) values.conservativeResize(Eigen::NoChange, values.cols() - 1);
}

Candidate motor_alone(int joint, const VectorXd& acceleration) {
  Candidate motor(RotorInertia{});
  motor.joint = joint;
  motor.columns = {{joint}, {MatrixXd(acceleration)}};
  motor.stale = true;
  return motor;
}

std::vector<Candidate> spring_pairs(const Workbench& bench, const Candidate& first, const std::vector<bool>& others) {
  const std::vector<MatrixXd> inertia = inertia_of(bench);
  std::vector<int> joints;
  for (int j = 0; j < bench.table->num_joints; ++j) {
    if (others[static_cast<std::size_t>(j)] && j != first.joint && bench.may_have_spring(j)) joints.push_back(j);
  }
  std::vector<Candidate> found(joints.size(), Candidate(ElasticJoint{}));
  host::for_each_parallel(joints.size(), [&](std::size_t k) {
    found[k] = SpringSearch(bench, inertia, {first.joint, joints[k]}).run(swing_of(first));
  });
  return found;
}

ArmSearch search_of(ElasticJoint) { return {propose_spring, apply_spring, describe_spring}; }

}  // namespace heft::diagnose

// Springs between motors and links.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <span>
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

/// Of all joints, along the links' motion.
LinkTorque links_of(const Workbench& bench) {
  const Motion& motion = *bench.motion;
  return link_torque(*bench.robot, motion.link_q, motion.link_qd, motion.link_qdd, all_joints(bench.table->num_joints));
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
  /// @param links   see links_of()
  /// @param joints  one or two, which have no spring
  SpringSearch(const Workbench& bench, const LinkTorque& links, std::vector<int> joints)
      : bench_(bench), links_(links), joints_(std::move(joints)) {
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
    for (const int j : joints_) mean_.push_back(links_.inertia(j, j).mean());
    set_up_motion();
  }

  /// @param near  two joints: the first one's spring found alone
  Candidate run(const Swing& near = {}) const {
    Candidate c(ElasticJoint{});
    c.joint = joints_.front();
    for (const int j : joints_) {
      if (!(links_.inertia(j, j).minCoeff() > 0.0)) {
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
  static constexpr double kFrom = 1.5, kTo = 45.0;  // [Hz]
  /// The deflection has to be about what the masses ask for: next to it stands the motor's inertia, which may be all that
  /// there is. Of 104 simulated springs those taken asked for 0.35 to 1.7 of it; rotor and friction of a UR10e look like 2.5.
  static constexpr double kAtLeast = 0.3, kAtMost = 2.0;
  using Swings = std::array<Swing, 2>;  ///< of the joints; one joint: the first one counts
  struct Found {
    Swings swings{};
    double gain{0.0};
    int tried{0};
    bool of_use{true};  ///< see Workbench::least_gain
  };

  Index count() const { return static_cast<Index>(elastic_.size()); }
  int elastic(Index a) const { return elastic_[static_cast<std::size_t>(a)]; }

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
    const Motion& motion = *bench_.motion;
    load_.resize(bench_.table->rows(), count());
    inertia_ = links_.inertias(elastic_);
    slope_ = links_.slopes(elastic_);
    const auto placed = std::span<const int>(elastic_).first(static_cast<std::size_t>(placed_));
    for (Index a = 0; a < count(); ++a) {
      load_.col(a) = bench_.load->col(elastic(a));
      // The load is that of the links; motors whose springs are in place are elsewhere: τ(θ..) = τ(x..) + M ë + G e.
      for (const int j : placed) {
        load_.col(a) += links_.inertia(elastic(a), j).cwiseProduct(motion.qdd.col(j) - motion.link_qdd.col(j)) +
                        links_.stiffness(elastic(a), j).cwiseProduct(motion.q.col(j) - motion.link_q.col(j));
      }
    }
    if (placed.empty()) return;
    before_ = deflections(*bench_.table, load_.leftCols(placed_), links_.inertias(placed), stiffness_.head(placed_),
                          damping_.head(placed_), links_.slopes(placed));
  }

  /// Takes from a column what deflections of the b-th joint take from the torque of another one: M ë + G e.
  /// @param from  the row that the column begins with
  template <typename Rows, typename Column>
  void take_torque(Index b, int joint, const Rows& value, const Rows& acceleration, Index from, Column&& column) const {
    const Index rows = column.size();
    column.array() -= acceleration.segment(from, rows).array() * links_.inertia(joint, elastic(b)).segment(from, rows).array() +
                      value.segment(from, rows).array() * links_.stiffness(joint, elastic(b)).segment(from, rows).array();
  }

  /// Takes the best of several where it is better than what there is.
  /// @return gain of each
  std::vector<double> take_best_of(const std::vector<Swings>& several, Found& found) const {
    std::vector<Deflections> all;
    for (const Swings& swings : several) all.push_back(deflections_with(swings));
    const auto write = [&](int joint, Index from, Eigen::Ref<MatrixXd> values) {
      values.setZero();
      for (Index s = 0; s < values.cols(); ++s) {
        const Deflections& by = all[static_cast<std::size_t>(s)];
        for (Index b = 0; b < count(); ++b) take_torque(b, joint, by.value.col(b), by.acceleration.col(b), from, values.col(s));
      }
    };
    found.tried += static_cast<int>(several.size());
    return take_best(bench_, several, write, found.swings, found.gain);
  }

  /// @param to  the highest frequency [Hz]
  void search_one(double to, Found& found) const {
    constexpr int kSteps = 17;
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
    constexpr int kSteps = 15;
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

  /// The deflections of all springs, less what those in place do alone, m × k; no rates.
  Deflections deflections_with(const Swings& swings) const {
    VectorXd stiffness = stiffness_, damping = damping_;
    for (std::size_t w = 0; w < joints_.size(); ++w) {
      stiffness[placed_ + static_cast<Index>(w)] = stiffness_of(swings[w], w);
      damping[placed_ + static_cast<Index>(w)] = damping_of(swings[w], w);
    }
    Deflections found = deflections(*bench_.table, load_, inertia_, stiffness, damping, slope_);
    found.rate.resize(0, 0);
    if (found.value.rows() == 0) {  // fitted masses that are physically impossible together, or a link that would fall
      found.value = found.acceleration = MatrixXd::Zero(bench_.table->rows(), count());
    } else if (placed_ > 0 && before_.value.rows() > 0) {
      found.value.leftCols(placed_) -= before_.value;
      found.acceleration.leftCols(placed_) -= before_.acceleration;
    }
    return found;
  }

  /// Puts columns of the springs into a candidate, with those of as many motors' inertias as this motion tells from the links'
  /// and does not make negative, and judges it. Two springs become its parts.
  void put_columns(const Swings& swings, Candidate& c) const {
    const Deflections found = deflections_with(swings);
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
      c.columns = columns_of(found, 0, count(), way);
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
      part.columns = columns_of(found, placed_ + static_cast<Index>(w), 1, own);
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

  /// @param by             see deflections_with()
  /// @param from, springs  which of the deflections
  /// @param motors         joints with a column of the motor's inertia
  Columns columns_of(const Deflections& by, Index from, Index springs, const std::vector<bool>& motors) const {
    const int n = bench_.table->num_joints;
    Columns columns;
    columns.joints = all_joints(n);
    for (int i = 0; i < n; ++i) {
      MatrixXd value = MatrixXd::Zero(bench_.table->rows(), 1);
      for (Index b = from; b < from + springs; ++b) take_torque(b, i, by.value.col(b), by.acceleration.col(b), 0, value.col(0));
      columns.values.push_back(std::move(value));
    }
    for (std::size_t w = 0; w < joints_.size(); ++w) {
      if (motors[w]) append_motor(columns, joints_[w], bench_.motion->qdd.col(joints_[w]));
    }
    return columns;
  }

  const Workbench& bench_;
  const LinkTorque& links_;
  std::vector<int> joints_, elastic_;  ///< the new ones; all of them, those in place first
  Index placed_{0};                    ///< how many are in place
  VectorXd stiffness_, damping_;       ///< of all; of the new ones 0
  std::vector<double> mean_;           ///< of M_jj, of the new ones
  MatrixXd load_, inertia_, slope_;    ///< see deflections()
  Deflections before_;                 ///< of the springs in place alone
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
    links_ = links_of(bench_);
  }
  GivenMasses(const GivenMasses&) = delete;  // the workbench points into it
  GivenMasses& operator=(const GivenMasses&) = delete;

  Candidate run(int joint) const { return SpringSearch(bench_, links_, {joint}).run(); }

 private:
  Workbench bench_;
  model::Robot robot_;
  MatrixXd load_;
  LinkTorque links_;
};

std::vector<Candidate> propose_spring(const Workbench& bench, const std::vector<bool>& joints) {
  const LinkTorque links = links_of(bench);
  std::optional<GivenMasses> given;
  std::vector<Candidate> found;
  for (int j = 0; j < bench.table->num_joints; ++j) {
    if (!joints[static_cast<std::size_t>(j)] || !bench.may_have_spring(j)) continue;
    found.push_back(SpringSearch(bench, links, {j}).run());
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
  const LinkTorque links = links_of(bench);
  std::vector<int> joints;
  for (int j = 0; j < bench.table->num_joints; ++j) {
    if (others[static_cast<std::size_t>(j)] && j != first.joint && bench.may_have_spring(j)) joints.push_back(j);
  }
  std::vector<Candidate> found(joints.size(), Candidate(ElasticJoint{}));
  host::for_each_parallel(joints.size(), [&](std::size_t k) {
    found[k] = SpringSearch(bench, links, {first.joint, joints[k]}).run(swing_of(first));
  });
  return found;
}

ArmSearch search_of(ElasticJoint) { return {propose_spring, apply_spring, describe_spring}; }

}  // namespace heft::diagnose

#include "engine.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "arm_search.hpp"
#include "heft/core/friction/friction.hpp"
#include "heft/host/parallel.hpp"
#include "heft/model/motion_torque.hpp"
#include "residual_structure.hpp"

namespace heft::diagnose {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

/// The motion `delay` seconds earlier.
Motion delayed(const MotionTable& table, double delay) {
  Motion motion = rigid_motion(table);
  if (delay == 0.0) return motion;
  motion.q = earlier_motion(table, table.q, delay);
  motion.qd = earlier_motion(table, table.qd, delay);
  motion.qdd = earlier_motion(table, table.qdd, delay);
  motion.displacement = earlier(table, table.displacement, delay);
  for (int j = 0; j < table.num_joints; ++j) {
    motion.direction.col(j) = motion.qd.col(j).unaryExpr(
        [width = table.sign_width[j]](double v) { return velocity_sign(v, width); });
  }
  motion.link_q = motion.q;
  motion.link_qd = motion.qd;
  motion.link_qdd = motion.qdd;
  return motion;
}

/// Leaves out rows that follow others that are out. A late torque channel shows a change of direction late, and what friction does
/// there that the model does not know would pull the delay to where those rows are out.
/// @param rows  how many
void leave_out_after(const MotionTable& table, Index rows, MatrixXd& keep) {
  for (Index j = 0; j < keep.cols(); ++j) {
    for (std::size_t run = 0; run + 1 < table.run_begin.size(); ++run) {
      Index since = rows;
      for (Index i = table.run_begin[run]; i < table.run_begin[run + 1]; ++i) {
        since = keep(i, j) > 0.0 ? since + 1 : 0;
        if (since > 0 && since <= rows) keep(i, j) = 0.0;
      }
    }
  }
}

}  // namespace

Engine::Engine(std::shared_ptr<const BaseModel> base, std::shared_ptr<const MotionTable> table,
               std::vector<GearCoupling<double>> pairs)
    : shared_(std::move(table)),
      table_(*shared_),
      shared_base_(std::move(base)),
      base_(*shared_base_),
      pairs_(std::move(pairs)),
      keep_(table_.keep),
      motion_(rigid_motion(table_)) {
  build();
  base_noise_ = plain_->noise();
  base_theta_ = plain_->theta();
  // With the weight of the robot's own values given, as every other model has it.
  const auto again =
      std::make_shared<const Problem>(table_, table_.keep, rows_, base_.places(), base_.prior(), steady_,
                                      table_.tau, VectorXd(), plain_.get());
  problem_ = std::make_unique<Problem>(*again);
  note_fit();
  load_all();
  fit_ = std::make_shared<const BaseFit>(
      BaseFit{shared_base_, shared_, pairs_, rows_, again, rigid_, lazy_load_, held_});
  problem_ = std::make_unique<Problem>(*plain_);
  note_fit();
}

Engine::Engine(std::shared_ptr<const BaseFit> fit)
    : shared_(fit->table),
      table_(*shared_),
      shared_base_(fit->base),
      base_(*shared_base_),
      pairs_(fit->pairs),
      keep_(table_.keep),
      motion_(rigid_motion(table_)),
      rigid_rows_(fit->rows),
      fit_(std::move(fit)),
      rigid_(fit_->robot),
      lazy_load_(fit_->load),
      loaded_(static_cast<std::size_t>(table_.num_joints), true),
      held_(fit_->held),
      base_noise_(fit_->fitted->noise()),
      base_theta_(fit_->fitted->theta()),
      steady_(fit_->fitted->steady()) {}

Workbench Engine::bench() const {
  std::vector<FirstMemory> memories(static_cast<std::size_t>(table_.num_joints));
  std::vector<const Candidate*> springs(memories.size(), nullptr);
  for (std::size_t e = 0; e < accepted.size(); ++e) {
    if (accepted[e].is_elastic()) springs[static_cast<std::size_t>(accepted[e].joint)] = &accepted[e];
    if (!accepted[e].has_memory() || first_memory(e) >= 0) continue;
    memories[static_cast<std::size_t>(accepted[e].joint)] = {&accepted[e], first_column_[e]};
  }
  return {problem_.get(),      &base_, &table_, &motion_, rows_.get(), &rigid_, &lazy_load_, &held_, &left_at_rest_,
          std::move(memories), std::move(springs), &no_springs_in, pairs_};
}

void Engine::build() {
  if (!nearby_ && deflected_ && problem_->theta().allFinite()) begin_near(*this, 2);
  link_load_ = {};
  MatrixXd keep = table_.keep;
  double delay = 0.0;
  bool elastic = false;
  const auto count_standing = [&](int j) { keep.col(j) = table_.keep.col(j) + table_.standing.col(j) + table_.resting.col(j); };
  if (standing_counts >= 0) count_standing(standing_counts);
  for (const Candidate& e : accepted) {
    if (e.has_memory()) count_standing(e.joint);
  }
  for (const Candidate& e : accepted) {
    if (e.effect.is<Delay>()) {
      delay += e.shape;
      leave_out_after(table_, static_cast<Index>(std::ceil(e.second * table_.sample_rate)), keep);
    }
    elastic = elastic || e.is_elastic();
    for (std::size_t k = 0; k < e.events.size(); ++k) {
      const auto run = static_cast<std::size_t>(e.event_runs[k]);
      for (Index i = table_.run_begin[run]; i < table_.run_begin[run + 1]; ++i) {
        if (table_.time[i] > e.events[k].first - 0.15 &&
            table_.time[i] < e.events[k].first + e.events[k].second + 0.15) {
          keep.row(i).setZero();
        }
      }
    }
  }
  const bool other_rows = keep_ != keep;
  keep_ = std::move(keep);
  if (rigid_rows_ == nullptr || delay != delay_) {
    motion_ = delayed(table_, delay);
    delay_ = delay;
    rigid_rows_ = std::make_shared<const BaseRows>(base_.rows(motion_));
    plain_ = nullptr;
  } else if (rows_ != rigid_rows_) {
    motion_.link_q = motion_.q;
    motion_.link_qd = motion_.qd;
    motion_.link_qdd = motion_.qdd;
  }
  if (elastic || other_rows || hold() != plain_hold_) plain_ = nullptr;
  if (const std::optional<Nearby> nearby = std::exchange(nearby_, {}); elastic && nearby) {
    refit_near(*nearby);
    return;
  }
  refit(false);
  // Some effects are made of the load torque, or begin with the friction that holds a joint; the fit gives both.
  const bool loaded = std::any_of(accepted.begin(), accepted.end(), [](const Candidate& e) {
    return e.takes_load() || e.effect.is<BaseTilt>() || e.has_memory();
  });
  for (int pass = 0; pass < (elastic ? kElasticPasses : loaded ? 2 : 0); ++pass) refit(elastic);
}

void Engine::anchor(const VectorXd& values, const std::vector<bool>& columns, double weight) {
  anchor_ = values;
  anchored_ = columns;
  anchor_weight_ = weight;
  plain_ = nullptr;
}

/// Whether the model does without a base column, or an effect in place contains it.
bool Engine::is_out(int column) const {
  if (!left_out.empty() && left_out[static_cast<std::size_t>(column)]) return true;
  return std::any_of(accepted.begin(), accepted.end(),
                     [&](const Candidate& e) { return contained_column(e, base_) == column; });
}

int contained_column(const Candidate& e, const BaseModel& base) {
  if (e.effect.is<Spring>()) return base.offset(e.joint);
  if (e.effect.is<Cable>()) return base.offset(e.pair.driven);
  return e.has_motor() ? base.rotor(e.joint) : -1;
}

/// Where a base column that is held is held.
double Engine::held_at(int column) const {
  if (is_out(column)) return 0.0;
  return anchor_.size() > 0 ? anchor_[column] : base_theta_[column];
}

/// How firmly each base column is held, b: 0 not at all.
VectorXd Engine::hold() const {
  constexpr double kHeld = 1e6;
  VectorXd hold = VectorXd::Zero(base_.columns());
  for (int c = 0; c < base_.columns(); ++c) {
    if (!anchored_.empty() && anchored_[static_cast<std::size_t>(c)]) hold[c] = anchor_weight_;
    if (is_out(c) || (masses_held && base_.is_link(c))) hold[c] = kHeld;
  }
  return hold;
}

/// Values of the base columns that the fit leans on, b.
VectorXd Engine::prior() const {
  const VectorXd firmly = hold();
  VectorXd prior = base_.prior();
  for (int c = 0; c < base_.columns(); ++c) {
    if (firmly[c] > 0.0) prior[c] = held_at(c);
  }
  return prior;
}

/// The problem of the base alone where no link deflects.
void Engine::set_up_base() {
  plain_hold_ = hold();
  const bool same_motion = fit_ != nullptr && rigid_rows_ == fit_->rows;
  if (same_motion && plain_hold_.isZero(0.0) && keep_ == table_.keep) {
    plain_ = fit_->fitted;
    return;
  }
  plain_ =
      std::make_shared<const Problem>(table_, keep_, rigid_rows_, base_.places(), prior(), steady_,
                                      table_.tau, plain_hold_, same_motion ? fit_->fitted.get() : nullptr);
  steady_ = plain_->steady();  // chosen once, or fits with and without an effect could not be compared
}

/// Columns of an accepted joint effect as the present fit gives them.
MatrixXd Engine::joint_columns(std::size_t index) const {
  const Candidate& effect = accepted[index];
  const std::ptrdiff_t first = first_memory(index);
  return first >= 0 ? second_memory_columns(bench(), effect, accepted[static_cast<std::size_t>(first)])
                    : joint_effect_columns(bench(), effect.effect.joint_effect(), effect.joint, effect.shape,
                                           {effect.replaces >= 0, effect.displacement}, effect.level);
}

/// Finds the columns of the accepted effects that go with the last fit.
void Engine::find_columns() {
  for (std::size_t e = 0; e < accepted.size(); ++e) accepted[e].beside = first_memory(e) >= 0;
  if (loaded_.empty()) return;
  std::vector<MatrixXd> found(accepted.size());
  host::for_each_parallel(accepted.size(), [&](std::size_t e) {
    if (accepted[e].effect.joint_effect() >= 0) found[e] = joint_columns(e);
  });
  for (std::size_t e = 0; e < accepted.size(); ++e) {
    Columns& columns = accepted[e].columns;
    if (accepted[e].effect.joint_effect() >= 0) columns.values = {std::move(found[e])};
    if (accepted[e].effect.is<BaseTilt>()) put_tilt_columns(bench(), accepted[e]);
  }
}

/// Columns that an accepted effect appends to the problem.
/// @param deflect  the deflection of elastic joints is in the motion
std::optional<Columns> Engine::appended(std::size_t index, bool deflect) const {
  const Candidate& effect = accepted[index];
  if (effect.effect.is<Delay>() || effect.effect.is<Contact>()) return {};  // in the motion, in the rows
  if (effect.is_elastic() && deflect) {
    // The deflection is in the link's motion now; what is left is the motor's inertia.
    if (!effect.has_motor()) return {};
    return Columns{{effect.joint}, {MatrixXd(motion_.qdd.col(effect.joint))}};
  }
  if (effect.replaces >= 0) return {};
  return effect.columns;
}

/// Puts the columns of the accepted effects into the problem.
void Engine::add_to_problem(bool deflect) {
  first_column_.assign(accepted.size(), -1);
  find_columns();
  std::vector<Columns> list;
  std::vector<std::size_t> whose;
  for (std::size_t e = 0; e < accepted.size(); ++e) {
    const Candidate& effect = accepted[e];
    if (effect.replaces >= 0) {
      problem_->replace(effect.joint, effect.replaces, effect.columns.values[0].col(0));
      first_column_[e] = effect.replaces;
    } else if (std::optional<Columns> columns = appended(e, deflect)) {
      list.push_back(std::move(*columns));
      whose.push_back(e);
    }
  }
  first_spring_column_ = -1;
  const bool turns = deflect && linear_.springs.count() > 0;
  if (turns) list.push_back(linear_.springs);
  const std::vector<int> firsts = problem_->append(list);
  for (std::size_t k = 0; k < whose.size(); ++k) {
    first_column_[whose[k]] = firsts[k];
    // Masses that only a tilt shows are those of the given robot where the motion shows little of it.
    constexpr double kGivenMasses = 1e-4;
    if (const auto hidden = static_cast<int>(accepted[whose[k]].hidden.cols()); hidden > 0)
      problem_->lean(firsts[k] + 2, hidden, kGivenMasses);
  }
  if (turns) first_spring_column_ = firsts.back();
}

void Engine::refit(bool deflect) {
  deflected_ = deflect;
  // What the columns are made of is that of the fit before.
  std::vector<bool> joints(loaded_.size(), false);
  for (const Candidate& e : accepted) {
    if (e.takes_load() && !joints.empty()) joints[static_cast<std::size_t>(e.joint)] = true;
  }
  load_joints(joints);
  if (deflect) {
    deflect_links();
    problem_.reset();  // it holds the rows of the last pass
    rows_.reset();
    rows_ = std::make_shared<const BaseRows>(base_.rows(motion_));
    linear_ = {};
    linear_ = linearised();
    problem_ = std::make_unique<Problem>(table_, keep_, linear_.rows, linear_.places, prior(), steady_,
                                         table_.tau - linear_.constant, hold());
  } else {
    if (plain_ == nullptr) set_up_base();
    rows_ = rigid_rows_;
    problem_ = std::make_unique<Problem>(*plain_);
  }
  add_to_problem(deflect);
  if (weights_held) problem_->hold_weights(base_noise_);
  if (!accepted.empty()) problem_->reweight();
  if (deflect) turn_springs();
  note_fit();
}

/// Robot of the fit, and what holds joints at rest; the rigid-body torque is that of another fit from here on.
void Engine::note_fit() {
  const VectorXd theta = problem_->theta();
  rigid_ = base_.robot(theta);
  more_load_.resize(0, 0);
  for (std::size_t e = 0; e < accepted.size(); ++e) {
    const bool tilts = accepted[e].effect.is<BaseTilt>();
    if (first_column_[e] < 0 || !(tilts || accepted[e].effect.is<PayloadChange>())) continue;
    if (tilts) accepted[e].tilt = fitted(e).head(2);
    if (more_load_.size() == 0) more_load_.setZero(table_.rows(), table_.num_joints);
    add_torque_of(e, 0, table_.rows(), more_load_);
  }
  loaded_.assign(static_cast<std::size_t>(table_.num_joints), false);
  lazy_load_.setZero(table_.rows(), table_.num_joints);
  find_holding_torque();
  find_resting_torque();
}

/// Rigid-body torque of some joints, all rows: it costs as much as a fit, and few models are asked for it.
void Engine::load_joints(const std::vector<bool>& joints) const {
  const std::lock_guard<std::mutex> lock(loading_);
  std::vector<std::size_t> missing;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (joints[j] && !loaded_[j]) missing.push_back(j);
  }
  if (missing.empty()) return;
  VectorXd links = problem_->theta().head(base_.columns());
  for (int c = 0; c < base_.columns(); ++c) {
    if (!base_.is_link(c)) links[c] = 0.0;
  }
  host::for_each_parallel(missing.size(), [&](std::size_t k) {
    const std::size_t j = missing[k];
    lazy_load_.col(static_cast<Index>(j)) = (*rows_)[j] * links(base_.places()[j]);
    if (more_load_.size() > 0) lazy_load_.col(static_cast<Index>(j)) += more_load_.col(static_cast<Index>(j));
  });
  for (const std::size_t j : missing) loaded_[j] = true;
}

void Engine::load_all() const { load_joints(std::vector<bool>(loaded_.size(), true)); }

void Engine::put(std::size_t index, Candidate candidate) {
  if (candidate.beside) {
    candidate.replaces = -1;
    candidate.columns.values[0].conservativeResize(Eigen::NoChange, 1);
    const auto first = std::find_if(accepted.begin(), accepted.end(), [&](const Candidate& e) {
      return e.joint == candidate.joint && e.has_memory();
    });
    first->shape = candidate.second;
    const auto at = static_cast<std::size_t>(first - accepted.begin());
    if (at > index) {  // the first of two comes before the second
      std::swap(accepted[at], accepted[index]);
      index = at;
    }
  }
  if (index == accepted.size()) {
    accepted.push_back(std::move(candidate));
  } else {
    accepted[index] = std::move(candidate);
  }
}

std::ptrdiff_t Engine::first_memory(std::size_t index) const {
  if (!accepted[index].has_memory()) return -1;
  for (std::size_t e = 0; e < index; ++e) {
    if (accepted[e].joint == accepted[index].joint && accepted[e].has_memory())
      return static_cast<std::ptrdiff_t>(e);
  }
  return -1;
}

std::ptrdiff_t Engine::second_memory(std::size_t index) const {
  for (std::size_t e = index + 1; e < accepted.size(); ++e) {
    if (first_memory(e) == static_cast<std::ptrdiff_t>(index)) return static_cast<std::ptrdiff_t>(e);
  }
  return -1;
}

VectorXd Engine::coefficients(std::size_t index) const {
  VectorXd c = fitted(index);
  const std::ptrdiff_t second = second_memory(index);
  if (second >= 0) c -= fitted(static_cast<std::size_t>(second));
  return c;
}

VectorXd Engine::fitted(std::size_t index) const {
  if (first_column_[index] < 0) return {};
  const Candidate& e = accepted[index];
  const int count = e.replaces >= 0 || e.is_elastic() ? 1 : e.columns.count();
  return problem_->theta().segment(first_column_[index], count);
}

std::vector<std::string> Engine::undetermined(double cutoff) const {
  const double rows_for_one = std::max(1.0, table_.sample_rate / (2.0 * cutoff));
  constexpr double kDeviations = 2.0;  // 95 % of a normal distribution lie within
  const VectorXd half_width = kDeviations * std::sqrt(rows_for_one) * problem_->white_std();
  const VectorXd theta = problem_->theta(), own = base_.prior();
  std::vector<std::string> names;
  for (int c = 0; c < base_.columns(); ++c) {
    if (!(half_width[c] < 0.5 * std::max(std::abs(theta[c]), std::abs(own[c]))))
      names.push_back(base_.name(c));
  }
  return names;
}

VectorXd Engine::noise_floor() const { return noise_with_hum(table_, keep_, problem_->residual()); }

SeenWithin<double> Engine::seen(int joint) const {
  const auto interval = [&](const MatrixXd& of) {
    SeenInterval<double> found = nowhere();
    if (of.cols() > 0) widen(found, of.col(joint), keep_.col(joint));
    return found.low <= found.high ? found : SeenInterval<double>{};
  };
  return {interval(table_.qd), interval(load()), interval(table_.q), interval(table_.temperature)};
}

model::Robot Engine::robot() const {
  const VectorXd theta = problem_->theta();
  model::Robot robot = rigid_;
  for (std::size_t e = 0; e < accepted.size(); ++e) {
    const Candidate& effect = accepted[e];
    const VectorXd c = coefficients(e);
    if (effect.effect.joint_effect() < 0) {
      effect.effect.visit([&](auto type) {
        if constexpr (ArmEffect<decltype(type)>) search_of(type).apply(effect, c, robot);
      });
      continue;
    }
    JointActuation<double>& joint = robot.joints[static_cast<std::size_t>(effect.joint)].actuation;
    if (effect.replaces >= 0) joint.coulomb_friction = theta[effect.replaces];
    // What a robot's joints hold already.
    if (effect.effect.is<Offset>()) {
      joint.friction_offset += c[0];
    } else if (effect.effect.is<RotorInertia>()) {
      joint.rotor_inertia += c[0];
    } else {
      const int kind = effect.effect.joint_effect();
      robot.effects.push_back(
          {kind, effect.joint, effect_parameters(kind, c, effect.shape, joint), effect.displacement});
    }
  }
  return robot;
}

VectorXd Engine::base_parameters() const {
  VectorXd beta = problem_->theta().head(base_.columns());
  for (const Candidate& e : accepted) {
    if (e.replaces >= 0) beta[e.replaces] = 0.0;
  }
  return beta;
}

/// What is no torque of an effect but that of springs.
MatrixXd Engine::base_torque(Index begin, Index count) const {
  const VectorXd beta = base_parameters();
  if (!deflected_) return base_.torque(*rows_, beta, begin, count);
  MatrixXd tau = linear_.constant.middleRows(begin, count);
  for (std::size_t j = 0; j < linear_.places.size(); ++j)
    tau.col(static_cast<Index>(j)) += (*linear_.rows)[j].middleRows(begin, count) * beta(linear_.places[j]);
  if (first_spring_column_ < 0) return tau;
  const VectorXd steps = problem_->theta().segment(first_spring_column_, linear_.springs.count());
  for (std::size_t s = 0; s < linear_.springs.joints.size(); ++s)
    tau.col(linear_.springs.joints[s]) += linear_.springs.values[s].middleRows(begin, count) * steps;
  return tau;
}

MatrixXd Engine::predicted() const { return predicted(0, table_.rows()); }

MatrixXd Engine::predicted(Index begin, Index count) const {
  MatrixXd tau = base_torque(begin, count);
  for (std::size_t e = 0; e < accepted.size(); ++e) {
    const Candidate& effect = accepted[e];
    if (first_column_[e] < 0) continue;
    if (effect.is_elastic()) {
      tau.col(effect.joint) += motion_.qdd.col(effect.joint).segment(begin, count) * fitted(e)[0];
      continue;
    }
    add_torque_of(e, begin, count, tau);
  }
  return tau;
}

void Engine::add_torque_of(std::size_t index, Index begin, Index count, MatrixXd& tau) const {
  const Columns& columns = accepted[index].columns;
  for (std::size_t a = 0; a < columns.joints.size(); ++a)
    tau.col(columns.joints[a]) += columns.values[a].middleRows(begin, count) * fitted(index);
}

std::vector<Candidate> Engine::propose(const std::vector<bool>& joints, const std::function<void(double)>& done,
                                       double least) const {
  load_all();
  Workbench bench = this->bench();
  bench.least_gain = least;
  // What takes longest comes first, so that no processor waits for it at the end.
  std::vector<std::function<std::vector<Candidate>()>> of_arm;
  for_each_arm_effect([&](auto type) {
    of_arm.emplace_back(
        [&bench, &joints, propose = search_of(type).propose] { return propose(bench, joints); });
  });
  std::vector<JointSearch> of_joints;
  for (int j = 0; j < table_.num_joints; ++j) {
    if (!joints[static_cast<std::size_t>(j)]) continue;
    for (JointSearch& search : joint_searches(bench, j)) of_joints.push_back(std::move(search));
  }
  std::vector<std::vector<Candidate>> arm(of_arm.size());
  std::vector<std::optional<Candidate>> single(of_joints.size());
  host::for_each_parallel(arm.size() + single.size(), [&](std::size_t s) {
    if (s < arm.size()) {
      arm[s] = of_arm[s]();
    } else {
      single[s - arm.size()] = of_joints[s - arm.size()]();
    }
  });
  if (done) done(1.0);
  std::vector<Candidate> found;
  for (std::optional<Candidate>& one : single) found.push_back(std::move(*one));
  for (std::vector<Candidate>& some : arm) std::move(some.begin(), some.end(), std::back_inserter(found));
  return found;
}

std::vector<Candidate> Engine::spring_pairs(const Candidate& first, const std::vector<bool>& others) const {
  load_all();
  return diagnose::spring_pairs(bench(), first, others);
}

std::vector<Candidate> Engine::forms_of(const Candidate& effect) const {
  load_all();
  const Workbench bench = this->bench();
  std::vector<Candidate> found;
  if (effect.effect.joint_effect() < 0) {
    for_each_arm_effect([&](auto type) {
      if (effect.effect.is<decltype(type)>())
        found = search_of(type).propose(bench, std::vector<bool>(static_cast<std::size_t>(table_.num_joints), true));
    });
    return found;
  }
  const std::vector<JointSearch> searches =
      joint_searches(bench, effect.joint, effect.effect.joint_effect());
  std::vector<std::optional<Candidate>> single(searches.size());
  host::for_each_parallel(single.size(), [&](std::size_t s) { single[s] = searches[s](); });
  for (std::optional<Candidate>& one : single) found.push_back(std::move(*one));
  return found;
}

void Engine::judge_again(Candidate& candidate) const {
  if (candidate.stale && !candidate.effect.is<Contact>() && candidate.columns.count() > 0)
    judge(*problem_, table_, left_at_rest_, candidate, candidate.beside ? 1 : 0);
  candidate.stale = false;
}

}  // namespace heft::diagnose

#include "written_model.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "heft/host/parallel.hpp"
#include "motion_signals.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Weights of identify's values among the versions, the simplest first.
constexpr double kHeld = 1e6;
constexpr std::array kWeights{kHeld, 0.1, 0.01, 0.0};
/// A version that is less simple has to lower the errors to this part of those of the simpler one [1]: the logs that it
/// is chosen by are few, and of the kind of the training logs.
constexpr double kMuchBetter = 0.98;
/// The same of one that derives motion with the cut-off of the search [1]: slower motion may want another one.
constexpr double kMuchBetterOwn = 0.97;
/// Part of the moving rows of the validation logs that repeat the training motion [1] from which on all of it does.
constexpr double kRepetition = 0.9;
/// A joint is worse in one kind of motion above this part of identify's error [1], as a kind has fewer rows than a log, and
/// if what is added there is more than this part of the squared error of the whole log: less needs no cure. It is forgiven
/// where the error of the whole log falls below the last of these parts: what is gained is more than what is lost.
constexpr double kWorseInKind = 1.05, kMattersInKind = 0.02, kMakesUpForIt = 0.95;
/// An effect costs a joint something above this [1]; what is below is rounding.
constexpr double kCosts = 1.001;

/// Whether errors are those of all rows of a log, as they are or in band, and not of a kind of motion.
bool is_whole(std::size_t row) {
  const std::size_t kind = row % JudgedMotion::kKinds;
  return kind == 0 || kind + 1 == JudgedMotion::kKinds;
}

/// @param errors, limits  of a version and of identify's model
bool is_worse(const std::vector<VectorXd>& errors, const std::vector<VectorXd>& limits, std::size_t row,
              Index joint) {
  const double error = errors[row][joint], limit = limits[row][joint];
  if (!(limit > 0.0)) return false;
  if (is_whole(row)) return error > kWorse * limit;
  const std::size_t all = row - row % JudgedMotion::kKinds;
  const double whole = limits[all][joint];
  return error > kWorseInKind * limit && error * error - limit * limit > kMattersInKind * whole * whole &&
         errors[all][joint] > kMakesUpForIt * whole;
}

}  // namespace

WrittenModel::WrittenModel(Search& search, const Identified& identified)
    : search_(search),
      identified_(identified) {
  repeated_ = part_repeated(search.start().judged->table(), search.start().train->table()) > kRepetition;
  limit_ = logs(true).errors_by_kind(logs(true).predicted(identified.robot), search.start().band);
  std::vector<Version> versions(repeated_ ? 1 : 2 * kWeights.size());
  std::vector<Robots> robots(kWeights.size());
  const auto find = [&](std::size_t w) {
    for (std::size_t v = 2 * w; v < std::min(versions.size(), 2 * w + 2); ++v)
      versions[v] = found(kWeights[w], v % 2 == 0, robots[w]);
  };
  const std::size_t weights = (versions.size() + 1) / 2;
  if (search.traces()) {  // in their order
    for (std::size_t w = 0; w < weights; ++w) find(w);
  } else {
    host::for_each_parallel(weights, find);
  }
  std::size_t best = 0;
  for (const bool ordinary : {true, false}) {
    for (std::size_t v = 0; v < versions.size(); ++v) {
      const Version& version = versions[v];
      if (version.ordinary != ordinary) continue;
      const double ratio = better_than(version, versions[best]);
      search.trace(fmt::format(
          "version of weight {:g}, {} motion: {} worse than identified, {} effects dropped, {:.3f}",
          version.weight, ordinary ? "ordinary" : "own", version.worse, version.dropped.size(), ratio));
      // Where nothing else speaks for a version, no joint may pay for it.
      if (ordinary && version.worse > versions[best].worse) continue;
      const double enough = ordinary ? kMuchBetter : kMuchBetterOwn;
      if (ratio * version.cost < enough * versions[best].cost) best = v;
    }
  }
  chosen_ = std::move(versions[best]);
  robot_ = made(chosen_, robots[best / 2]).robot;
  engine_ = built(chosen_.kept, chosen_.weight);
  load_ = load_of(robot_, judged().table());
  for (JointEffect<double>& effect : robot_.effects) effect.seen = seen(effect.joint);
  for (JointCable<double>& cable : robot_.cables) cable.seen = seen(cable);
}

SeenInterval<double> WrittenModel::seen(const JointCable<double>& cable) const {
  SeenInterval<double> all = nowhere();
  const auto widen_by = [&](const MatrixXd& q, const MatrixXd& keep) {
    widen(all, q.col(cable.driven) + cable.ratio * q.col(cable.driving),
          keep.col(cable.driving).cwiseMax(keep.col(cable.driven)));
  };
  widen_by(engine().table().q, engine().keep());
  widen_by(judged().table().q, judged().table().keep);
  return all.low <= all.high ? all : SeenInterval<double>{};
}

SeenWithin<double> WrittenModel::seen(int joint) const {
  SeenWithin<double> all = engine().seen(joint);
  const MotionTable& motion = judged().table();
  const auto widen_by = [&](SeenInterval<double>& interval, const MatrixXd& of) {
    if (of.cols() > 0) widen(interval, of.col(joint), motion.keep.col(joint));
  };
  widen_by(all.velocity, motion.qd);
  widen_by(all.load, load_);
  widen_by(all.position, motion.q);
  widen_by(all.temperature, motion.temperature);
  return all;
}

const JudgedMotion& WrittenModel::logs(bool ordinary) const {
  return ordinary ? *identified_.ordinary : *search_.start().judged_as_filed;
}

bool WrittenModel::reaches(std::size_t effect, int joint) const {
  const Candidate& e = search_.engine().accepted[effect];
  return e.joint < 0 || e.joint == joint || e.effect.joint_effect() < 0;
}

/// Base columns that are identify's: the masses, and the friction of joints without an effect of their own.
std::vector<bool> WrittenModel::anchored(const Engine& engine) const {
  const BaseModel& base = *identified_.base;
  std::vector<bool> held(static_cast<std::size_t>(base.columns()), true);
  const auto release = [&](int column) {
    if (column >= 0) held[static_cast<std::size_t>(column)] = false;
  };
  for (const Candidate& e : engine.accepted) {
    for (int j = 0; j < base.num_joints(); ++j) {
      const bool paired = (e.effect.is<WristCoupling>() || e.effect.is<Cable>()) &&
                          (j == e.pair.driving || j == e.pair.driven);
      if (e.joint != j && !paired) continue;
      for (const int column : {base.coulomb(j), base.viscous(j), base.offset(j)}) release(column);
      if (paired && e.effect.is<WristCoupling>()) release(base.rotor(j));
    }
  }
  return held;
}

std::unique_ptr<Engine> WrittenModel::built(const std::vector<bool>& kept, double weight) const {
  std::unique_ptr<Engine> engine = identified_.with_effects(search_.engine(), kept);
  if (weight > 0.0) engine->anchor(identified_.beta, anchored(*engine), weight);
  engine->build();
  // Other masses than the search's ask for other motors.
  while (!engine->remove_impossible_motors().empty()) engine->build();
  return engine;
}

/// Without an effect the held version is identify's model, in every digit.
WrittenModel::Made& WrittenModel::made(const Version& version, Robots& robots) const {
  const auto known = robots.find(version.kept);
  if (known != robots.end()) return known->second;
  const std::unique_ptr<Engine> engine = built(version.kept, version.weight);
  const bool none = version.weight == kHeld && engine->accepted.empty();
  return robots.emplace(version.kept, Made{none ? identified_.robot : engine->robot(), {}}).first->second;
}

/// The version with all effects, less those that a joint pays for.
WrittenModel::Version WrittenModel::found(double weight, bool ordinary, Robots& robots) const {
  const std::vector<bool> all(search_.engine().accepted.size(), true);
  Version version{weight, ordinary, all, {}, 0, 1.0, {}};
  judge(version, robots);
  while (version.worse > 0 && drop_one(version, robots)) {
  }
  return version;
}

void WrittenModel::judge(Version& version, Robots& robots) const {
  const JudgedMotion& motion = logs(version.ordinary);
  Made& model = made(version, robots);
  std::vector<VectorXd>& errors = model.errors[version.ordinary];
  if (errors.empty()) errors = motion.errors_by_kind(motion.predicted(model.robot), search_.start().band);
  version.errors = errors;
  version.worse = 0;
  version.cost = 1.0;
  for (std::size_t r = 0; r < limit_.size(); ++r) {
    for (Index j = 0; j < limit_[r].size(); ++j) {
      if (!is_worse(version.errors, limit_, r, j)) continue;
      ++version.worse;
      if (is_whole(r)) version.cost *= version.errors[r][j] / limit_[r][j];
    }
  }
}

/// Takes out of a version the effect that costs a joint that is worse most, the worst joint first.
/// @return whether there was one
bool WrittenModel::drop_one(Version& version, Robots& robots) const {
  struct Place {
    double ratio;
    std::size_t row;
    int joint;
  };
  std::vector<Place> places;
  for (std::size_t r = 0; r < limit_.size(); ++r) {
    for (Index j = 0; j < limit_[r].size(); ++j) {
      if (is_worse(version.errors, limit_, r, j))
        places.push_back({version.errors[r][j] / limit_[r][j], r, static_cast<int>(j)});
    }
  }
  std::sort(places.begin(), places.end(), [](const Place& a, const Place& b) { return a.ratio > b.ratio; });
  for (const auto [ratio, row, joint] : places) {
    search_.trace(fmt::format("  joint {}, kind {} of log {}: {:.4g}, identified {:.4g}", joint + 1,
                              row % JudgedMotion::kKinds, row / JudgedMotion::kKinds + 1,
                              version.errors[row][joint], limit_[row][joint]));
    std::optional<Version> best;
    double least = version.errors[row][joint] / kCosts;
    for (std::size_t e = 0; e < version.kept.size(); ++e) {
      if (!version.kept[e] || own_column(e) >= 0 || !reaches(e, joint)) continue;
      Version tried = dropped(version, {e}, joint, row, robots);
      if (!(tried.errors[row][joint] < least)) continue;
      least = tried.errors[row][joint];
      best = std::move(tried);
    }
    if (!best) continue;
    version = std::move(*best);
    return true;
  }
  if (version.weight != kHeld) return false;
  // No effect alone is to blame: without all of its own a joint is predicted as by identify's model.
  for (const auto [ratio, row, joint] : places) {
    std::vector<std::size_t> own;
    for (std::size_t e = 0; e < version.kept.size(); ++e) {
      if (version.kept[e] && own_column(e) < 0 && search_.engine().accepted[e].joint == joint)
        own.push_back(e);
    }
    if (own.empty()) continue;
    version = dropped(version, own, joint, row, robots);
    return true;
  }
  return false;
}

/// A version without some effects, of which joint and row say why.
WrittenModel::Version WrittenModel::dropped(const Version& version, const std::vector<std::size_t>& effects,
                                            int joint, std::size_t row, Robots& robots) const {
  Version other = version;
  std::vector<std::size_t> all = effects;  // with the second memories of first ones
  for (std::size_t e = 0; e < other.kept.size(); ++e) {
    const std::ptrdiff_t first = search_.engine().first_memory(e);
    if (first >= 0 && other.kept[e] && std::count(effects.begin(), effects.end(), std::size_t(first)) > 0 &&
        std::count(effects.begin(), effects.end(), e) == 0)
      all.push_back(e);
  }
  for (const std::size_t e : all) {
    other.kept[e] = false;
    other.dropped.emplace_back(
        e, fmt::format("predicts joint {} worse than the identified model on {}", joint + 1,
                       logs(true).table().runs[row / JudgedMotion::kKinds]));
  }
  judge(other, robots);
  return other;
}

/// Geometric mean of errors against those of another version, each joint of each log counting as much as another.
double WrittenModel::better_than(const Version& other, const Version& than) const {
  double sum = 0.0;
  int count = 0;
  for (std::size_t r = 0; r < limit_.size(); ++r) {
    if (!is_whole(r)) continue;
    for (Index j = 0; j < limit_[r].size(); ++j) {
      if (!(other.errors[r][j] > 0.0 && than.errors[r][j] > 0.0)) continue;
      sum += std::log(other.errors[r][j] / than.errors[r][j]);
      ++count;
    }
  }
  return count > 0 ? std::exp(sum / count) : 1.0;
}

std::string WrittenModel::why_not(std::size_t effect) const {
  std::string all;
  for (const auto& [dropped, why] : chosen_.dropped) {
    if (dropped == effect) all = why;
  }
  return all;
}

std::unique_ptr<Engine> WrittenModel::with(std::size_t effect, bool in_place) const {
  std::vector<bool> kept = chosen_.kept;
  kept[effect] = in_place;
  return built(kept, chosen_.weight);
}

}  // namespace heft::diagnose

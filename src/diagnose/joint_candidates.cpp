#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>
#include <type_traits>

#include "candidates.hpp"
#include "heft/core/effects/arm_effects.hpp"
#include "peak.hpp"
#include "rules.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

template <typename Effect>
concept ReplacesCoulomb = requires {
  Effect::kReplacesCoulomb;
};

template <typename Effect>
concept MayBeBetweenWhole = requires {
  Effect::kBetweenWhole;
};

/// Places that are looked at between two shapes of the grid, at first and with those around the best.
constexpr int kPlaces = 7, kRefinements = kPlaces + 3;

/// Writes the columns of one effect at one shape, some rows after the other.
template <typename Effect>
class ColumnWriter {
 public:
  static constexpr auto kCount = static_cast<Index>(Effect::kNotNegative.size());

  /// @param level  see joint_effect_columns()
  ColumnWriter(const Workbench& bench, int joint, double shape, FrictionForm form, double level)
      : bench_(bench), joint_(joint), shape_(shape), form_(form), friction_{0.0, level, 0.0, 0.0} {
    if constexpr (EffectWithMemory<Effect>) p_ = Effect::parameters({level}, shape, friction_);
  }

  /// @param from    the row after the last one written
  /// @param values  rows × kCount
  void write(Index from, Eigen::Ref<MatrixXd> values) {
    const MotionTable& table = *bench_.table;
    const bool measured = form_.displacement != Displacement::kPosition;
    const int steps = measured ? displacement_column(form_.displacement, joint_, table.num_joints) : 0;
    for (Index i = from; i < from + values.rows(); ++i) {
      x_.time = table.time[i];
      x_.qd = bench_.motion->qd(i, joint_);
      x_.qdd = bench_.motion->qdd(i, joint_);
      x_.direction = bench_.motion->direction(i, joint_);
      x_.load = (*bench_.load)(i, joint_);
      if (table.temperature.cols() > 0) x_.temperature = table.temperature(i, joint_);
      const double q = bench_.motion->q(i, joint_);
      if constexpr (EffectWithMemory<Effect>) {
        if (run_ < table.run_begin.size() && table.run_begin[run_] == i) {
          x_.memory = Effect::memory_at_rest(p_, (*bench_.held)(static_cast<Index>(run_), joint_), friction_);
          ++run_;
        } else {
          x_.memory =
              Effect::memory(p_, x_.memory, measured ? bench_.motion->displacement(i, steps) : q - x_.q);
        }
      }
      x_.q = q;
      const auto row = Effect::columns(shape_, x_);
      for (Index c = 0; c < kCount; ++c) values(i - from, c) = row[static_cast<std::size_t>(c)];
    }
    if (form_.whole) values.col(0) += bench_.motion->direction.col(joint_).segment(from, values.rows());
  }

 private:
  const Workbench& bench_;
  int joint_;
  double shape_;
  FrictionForm form_;
  JointActuation<double> friction_;
  EffectParameters<double> p_{};
  EffectPoint<double> x_;  ///< of the row before
  std::size_t run_{0};
};

template <typename Effect>
MatrixXd columns_of(const Workbench& bench, int joint, double shape, FrictionForm form, double level) {
  MatrixXd values(bench.table->rows(), ColumnWriter<Effect>::kCount);
  ColumnWriter<Effect>(bench, joint, shape, form, level).write(0, values);
  return values;
}

/// Ratio of neighbours in the grid of a shape.
template <typename Effect>
double range_ratio() {
  const ShapeRange& range = Effect::kShapes[0];
  return std::pow(range.to / range.from, 1.0 / std::max(1.0, range.steps - 1.0));
}

/// The first grid of a shape.
std::vector<double> grid_of(const ShapeRange& range, const MotionTable& table, int joint) {
  double unit = 1.0;
  if (range.scale == ShapeScale::kTopSpeed) unit = table.qd.col(joint).cwiseAbs().maxCoeff();
  if (range.scale == ShapeScale::kTravel)
    unit = table.q.col(joint).maxCoeff() - table.q.col(joint).minCoeff();
  if (range.scale == ShapeScale::kDuration) {
    unit = *std::max_element(table.run_seconds.begin(), table.run_seconds.end());
  }
  if (range.scale == ShapeScale::kTemperature) unit = table.temperature.col(joint).mean();
  const double from = range.from * unit, to = range.to * unit;
  if (range.fixed) return {from, to};
  std::vector<double> grid;
  for (int s = 0; s < range.steps; ++s) {
    if (range.whole) {
      grid.push_back(std::round(from) + s);
    } else {
      grid.push_back(from * std::pow(to / from, s / std::max(1.0, range.steps - 1.0)));
    }
  }
  return grid;
}

/// Range of a shape for a memory that goes by a displacement.
template <typename Effect>
ShapeRange range_of(Displacement displacement) {
  ShapeRange range = Effect::kShapes[0];
  if (displacement != Displacement::kPosition) {
    // What was measured resolves shorter distances than a low-passed position.
    constexpr double kShorter = 0.05;
    range.from *= kShorter;
    range.steps += static_cast<int>(std::lround(-std::log(kShorter) / std::log(range_ratio<Effect>())));
  }
  return range;
}

/// Finds a second memory of a joint's friction beside the one in place, and that one's distance again: the distance of
/// one alone lies between the two.
template <typename Effect>
Candidate second_memory(const Workbench& bench, int joint, Displacement displacement) {
  const FirstMemory& in_place = bench.memories[static_cast<std::size_t>(joint)];
  const Candidate& first = *in_place.effect;
  Candidate c(Effect{});
  c.joint = joint;
  c.displacement = displacement;
  c.beside = true;
  c.level = first.level;
  c.columns.joints = {joint};
  const double least = bench.least_gain_of(joint);
  const auto part = [&](double shape, Displacement by) {
    return columns_of<Effect>(bench, joint, shape, {false, by}, first.level);
  };
  /// Of columns of each distance and then that of the Coulomb friction, which the first one holds if it replaces it, the
  /// columns of both: what the second takes over from the first, and the first.
  const auto pair_of = [&](Index columns, Index own, Index other) {
    MatrixXd pair = MatrixXd::Zero(columns, 2);
    pair(own, 0) = 1.0;
    pair(other, 0) = -1.0;
    pair(other, 1) = 1.0;
    if (first.replaces >= 0) pair(columns - 1, 1) = 1.0;
    return pair;
  };
  const auto best_of = [&](const std::vector<double>& owns, const std::vector<double>& others) {
    std::vector<ColumnWriter<Effect>> writers;
    for (const double own : owns)
      writers.emplace_back(bench, joint, own, FrictionForm{false, displacement}, first.level);
    for (const double other : others)
      writers.emplace_back(bench, joint, other, FrictionForm{false, first.displacement}, first.level);
    const auto columns = static_cast<Index>(writers.size()) + 1;
    std::vector<MatrixXd> pairs;
    for (std::size_t own = 0; own < owns.size(); ++own) {
      for (std::size_t other = 0; other < others.size(); ++other) {
        pairs.push_back(
            pair_of(columns, static_cast<Index>(own), static_cast<Index>(owns.size() + other)));
      }
    }
    c.tried += static_cast<int>(pairs.size());
    const WideMoments all = bench.problem->wide_moments(
        joint, columns, static_cast<int>(columns), [&](Index from, Eigen::Ref<MatrixXd> values) {
          for (std::size_t w = 0; w < writers.size(); ++w)
            writers[w].write(from, values.col(static_cast<Index>(w)));
          values.col(columns - 1) = bench.motion->direction.col(joint).segment(from, values.rows());
        });
    const std::vector<double> gains = bench.problem->gains(all, pairs, in_place.column);
    const auto top = static_cast<std::size_t>(std::max_element(gains.begin(), gains.end()) - gains.begin());
    return std::tuple(owns[top / others.size()], others[top % others.size()], gains[top]);
  };
  // Every second distance of the grids, then finer steps around the best pair.
  const auto coarse = [&](Displacement by) {
    std::vector<double> all = grid_of(range_of<Effect>(by), *bench.table, joint), some;
    for (std::size_t k = 0; k < all.size(); k += 2) some.push_back(all[k]);
    return some;
  };
  auto [own, other, gain] = best_of(coarse(displacement), coarse(first.displacement));
  if (gain < least) {
    c.refused = kOfNoUse;
    return c;
  }
  double step = range_ratio<Effect>();
  for (int k = 0; k < 4; ++k, step = std::sqrt(step)) {
    std::tie(own, other, std::ignore) = best_of({own / step, own, own * step}, {other / step, other, other * step});
  }
  MatrixXd values(bench.table->rows(), 3);
  values << part(own, displacement), part(other, first.displacement), bench.motion->direction.col(joint);
  c.columns.values = {values * pair_of(3, 0, 1)};
  c.shape = own;
  c.second = other;
  c.replaces = in_place.column;
  judge(*bench.problem, *bench.table, *bench.left_at_rest, c, 1, least);
  const VectorXd& parts = c.trial.coefficients;
  if (!(parts[0] > 0.0)) c.refused = "would be negative";
  const bool too_much =
      first.replaces < 0 && c.trial.valid && !(parts[1] < c.trial.base[bench.base->coulomb(joint)]);
  if (!(parts[0] < parts[1]) || too_much) c.refused = "would be more than all of the friction";
  return c;
}

/// Finds the best shape of one effect on one joint.
template <typename Effect>
class ShapeSearch {
 public:
  ShapeSearch(const Workbench& bench, int joint, FrictionForm form)
      : bench_(bench),
        joint_(joint),
        form_(form),
        least_(bench.least_gain_of(joint)),
        level_(bench.robot->joints[static_cast<std::size_t>(joint)].actuation.coulomb_friction) {}

  Candidate run() {
    Candidate candidate(Effect{});
    candidate.joint = joint_;
    candidate.displacement = form_.displacement;
    double best = 0.0;
    if constexpr (Effect::kShapes.size() > 0) {
      const ShapeRange range = range_of<Effect>(form_.displacement);
      const std::vector<double> grid = grid_of(range, *bench_.table, joint_);
      candidate.tried = static_cast<int>(grid.size());
      const std::vector<double> gains = gains_of(grid);
      std::size_t top = 0;
      for (std::size_t s = 0; s < grid.size(); ++s) {
        if (gains[s] > gains[top]) top = s;
      }
      best = grid[top];
      if (gains[top] < least_) {
        candidate.refused = kOfNoUse;
        return candidate;
      }
      if constexpr (EffectWithMemory<Effect>) {
        // A part of the friction holds a resting joint with less than all of it.
        if (!form_.whole && gains[top] > 0.0) {
          level_ = std::clamp(bench_.problem->scan(moments_of({best})).front().second[0], 0.0, level_);
        }
      }
      if (!range.fixed && !range.whole && grid.size() > 1 && gains[top] > 0.0) {
        best = refine(grid[top > 0 ? top - 1 : 0], grid[std::min(top + 1, grid.size() - 1)]);
      }
      if constexpr (MayBeBetweenWhole<Effect>) {
        // Fewer periods than that in the travel are no ripple but any curve over position.
        constexpr double kLeastPeriods = 4.0;
        const auto q = bench_.table->q.col(joint_);
        const double periods = best * (q.maxCoeff() - q.minCoeff()) / (2.0 * std::numbers::pi);
        if (periods > kLeastPeriods && gains[top] > 0.0) {
          const double between = refine(best - 1.0, best + 1.0);
          candidate.tried += kRefinements;
          if (gains_of({between})[0] > (1.0 + Effect::kBetweenWhole) * gains[top]) best = between;
        }
      }
      if (!(gains[top] > 0.0)) candidate.refused = "explains nothing with physically possible values";
    }
    candidate.shape = best;
    candidate.columns.joints = {joint_};
    candidate.columns.values = {columns_of<Effect>(bench_, joint_, best, form_, level_)};
    candidate.level = level_;
    if (form_.whole) candidate.replaces = bench_.base->coulomb(joint_);
    if (candidate.refused.empty()) {
      judge(*bench_.problem, *bench_.table, *bench_.left_at_rest, candidate, 0, least_);
      for (Index c = 0; c < candidate.trial.coefficients.size(); ++c) {
        if (Effect::kNotNegative[static_cast<std::size_t>(c)] &&
            candidate.trial.coefficients[c] < -2.0 * candidate.trial.std[c]) {
          candidate.refused = "would be negative";
        }
      }
      // Two coefficients of which one is as good as zero: only the other one has to be allowed.
      if (candidate.trial.coefficients.size() > 0 && candidate.trial.coefficients.maxCoeff() <= 0.0 &&
          Effect::kNotNegative[0]) {
        candidate.refused = "would be negative";
      }
      if constexpr (ReplacesCoulomb<Effect>) {
        if (!form_.whole && candidate.trial.valid &&
            !(candidate.trial.coefficients[0] < candidate.trial.base[bench_.base->coulomb(joint_)])) {
          candidate.refused = "would be more than all of the friction";
        }
      }
    }
    return candidate;
  }

 private:
  static constexpr Index kCount = ColumnWriter<Effect>::kCount;

  WideMoments moments_of(const std::vector<double>& shapes) const {
    std::vector<ColumnWriter<Effect>> writers;
    for (const double shape : shapes) writers.emplace_back(bench_, joint_, shape, form_, level_);
    const auto write = [&](Index from, Eigen::Ref<MatrixXd> values) {
      MatrixXd once;  // sine and cosine of the position
      for (std::size_t s = 0; s < shapes.size(); ++s) {
        const Index at = kCount * static_cast<Index>(s);
        if constexpr (std::is_same_v<Effect, Ripple>) {
          if (s > 0 && shapes[s] == shapes[s - 1] + 1.0) {
            if (once.size() == 0) {
              const auto q = bench_.motion->q.col(joint_).segment(from, values.rows()).array();
              once = (MatrixXd(values.rows(), 2) << q.sin(), q.cos()).finished();
            }
            turn_on(once, values.middleCols(at - kCount, kCount), values.middleCols(at, kCount));
            continue;
          }
        }
        writers[s].write(from, values.middleCols(at, kCount));
      }
    };
    return bench_.problem->wide_moments(joint_, kCount * static_cast<Index>(shapes.size()),
                                        static_cast<int>(kCount), write);
  }

  std::vector<double> gains_of(const std::vector<double>& shapes) const {
    const WideMoments moments = moments_of(shapes);
    if (form_.whole) return bench_.problem->gains({&moments, 1}, bench_.base->coulomb(joint_));
    std::vector<double> gains;
    for (const auto& [gain, coefficients] : bench_.problem->scan(moments)) {
      bool allowed = true;
      if constexpr (kCount == 1) allowed = !Effect::kNotNegative[0] || coefficients[0] > 0.0;
      gains.push_back(allowed ? gain : 0.0);
    }
    return gains;
  }

  /// Sine and cosine of one more period a turn, by rotation: a hundred of them cost as much as two by name.
  /// @param once  rows × 2: of the position
  /// @param last  rows × 2: of the number before
  static void turn_on(const MatrixXd& once, const Eigen::Ref<const MatrixXd>& last,
                      Eigen::Ref<MatrixXd> next) {
    const auto sine = once.col(0).array(), cosine = once.col(1).array();
    next.col(0) = last.col(0).array() * cosine + last.col(1).array() * sine;
    next.col(1) = last.col(1).array() * cosine - last.col(0).array() * sine;
  }

  /// The best between two shapes, in the logarithm.
  double refine(double low, double high) const {
    const double from = std::log(low), width = std::log(high) - from;
    Peak peak;
    const auto look_at = [&](double first, double step, int count) {
      std::vector<double> places, shapes;
      for (int k = 0; k < count; ++k) {
        places.push_back(std::clamp(first + k * step, from, from + width));
        shapes.push_back(std::exp(places.back()));
      }
      const std::vector<double> gains = gains_of(shapes);
      for (std::size_t k = 0; k < places.size(); ++k) peak.add(places[k], gains[k]);
    };
    look_at(from, width / (kPlaces - 1), kPlaces);
    const double step = width / (4 * (kPlaces - 1));
    look_at(peak.vertex() - step, step, 3);
    return std::exp(peak.vertex());
  }

  const Workbench& bench_;
  int joint_;
  FrictionForm form_;
  double least_;  ///< see Workbench::least_gain_of()
  double level_;  ///< the joint's Coulomb friction in the present fit
};

}  // namespace

double Workbench::least_gain_of(int joint) const {
  // What does not take half of what matters with the shapes tried first does not with the best one; what matters is asked of
  // left-out blocks, where it is less.
  constexpr double kOfWhatMatters = 0.5;
  return std::max(least_gain, kOfWhatMatters * squared(kRelevantGainInRuns) * problem->weight(joint) * problem->squares_of(joint));
}

bool Workbench::may_have_spring(int joint) const {
  return springs[static_cast<std::size_t>(joint)] == nullptr &&
         std::find(no_springs_in->begin(), no_springs_in->end(), joint) == no_springs_in->end();
}

void judge(const Problem& problem, const MotionTable& table, const MatrixXd& left_at_rest, Candidate& c, int tested,
           double least) {
  c.trial = problem.judge(problem.moments(c.columns), c.replaces, tested, least);
  c.at_turns = 0.0;
  if (const double times = c.turns_that_matter(); times > 0.0 && c.trial.valid)
    c.at_turns = problem.part_of_fall(c.columns, c.trial, c.joint, table.turns(c.joint, times), left_at_rest.col(c.joint));
}

MatrixXd joint_effect_columns(const Workbench& bench, int effect, int joint, double shape, FrictionForm form,
                              double level) {
  MatrixXd values;
  visit_joint_effect(
      effect, [&](auto type) { values = columns_of<decltype(type)>(bench, joint, shape, form, level); });
  return values;
}

MatrixXd second_memory_columns(const Workbench& bench, const Candidate& second, const Candidate& first) {
  const auto part = [&](const Candidate& c) {
    return joint_effect_columns(bench, c.effect.joint_effect(), c.joint, c.shape, {false, c.displacement},
                                first.level);
  };
  return part(second) - part(first);
}

EffectParameters<double> effect_parameters(int effect, const VectorXd& coefficients, double shape,
                                           const JointActuation<double>& actuation) {
  EffectParameters<double> result{};
  visit_joint_effect(effect, [&](auto type) {
    using Effect = decltype(type);
    std::array<double, Effect::kNotNegative.size()> values{};
    for (std::size_t k = 0; k < values.size(); ++k) values[k] = coefficients[static_cast<Index>(k)];
    result = Effect::parameters(values, shape, actuation);
  });
  return result;
}

std::vector<JointSearch> joint_searches(const Workbench& bench, int joint, int only) {
  std::vector<JointSearch> searches;
  for (int effect = 0; effect < kNumJointEffects; ++effect) {
    if (only >= 0 && effect != only) continue;
    visit_joint_effect(effect, [&](auto type) {
      using Effect = decltype(type);
      if (std::is_same_v<Effect, FrictionTemperature> && bench.table->temperature.cols() == 0) return;
      for (const Displacement displacement :
           {Displacement::kPosition, Displacement::kVelocity, Displacement::kMeasured}) {
        const bool measured = displacement != Displacement::kPosition;
        if (measured && (!EffectWithMemory<Effect> || bench.motion->displacement.cols() == 0)) continue;
        if constexpr (EffectWithMemory<Effect>) {
          if (bench.memories[static_cast<std::size_t>(joint)].effect != nullptr) {
            if (bench.table->runs.size() >= kRunsThatAgree) {
              searches.emplace_back([&bench, joint, displacement] {
                return second_memory<Effect>(bench, joint, displacement);
              });
            }
            continue;
          }
        }
        const auto search = [&](bool whole) {
          searches.emplace_back([&bench, joint, form = FrictionForm{whole, displacement}] {
            return ShapeSearch<Effect>(bench, joint, form).run();
          });
        };
        search(ReplacesCoulomb<Effect>);
        if constexpr (ReplacesCoulomb<Effect>) search(false);
      }
    });
  }
  return searches;
}

}  // namespace heft::diagnose

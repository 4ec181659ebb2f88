#include "heft/excite/separate.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <random>

#include <fmt/format.h>

#include "finish_motion.hpp"
#include "heft/core/effects/arm_effects.hpp"
#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"
#include "heft/host/parallel.hpp"
#include "heft/regression/base_parameters.hpp"
#include "heft/statistics/median.hpp"
#include "rival_torque.hpp"
#include "robot_words.hpp"

namespace heft::excite {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Rate at which motions are compared [Hz]: Fourier motions end at 2.5 Hz, and what rings faster is integrated between rows.
constexpr double kRate = 50.0;
/// Further apart than this is not better: three times what decides.
constexpr double kEnough = 3.0 * kDecides;
/// Part of a column's square that the base leaves, below which it is in the base.
constexpr double kInBase = 1e-6;

/// What everybody fits: rigid bodies, drives, and what is made of them by the noise of each joint.
class Base {
 public:
  explicit Base(const model::Robot& robot)
      : columns_(robot, {true, true, true, true, robot.couplings}),
        base_(regression::find_base_parameters(columns_)) {}

  /// Rows of all joints one after the other, (m n) × b, in noise.
  MatrixXd rows(const Samples& at, const VectorXd& noise) const {
    const Index m = at.q.rows(), n = at.q.cols();
    MatrixXd rows(m * n, base_.count());
    for (Index i = 0; i < m; ++i) {
      const MatrixXd Y =
          columns_.regressor(at.q.row(i).transpose(), at.qd.row(i).transpose(), at.qdd.row(i).transpose());
      for (Index j = 0; j < n; ++j) rows.row(j * m + i) = Y.row(j)(base_.kept) / noise[j];
    }
    return rows;
  }

 private:
  regression::RegressionColumns columns_;
  regression::BaseParameters base_;
};

/// Squared distances from what the base explains.
class Left {
 public:
  explicit Left(MatrixXd rows) : rows_(std::move(rows)) {
    MatrixXd gram = rows_.transpose() * rows_;
    scale_ = gram.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    gram = scale_.asDiagonal() * gram * scale_.asDiagonal();
    gram.diagonal().array() += 1e-10;  // directions that the motion does not show explain nothing
    cholesky(gram, factor_);
  }

  /// Torque m × n as a column in noise, less what the base explains.
  VectorXd of(const MatrixXd& torque, const VectorXd& noise) const {
    const MatrixXd scaled = torque * noise.cwiseInverse().asDiagonal();
    VectorXd column = Eigen::Map<const VectorXd>(scaled.data(), scaled.size());
    VectorXd x = scale_.cwiseProduct(rows_.transpose() * column);
    solve_lower(factor_, x);
    solve_lower_transposed(factor_, x);
    const double whole = column.squaredNorm();
    column -= rows_ * scale_.cwiseProduct(x);
    if (column.squaredNorm() < kInBase * whole) column.setZero();
    return column;
  }

 private:
  MatrixXd rows_, factor_;
  VectorXd scale_;
};

/// A rival on one motion, less what the base explains.
struct Projected {
  std::vector<VectorXd> own;
  std::vector<std::vector<VectorXd>> family;
};

/// Squared length of `column` that the best of the family leaves.
double left_by(const VectorXd& column, const std::vector<std::vector<VectorXd>>& family) {
  double least = column.squaredNorm();
  for (const std::vector<VectorXd>& shape : family) {
    MatrixXd C(column.size(), static_cast<Index>(shape.size()));
    Index count = 0;
    for (const VectorXd& c : shape) {
      if (c.squaredNorm() > 0.0) C.col(count++) = c / c.norm();
    }
    if (count == 0) continue;
    MatrixXd gram = C.leftCols(count).transpose() * C.leftCols(count);
    gram.diagonal().array() += 1e-9;
    VectorXd x = C.leftCols(count).transpose() * column;
    if (!solve_positive(gram, x)) continue;
    least = std::min(least, (column - C.leftCols(count) * x).squaredNorm());
  }
  return least;
}

/// Distance with `truth` as the truth; NaN when the base holds it, so that nothing can be mistaken for it.
double one_way(const Projected& truth, const Projected& other, double weight) {
  double sum = 0.0;
  int count = 0;
  for (const VectorXd& own : truth.own) {
    if (own.squaredNorm() == 0.0) continue;
    sum += left_by(own, other.family);
    ++count;
  }
  return count == 0 ? kNaN : std::sqrt(weight * sum / count);
}

std::vector<Separation> distances(const model::Robot& robot, const Base& base, const Questions& asked,
                                  const RivalMotion& motion, double rate) {
  const Left left(base.rows(motion.at, asked.noise));
  const double weight = std::min(1.0, kIndependentRate / rate);
  std::vector<Separation> pairs;
  for (const Question& question : asked.all) {
    std::vector<Projected> rivals;
    for (const Rival& rival : question.rivals) {
      Projected projected;
      for (const MatrixXd& torque : own_torque(robot, rival, motion))
        projected.own.push_back(left.of(torque, asked.noise));
      for (const auto& shape : family(robot, rival, motion)) {
        projected.family.emplace_back();
        for (const MatrixXd& column : shape) projected.family.back().push_back(left.of(column, asked.noise));
      }
      rivals.push_back(std::move(projected));
    }
    const bool functions = effect_with_id(question.rivals.front().kind) == nullptr;
    for (std::size_t a = 0; a < (functions ? rivals.size() : 1); ++a) {
      for (std::size_t b = a + 1; b < rivals.size(); ++b) {
        const double there = one_way(rivals[a], rivals[b], weight),
                     back = one_way(rivals[b], rivals[a], weight);
        const double distance = std::isnan(there) ? back : std::isnan(back) ? there : std::min(there, back);
        pairs.push_back({question.rivals.front().joint, question.rivals[a].kind, question.rivals[b].kind,
                         std::isnan(distance) ? 0.0 : distance});
      }
    }
  }
  return pairs;
}

/// The geometric mean of all distances, none counted beyond what is enough, as a logarithm.
double worth(const std::vector<Separation>& pairs) {
  double sum = 0.0;
  for (const Separation& pair : pairs) sum += std::log(std::clamp(pair.distance, 1e-6, kEnough));
  return sum / static_cast<double>(pairs.size());
}

double smallest(const std::vector<Separation>& pairs) {
  double least = kInfinity;
  for (const Separation& pair : pairs) least = std::min(least, pair.distance);
  return least;
}

Samples samples_of(const ExcitationTrajectory& motion, double rate) {
  const auto rows = static_cast<Index>(motion.duration * rate) + 1;
  Samples samples{MatrixXd(rows, motion.num_joints()), {}, {}};
  samples.qd = samples.qdd = samples.q;
  VectorXd q, qd, qdd;
  for (Index i = 0; i < rows; ++i) {
    motion.evaluate(static_cast<double>(i) / rate, q, qd, qdd);
    samples.q.row(i) = q, samples.qd.row(i) = qd, samples.qdd.row(i) = qdd;
  }
  return samples;
}

/// The search for one arm.
class SeparatingSearch {
 public:
  SeparatingSearch(const model::Robot& robot, const LimitsFile& limits, const Questions& asked,
                   const SeparateOptions& options)
      : robot_(model::with_load(robot, options.payload)),
        limits_(limits),
        asked_(asked),
        options_(options),
        base_(robot_),
        dynamics_(robot_) {}

  const model::Robot& robot() const { return robot_; }

  std::vector<Separation> distances_of(Samples samples, double rate) const {
    return distances(robot_, base_, asked_, rival_motion(dynamics_, std::move(samples), rate), rate);
  }

  /// The best of random motions, bettered.
  void fourier() {
    // The first harmonic lasts as long as the motion, or a part of it: slow and wide, or fast and narrow.
    constexpr std::array<double, 4> kParts{1.0, 2.0, 4.0, 10.0};
    struct Try {
      std::size_t design;
      std::uint64_t seed;
      ExcitationTrajectory motion;
      double worth{-kInfinity}, smallest{0.0};
    };
    std::vector<Try> tries;
    for (const double part : kParts) {
      ExcitationOptions design;
      design.duration = options_.duration;
      design.period = options_.duration / part;
      design.start = limits_.start;
      design.seed = options_.seed;
      designs_.push_back(std::make_unique<ExcitationDesign>(robot_, limits_.limits, design));
      for (int k = 0; k < options_.motions; ++k)
        tries.push_back({designs_.size() - 1, options_.seed + 7919 * tries.size(), {}});
    }
    host::for_each_parallel(
        tries.size(),
        [&](std::size_t i) {
          Try& one = tries[i];
          try {
            one.motion = designs_[one.design]->random_motion(one.seed);
          } catch (const NotIdentifiableError&) {
            return;  // other periods may have one
          }
          const std::vector<Separation> pairs = distances_of(samples_of(one.motion, kRate), kRate);
          one.worth = worth(pairs);
          one.smallest = smallest(pairs);
        },
        [&](double done) {
          if (options_.progress) options_.progress(0.6 * done);
        });
    tried = static_cast<int>(tries.size());
    std::vector<double> all;
    for (const Try& one : tries) all.push_back(one.smallest);
    median = statistics::median(all);
    const Try& start = *std::max_element(tries.begin(), tries.end(),
                                         [](const Try& a, const Try& b) { return a.worth < b.worth; });
    if (!(start.worth > -kInfinity))
      designs_[start.design]->random_motion(start.seed);  // says why there is none
    best = start.motion;
    best_worth = start.worth;
    better(*designs_[start.design]);
  }

  /// A random search from the best one: steps that shrink where they do not help (Schumer and Steiglitz, IEEE Trans. Autom.
  /// Control 13, 1968).
  void better(const ExcitationDesign& design) {
    std::mt19937_64 random(options_.seed);
    std::normal_distribution<double> normal;
    VectorXd x = design.encode(best);
    double step = 0.2 * std::sqrt(x.squaredNorm() / static_cast<double>(x.size()));
    for (int k = 0; k < options_.steps; ++k) {
      VectorXd next = x;
      for (double& value : next) value += step * normal(random);
      const ExcitationTrajectory motion = design.decode(next);
      bool taken = false;
      if (design.use_of(motion).inside) {
        const double found = worth(distances_of(samples_of(motion, kRate), kRate));
        ++tried;
        taken = found > best_worth;
        if (taken) best = motion, best_worth = found, x = next;
      }
      step *= taken ? 1.5 : 0.85;
      if (options_.progress) options_.progress(0.6 + 0.35 * (k + 1) / options_.steps);
    }
  }

  int tried{0};
  double median{0.0};
  ExcitationTrajectory best;
  double best_worth{-kInfinity};

 private:
  model::Robot robot_;
  const LimitsFile& limits_;
  const Questions& asked_;
  const SeparateOptions& options_;
  Base base_;
  model::Dynamics dynamics_;
  std::vector<std::unique_ptr<ExcitationDesign>> designs_;
};

/// Whether a rival acts by how fast the motion changes.
bool is_dynamic(const Questions& asked) {
  return std::any_of(asked.all.begin(), asked.all.end(), [](const Question& question) {
    return std::any_of(question.rivals.begin(), question.rivals.end(), [](const Rival& rival) {
      return rival.kind == ElasticJoint::kId || rival.kind == Delay::kId;
    });
  });
}

/// Strokes of the joints in question.
FrictionMotion strokes(const model::Robot& robot, const LimitsFile& limits, const Questions& asked,
                       const SeparateOptions& options, bool finished) {
  FrictionOptions friction;
  friction.longest_stroke = 1.5;
  friction.payload = options.payload;
  friction.seed = options.seed;
  friction.rate = finished ? options.rate : kRate;
  friction.rehearse = finished && options.rehearse;
  if (finished) friction.from = options.from;
  for (const Question& question : asked.all) {
    const int joint = question.rivals.front().joint;
    if (std::find(friction.joints.begin(), friction.joints.end(), joint) == friction.joints.end())
      friction.joints.push_back(joint);
  }
  return friction_strokes(robot, limits, friction);
}

void judge(SeparatingMotion& motion) {
  for (const Separation& pair : motion.pairs) {
    if (pair.decides()) continue;
    motion.judgement.add(
        host::Verdict::kDoubtful,
        fmt::format("{} and {} of joint {} stay {:.2g} standard deviations apart, {:g} decide", pair.first,
                    pair.second, pair.joint + 1, pair.distance, kDecides));
  }
}

}  // namespace

std::vector<Separation> distances_of(const model::Robot& robot, const Questions& asked, const MatrixXd& q,
                                     const MatrixXd& qd, const MatrixXd& qdd, double rate) {
  return distances(robot, Base(robot), asked, rival_motion(model::Dynamics(robot), {q, qd, qdd}, rate), rate);
}

SeparatingMotion separate(const model::Robot& robot, const LimitsFile& limits, const Questions& asked,
                          const SeparateOptions& options) {
  SeparatingSearch search(robot, limits, asked, options);
  search.fourier();
  std::optional<FrictionMotion> alternative;
  try {
    // The corners of a stroke make an elastic joint ring, at frequencies that no log resolves: a distance in name only.
    if (!is_dynamic(asked)) alternative = strokes(robot, limits, asked, options, false);
    ++search.tried;
  } catch (const NotIdentifiableError&) {
    // No stroke is safe at the pose; the Fourier motion is.
  }
  const bool by_strokes =
      alternative &&
      worth(search.distances_of({alternative->log.q, alternative->log.qd, alternative->log.qdd}, kRate)) >
          search.best_worth;
  SeparatingMotion motion;
  if (by_strokes) {
    static_cast<Motion&>(motion) = strokes(robot, limits, asked, options, true);
    motion.how = fmt::format("strokes at constant speed, {:.3g} s", motion.path.duration());
  } else {
    motion.robot = search.robot();
    motion.limits = limits.limits;
    motion.how = fmt::format("Fourier series of {:g} s with harmonics of {:g} s", search.best.duration,
                             search.best.period);
    finish_motion(motion, {fourier_piece("separating motion", search.best)}, options.from, options.rate,
                  options.rehearse);
  }
  motion.asked = asked;
  motion.tried = search.tried;
  motion.median = search.median;
  motion.pairs = search.distances_of({motion.log.q, motion.log.qd, motion.log.qdd}, options.rate);
  judge(motion);
  if (options.progress) options.progress(1.0);
  return motion;
}

}  // namespace heft::excite

#include "heft/excite/excite.hpp"

#include <algorithm>
#include <cmath>
#include <exception>
#include <functional>
#include <utility>

#include <fmt/format.h>

#include "finish_motion.hpp"
#include "heft/data/differentiate.hpp"
#include "heft/data/log.hpp"
#include "heft/data/motion_rows.hpp"
#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"
#include "heft/host/parallel.hpp"
#include "heft/statistics/median.hpp"
#include "limit_check.hpp"
#include "robot_words.hpp"

namespace heft::excite {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

/// A good fit is possible below; above, single parameters lose a digit or more to the noise.
constexpr double kGoodCondition = 30.0;

/// Scores random motions while other work is done; what that throws comes first.
RandomMotions random_motions(const ExcitationDesign& design, int count, const std::function<void()>& beside) {
  std::vector<ExcitationScore> scores(static_cast<std::size_t>(count));
  std::exception_ptr failure;
  try {
    host::for_each_parallel(scores.size() + 1, [&](std::size_t i) {
      // Seeds far from those of the search.
      if (i > 0) {
        scores[i - 1] = design.score(design.random_motion(design.options().seed + 1'000'003 * i));
        return;
      }
      try {
        beside();
      } catch (...) {
        failure = std::current_exception();
      }
    });
  } catch (...) {
    if (!failure) throw;
  }
  if (failure) std::rethrow_exception(failure);
  std::vector<double> condition, mean_std, volume_std;
  for (const ExcitationScore& score : scores) {
    condition.push_back(score.condition);
    mean_std.push_back(score.mean_std);
    volume_std.push_back(score.volume_std);
  }
  return {count, statistics::median(condition), statistics::median(mean_std), statistics::median(volume_std)};
}

}  // namespace

SpaceRecord in_space(const model::Robot& robot, const MotionLimits& limits, const data::Log& log) {
  const LimitCheck check(robot, limits);
  SpaceRecord record;
  record.link_distance.resize(log.num_samples());
  record.link_spare = record.obstacle_distance = record.height = record.tool_speed = record.link_distance;
  for (Index i = 0; i < log.num_samples(); ++i) {
    const InSpace space = check.in_space(log.q.row(i), log.qd.row(i));
    record.link_distance[i] = space.link_distance;
    record.link_spare[i] = space.link_spare;
    record.obstacle_distance[i] = space.obstacle_distance;
    record.height[i] = space.height;
    record.tool_speed[i] = space.speed;
  }
  return record;
}

void finish_motion(Motion& motion, const std::vector<Piece>& core, const std::optional<VectorXd>& from,
                   double rate, bool rehearsed) {
  VectorXd first, last, qd, qdd;
  core.front().at(0.0, first, qd, qdd);
  core.back().at(core.back().duration, last, qd, qdd);
  const auto add = [&](const std::vector<Piece>& pieces, const std::string& name) {
    if (pieces.empty()) return;
    const double begin = motion.path.duration();
    for (const Piece& piece : pieces) motion.path.add(piece);
    motion.phases.push_back({name, begin, motion.path.duration()});
  };
  if (from) add(safe_way(motion.robot, motion.limits, "way to the motion", *from, first), "approach");
  add(core, "motion");
  if (from) add(safe_way(motion.robot, motion.limits, "way back", last, *from), "return");
  data::refuse_many_rows(motion.path.duration(), rate);
  motion.log = log_of(motion.robot, motion.path, rate);
  const LimitCheck check(motion.robot, motion.limits);
  motion.limits = check.limits;
  const Samples samples{motion.log.q, motion.log.qd, motion.log.qdd};
  motion.use = check.use_of(samples);
  if (!motion.use.inside) {
    throw NotIdentifiableError(
        fmt::format("robot \"{}\": no safe motion: the final check of every row found a limit exceeded: {}",
                    motion.robot.name, motion.use.worst));
  }
  if (!rehearsed) {
    motion.judgement.add(host::Verdict::kDoubtful, "The motion was not rehearsed on a simulated arm");
    return;
  }
  motion.rehearsal = rehearse(motion.robot, motion.limits, motion.path);
  if (!motion.rehearsal->passed) {
    throw NotIdentifiableError(
        fmt::format("robot \"{}\": no safe motion: in simulation the arm passes a limit: {}; a larger margin "
                    "(\"margin\" in the limits) leaves the controller more room",
                    motion.robot.name, motion.rehearsal->failure));
  }
}

namespace {

Options::Given given_motion(const std::string& name, const data::Log& log) {
  const double rate = data::median_sample_rate(log.time);
  constexpr double kRows = 100.0, kRounding = 1.0 + 1e-6;  // a second; of time stamps: 999.9999 Hz are 1 kHz
  const auto stride = std::max<Index>(1, static_cast<Index>(std::floor(kRounding * rate / kRows)));
  const Index rows = (log.num_samples() + stride - 1) / stride;
  Options::Given given{name, Eigen::MatrixXd(rows, log.q.cols()), {}, {}, static_cast<double>(stride) / rate};
  given.qd = given.qdd = given.q;
  for (Index i = 0; i < rows; ++i) {
    given.q.row(i) = log.q.row(i * stride);
    given.qd.row(i) = log.qd.row(i * stride);
    given.qdd.row(i) = log.qdd.row(i * stride);
  }
  return given;
}

/// Columns of the regression that the log to be recorded can have.
ModelStructure structure_of(const model::Robot& robot, const Options& options) {
  ModelStructure structure = options.search.structure;
  if (options.torque_at == data::TorqueAt::kJoint) {
    structure.coulomb = structure.viscous = false;
    structure.couplings.clear();
  } else if (structure.couplings.empty()) {
    structure.couplings = robot.couplings;
  }
  return structure;
}

}  // namespace

std::vector<Options::Given> given_motions(const data::LogSet& logs, std::vector<std::string>* notes) {
  std::vector<Options::Given> given;
  for (const data::LogSource& source : logs.given())
    given.push_back(given_motion(source.path, data::read_motion(source, true, notes).log));
  return given;
}

ExcitingMotion design(const model::Robot& robot, const MotionLimits& limits, const Options& options) {
  ExcitingMotion motion;
  motion.robot = model::with_load(robot, options.payload);
  ExcitationOptions search = options.search;
  search.sample_rate = options.rate;
  search.structure = structure_of(robot, options);
  if (search.torque_noise.size() > 0) {
    motion.noise = ExcitingMotion::Noise::kStated;
  } else if (limits.torque.allFinite()) {
    search.torque_noise = 0.01 * options.noise_percent * limits.torque;
    motion.noise = ExcitingMotion::Noise::kShareOfLimits;
    motion.noise_percent = options.noise_percent;
  }
  auto designed = std::make_shared<ExcitationDesign>(motion.robot, limits, search);
  // A pose that cannot be held is refused before the search, which takes a while.
  if (options.from) safe_way(motion.robot, limits, "pose to come from", *options.from, *options.from);
  for (const Options::Given& given : options.given) {
    designed->add_given(given.q, given.qd, given.qdd, given.seconds);
    motion.given.push_back(given.name);
  }
  motion.excitation = designed->optimize(options.progress);
  motion.limits = designed->limits();
  motion.design = designed;
  const auto finish = [&] {
    finish_motion(motion, {fourier_piece("exciting motion", motion.excitation.trajectory)}, options.from,
                  options.rate, options.rehearse);
  };
  if (options.compare > 0) {
    motion.random = random_motions(*designed, options.compare, finish);
  } else {
    finish();
  }
  if (!(motion.excitation.score.condition <= kGoodCondition)) {
    motion.judgement.add(
        host::Verdict::kDoubtful,
        fmt::format("The condition number is {:.3g}, above {:g}: some parameters will be known badly",
                    motion.excitation.score.condition, kGoodCondition));
  }
  return motion;
}

ExcitingMotion design(const model::Robot& robot, const LimitsFile& limits, const Options& options) {
  Options asked = options;
  if (asked.search.start.size() == 0) asked.search.start = limits.start;
  if (asked.search.torque_noise.size() == 0) asked.search.torque_noise = limits.torque_noise;
  return design(robot, limits.limits, asked);
}

FrictionMotion friction_strokes(const model::Robot& robot, const LimitsFile& limits,
                                const FrictionOptions& options) {
  FrictionOptions asked = options;
  if (asked.pose.size() == 0) asked.pose = limits.start;
  return friction_strokes(robot, limits.limits, asked);
}

model::Robot within(model::Robot robot, const MotionLimits& limits) {
  for (Index j = 0; j < robot.num_joints(); ++j) {
    model::RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
    joint.lower = limits.lower[j];
    joint.upper = limits.upper[j];
  }
  return robot;
}

struct PoseCheck::Impl {
  LimitCheck check;
};
PoseCheck::PoseCheck(const model::Robot& robot, MotionLimits limits) {
  limits.velocity.setOnes(robot.num_joints());
  limits.torque.setConstant(robot.num_joints(), kInfinity);
  impl_.reset(new Impl{LimitCheck(robot, limits)});
}
PoseCheck::~PoseCheck() = default;
PoseCheck::PoseCheck(PoseCheck&&) noexcept = default;
PoseCheck& PoseCheck::operator=(PoseCheck&&) noexcept = default;
std::string PoseCheck::objection(const VectorXd& q) const {
  std::string nearest;
  return impl_->check.pose_slack(q, &nearest) > 0.0 ? std::string() : nearest;
}

}  // namespace heft::excite

#include "guards.hpp"

#include <algorithm>
#include <string>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "engine.hpp"
#include "heft/host/error.hpp"
#include "heft/host/words.hpp"
#include "motion_scores.hpp"

namespace heft::diagnose {
namespace {

constexpr const char* kMotionToRecord =
    "record a motion of at least 20 s in which every joint turns back and forth over much of its range, at "
    "slow and at fast speeds (heft excite designs one)";

/// Largest travel of each joint in one of the logs, and the length of all of them [s].
struct Extent {
  Eigen::VectorXd travel;  ///< [rad, m]
  double seconds{0.0};
};

Extent extent_of(const std::vector<data::Log>& logs) {
  Extent extent{Eigen::VectorXd::Zero(logs.front().q.cols())};
  for (const data::Log& log : logs) {
    extent.travel =
        extent.travel.cwiseMax((log.q.colwise().maxCoeff() - log.q.colwise().minCoeff()).transpose());
    extent.seconds += log.time[log.time.size() - 1] - log.time[0];
  }
  return extent;
}

/// Below it nothing but noise moves [rad, m].
constexpr double kResting = 5e-3;

}  // namespace

void refuse_too_little_motion(const model::Robot& robot, const std::vector<data::Log>& train) {
  // A joint below these never leaves one posture.
  constexpr double kHardlyTurns = 0.05, kHardlySlides = 0.005;  // [rad, m]
  const int n = robot.num_joints();
  const Extent extent = extent_of(train);
  if (extent.travel.maxCoeff() < kResting) {
    throw NotIdentifiableError(fmt::format(
        "{}: no joint moves by more than {:.2g} rad or m: no parameter and no effect can be found; {}",
        train.front().path, extent.travel.maxCoeff(), kMotionToRecord));
  }
  std::vector<int> hardly;
  for (int j = 0; j < n; ++j) {
    const bool slides = robot.joints[static_cast<std::size_t>(j)].joint.type == JointType::kPrismatic;
    if (extent.travel[j] < (slides ? kHardlySlides : kHardlyTurns)) hardly.push_back(j);
  }
  if (2 * static_cast<int>(hardly.size()) <= n) return;
  throw NotIdentifiableError(fmt::format(
      "{}: {} of {} hardly move (by less than {} rad or {} m): their parameters, and what the arm lacks, "
      "cannot be determined; {}",
      train.front().path, host::joints_in_words(hardly), n, kHardlyTurns, kHardlySlides, kMotionToRecord));
}

void refuse_too_few_parameters(const model::Robot& bare, const std::vector<data::Log>& train) {
  constexpr double kShort = 10.0;  // [s]
  constexpr double kLeastShare = 1.0 / 8.0;
  constexpr std::size_t kMostNames = 8;
  const double seconds = extent_of(train).seconds;
  if (seconds >= kShort) return;
  const JudgedMotion motion(bare, train, {});
  const Engine engine(std::make_shared<const BaseModel>(bare, searched_structure()), motion.shared_table(),
                      {});
  const double cutoff = motion.streams().front().summary().cutoff;
  const std::vector<std::string> missing = engine.undetermined(cutoff);
  const auto all = static_cast<std::size_t>(engine.num_base_parameters());
  if (static_cast<double>(all - missing.size()) >= kLeastShare * static_cast<double>(all)) return;
  const std::vector<std::string> names(
      missing.begin(), missing.begin() + static_cast<long>(std::min(kMostNames, missing.size())));
  throw NotIdentifiableError(fmt::format(
      "{}: {:.2g} s determine {} of {} parameters of rigid bodies and friction, too few to look "
      "for what they lack; {}. Missing among others: {}",
      train.front().path, seconds, all - missing.size(), all, kMotionToRecord, fmt::join(names, ", ")));
}

void refuse_nothing_to_judge(const std::vector<data::Log>& validate) {
  constexpr double kShortest = 2.0;  // [s]
  const Extent extent = extent_of(validate);
  if (extent.travel.maxCoeff() >= kResting && extent.seconds >= kShortest) return;
  throw NotIdentifiableError(
      extent.seconds < kShortest
          ? fmt::format("{}: {:.2g} s of motion: too little to judge an effect on; {}", validate.front().path,
                        extent.seconds, kMotionToRecord)
          : fmt::format(
                "{}: {:.2g} s in which no joint moves by more than {:.2g} rad or m: too little to judge an "
                "effect on; {}",
                validate.front().path, extent.seconds, extent.travel.maxCoeff(), kMotionToRecord));
}

}  // namespace heft::diagnose

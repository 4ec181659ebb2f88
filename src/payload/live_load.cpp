// The load of a live stream: what to state, and when.
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "heft/host/error.hpp"
#include "heft/payload/payload.hpp"
#include "load_follower.hpp"
#include "load_geometry.hpp"
#include "runs.hpp"

namespace heft::payload {

struct LiveLoad::Impl {
  using Kind = LiveEvent::Kind;

  Impl(const UnloadedArm& given, const Options& asked)
      : arm(as_measured(given, asked)), options(run_options(given, {}, asked, given.zero_mass_std())) {
    refuse_rows(arm, asked.first_joint);
    if (!mass_is_visible(model::Dynamics(arm), asked.first_joint - 1))
      throw NotIdentifiableError(hidden_mass(asked.first_joint, arm.num_joints()));
    double weight = 0.0;
    for (const model::RobotJoint& joint : arm.joints) weight += joint.link[kMass];
    light = kLight * std::abs(weight);
  }

  std::optional<LiveEvent> take(const data::LiveRow& row) {
    const LoadFollower::Taken taken = follower->take(row);
    if (taken.refused) {
      ++summary.refused;
      const bool named = std::exchange(refusing, true);
      if (named || taken.joint < 0) return std::nullopt;
      LiveEvent event{Kind::kRefused, row.time, row.time, {}, {}, taken.joint};
      return event;
    }
    refusing = false;
    ++summary.samples;
    if (taken.changed) return change(row.time);
    return taken.estimated ? judge(row.time) : std::nullopt;
  }

  /// The torques show another load. Before anything was stated that is the filters, or the guess of the noise.
  std::optional<LiveEvent> change(double time) {
    since = time;
    if (!stated || changing) return std::nullopt;
    changing = true;
    // What was known last: more rows than what was stated.
    stated = latest;
    return LiveEvent{Kind::kChange, time, time, {}, *stated};
  }

  /// States the load as it is now where that is something new.
  std::optional<LiveEvent> judge(double time) {
    const LoadState state = follower->state();
    if (state != LoadState::kKnown && state != LoadState::kNone) return std::nullopt;
    const LoadValue now = follower->load();
    const double half = now.mass.half_width();
    if (!(half <= std::max(kClear * std::abs(now.mass.value), light))) return std::nullopt;
    // What lies between one half-width and two may still be nothing: there are many looks.
    if (now.mass.value < -2.0 * half) return impossible(time, now);
    if (!now.mass.contains(0.0) && now.mass.value < 2.0 * half) return std::nullopt;
    summary.unanswered.clear();
    if (!stated) return state_first(time, now);
    latest = now;
    return changing ? state_change(time, now) : correct(time, now);
  }

  std::optional<LiveEvent> impossible(double time, const LoadValue& now) {
    const bool said = !summary.unanswered.empty();
    summary.unanswered = fmt::format(
        "the mass is negative ({:.3g} kg ± {:.2g} kg): the model is not that of this arm without load, or the torques have "
        "another sign",
        now.mass.value, now.mass.half_width());
    if (said) return std::nullopt;
    return LiveEvent{Kind::kImpossible, time, since, now, stated.value_or(LoadValue{})};
  }

  std::optional<LiveEvent> state_first(double time, const LoadValue& now) {
    stated = latest = now;
    summary.load_since = since;
    return LiveEvent{Kind::kKnown, time, since, now, {}};
  }

  std::optional<LiveEvent> state_change(double time, const LoadValue& now) {
    changing = false;
    const LoadValue before = std::exchange(*stated, now);
    const double apart = std::hypot(before.mass.half_width(), now.mass.half_width());
    LiveEvent event{Kind::kReplaced, time, since, now, before};
    if (std::abs(now.mass.value - before.mass.value) <= apart) {
      event.kind = Kind::kUnchanged;
      return event;
    }
    if (!(before.mass.lower > 0.0)) event.kind = Kind::kAttached;
    else if (!(now.mass.lower > 0.0)) event.kind = Kind::kDetached;
    summary.load_since = since;
    summary.changes.push_back({since, before.mass.value, now.mass.value, now.mass.std});
    return event;
  }

  /// Without a change that was seen. What was stated as none may turn out to be a light load.
  std::optional<LiveEvent> correct(double time, const LoadValue& now) {
    const bool was_none = !(stated->mass.lower > 0.0);
    const bool outside = std::abs(now.mass.value - stated->mass.value) > stated->mass.half_width();
    if (!outside && !(was_none && now.mass.lower > 0.0)) return std::nullopt;
    summary.load_since = since;
    return LiveEvent{Kind::kCorrected, time, since, now, std::exchange(*stated, now)};
  }

  model::Robot arm;
  PayloadRunOptions options;
  double light{0.0};  ///< [kg]
  data::LiveClock clock;
  std::optional<LoadFollower> follower;
  std::optional<LoadValue> stated, latest;
  bool changing{false};  ///< another load than `stated`, not known yet
  bool refusing{false};  ///< the row before was refused
  double since{0.0};     ///< data count from here on [s]
  LiveSummary summary;
};

namespace {

/// @throws DataError for a low-pass that rows at this rate cannot have [Hz]
void refuse_cutoff(double cutoff, double rate) {
  if (cutoff < 0.5 * rate) return;
  throw DataError(fmt::format(
      "cut-off {:.6g} Hz; the stream has {:.4g} samples a second; expected more than 0 and less than {:.4g} Hz; choose a lower "
      "cut-off",
      cutoff, rate, 0.5 * rate));
}

}  // namespace

LiveLoad::LiveLoad(const UnloadedArm& arm, const Options& options)
    : impl_(std::make_unique<Impl>(arm, options)) {}
LiveLoad::~LiveLoad() = default;

std::optional<LiveEvent> LiveLoad::push(const data::LiveRow& row) {
  Impl& my = *impl_;
  const std::vector<data::LiveRow>& rows = my.clock.push(row);
  if (my.clock.anew()) {
    my.follower.reset();
    my.since = row.time;
  }
  my.summary.seconds += my.clock.step();
  if (!rows.empty() && !my.follower) {
    refuse_cutoff(my.options.cutoff, 1.0 / my.clock.period());
    my.follower.emplace(my.arm, my.options, my.clock.period());
  }
  // While filters settle nothing can come of a row but a refusal.
  std::optional<LiveEvent> first;
  for (const data::LiveRow& each : rows) {
    std::optional<LiveEvent> of_row = my.take(each);
    if (!first) first = std::move(of_row);
  }
  return first;
}

LiveSummary LiveLoad::end(long refused) {
  Impl& my = *impl_;
  LiveSummary summary = my.summary;
  summary.refused += refused;
  summary.load = my.latest;
  summary.changing = my.changing;
  if (!my.stated && summary.unanswered.empty()) {
    const std::string so_far =
        my.follower
            ? fmt::format("{:.3g} kg ± {:.2g} kg (95 %) so far", my.follower->load().mass.value,
                          my.follower->load().mass.half_width())
            : fmt::format("{} rows are too few", summary.samples + summary.refused + my.clock.waiting());
    if (summary.refused > summary.samples) {
      summary.unanswered = fmt::format(
          "most rows were left out: {} of {}; no load can be determined from the others; repair what is said of them above",
          summary.refused, summary.refused + summary.samples + static_cast<long>(my.clock.waiting()));
      return summary;
    }
    summary.unanswered = fmt::format(
        "the motion did not determine the load: {}; move several joints, the wrist among them, both ways and with large angles",
        so_far);
  }
  return summary;
}

}  // namespace heft::payload

/// @file
/// Campaigns of the load observer against the simulated UR5 at ordinary work: how far off, how often inside its interval, how
/// soon a change is seen, how often one is seen that was none.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "heft/core/estimate/load_observer.hpp"
#include "support/pick_and_place.hpp"

namespace heft::test {

/// A load at the flange of a UR5, drawn at random: mass [kg], centre of mass [m].
struct RandomLoad {
  double mass;
  std::array<double, 3> com;

  explicit RandomLoad(unsigned seed, double lightest = 0.5) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> uniform(0.0, 1.0);
    mass = lightest + (5.0 - lightest) * uniform(random);
    com = {0.05 * (2 * uniform(random) - 1), 0.05 * (2 * uniform(random) - 1), 0.02 + 0.08 * uniform(random)};
  }
};

template <typename Scalar>
class LoadCampaign {
 public:
  using Observer = LoadObserver<model::Ur5Arm, Scalar>;

  /// Mass and three coordinates of the centre: how often the 95 % interval held them; how often within the limits.
  struct Coverage {
    int runs{0}, unknown{0}, changes{0}, mass_within_2_percent{0}, com_within_5_mm{0};
    std::array<int, 4> held{};
  };
  /// @param seconds  of motion, then it is asked
  static Coverage coverage(int runs, double seconds, PickAndPlaceSettings settings, double lightest = 0.5) {
    Coverage found;
    for (int run = 0; run < runs; ++run) {
      const RandomLoad load(static_cast<unsigned>(run), lightest);
      settings.seed = static_cast<std::uint64_t>(1000 + run);
      LoadCampaign campaign(settings);
      campaign.arm.carry(load.mass, load.com);
      for (double moved = 0; moved < seconds; moved += campaign.arm.moves() ? settings.period : 0.0) {
        campaign.step();
      }
      const LoadEstimate<Scalar> estimate = campaign.observer.estimate();
      const double mass = static_cast<double>(estimate.value[kMass]);
      found.changes += campaign.changes;
      found.unknown += estimate.state == LoadState::kKnown ? 0 : 1;
      found.mass_within_2_percent += std::abs(mass - load.mass) < 0.02 * load.mass ? 1 : 0;
      found.held[0] += std::abs(mass - load.mass) < 1.96 * static_cast<double>(estimate.std[kMass]) ? 1 : 0;
      double farthest = 0;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double error = std::abs(static_cast<double>(estimate.com[axis]) - load.com[axis]);
        farthest = std::max(farthest, error);
        found.held[1 + axis] += error < 1.96 * static_cast<double>(estimate.com_std[axis]) ? 1 : 0;
      }
      found.com_within_5_mm += farthest < 0.005 ? 1 : 0;
      ++found.runs;
    }
    return found;
  }

  /// Grasps and releases in turn, in the pauses of forty seconds of work each.
  struct Changes {
    int true_ones{0}, missed{0}, false_ones{0};
    double slowest{0};  ///< from the first motion afterwards [s]
  };
  static Changes changes_seen(int runs, PickAndPlaceSettings settings, double lightest) {
    Changes found;
    for (int run = 0; run < runs; ++run) {
      const RandomLoad load(static_cast<unsigned>(run), lightest);
      settings.seed = static_cast<std::uint64_t>(5000 + run);
      LoadCampaign campaign(settings);
      bool holds = false, due = false;
      double gripped = 0;
      while (campaign.arm.time() < 40.0) {
        if (campaign.arm.grips() && campaign.arm.time() > 4.0) {
          found.missed += due ? 1 : 0;
          holds = !holds;
          campaign.arm.carry(holds ? load.mass : 0.0, load.com);
          due = true;
          gripped = campaign.arm.time();
          ++found.true_ones;
        }
        if (!campaign.step()) continue;
        found.false_ones += due ? 0 : 1;
        const bool moved = campaign.arm.moves_since() > gripped;
        if (due && moved)
          found.slowest = std::max(found.slowest, campaign.arm.time() - campaign.arm.moves_since());
        due = false;
      }
    }
    return found;
  }

  /// Changes seen in so many hours with one and the same load, which is known at the end.
  static int false_alarms(double hours, const PickAndPlaceSettings& settings) {
    LoadCampaign campaign(settings);
    const RandomLoad load(1);
    campaign.arm.carry(load.mass, load.com);
    while (campaign.arm.time() < 3600.0 * hours) campaign.step();
    EXPECT_EQ(campaign.observer.state(), LoadState::kKnown);
    return campaign.changes;
  }

  explicit LoadCampaign(const PickAndPlaceSettings& settings) : arm(settings) {
    refused += observer.configure() == Status::kOk ? 0 : 1;
  }
  ~LoadCampaign() { EXPECT_EQ(refused, 0); }
  LoadCampaign(const LoadCampaign&) = delete;
  LoadCampaign& operator=(const LoadCampaign&) = delete;

  /// @return another load was seen
  bool step() {
    const OnlineSample s = arm.next();
    typename Observer::Record record;
    const Status status = observer.update(s.q.template cast<Scalar>(), s.qd.template cast<Scalar>(),
                                          s.tau.template cast<Scalar>(), static_cast<Scalar>(s.dt), record);
    refused += status == Status::kOk ? 0 : 1;
    changes += record.changed ? 1 : 0;
    return record.changed;
  }

  PickAndPlaceUr5 arm;
  Observer observer;
  int changes{0}, refused{0};
};

/// A torque reading with 1 % of what the joint can do as its noise.
inline PickAndPlaceSettings ordinary_work() { return {}; }
/// The same noise, a fifth of its power correlated over 50 ms: behind the filter that is most of what is left.
inline PickAndPlaceSettings correlated_work() {
  PickAndPlaceSettings settings;
  settings.correlated = 0.2;
  return settings;
}

}  // namespace heft::test

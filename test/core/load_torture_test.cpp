/// A hundred million samples, half in float, half in double: loads that flicker, contacts, numbers that are none, time that stands
/// still, encoders that stick, torques that clip, dropouts; in between good data, after two seconds of which the load is
/// right again in 95 rounds of a hundred.
#include <array>
#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "heft/core/estimate/load_observer.hpp"
#include "heft/core/physical_body.hpp"
#include "support/pick_and_place.hpp"

namespace heft::test {
namespace {

enum class Trouble { kFlicker, kContact, kNoNumbers, kTime, kStuck, kClipped, kDropouts, kCount };

template <typename Scalar>
class LoadTorture : public ::testing::Test {
 public:
  using Observer = LoadObserver<model::Ur5Arm, Scalar>;
  static constexpr long kSamples = 50'000'000;
  static constexpr std::array<double, 3> kCom{0.02, -0.03, 0.06};

  void take(const OnlineSample& s, Status expected) {
    typename Observer::Record record;
    const Status status = observer.update(s.q.template cast<Scalar>(), s.qd.template cast<Scalar>(),
                                          s.tau.template cast<Scalar>(), static_cast<Scalar>(s.dt), record);
    ++samples;
    wrong += status == expected ? 0 : 1;
    ++statuses[static_cast<std::size_t>(status)];
    ++states[static_cast<std::size_t>(record.state)];
    if (!record.estimated) return;
    // Counted, for a million messages help nobody.
    // A body on the edge of what can exist may be rounded across it: by some units of the last place in float.
    InertialParameters<double> load{};
    for (std::size_t i = 0; i < 10; ++i) load[i] = static_cast<double>(observer.load()[i]);
    const double rounding = 1e-5 * (load[kMass] + load[kIxx] + load[kIyy] + load[kIzz]);
    for (const std::size_t i : {kIxx, kIyy, kIzz}) load[i] += rounding;
    const bool none = load == InertialParameters<double>{};
    impossible += none || check_physical(load) == Status::kOk ? 0 : 1;
    const LoadEstimate<Scalar> found = observer.estimate();
    for (std::size_t i = 0; i < 10; ++i) {
      not_finite += std::isfinite(found.value[i]) && std::isfinite(found.std[i]) ? 0 : 1;
    }
  }

  void work(double seconds) {
    for (const double end = arm.time() + seconds; arm.time() < end;) take(arm.next(), Status::kOk);
  }

  /// Ten seconds of ordinary work, five of one trouble, then two of motion with good data.
  void round(Trouble trouble) {
    const double load = 1.0 + uniform(random) * 3.0, end = arm.time() + 15.0;
    arm.carry(load, kCom);
    work(10.0);
    stuck = static_cast<int>(uniform(random) * 5.99);
    stuck_at = 1e30;
    for (long k = 0; arm.time() < end; ++k) suffer(trouble, k, load);
    arm.carry(load, kCom);
    for (double moved = 0; moved < 2.0; moved += arm.moves() ? 2e-3 : 0.0) take(arm.next(), Status::kOk);
    ++rounds;
    const double error = std::abs(static_cast<double>(observer.load()[kMass]) - load);
    if (observer.state() != LoadState::kKnown || !(error < 0.1 * load)) {
      ++not_right[static_cast<std::size_t>(trouble)];
    }
  }

  void suffer(Trouble trouble, long k, double load) {
    const double nan = std::numeric_limits<double>::quiet_NaN(),
                 inf = std::numeric_limits<double>::infinity();
    if (trouble == Trouble::kFlicker && k % 100 == 0) arm.carry(k % 200 == 0 ? 0.0 : load, kCom);
    OnlineSample s = arm.next();
    const bool now = k % 3 == 0;
    switch (trouble) {
      case Trouble::kContact:
        if (k % 500 < 250) s.tau[k % 1000 < 500 ? 1 : 2] += 40.0;
        break;
      case Trouble::kNoNumbers:
        if (!now) break;
        (k % 2 == 0 ? s.q : k % 5 == 0 ? s.qd : s.tau)[k % 6] = k % 4 == 0 ? nan : k % 4 == 1 ? -inf : inf;
        return take(s, Status::kNonFiniteInput);
      case Trouble::kTime:
        if (!now) break;
        s.dt = k % 2 == 0 ? 0.0 : -1.0;
        return take(s, Status::kOutOfRange);
      case Trouble::kStuck:
        if (stuck_at > 1e29) stuck_at = s.q[stuck];
        s.q[stuck] = stuck_at;
        break;
      case Trouble::kClipped: s.tau[1] = std::min(20.0, std::max(-20.0, s.tau[1])); break;
      case Trouble::kDropouts:
        if (k % 50 != 0) break;
        for (int lost = 0; lost < 24; ++lost) arm.next();
        s = arm.next();
        s.dt = 0.052;
        break;
      default: break;
    }
    take(s, Status::kOk);
  }

  std::mt19937_64 random{7};
  std::uniform_real_distribution<double> uniform{0.0, 1.0};
  PickAndPlaceUr5 arm{PickAndPlaceSettings{.seed = 11}};
  Observer observer;
  long samples{0}, wrong{0}, impossible{0}, not_finite{0}, rounds{0};
  std::array<long, 8> statuses{};
  std::array<long, 5> states{};
  std::array<long, static_cast<std::size_t>(Trouble::kCount)> not_right{};
  int stuck{0};
  double stuck_at{0};
};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(LoadTorture, Scalars);

TYPED_TEST(LoadTorture, FiftyMillionSamples) {
  this->take(this->arm.next(), Status::kNotConfigured);
  ASSERT_EQ(this->observer.configure(), Status::kOk);
  while (this->samples < TestFixture::kSamples) {
    this->round(static_cast<Trouble>(this->rounds % static_cast<long>(Trouble::kCount)));
  }
  EXPECT_GE(this->samples, TestFixture::kSamples);
  EXPECT_EQ(this->wrong, 0);
  EXPECT_EQ(this->not_finite, 0);
  EXPECT_EQ(this->impossible, 0);
  for (const Status status :
       {Status::kOk, Status::kNonFiniteInput, Status::kOutOfRange, Status::kNotConfigured}) {
    EXPECT_GT(this->statuses[static_cast<std::size_t>(status)], 0) << to_string(status);
  }
  for (std::size_t state = 0; state < this->states.size(); ++state) {
    EXPECT_GT(this->states[state], 0) << to_string(static_cast<LoadState>(state));
  }
  // The rest are right again some seconds later: a part of what a trouble taught of the noise is left.
  const long of_each = this->rounds / static_cast<long>(Trouble::kCount);
  long all = 0;
  for (std::size_t trouble = 0; trouble < this->not_right.size(); ++trouble) {
    EXPECT_LE(this->not_right[trouble], of_each / 10) << "trouble " << trouble << " of " << of_each;
    all += this->not_right[trouble];
  }
  EXPECT_LE(all, this->rounds * 5 / 100) << this->rounds;
}

}  // namespace
}  // namespace heft::test

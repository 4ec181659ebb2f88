// Instrumental variables: by hand against closed forms, then on a small arm with noise in the measured
// position.
#include <cmath>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/LU>

#include "heft/data/differentiate.hpp"
#include "heft/host/error.hpp"
#include "heft/regression/recorded_rows.hpp"
#include "heft/regression/weighted_fit.hpp"
#include "heft/statistics/block_jackknife.hpp"
#include "heft/statistics/distributions.hpp"
#include "heft/statistics/residual_moments.hpp"
#include "identify/bias_test.hpp"
#include "identify/instrumental.hpp"
#include "support/arms.hpp"
#include "support/synthetic_log.hpp"

namespace heft::identify {
namespace {

using ::testing::HasSubstr;

Eigen::MatrixXd normal_matrix(Eigen::Index rows, Eigen::Index cols, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  return Eigen::MatrixXd::NullaryExpr(rows, cols, [&] { return normal(random); });
}

// ------------------------------------------------------------------------------------------------ by hand

const Eigen::Vector3d kTruth(1.0, -2.0, 0.5);

/// One joint, noise of the given size in the regressor; instruments see the regressor with noise of their
/// own.
InstrumentSums sums_by_hand(double noise, double instrument_noise, std::uint64_t seed, int rows = 2000) {
  std::mt19937_64 random(seed);
  const Eigen::MatrixXd W0 = normal_matrix(rows, 3, random);
  const Eigen::MatrixXd W = W0 + noise * normal_matrix(rows, 3, random);
  const Eigen::MatrixXd Z = W0 + instrument_noise * normal_matrix(rows, 3, random);
  const Eigen::VectorXd y = W0 * kTruth + 0.5 * normal_matrix(rows, 1, random);
  InstrumentSums sums(1, 3, 0.5);
  sums.add(0, 0, Eigen::VectorXd::LinSpaced(rows, 0.0, 30.0), Z, W, y);
  return sums;
}

TEST(InstrumentSums, AreTheCrossMomentsHoweverBlocksMerge) {
  std::mt19937_64 random(1);
  const Eigen::MatrixXd Z = normal_matrix(4000, 4, random), W = normal_matrix(4000, 4, random);
  const Eigen::VectorXd y = normal_matrix(4000, 1, random);
  const Eigen::VectorXd time = Eigen::VectorXd::LinSpaced(4000, -1.0, 399.0);
  InstrumentSums sums(2, 4, 1.0, 16);
  for (int log = 0; log < 2; ++log) {
    for (Eigen::Index first = 0; first < 4000; first += 500) {
      for (int joint = 0; joint < 2; ++joint) {
        sums.add(log, joint, time.segment(first, 500), Z.middleRows(first, 500), W.middleRows(first, 500),
                 y.segment(first, 500));
      }
    }
  }
  EXPECT_LE(sums.num_blocks(), 17);
  ASSERT_EQ(sums.num_blocks(), sums.plain().num_blocks());
  const auto all = sums.weighted(Eigen::Vector2d(1.0, 0.25));
  EXPECT_LT((all.A - 2.5 * Z.transpose() * W).norm(), 1e-9 * all.A.norm());
  EXPECT_LT((all.r - 2.5 * Z.transpose() * y).norm(), 1e-9 * all.r.norm());
  // Blocks of equal number hold the same rows: with Z = W the moments are the plain ones.
  InstrumentSums same(1, 4, 1.0, 16);
  same.add(0, 0, time, W, W, y);
  for (int b = 0; b < same.num_blocks(); ++b) {
    const auto block = same.weighted(b, Eigen::VectorXd::Ones(1));
    EXPECT_LT((block.A - same.plain().factor(b, 0).information()).norm(), 1e-9 * block.A.norm()) << b;
  }
}

TEST(InstrumentSums, RefuseInstrumentsOfAnotherShape) {
  InstrumentSums sums(1, 2, 1.0);
  const Eigen::VectorXd time = Eigen::VectorXd::LinSpaced(3, 0.0, 1.0);
  EXPECT_THROW(sums.add(0, 0, time, Eigen::MatrixXd::Ones(3, 0), Eigen::MatrixXd::Ones(3, 2), time),
               DataError);
}

TEST(Instrumental, SolvesTheCrossMoments) {
  const InstrumentSums sums = sums_by_hand(0.5, 0.3, 2);
  const auto moments = sums.weighted(Eigen::VectorXd::Ones(1));
  const Eigen::VectorXd expected = moments.A.partialPivLu().solve(moments.r);
  const InstrumentalEstimate found =
      solve_instrumental(sums, Eigen::VectorXd::Ones(1), Eigen::Vector3d(3.0, 1.0, 4.0));
  EXPECT_LT((found.beta - expected).norm(), 1e-10);
  EXPECT_EQ(found.left_out, 0);
  EXPECT_EQ(found.groups, sums.num_blocks());
  EXPECT_NEAR(found.relevance, 1.0 / 1.25, 0.07);
  EXPECT_GT(found.relevance_ratio, 10.0);
}

TEST(Instrumental, CovarianceIsTheScatterOverExperiments) {
  constexpr int kSeeds = 300;
  Eigen::Vector3d squared = Eigen::Vector3d::Zero(), stated = squared, mean = squared;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const InstrumentalEstimate found = solve_instrumental(sums_by_hand(0.5, 0.3, seed, 500),
                                                          Eigen::VectorXd::Ones(1), Eigen::Vector3d::Zero());
    mean += (found.beta - kTruth) / kSeeds;
    squared += (found.beta - kTruth).cwiseAbs2();
    stated += found.covariance.diagonal();
  }
  for (int i = 0; i < 3; ++i) {
    EXPECT_LT(std::abs(mean[i]), 4.0 * std::sqrt(squared[i]) / kSeeds) << i;
    // The scatter of 300 is known to ± 4 %.
    EXPECT_NEAR(std::sqrt(stated[i] / squared[i]), 1.03, 0.12) << i;
  }
}

TEST(Instrumental, GroupsOfBlocksWidenTheIntervalOfCorrelatedNoise) {
  // A torque error constant over 2 s, and a column that hardly changes over 2 s either: blocks of 0.5 s count
  // it four times as independent.
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  constexpr int kRows = 6000;
  InstrumentSums sums(1, 1, 0.5, 200);
  const Eigen::VectorXd time = Eigen::VectorXd::LinSpaced(kRows, 0.0, 60.0 - 0.01);
  Eigen::VectorXd y(kRows);
  for (int i = 0; i < kRows; ++i) {
    if (i % 200 == 0) y[i] = normal(random);
    if (i % 200 != 0) y[i] = y[i - 1];
  }
  const Eigen::MatrixXd W = Eigen::MatrixXd::Ones(kRows, 1);
  sums.add(0, 0, time, W, W, y);
  const auto std_with = [&](double length) {
    return std::sqrt(
        solve_instrumental(sums, Eigen::VectorXd::Ones(1), Eigen::VectorXd::Zero(1), 1000.0, length)
            .covariance(0, 0));
  };
  EXPECT_NEAR(std_with(2.0) / std_with(0.0), 2.0, 0.1);
  EXPECT_NEAR(std_with(2.0), std::sqrt((y.array() - y.mean()).square().sum() / 200.0 / 30.0 / 29.0), 1e-9);
}

TEST(Instrumental, LeavesUndeterminedDirectionsAtTheStart) {
  std::mt19937_64 random(4);
  Eigen::MatrixXd W = normal_matrix(1000, 3, random);
  W.col(2) = 2.0 * W.col(1);
  InstrumentSums sums(1, 3, 0.5);
  const Eigen::Vector3d truth(1.0, 2.0, 3.0);
  sums.add(0, 0, Eigen::VectorXd::LinSpaced(1000, 0.0, 20.0), W, W, W * truth);
  const Eigen::Vector3d start(0.0, 2.4, 2.8);  // differs along (0, 2, −1), which no row sees
  const InstrumentalEstimate found = solve_instrumental(sums, Eigen::VectorXd::Ones(1), start);
  EXPECT_EQ(found.left_out, 1);
  EXPECT_LT((found.beta - Eigen::Vector3d(1.0, 2.4, 2.8)).norm(), 1e-9);
}

TEST(Instrumental, KnowsWeakInstrumentsFromStrongOnes) {
  EXPECT_GT(solve_instrumental(sums_by_hand(0.5, 3.0, 5), Eigen::VectorXd::Ones(1), kTruth).relevance_ratio,
            8.0);
  // Noise alone.
  std::mt19937_64 random(6);
  InstrumentSums sums(1, 3, 0.5);
  const Eigen::MatrixXd W = normal_matrix(2000, 3, random);
  sums.add(0, 0, Eigen::VectorXd::LinSpaced(2000, 0.0, 30.0), normal_matrix(2000, 3, random), W, W * kTruth);
  EXPECT_LT(solve_instrumental(sums, Eigen::VectorXd::Ones(1), kTruth).relevance_ratio, 4.0);
}

TEST(BiasTest, FindsNoiseInTheRegressorAndOnlyThat) {
  int biased = 0, found_none = 0;
  constexpr int kSeeds = 100;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    // Attenuation 1/1.09, a ninth of the residual's size and up.
    biased += test_bias(sums_by_hand(0.3, 0.2, seed), Eigen::VectorXd::Ones(1), kTruth).biased ? 1 : 0;
    const BiasTest none = test_bias(sums_by_hand(0.0, 0.5, seed), Eigen::VectorXd::Ones(1), kTruth);
    found_none += none.p_value > 0.05 ? 1 : 0;
    EXPECT_FALSE(none.biased) << seed;
  }
  EXPECT_GE(biased, 99);
  // p is uniform without bias: 95 of 100 above 0.05, the jackknife errs to more.
  EXPECT_GE(found_none, 90);
}

TEST(BiasTest, ABiasThatMovesHardlyAnyTorqueDoesNotMatter) {
  const BiasTest test = test_bias(sums_by_hand(0.1, 0.02, 7, 60000), Eigen::VectorXd::Ones(1), kTruth);
  EXPECT_LT(test.p_value, 0.01);
  EXPECT_FALSE(test.biased);
  EXPECT_THAT(test.verdict, HasSubstr("no significant bias"));
}

TEST(BiasTest, GivesNoVerdictItCannotStandBy) {
  EXPECT_THAT(test_bias(sums_by_hand(0.5, 0.2, 8), Eigen::VectorXd::Ones(1), kTruth, 1000.0, 4.0).verdict,
              HasSubstr("at least 10 are needed"));
  EXPECT_THAT(test_bias(sums_by_hand(0.2, 40.0, 9, 400), Eigen::VectorXd::Ones(1), kTruth).verdict,
              HasSubstr("too weak"));
}

// ------------------------------------------------------------------------------------------------ a small
// arm

model::Robot arm_with_rotors() {
  model::Robot robot = test::planar_two_link();
  robot.joints[0].actuation = {0.3, 1.0, 0.8, 0.2};
  robot.joints[1].actuation = {0.1, 0.4, 0.3, -0.1};
  return robot;
}

constexpr double kCutoff = 40.0;  // generous for a motion of half a Hertz

/// A log of the arm with torque noise of 2 % and noise of the given size in the position [rad].
data::Log noisy_log(double position_noise, std::uint32_t seed, double duration = 30.0) {
  test::SyntheticSettings settings;
  settings.duration = duration;
  settings.sample_rate = 200.0;
  settings.noise = 0.02;
  settings.noise_seed = settings.motion_seed = seed;
  settings.with_velocity = false;
  data::Log log = test::synthetic_log(arm_with_rotors(), settings);
  std::mt19937_64 random(seed);
  log.q += position_noise * normal_matrix(log.q.rows(), log.q.cols(), random);
  return log;
}

data::MotionStream stream_of(data::Log log) {
  data::StreamOptions options;
  options.motion.cutoff = kCutoff;
  options.cut_standstill = false;
  options.extra = {"qref"};
  return data::MotionStream(std::move(log), options);
}

/// Plain weighted least squares, its noise, and instruments on top.
struct Experiment {
  regression::RegressionColumns columns{arm_with_rotors(), {}};
  regression::BaseParameters base{regression::find_base_parameters(columns)};
  Eigen::VectorXd truth{base.regrouping * columns.values(arm_with_rotors())};
  regression::ObservationOptions observation{};

  /// The truth without Coulomb friction, whose smooth sign follows the step.
  Eigen::VectorXd smooth_truth() const {
    Eigen::VectorXd beta = truth;
    beta[index_of("Fc1")] = beta[index_of("Fc2")] = 0.0;
    return beta;
  }
  /// The arm of smooth_truth() under a slow control. @param step  at most [s]
  regression::InstrumentMotion slow_motion(const data::MotionStream& stream, double step) const {
    InstrumentOptions options;
    options.control = 1.5;
    options.step = step;
    return simulated_motion(columns, base, smooth_truth(), {&stream}, options);
  }

  struct Result {
    Eigen::VectorXd plain, noise;
    InstrumentalFit fit;
    BiasTest bias;
    int inside{0};        ///< parameters whose 95 % interval holds the truth
    int plain_inside{0};  ///< plain estimates in the same intervals
  };
  Result run(const data::MotionStream& stream, Instruments kind) const {
    const std::vector<const data::MotionStream*> logs{&stream};
    regression::BlockFactors factors(2, base.count(), 0.5);
    regression::for_each_observation(columns, base.kept, logs, observation,
                                     [&](const regression::ObservationRows& rows) {
                                       factors.add(rows.log, rows.joint, rows.time, rows.W, rows.tau);
                                     });
    Result result{
        {}, Eigen::Vector2d::Ones(), {{}, InstrumentSums(2, base.count(), 0.5), {}, 0, false, {}}, {}};
    for (int round = 0; round < 3; ++round) {
      const regression::TriangularFactor data = factors.weighted(result.noise.cwiseAbs2().cwiseInverse());
      result.plain = data.R().triangularView<Eigen::Upper>().solve(data.z());
      for (int j = 0; j < 2; ++j) {
        const regression::TriangularFactor joint = factors.joint(j);
        result.noise[j] = std::sqrt(joint.squared_error(result.plain) / static_cast<double>(joint.rows()));
      }
    }
    InstrumentOptions options;
    options.kind = kind;
    result.fit = fit_instrumental(columns, base, logs, observation, result.plain, result.noise, options);
    const Eigen::VectorXd weights = result.noise.cwiseAbs2().cwiseInverse();
    const InstrumentalEstimate estimate =
        solve_instrumental(result.fit.sums, weights, result.plain, 1000.0, 1.0);
    result.bias = test_bias(result.fit.sums, weights, result.plain, 1000.0, 1.0);
    for (int i = 0; i < base.count(); ++i) {
      const double half =
          statistics::interval_factor(estimate.groups - 1) * std::sqrt(estimate.covariance(i, i));
      result.inside += std::abs(estimate.beta[i] - truth[i]) < half ? 1 : 0;
      result.plain_inside += std::abs(result.plain[i] - truth[i]) < half ? 1 : 0;
    }
    return result;
  }
  Eigen::Index index_of(const std::string& name) const {
    for (int i = 0; i < base.count(); ++i) {
      if (columns[base.kept[static_cast<std::size_t>(i)]].name == name) return i;
    }
    return -1;
  }
};

TEST(Instrumental, SimulatedInstrumentsTakeAwayTheBiasOfPositionNoise) {
  const Experiment experiment;
  const Eigen::Index Izz1 = experiment.index_of("Izz1");
  int inside = 0, plain_inside = 0, all = 0;
  double plain = 0.0, instrumental = 0.0;
  constexpr int kSeeds = 12;
  for (std::uint32_t seed = 1; seed <= kSeeds; ++seed) {
    const Experiment::Result result =
        experiment.run(stream_of(noisy_log(1e-4, seed)), Instruments::kSimulated);
    EXPECT_TRUE(result.fit.converged) << seed;
    EXPECT_GE(result.fit.iterations, 2) << seed;
    EXPECT_TRUE(result.fit.notes.empty()) << seed << ": " << result.fit.notes.front();
    EXPECT_TRUE(result.bias.biased) << seed;
    EXPECT_THAT(result.bias.verdict, HasSubstr("biased by noise in the measured motion: use --method iv"))
        << seed;
    inside += result.inside;
    plain_inside += result.plain_inside;
    all += experiment.base.count();
    plain += result.plain[Izz1] / kSeeds;
    instrumental += result.fit.estimate.beta[Izz1] / kSeeds;
  }
  // Least squares loses most of the inertia; instruments find it.
  EXPECT_LT(plain, 0.5 * experiment.truth[Izz1]);
  EXPECT_NEAR(instrumental, experiment.truth[Izz1], 0.05 * experiment.truth[Izz1]);
  EXPECT_LT(plain_inside, 0.4 * all);
  EXPECT_GT(inside, 0.88 * all);
}

TEST(Instrumental, DelayedInstrumentsTakeAwayTheBiasOfWhiteNoise) {
  const Experiment experiment;
  const Eigen::Index Izz1 = experiment.index_of("Izz1");
  int biased = 0;
  double plain = 0.0, instrumental = 0.0;
  constexpr int kSeeds = 10;
  for (std::uint32_t seed = 1; seed <= kSeeds; ++seed) {
    const Experiment::Result result = experiment.run(stream_of(noisy_log(3e-5, seed)), Instruments::kDelayed);
    biased += result.bias.biased ? 1 : 0;
    plain += result.plain[Izz1] / kSeeds;
    instrumental += result.fit.estimate.beta[Izz1] / kSeeds;
  }
  EXPECT_LT(plain, 0.9 * experiment.truth[Izz1]);
  EXPECT_NEAR(instrumental, experiment.truth[Izz1], 0.05 * experiment.truth[Izz1]);
  EXPECT_GE(biased, 9);
}

TEST(BiasTest, FindsNoneInLogsWithoutPositionNoise) {
  const Experiment experiment;
  constexpr int kSeeds = 40;
  int unbiased = 0;
  for (std::uint32_t seed = 1; seed <= kSeeds; ++seed) {
    const Experiment::Result result =
        experiment.run(stream_of(noisy_log(0.0, 100 + seed, 20.0)),
                       seed % 4 == 0 ? Instruments::kSimulated : Instruments::kDelayed);
    unbiased += !result.bias.biased && result.bias.p_value > 0.01 ? 1 : 0;
  }
  EXPECT_GE(unbiased, 38);
}

/// All pieces of a log with their motion replaced, on those rows that the instruments take of them.
std::vector<data::MotionChunk> replaced(const data::MotionStream& stream, const regression::InstrumentMotion& motion,
                                        const regression::KeptRows& kept = {}) {
  std::vector<data::MotionChunk> pieces;
  stream.for_each([&](const data::MotionChunk& chunk) {
    regression::ThinnedMotion other = motion(0, chunk, kept);
    data::MotionChunk& piece = pieces.emplace_back();
    piece.sample_rate = chunk.sample_rate / static_cast<double>(other.stride);
    piece.time = chunk.time(Eigen::seqN(other.first, other.q.rows(), other.stride));
    piece.q = std::move(other.q), piece.qd = std::move(other.qd), piece.qdd = std::move(other.qdd);
  });
  return pieces;
}

/// A fast motion, whose velocity products disturb a slow control.
data::Log fast_log() {
  test::SyntheticSettings settings;
  settings.duration = 10.0;
  settings.sample_rate = 500.0;
  settings.fundamental = 0.25;
  settings.with_velocity = false;
  return test::synthetic_log(arm_with_rotors(), settings);
}

TEST(SimulatedMotion, FollowsAndObeysTheDynamics) {
  const Experiment experiment;
  const data::Log log = fast_log();
  const data::MotionStream stream = stream_of(log);
  const auto report = std::make_shared<SimulationReport>();
  InstrumentOptions options;
  options.control = 1.5;
  options.smoothing = 39.0;  // so that the reference is the motion itself
  const std::vector<data::MotionChunk> pieces = replaced(
      stream,
      simulated_motion(experiment.columns, experiment.base, experiment.truth, {&stream}, options, report));
  ASSERT_EQ(pieces.size(), 1U);
  EXPECT_EQ(report->pieces, 1);
  EXPECT_EQ(report->failed, 0);
  const data::MotionChunk& chunk = pieces.front();
  // Velocity products are left to the feedback, so it follows, but not exactly.
  const double error = (chunk.q - log.q).cwiseAbs().maxCoeff();
  EXPECT_LT(error, 0.5);
  EXPECT_GT(error, 0.02);
  // q, q̇, q̈ belong together.
  const Eigen::MatrixXd qd = data::differentiate(chunk.time, chunk.q);
  const Eigen::MatrixXd qdd = data::differentiate(chunk.time, chunk.qd);
  const Eigen::Index inner = chunk.q.rows() - 100;
  EXPECT_LT((qd - chunk.qd).middleRows(50, inner).cwiseAbs().maxCoeff(), 2e-3);
  EXPECT_LT((qdd - chunk.qdd).middleRows(50, inner).norm() / chunk.qdd.norm(), 0.02);
  // The control's torque, from the reference, is the torque that this motion needs by inverse dynamics.
  const model::Dynamics dynamics(arm_with_rotors());
  const double omega = 2.0 * std::numbers::pi * options.control;
  const Eigen::MatrixXd rd = data::differentiate(chunk.time, log.q);
  const Eigen::MatrixXd rdd = data::differentiate(chunk.time, rd);
  double worst = 0.0;
  int instants = 0;
  for (Eigen::Index i = 50; i < chunk.q.rows() - 50; i += 7) {
    const Eigen::VectorXd q = chunk.q.row(i), v = chunk.qd.row(i), a = chunk.qdd.row(i);
    const Eigen::VectorXd r = log.q.row(i), s = rd.row(i), t = rdd.row(i);
    // Away from reversals, where the smooth sign is 1.
    if (s.cwiseAbs().minCoeff() < 1.0 || v.cwiseAbs().minCoeff() < 1.0) continue;
    Eigen::MatrixXd H = dynamics.mass_matrix(r);
    H.diagonal() += Eigen::Vector2d(0.3, 0.1);
    // Viscous, Coulomb and offset along the reference: 0.8, 0.3 N·m·s/rad, ± 1, ± 0.4 and 0.2, − 0.1 N·m.
    Eigen::VectorXd tau =
        H * (t + 2.0 * omega * (s - v) + omega * omega * (r - q)) + dynamics.gravity_torque(r);
    tau[0] += 0.8 * s[0] + std::copysign(1.0, s[0]) + 0.2;
    tau[1] += 0.3 * s[1] + std::copysign(0.4, s[1]) - 0.1;
    worst = std::max(worst, (tau - dynamics.joint_torque(q, v, a)).cwiseAbs().maxCoeff());
    ++instants;
  }
  EXPECT_GT(instants, 50);
  // Torques are up to 40 N·m; what is left is the low-pass on the reference and the smooth sign.
  EXPECT_LT(worst, 0.1);
}

TEST(SimulatedMotion, IsOfFourthOrder) {
  const Experiment experiment;
  const data::MotionStream stream = stream_of(fast_log());
  const auto position = [&](double step) {
    const data::MotionChunk piece = replaced(stream, experiment.slow_motion(stream, step), {0, 20}).front();
    EXPECT_NEAR(piece.sample_rate, 1.0 / step, 1e-6);
    // At the instants that all of them have, 0.02 s apart.
    const auto stride = static_cast<Eigen::Index>(std::lround(0.02 / step));
    return Eigen::MatrixXd(piece.q(Eigen::seq(0, piece.q.rows() - 1, stride), Eigen::all));
  };
  const Eigen::MatrixXd fine = position(0.002);
  const double coarse_error = (position(0.02) - fine).cwiseAbs().maxCoeff();
  const double error = (position(0.01) - fine).cwiseAbs().maxCoeff();
  EXPECT_LT(error, 1e-4);
  EXPECT_GT(coarse_error / error, 10.0);
}

// Steps end on the rows that are kept, whatever row that begins with, and two at least lie between two of them.
TEST(SimulatedMotion, HasTheRowsThatAreKept) {
  const Experiment experiment;
  const data::Log log = fast_log();
  const data::MotionStream stream = stream_of(log);
  const auto motion_at = [&](double longest, const regression::KeptRows& kept) {
    return replaced(stream, experiment.slow_motion(stream, longest), kept).front();
  };
  const data::MotionChunk all = motion_at(0.002, {0, 1});
  ASSERT_EQ(all.q.rows(), log.q.rows());
  struct Steps {
    double longest;
    regression::KeptRows kept;
    Eigen::Index first, stride;
  };
  for (const Steps& c : {Steps{0.011, {7, 12}, 3, 4}, Steps{0.007, {7, 12}, 1, 3}, Steps{0.0051, {5, 6}, 1, 2},
                        Steps{0.1, {2, 5}, 2, 1}, Steps{0.0007, {1, 4}, 0, 1}}) {
    const data::MotionChunk some = motion_at(c.longest, c.kept);
    const Eigen::Index first = c.stride == 1 ? 0 : c.first, rows = (all.q.rows() - 1 - first) / c.stride + 1;
    ASSERT_EQ(some.q.rows(), rows) << c.longest;
    EXPECT_NEAR(some.sample_rate, 500.0 / static_cast<double>(c.stride), 1e-6) << c.longest;
    const auto same = Eigen::seqN(first, rows, c.stride);
    EXPECT_EQ(some.time, Eigen::VectorXd(all.time(same))) << c.longest;
    EXPECT_LT((some.q - all.q(same, Eigen::all)).cwiseAbs().maxCoeff(), 1e-4) << c.longest;
    EXPECT_LT((some.qd - all.qd(same, Eigen::all)).cwiseAbs().maxCoeff(), 5e-3) << c.longest;
  }
}

// Instruments on every sixth row pass the low-pass at a sixth of the rate, and come out as those on every row.
TEST(SimulatedMotion, GivesTheSameInstrumentsOnFewerRows) {
  const Experiment experiment;
  const data::MotionStream stream = stream_of(fast_log());
  const auto instruments = [&](double step) {
    std::vector<Eigen::MatrixXd> Z;
    regression::ObservationOptions observation;
    observation.cutoff = 10.0;  // every twelfth row is kept
    regression::for_each_observation(
        experiment.columns, experiment.base.kept, {&stream}, observation,
        [&](const regression::ObservationRows& rows) { Z.push_back(rows.Z); },
        experiment.slow_motion(stream, step));
    return Z;
  };
  const std::vector<Eigen::MatrixXd> every = instruments(0.002), sixth = instruments(0.012);
  ASSERT_EQ(every.size(), 2U);
  ASSERT_EQ(sixth.size(), 2U);
  for (std::size_t joint = 0; joint < 2; ++joint) {
    ASSERT_EQ(sixth[joint].rows(), every[joint].rows());
    for (Eigen::Index c = 0; c < every[joint].cols(); ++c) {
      // A sharp sign changes on a row: up to 12 ms late.
      const bool is_sign = experiment.columns[experiment.base.kept[static_cast<std::size_t>(c)]].kind == regression::ColumnKind::kCoulomb;
      EXPECT_LE((sixth[joint].col(c) - every[joint].col(c)).norm(), (is_sign ? 0.06 : 0.01) * every[joint].col(c).norm()) << c;
    }
  }
}

// It is simulated in stretches that begin one after the other, each with a wrong start before it.
TEST(SimulatedMotion, HasNoSeams) {
  const Experiment experiment;
  const Eigen::VectorXd beta = experiment.smooth_truth();
  const data::MotionStream stream = stream_of(fast_log());
  InstrumentOptions options;
  options.control = 1.5;
  options.smoothing = 39.0;
  options.step = 0.002;  // the log's own: every row is a step
  const data::MotionChunk chunk =
      replaced(stream, simulated_motion(experiment.columns, experiment.base, beta, {&stream}, options)).front();
  const double h = chunk.time[1] - chunk.time[0];
  ASSERT_NEAR(h, options.step, 1e-9);
  double worst = 0.0;
  for (Eigen::Index i = 0; i + 1 < chunk.q.rows(); ++i) {
    // q from one row to the next by velocity and acceleration, of fourth order.
    const Eigen::RowVectorXd travel = 0.5 * h * (chunk.qd.row(i) + chunk.qd.row(i + 1)) -
                                      h * h / 12.0 * (chunk.qdd.row(i + 1) - chunk.qdd.row(i));
    worst = std::max(worst, (chunk.q.row(i + 1) - chunk.q.row(i) - travel).cwiseAbs().maxCoeff());
  }
  EXPECT_LT(worst, 1e-8);  // a slow control forgets less, its matrices being those of the reference
}

TEST(SimulatedMotion, FollowsTheLogsReferenceWhereItHasOne) {
  const Experiment experiment;
  const Eigen::MatrixXd reference = noisy_log(0.0, 2, 10.0).q;
  const auto simulated = [&](std::uint64_t noise_seed, int place) {
    data::Log log = noisy_log(0.0, 2, 10.0);
    std::mt19937_64 random(noise_seed);
    log.q += 1e-3 * normal_matrix(log.q.rows(), log.q.cols(), random);
    log.qref = reference;
    const data::MotionStream stream = stream_of(std::move(log));
    InstrumentOptions options;
    options.reference = place;
    options.smoothing = 2.0;
    return replaced(stream, simulated_motion(experiment.columns, experiment.base, experiment.truth, {&stream},
                                             options))
        .front()
        .qdd;
  };
  // Noise in the measured position is not in it, not even in part.
  EXPECT_EQ(simulated(1, 0), simulated(2, 0));
  EXPECT_GT((simulated(1, -1) - simulated(2, -1)).norm(), 0.0);
}

TEST(SimulatedMotion, TakesTheReferenceWhereTheModelCannotMove) {
  const Experiment experiment;
  const data::Log log = noisy_log(0.0, 3, 10.0);
  const data::MotionStream stream = stream_of(log);
  Eigen::VectorXd beta = experiment.truth;
  beta[experiment.index_of("Izz1")] = -1.0;
  const auto report = std::make_shared<SimulationReport>();
  const std::vector<data::MotionChunk> pieces =
      replaced(stream, simulated_motion(experiment.columns, experiment.base, beta, {&stream}, {}, report));
  EXPECT_EQ(report->failed, 1);
  EXPECT_LT((pieces.front().q - log.q).cwiseAbs().maxCoeff(), 0.05);
}

// Joints are read side by side, each with its own pass over what was recorded.
TEST(ResidualCorrelation, OfRecordedRowsIsThatOfTheRows) {
  const Experiment experiment;
  const data::MotionStream stream = stream_of(noisy_log(1e-4, 5, 20.0));
  const std::vector<const data::MotionStream*> logs{&stream};
  regression::RecordedRows record;
  (void)regression::compressed(experiment.columns, experiment.base, logs, {}, {}, &record);
  statistics::ResidualMoments moments(2);
  regression::for_each_observation(
      experiment.columns, experiment.base.kept, logs, {}, [&](const regression::ObservationRows& rows) {
        moments.add(rows.log, rows.joint, rows.time, rows.tau - rows.W * experiment.truth);
      });
  const Eigen::VectorXd expected = moments.correlation_time();
  EXPECT_GT(expected.minCoeff(), 0.0);
  EXPECT_NE(expected[0], expected[1]);
  EXPECT_EQ(regression::residual_correlation(experiment.columns, experiment.base, logs, {}, experiment.truth, record),
            expected);
}

TEST(DelayedMotion, ShiftsByWholeSamples) {
  const data::Log log = noisy_log(0.0, 4, 10.0);
  const data::MotionStream stream = stream_of(log);
  std::vector<data::MotionChunk> before;
  stream.for_each([&](const data::MotionChunk& chunk) { before.push_back(chunk); });
  const auto shifted_by = [&](const regression::ObservationOptions& observation,
                              const InstrumentOptions& options, Eigen::Index rows) {
    const data::MotionChunk after = replaced(stream, delayed_motion({&stream}, observation, options)).front();
    const Eigen::Index rest = after.q.rows() - rows;
    return after.qdd.bottomRows(rest) == before.front().qdd.topRows(rest) &&
           after.q.topRows(rows).rowwise().mean().isApproxToConstant(before.front().q.row(0).mean());
  };
  InstrumentOptions options;
  options.delay = 0.1;
  EXPECT_TRUE(shifted_by({}, options, 20));
  // 2.2 periods of the lower cut-off.
  EXPECT_TRUE(shifted_by({}, {}, 11));
  EXPECT_TRUE(shifted_by({10.0, 4.0, 0.0}, {}, 44));
}

}  // namespace
}  // namespace heft::identify

#include "heft/data/motion_stream.hpp"

#include <malloc.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <numbers>
#include <random>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/core/effects/hysteresis.hpp"
#include "heft/host/error.hpp"
#include "heft/host/parallel.hpp"
#include "moving_span.hpp"
#include "streaming_median.hpp"
#include "support/measured_data.hpp"
#include "support/temporary_folder.hpp"

namespace heft::data {
namespace {

using Eigen::Index;
using heft::test::message_of;
using heft::test::TemporaryFolder;
using std::numbers::pi;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;

/// Two joints that move in sines, start and end at rest, with noise in the torque.
Log sine_log(Index rows, double rate, double jitter, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> late(-jitter, jitter);
  std::normal_distribution<double> noise(0.0, 1.0);
  Log log;
  log.path = "sine";
  log.time.resize(rows);
  log.q.resize(rows, 2);
  log.tau.resize(rows, 2);
  for (Index k = 0; k < rows; ++k) {
    const double t = 3.0 + (static_cast<double>(k) + late(random)) / rate;
    log.time[k] = t;
    log.q(k, 0) = std::sin(2.0 * pi * 0.37 * t) + 0.2 * std::cos(2.0 * pi * 1.1 * t) + 1e-5 * noise(random);
    log.q(k, 1) = 0.7 * std::cos(2.0 * pi * 0.23 * t) - 0.4 + 1e-5 * noise(random);
    log.tau(k, 0) = 10.0 * std::sin(2.0 * pi * 0.5 * t) + noise(random);
    log.tau(k, 1) = 3.0 * noise(random);
  }
  return log;
}

/// The whole of a stream, piece behind piece.
struct Whole {
  Eigen::VectorXd time, row_time;
  Eigen::MatrixXd q, qd, qdd, tau, row_q, row_qd, row_qdd, row_tau;
  Eigen::VectorXd usable;
  Index pieces{0};
  Index largest{0};  ///< rows of the largest piece, margins included
};

void append(Eigen::MatrixXd& to, const Eigen::MatrixXd& more) {
  const Index rows = to.rows();
  to.conservativeResize(rows + more.rows(), more.cols());
  to.bottomRows(more.rows()) = more;
}
void append(Eigen::VectorXd& to, const Eigen::VectorXd& more) {
  to.conservativeResize(to.size() + more.size());
  to.tail(more.size()) = more;
}

Whole whole_of(const MotionStream& stream) {
  Whole whole;
  stream.for_each([&](const MotionChunk& chunk) {
    EXPECT_EQ(chunk.first, whole.time.size()) << "no row is left out or twice";
    ++whole.pieces;
    whole.largest = std::max(whole.largest, chunk.time.size());
    const auto own = [&](const Eigen::MatrixXd& x) { return x.middleRows(chunk.begin, chunk.count).eval(); };
    append(whole.time, chunk.time.segment(chunk.begin, chunk.count));
    append(whole.usable, chunk.usable.segment(chunk.begin, chunk.count).cast<double>().matrix());
    append(whole.q, own(chunk.q));
    append(whole.qd, own(chunk.qd));
    append(whole.qdd, own(chunk.qdd));
    append(whole.tau, own(chunk.tau));
    append(whole.row_time, chunk.row_time);
    append(whole.row_q, chunk.row_q());
    append(whole.row_qd, chunk.row_qd());
    append(whole.row_qdd, chunk.row_qdd());
    append(whole.row_tau, chunk.row_tau);
  });
  return whole;
}

/// Largest deviation, against the largest value.
double deviation(const Eigen::MatrixXd& found, const Eigen::MatrixXd& expected) {
  if (found.rows() != expected.rows() || found.cols() != expected.cols()) {
    ADD_FAILURE() << found.rows() << " x " << found.cols() << " against " << expected.rows() << " x "
                  << expected.cols();
    return std::numeric_limits<double>::infinity();
  }
  return (found - expected).cwiseAbs().maxCoeff() / expected.cwiseAbs().maxCoeff();
}

/// That a stream in pieces gives what the functions for whole logs give.
void expect_the_whole_log(const Log& log, const MotionStream& stream, Index least_pieces,
                          MotionOptions options = {}) {
  const Whole whole = whole_of(stream);
  EXPECT_GE(whole.pieces, least_pieces);

  Log reference = log;
  options.cutoff = stream.summary().cutoff_chosen ? 0.0 : stream.summary().cutoff;
  options.from_position = true;
  options.smooth_position = true;
  const MotionReport report = derive_motion(reference, options);
  EXPECT_DOUBLE_EQ(stream.summary().cutoff, report.cutoff);
  EXPECT_DOUBLE_EQ(stream.summary().bandwidth, report.bandwidth);
  EXPECT_DOUBLE_EQ(stream.summary().sample_rate, report.sample_rate);
  EXPECT_EQ(stream.summary().resampled, report.resampled);
  EXPECT_EQ(whole.row_time, log.time);
  EXPECT_EQ(whole.row_tau, log.tau);
  EXPECT_LT(deviation(whole.row_q, reference.q), 1e-9);
  EXPECT_LT(deviation(whole.row_qd, reference.qd), 1e-9);
  EXPECT_LT(deviation(whole.row_qdd, reference.qdd), 1e-9);

  // The same on the grid, where derive_motion on the resampled log does no more resampling.
  Log even = report.resampled ? resample_uniform(log) : log;
  options.cutoff = report.cutoff;
  const Eigen::MatrixXd tau = even.tau;
  derive_motion(even, options);
  EXPECT_LT(deviation(whole.time, even.time), 1e-4);  // the log's own stamps may be up to 1 % of a period off
  EXPECT_LT(deviation(whole.q, even.q), 1e-9);
  EXPECT_LT(deviation(whole.qd, even.qd), 1e-9);
  EXPECT_LT(deviation(whole.qdd, even.qdd), 1e-9);
  EXPECT_LT(deviation(whole.tau, tau), 1e-9);
}

TEST(MotionStream, GivesInPiecesWhatTheWholeLogGives) {
  StreamOptions options;
  options.chunk_samples = 1000;
  for (const double jitter : {0.0, 0.3}) {
    SCOPED_TRACE(jitter);
    const Log log = sine_log(20000, 250.0, jitter, 1);
    expect_the_whole_log(log, MotionStream(log, options), 5);
  }
}

TEST(MotionStream, GivesInPiecesWhatTheWholeOfALongLogGives) {
  StreamOptions options;
  options.motion.cutoff = 20.0;
  for (const double jitter : {0.0, 0.2}) {
    SCOPED_TRACE(jitter);
    const Log log = sine_log(200000, 1000.0, jitter, 2);
    expect_the_whole_log(log, MotionStream(log, options), 10);
  }
}

TEST(MotionStream, GivesInPiecesWhatTheWholeLogGivesWithoutAFilter) {
  // Ten times the bandwidth is beyond 0.4 times the rate: no filter, and margins of splines and differences
  // only.
  StreamOptions options;
  options.chunk_samples = 150;
  for (const double jitter : {0.0, 0.4}) {
    SCOPED_TRACE(jitter);
    const Log log = sine_log(3000, 20.0, jitter, 19);
    const MotionStream stream(log, options);
    EXPECT_EQ(stream.summary().cutoff, 0.0);
    expect_the_whole_log(log, stream, 20);
  }
}

TEST(MotionStream, GivesTheSameFromFileAndFromMemory) {
  const TemporaryFolder folder;
  const std::string path = folder.path("log.csv");
  for (const double jitter : {0.0, 0.3}) {
    const Log log = sine_log(9000, 250.0, jitter, 3);
    write_log(path, log);
    StreamOptions options;
    options.chunk_samples = 1000;
    const Whole memory = whole_of(MotionStream(log, options));
    const Whole file = whole_of(MotionStream(path, {}, options));
    EXPECT_EQ(file.time, memory.time);
    EXPECT_EQ(file.q, memory.q);
    EXPECT_EQ(file.qd, memory.qd);
    EXPECT_EQ(file.qdd, memory.qdd);
    EXPECT_EQ(file.tau, memory.tau);
    EXPECT_EQ(file.usable, memory.usable);
    EXPECT_EQ(file.row_qdd, memory.row_qdd);
  }
}

TEST(MotionStream, GivesInPiecesWhatTheWholeOfAMeasuredLogGives) {
  const std::string folder = HEFT_DATA_DIR "/ur10e-dynamic-calibration";
  HEFT_NEEDS_MEASURED_DATA(folder);
  StreamOptions options;
  options.prefer_logged = false;
  options.chunk_samples = 500;
  for (const char* name : {"/exc-12h-20s.csv", "/ptp-10-points.csv"}) {
    SCOPED_TRACE(name);
    LogRequirements needs;
    needs.torque = true;
    const MotionStream stream(folder + name, needs, options);
    EXPECT_TRUE(stream.summary().resampled);
    expect_the_whole_log(read_log(folder + name, needs), stream, 2);
  }
}

TEST(MotionStream, GivesInPiecesWhatSavitzkyAndGolayGiveOnTheWholeLog) {
  StreamOptions options;
  options.chunk_samples = 1000;
  options.motion.method = DerivativeMethod::kSavitzkyGolay;
  for (const double jitter : {0.0, 0.3}) {
    SCOPED_TRACE(jitter);
    const Log log = sine_log(20000, 250.0, jitter, 4);
    expect_the_whole_log(log, MotionStream(log, options), 5, options.motion);
  }
}

TEST(MotionStream, GivesMarginsThatAreAsGoodAsThePieces) {
  StreamOptions options;
  options.chunk_samples = 1000;
  const MotionStream stream(sine_log(12000, 250.0, 0.3, 5), options);
  const Whole whole = whole_of(stream);
  const double margin = 14.0 / stream.summary().cutoff;
  stream.for_each([&](const MotionChunk& chunk) {
    const Index from = chunk.first - chunk.begin;
    const Index rows = chunk.time.size();
    EXPECT_TRUE(from == 0 || chunk.time[chunk.begin] - chunk.time[0] >= margin);
    EXPECT_TRUE(from + rows == whole.time.size() ||
                chunk.time[rows - 1] - chunk.time[chunk.begin + chunk.count - 1] >= margin);
    EXPECT_EQ(chunk.time, whole.time.segment(from, rows));
    EXPECT_LT((chunk.qdd - whole.qdd.middleRows(from, rows)).cwiseAbs().maxCoeff(),
              1e-9 * whole.qdd.cwiseAbs().maxCoeff());
    EXPECT_LT((chunk.tau - whole.tau.middleRows(from, rows)).cwiseAbs().maxCoeff(), 1e-9);
  });
}

TEST(MotionStream, FindsTheBandwidthOfALogTooLongForOneSpectrum) {
  // 1.1 Hz with a tenth of the power and more: 10 times that is the cut-off.
  const Log log = sine_log(200000, 1000.0, 0.0, 6);
  const MotionStream stream(log);
  EXPECT_TRUE(stream.summary().cutoff_chosen);
  EXPECT_NEAR(stream.summary().bandwidth, motion_bandwidth(log.q, 1000.0), 3.0 * 1000.0 / 131072.0);
  EXPECT_NEAR(stream.summary().cutoff, 11.0, 0.3);
}

TEST(MotionStream, TakesTheLoggedMotionWhereThereIsOne) {
  Log log = sine_log(6000, 250.0, 0.2, 7);
  // Rates a little too large, to differ from derived ones.
  const Log derived = [&] {
    Log motion = log;
    derive_motion(motion, {});
    return motion;
  }();
  log.qd = 1.05 * derived.qd;
  log.qdd = 1.05 * 1.05 * derived.qdd;
  StreamOptions options;
  options.chunk_samples = 1000;
  const MotionStream stream(log, options);
  EXPECT_TRUE(stream.summary().velocity_logged);
  EXPECT_GT(stream.summary().cutoff, 3.0) << "for the torque";
  const Whole whole = whole_of(stream);
  EXPECT_EQ(whole.row_q, log.q);
  EXPECT_EQ(whole.row_qd, log.qd);
  EXPECT_EQ(whole.row_qdd, log.qdd);
  const Log even = resample_uniform(log);
  EXPECT_LT(deviation(whole.q, even.q), 1e-9);
  EXPECT_LT(deviation(whole.qdd, even.qdd), 1e-9);

  options.prefer_logged = false;
  EXPECT_FALSE(MotionStream(log, options).summary().velocity_logged);
  log.qdd.resize(0, 0);
  const MotionStream half(log);
  EXPECT_FALSE(half.summary().velocity_logged) << "a velocity alone is not taken";
  EXPECT_FALSE(half.summary().acceleration_logged);
}

/// Rest for 8 s, a motion of 24 s, rest for 8 s.
Log log_with_rests() {
  Log log = sine_log(10000, 250.0, 0.0, 8);
  std::mt19937 random(9);
  std::normal_distribution<double> noise(0.0, 1e-5);
  for (Index k = 0; k < log.time.size(); ++k) {
    const double t = std::clamp((log.time[k] - 3.0 - 8.0) / 24.0, 0.0, 1.0);
    log.q(k, 0) = 0.9 * std::pow(std::sin(pi * t), 4) * std::sin(6.0 * pi * t) + noise(random);
    log.q(k, 1) = 0.4 + noise(random);
  }
  return log;
}

TEST(MotionStream, DerivesAMotionWhoseRecordedAccelerationContradictsIt) {
  Log log;
  log.path = "noise.csv";
  const int rows = 2000;
  log.time = Eigen::VectorXd::LinSpaced(rows, 0.0, 0.01 * (rows - 1));
  log.q = (2.0 * log.time.array()).sin().matrix();
  log.qd = (2.0 * (2.0 * log.time.array()).cos()).matrix();
  log.tau = log.q;
  const Eigen::VectorXd qdd = (-4.0 * (2.0 * log.time.array()).sin()).matrix();
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0.0, 20.0);
  log.qdd = Eigen::MatrixXd(rows, 1).unaryExpr([&](double) { return noise(random); });
  const MotionStream stream(log);
  EXPECT_FALSE(stream.summary().acceleration_logged);
  EXPECT_THAT(stream.summary().notes, testing::Contains(testing::HasSubstr("derived from position instead")));
  stream.for_each([&](const MotionChunk& chunk) {
    const Eigen::Index middle = chunk.row_qdd().rows() / 2;
    EXPECT_NEAR(chunk.row_qdd()(middle, 0), qdd[middle], 0.02);
  });
  EXPECT_EQ(stream.summary().top_speed.size(), 1);
  EXPECT_NEAR(stream.summary().top_speed[0], 2.0, 0.05);
  log.qdd = qdd;
  EXPECT_TRUE(MotionStream(log).summary().acceleration_logged);
}

TEST(MotionStream, TellsDisplacementsFromTheVelocitiesAsLogged) {
  // A joint that rests, moves on and settles with a small reversal; its position in steps of 24 urad with noise.
  constexpr double kRate = 200.0, kStep = 24e-6, kNoise = 10e-6;
  for (const double jitter : {0.0, 0.3}) {
    std::mt19937 random(5);
    std::uniform_real_distribution<double> late(-jitter, jitter);
    std::normal_distribution<double> noise(0.0, kNoise);
    const auto position = [](double t) {
      const double u = std::clamp((t - 2.0) / 2.0, 0.0, 1.0);
      const double settle = t > 4.0 ? 2e-4 * std::exp(-3.0 * (t - 4.0)) * std::sin(6.0 * (t - 4.0)) : 0.0;
      return 0.5 * u * u * (3.0 - 2.0 * u) + settle;
    };
    Log log;
    log.path = "settling";
    const Index rows = 1400;
    log.time.resize(rows), log.q.resize(rows, 1), log.qd.resize(rows, 1), log.tau.setZero(rows, 1);
    Eigen::VectorXd truth(rows);
    for (Index k = 0; k < rows; ++k) {
      const double t = log.time[k] = (static_cast<double>(k) + late(random)) / kRate;
      truth[k] = position(t);
      log.q(k, 0) = kStep * std::round((truth[k] + noise(random)) / kStep);
      log.qd(k, 0) = (position(t + 1e-5) - position(t - 1e-5)) / 2e-5;
    }
    StreamOptions options;
    options.motion.cutoff = 6.0;
    options.prefer_logged = false;
    options.displacement = true;
    const auto steps_of = [&](Index chunk, bool grid) {
      options.chunk_samples = chunk;
      Eigen::MatrixXd steps(0, 2);
      MotionStream(log, options).for_each([&](const MotionChunk& piece) {
        append(steps,
               grid ? piece.displacement.middleRows(piece.begin, piece.count) : piece.row_displacement);
      });
      return steps;
    };
    const Eigen::MatrixXd steps = steps_of(16384, false);
    ASSERT_EQ(steps.rows(), rows);
    EXPECT_EQ(steps(0, 0), 0.0);
    double held = log.q(0, 0), while_settling = 0.0;
    for (Index k = 1; k < rows; ++k) {
      held += steps(k, 1);
      EXPECT_NEAR(held, log.q(k, 0), 4.5 * kStep) << k;
      // Where the velocity jumps as the joint begins to settle, half a row of the jump is lost: 3 urad.
      EXPECT_NEAR(steps(k, 0), truth[k] - truth[k - 1], kStep / 6.0) << k;
      // While the joint settles it is the velocity that shows it, to a third of an encoder's step.
      if (truth[k] == truth[0] || log.time[k] < 4.05) continue;
      EXPECT_NEAR(steps(k, 1), truth[k] - truth[k - 1], kStep / 3.0) << k;
      while_settling += std::abs(steps(k, 1));
    }
    EXPECT_GT(while_settling, 1e-4);
    // Pieces give what the whole gives.
    const Eigen::MatrixXd pieces = steps_of(200, false);
    ASSERT_EQ(pieces.rows(), rows);
    EXPECT_LT((pieces - steps).colwise().sum().cwiseAbs().maxCoeff(), 12.0 * kStep);
    // The even grid may have a row more or less than the log.
    EXPECT_LT((steps_of(200, true).colwise().sum() - pieces.colwise().sum()).cwiseAbs().maxCoeff(),
              12.0 * kStep);
    // A velocity that reads too much runs away alone, and does not where it is held near the position.
    log.qd.array() += 1e-3;
    const Eigen::MatrixXd biased = steps_of(16384, false);
    const double drift = 1e-3 * (log.time[rows - 1] - log.time[0]);
    EXPECT_NEAR((biased - steps).col(0).sum(), drift, 1e-3 * drift);
    EXPECT_NEAR(log.q(0, 0) + biased.col(1).sum(), log.q(rows - 1, 0), 4.5 * kStep);
    // A log without velocities has none, and nobody gets any without asking.
    const auto columns = [&] {
      Index found = 0;
      MotionStream(log, options).for_each([&](const MotionChunk& piece) {
        found = std::max({found, piece.displacement.cols(), piece.row_displacement.cols()});
      });
      return found;
    };
    EXPECT_EQ(columns(), 2);
    options.displacement = false;
    EXPECT_EQ(columns(), 0);
    options.displacement = true;
    log.qd.resize(0, 0);
    EXPECT_EQ(columns(), 0);
  }
}

TEST(MotionStream, GridsOfUnevenLogsKeepTurningPointsOfTheDisplacement) {
  // A joint stops, swings back by a tenth of a milliradian and rests: for a row or two of the log it is at the turn.
  constexpr double kRate = 100.0, kSwing = 1e-4;
  const heft::EffectParameters<double> friction{1e-4, 0.0};
  for (unsigned seed = 1; seed <= 30; ++seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> late(-0.45, 0.45);
    Log log;
    log.path = "swinging back";
    const Index rows = 500;
    log.time.resize(rows), log.q.resize(rows, 1), log.qd.setZero(rows, 1), log.tau.setZero(rows, 1);
    for (Index k = 0; k < rows; ++k) {
      const double t = log.time[k] = (static_cast<double>(k) + late(random)) / kRate;
      const double u = std::clamp((t - 1.0) / 2.0, 0.0, 1.0);
      log.q(k, 0) = 0.5 * u * u * (3.0 - 2.0 * u);
      log.qd(k, 0) = 1.5 * u * (1.0 - u);
    }
    log.qd(310, 0) = -2.0 * kSwing * kRate;
    log.qd(311, 0) = 1.4 * kSwing * kRate;
    StreamOptions options;
    options.motion.cutoff = 6.0;
    options.prefer_logged = false;
    options.displacement = true;
    double on_rows = 0.0, on_grid = 0.0;
    MotionStream(log, options).for_each([&](const MotionChunk& piece) {
      const auto remember = [&](double& z, const Eigen::Ref<const Eigen::VectorXd>& steps) {
        for (const double step : steps) z = heft::Hysteresis::memory(friction, z, step);
      };
      remember(on_rows, piece.row_displacement.col(0));
      remember(on_grid, piece.displacement.col(0).segment(piece.begin, piece.count));
    });
    EXPECT_LT(std::abs(on_rows), 0.9);
    EXPECT_NEAR(on_grid, on_rows, 0.05) << seed;
  }
}

TEST(MotionStream, MarksStandstillAtTheEndsAsNotUsable) {
  const Log log = log_with_rests();
  StreamOptions options;
  options.motion.cutoff = 8.0;
  const MotionStream stream(log, options);
  const StreamSummary& summary = stream.summary();
  // The motion begins with t⁵, so that 1 % of the top speed is reached a little later than at 11 s.
  EXPECT_GT(summary.moving_from, 11.0);
  EXPECT_LT(summary.moving_from, 14.0);
  EXPECT_GT(summary.moving_to, 32.0);
  EXPECT_LT(summary.moving_to, 35.0);
  EXPECT_NEAR(summary.moving_from - 11.0, 35.0 - summary.moving_to, 0.05) << "the motion is symmetric";

  const Whole whole = whole_of(stream);
  const double threshold = 0.01 * summary.top_speed[0];
  for (Index k = 0; k < whole.time.size(); ++k) {
    const bool inside = whole.time[k] >= summary.moving_from && whole.time[k] <= summary.moving_to;
    EXPECT_EQ(whole.usable[k] != 0.0, inside);
    EXPECT_TRUE(inside || std::abs(whole.qd(k, 0)) <= threshold);
  }

  options.cut_standstill = false;
  EXPECT_EQ(whole_of(MotionStream(log, options)).usable.minCoeff(), 1.0);
  options.cut_standstill = true;
  options.standstill_speed = 0.5 * summary.top_speed[0];
  EXPECT_GT(MotionStream(log, options).summary().moving_from, summary.moving_from + 0.5);
}

TEST(MotionStream, KeepsALogThatStandsStillAsAWholeAndSaysSo) {
  Log log = log_with_rests();
  log.q.col(0).setConstant(0.3);
  const MotionStream stream(log);
  EXPECT_EQ(stream.summary().moving_from, stream.summary().begin);
  EXPECT_EQ(stream.summary().moving_to, stream.summary().end);
  ASSERT_EQ(stream.summary().notes.size(), 1u);
  EXPECT_THAT(stream.summary().notes[0], HasSubstr("no joint moves"));
}

TEST(MotionStream, SummarisesTheWholeLog) {
  const Log log = sine_log(9000, 250.0, 0.2, 10);
  const MotionStream stream(log);
  const StreamSummary& summary = stream.summary();
  EXPECT_EQ(summary.path, "sine");
  EXPECT_EQ(summary.num_joints, 2);
  EXPECT_EQ(summary.samples, 9000);
  EXPECT_EQ(summary.begin, log.time[0]);
  EXPECT_EQ(summary.end, log.time[8999]);
  EXPECT_EQ(summary.travel, (log.q.colwise().maxCoeff() - log.q.colwise().minCoeff()).transpose());
  EXPECT_EQ(summary.max_torque, log.tau.cwiseAbs().colwise().maxCoeff().transpose());
  const Whole whole = whole_of(stream);
  EXPECT_LT((summary.top_speed - whole.qd.cwiseAbs().colwise().maxCoeff().transpose()).cwiseAbs().maxCoeff(),
            1e-9);
  EXPECT_THAT(summary.notes, IsEmpty());
}

TEST(MotionStream, MarksGapsAndWhatTheFilterCarriesOutOfThem) {
  Log log = sine_log(10000, 250.0, 0.0, 11);
  for (Index k = 5000; k < 10000; ++k) log.time[k] += 2.0;
  StreamOptions options;
  options.motion.cutoff = 10.0;
  options.chunk_samples = 700;
  const MotionStream stream(log, options);
  ASSERT_EQ(stream.summary().gaps.size(), 1u);
  const TimeGap gap = stream.summary().gaps[0];
  EXPECT_EQ(gap.begin, log.time[4999]);
  EXPECT_EQ(gap.end, log.time[5000]);
  options.cut_standstill = false;
  const Whole whole = whole_of(MotionStream(log, options));
  for (Index k = 0; k < whole.time.size(); ++k) {
    const bool reached = whole.time[k] > gap.begin - 0.3 && whole.time[k] < gap.end + 0.3;
    EXPECT_EQ(whole.usable[k] == 0.0, reached) << whole.time[k];
  }
  expect_the_whole_log(log, stream, 10);
}

TEST(MotionStream, HasTheMotionBesideAGapAsWellAsElsewhere) {
  // Half a second of motion is missing; along a straight line the velocity would jump at both ends.
  Log log = sine_log(10000, 250.0, 0.0, 13);
  std::vector<Index> rows;
  for (Index k = 0; k < 10000; ++k) {
    if (k < 5000 || k >= 5125) rows.push_back(k);
  }
  for (Eigen::MatrixXd* channel : {&log.q, &log.tau}) *channel = (*channel)(rows, Eigen::all).eval();
  log.time = log.time(rows).eval();
  StreamOptions options;
  options.motion.cutoff = 10.0;
  options.cut_standstill = false;
  const Whole whole = whole_of(MotionStream(log, options));
  double beside = 0.0, elsewhere = 0.0;
  for (Index k = 500; k + 500 < whole.time.size(); ++k) {
    if (whole.usable[k] == 0.0) continue;
    const auto sine = [&](double f) { return std::sin(2.0 * pi * f * whole.time[k]); };
    const auto cosine = [&](double f) { return std::cos(2.0 * pi * f * whole.time[k]); };
    const double truth = -std::pow(2.0 * pi * 0.37, 2) * sine(0.37) - 0.2 * std::pow(2.0 * pi * 1.1, 2) * cosine(1.1);
    const bool is_beside = std::abs(whole.time[k] - 0.5 * (log.time[4999] + log.time[5000])) < 1.0;
    double& most = is_beside ? beside : elsewhere;
    most = std::max(most, std::abs(whole.qdd(k, 0) - truth));
  }
  EXPECT_LT(beside, 1.5 * elsewhere);
}

TEST(MotionStream, PassesOverAGapOfDays) {
  Log log = sine_log(4000, 250.0, 0.0, 12);
  for (Index k = 2000; k < 4000; ++k) log.time[k] += 1e6;
  StreamOptions options;
  options.motion.cutoff = 10.0;
  options.chunk_samples = 1000;
  const MotionStream stream(log, options);
  Index pieces = 0;
  Eigen::VectorXd row_time;
  Eigen::MatrixXd row_qd;
  stream.for_each([&](const MotionChunk& chunk) {
    ++pieces;
    append(row_time, chunk.row_time);
    append(row_qd, chunk.row_qd());
    EXPECT_NEAR(chunk.time[chunk.begin],
                stream.summary().begin + static_cast<double>(chunk.first) / stream.summary().sample_rate,
                1e-6);
  });
  EXPECT_LT(pieces, 20);
  EXPECT_EQ(row_time, log.time);
  // Far from the gap the motion is that of the log without it.
  Log before = log;
  before.time = log.time.head(2000);
  before.q = log.q.topRows(2000).eval();
  MotionOptions motion;
  motion.cutoff = 10.0;
  derive_motion(before, motion);
  // The fitted grid has another phase and period than the log's own stamps: 1e-4 of resampling.
  EXPECT_LT(deviation(row_qd.topRows(1700), before.qd.topRows(1700)), 1e-3);
}

TEST(MotionStream, HandsOutTheExtraColumnsAskedFor) {
  Log log = sine_log(3000, 250.0, 0.2, 13);
  log.qref = log.q * 1.5;
  log.extra.emplace_back("qlink1", log.q.col(0) * 2.0);
  log.extra.emplace_back("tauref1", log.tau.col(0));
  log.extra.emplace_back("tauref2", log.tau.col(1));
  log.extra.emplace_back("odd", log.tau.col(1));
  const TemporaryFolder folder;
  write_log(folder.path("log.csv"), log);
  StreamOptions options;
  options.extra = {"qref", "qlink", "nothing", "tauref"};
  const MotionStream file(folder.path("log.csv"), {}, options);
  ASSERT_EQ(file.summary().notes.size(), 1u);
  EXPECT_THAT(file.summary().notes[0],
              AllOf(HasSubstr("without use: odd"), testing::Not(HasSubstr("tauref"))));
  const Log even = resample_uniform(log);
  for (const MotionStream* stream : {&file}) {
    stream->for_each([&](const MotionChunk& chunk) {
      ASSERT_EQ(chunk.extra.size(), 4u);
      EXPECT_LT(deviation(chunk.extra[0], even.qref), 1e-9);
      ASSERT_EQ(chunk.extra[1].cols(), 1) << "columns up to the first that is missing";
      EXPECT_LT(deviation(chunk.extra[1], even.extra[0].second), 1e-9);
      EXPECT_EQ(chunk.extra[2].cols(), 0);
      EXPECT_LT(deviation(chunk.extra[3], even.tau), 1e-9);
    });
  }
  const MotionStream memory(log, options);
  memory.for_each([&](const MotionChunk& chunk) {
    EXPECT_LT(deviation(chunk.extra[0], even.qref), 1e-9);
    EXPECT_EQ(chunk.extra[1].cols(), 1);
    EXPECT_LT(deviation(chunk.extra[3], even.tau), 1e-9);
  });
}

TEST(MotionStream, MakesTorqueFromCurrent) {
  Log log = sine_log(3000, 250.0, 0.0, 14);
  log.current = log.tau;
  log.tau.resize(0, 0);
  const TemporaryFolder folder;
  write_log(folder.path("log.csv"), log);
  LogRequirements needs;
  needs.torque = true;
  needs.torque_constant = {2.0, 10.0};
  const Whole whole = whole_of(MotionStream(folder.path("log.csv"), needs));
  EXPECT_EQ(whole.row_tau.col(0), 2.0 * log.current.col(0));
  EXPECT_EQ(whole.row_tau.col(1), 10.0 * log.current.col(1));
}

TEST(MotionStream, TellsHowFarItIs) {
  StreamOptions options;
  options.chunk_samples = 500;
  const MotionStream stream(sine_log(8000, 250.0, 0.2, 15), options);
  double last = 0.0;
  stream.for_each([](const MotionChunk&) {},
                  [&](double part) {
                    EXPECT_GT(part, last);
                    last = part;
                  });
  EXPECT_EQ(last, 1.0);
}

// --- the middle period of a log of any length ---

TEST(StreamingMedian, IsTheMiddleOneOfAnyNumberOfValues) {
  std::mt19937 random(20);
  const auto expect_middle = [](const std::vector<double>& values) {
    StreamingMedian median;
    int passes = 0;
    do {
      for (const double value : values) median.add(value);
      ++passes;
    } while (!median.finish_pass());
    EXPECT_LE(passes, 5);
    std::vector<double> sorted = values;
    std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2),
                     sorted.end());
    EXPECT_EQ(median.value(), sorted[sorted.size() / 2]);
  };
  for (const std::size_t count : {std::size_t{1}, std::size_t{2}, std::size_t{7}, std::size_t{131072},
                                  std::size_t{131073}, std::size_t{400000}}) {
    SCOPED_TRACE(count);
    std::vector<double> values(count);
    std::lognormal_distribution<double> wide(0.0, 3.0);
    for (double& value : values) value = wide(random);
    expect_middle(values);
    // Two values in halves: the middle is the first of the larger.
    for (std::size_t k = 0; k < count; ++k) values[k] = k < count / 2 ? 0.001 : 0.002;
    expect_middle(values);
    std::fill(values.begin(), values.end(), 0.004);
    expect_middle(values);
    // Time stamps of an even clock: differences that are equal but for rounding.
    for (std::size_t k = 0; k < count; ++k) {
      values[k] = 0.001 * static_cast<double>(k + 1) - 0.001 * static_cast<double>(k);
    }
    expect_middle(values);
  }
}

// --- memory ---

/// Largest part of memory this process had since the last call [kB]; 0 where the system does not say.
long largest_memory() {
  ::malloc_trim(0);
  const auto read = [](const char* what) {
    std::ifstream status("/proc/self/status");
    for (std::string line; std::getline(status, line);) {
      if (line.rfind(what, 0) == 0) return std::stol(line.substr(std::string(what).size()));
    }
    return 0L;
  };
  const long peak = read("VmHWM:");
  std::ofstream("/proc/self/clear_refs") << "5";  // the peak is now what is in use
  return read("VmHWM:") < peak ? peak : 0;
}

/// A log of three joints, written without being in memory.
std::string write_long_log(const TemporaryFolder& folder, long rows) {
  const std::string path = folder.path(fmt::format("log{}.csv", rows));
  std::ofstream out(path, std::ios::binary);
  out << "time,q1,q2,q3,tau1,tau2,tau3\n";
  fmt::memory_buffer line;
  for (long k = 0; k < rows; ++k) {
    const double t = static_cast<double>(k) / 1000.0;
    line.clear();
    const double a = std::sin(2.0 * t);
    const double b = std::cos(1.3 * t);
    fmt::format_to(std::back_inserter(line), "{:.3f},{:.7f},{:.7f},{:.7f},{:.4f},{:.4f},{:.4f}\n", t, a, b,
                   a * b, 10 * a, 20 * b, 5 * a);
    out.write(line.data(), static_cast<std::streamsize>(line.size()));
  }
  return path;
}

TEST(MotionStream, TakesNoMoreMemoryForALongerLog) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "a sanitizer keeps what was freed";
#endif
  const TemporaryFolder folder;
  // On one thread: how much several hold at the same moment is chance, of a megabyte and more. What all of them take is asked of
  // identify (identify_bench --check-memory).
  host::set_threads(1);
  std::array<long, 2> peak{};
  const std::array<long, 2> rows{140000, 340000};
  for (std::size_t k = 0; k < 2; ++k) {
    const std::string path = write_long_log(folder, rows[k]);
    largest_memory();
    Index largest = 0;
    const MotionStream stream(path, {});
    stream.for_each([&](const MotionChunk& chunk) { largest = std::max(largest, chunk.time.size()); });
    peak[k] = largest_memory();
    EXPECT_EQ(stream.summary().samples, rows[k]);
    EXPECT_LT(largest, 16384 + 2 * 5000);
  }
  host::set_threads(0);
  if (peak[0] == 0 || peak[1] == 0) GTEST_SKIP() << "the system does not tell the largest memory";
  // The 200 000 rows more are 11 200 kB.
  RecordProperty("kilobytes_more", static_cast<int>(peak[1] - peak[0]));
  EXPECT_LT(peak[1] - peak[0], 1500);
}

// --- refusals ---

std::string stream_refusal(const std::string& content, const LogRequirements& needs = {}) {
  const TemporaryFolder folder;
  const std::string path = folder.write("log.csv", content);
  const std::string message = message_of<DataError>([&] { MotionStream(path, needs); });
  EXPECT_EQ(message, message_of<DataError>([&] { read_log(path, needs); })) << "as read_log says it";
  EXPECT_EQ(message.substr(0, path.size()), path) << "the message must begin with the file";
  return message.empty() ? message : "log.csv" + message.substr(path.size());
}

/// A sound log of `rows` rows with one line replaced.
std::string text_log(int rows, int changed_line = 0, const std::string& change = "") {
  std::string text = "time,q1,tau1\n";
  for (int line = 2; line < rows + 2; ++line) {
    text +=
        line == changed_line ? change + "\n" : fmt::format("{},{},1\n", 0.01 * line, std::sin(0.1 * line));
  }
  return text;
}

TEST(MotionStream, RefusesAMissingColumn) {
  LogRequirements needs;
  needs.torque = true;
  EXPECT_THAT(stream_refusal("time,q1,q2,tau1\n0,1,2,3\n", needs),
              HasSubstr("log.csv:1: column 'tau2' is missing; found time, q1, q2, tau1"));
  EXPECT_THAT(stream_refusal("q1,q2\n0,1\n"), HasSubstr("log.csv:1: column 'time' is missing"));
}

TEST(MotionStream, RefusesARepeatedTimeStampFarIntoTheLog) {
  EXPECT_THAT(stream_refusal(text_log(9000, 7000, "69.99,0,1")),
              HasSubstr("log.csv:7000: column 'time': found 69.99 after 69.99 (line 6999); expected time to "
                        "increase with every row; remove repeated rows or sort the log"));
}

TEST(MotionStream, RefusesNumbersThatAreNotFinite) {
  EXPECT_THAT(stream_refusal(text_log(9000, 7000, "70,nan,1")),
              HasSubstr("log.csv:7000: column 'q1': found 'nan'; expected a finite number"));
  EXPECT_THAT(stream_refusal(text_log(9000, 7000, "70,0,inf")),
              HasSubstr("log.csv:7000: column 'tau1': found 'inf'"));
}

TEST(MotionStream, RefusesRaggedRowsAndText) {
  EXPECT_THAT(stream_refusal(text_log(9000, 9001, "90.01,2")),
              HasSubstr("log.csv:9001: column 'tau1' is missing"));
  EXPECT_THAT(stream_refusal(text_log(9000, 8000, "80,2,x")),
              HasSubstr("log.csv:8000: column 'tau1': found 'x'"));
}

TEST(MotionStream, RefusesTooShortALogAndAnotherRobots) {
  LogRequirements needs;
  needs.min_samples = 100;
  EXPECT_THAT(stream_refusal(text_log(50), needs),
              HasSubstr("the log ends after 50 samples; expected at least 100"));
  needs = {};
  needs.num_joints = 6;
  EXPECT_THAT(stream_refusal(text_log(50), needs),
              HasSubstr("the log has 1 joints (q1 to q1), the robot has 6"));
  const TemporaryFolder folder;
  EXPECT_THAT(message_of<DataError>([&] { MotionStream(folder.write("log.csv", text_log(4)), {}); }),
              HasSubstr("4 samples; expected at least 5 to derive velocity and acceleration"));
}

TEST(MotionStream, NamesDegreesWhenAskedToCheck) {
  Log log = sine_log(6000, 250.0, 0.2, 16);
  log.q *= 180.0 / pi;
  const TemporaryFolder folder;
  write_log(folder.path("log.csv"), log);
  JointLimits limits;
  limits.lower = Eigen::Vector2d(-3.0, -3.0);
  limits.upper = Eigen::Vector2d(3.0, 3.0);
  const MotionStream stream(folder.path("log.csv"), {});
  EXPECT_THAT(message_of<DataError>([&] { refuse_errors(stream.check(limits)); }),
              AllOf(HasSubstr("log.csv: column 'q2': q2 reaches -63.03, the limits are +-3 rad; -63.03 is "
                              "-1.1 rad in degrees"),
                    HasSubstr("expected rad; multiply q1 to q2 by pi/180")));
}

TEST(MotionStream, RefusesACutOffAboveHalfTheRate) {
  StreamOptions options;
  options.motion.cutoff = 130.0;
  EXPECT_THAT(
      message_of<DataError>([&] { MotionStream(sine_log(500, 250.0, 0.0, 17), options); }),
      AllOf(HasSubstr("sine: cut-off 130 Hz; the log has 250 samples a second"), HasSubstr("125 Hz")));
}

TEST(MotionStream, RefusesABadLogFromMemory) {
  Log log = sine_log(500, 250.0, 0.0, 18);
  log.q(77, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(message_of<DataError>([&] { MotionStream{log}; }), HasSubstr("row 78, column 'q2': found nan"));
  log = sine_log(500, 250.0, 0.0, 18);
  log.time[100] = log.time[99];
  EXPECT_THAT(message_of<DataError>([&] { MotionStream{log}; }), HasSubstr("row 101, column 'time'"));
  log = sine_log(500, 250.0, 0.0, 18);
  log.tau.conservativeResize(499, 2);
  EXPECT_THAT(message_of<DataError>([&] { MotionStream{log}; }),
              HasSubstr("tau is 499 x 2; expected 500 rows"));
}

TEST(MotionStream, NoticesALogThatIsStillWritten) {
  const TemporaryFolder folder;
  const std::string path = folder.write("log.csv", text_log(2000));
  const MotionStream stream(path, {});
  const auto pass = [&] { stream.for_each([](const MotionChunk&) {}); };
  folder.write("log.csv", text_log(2100));
  EXPECT_THAT(message_of<DataError>(pass),
              HasSubstr("the log has 2100 rows and had 2000 when it was first read"));
  folder.write("log.csv", text_log(1000));
  EXPECT_THAT(message_of<DataError>(pass), HasSubstr("changed while it was being read (it had 2000 rows)"));
}

// Stretches that are looked at by themselves give what the whole gives.
TEST(MovingSpan, IsThatOfItsStretches) {
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  MovingSpan whole, of_stretches;
  for (int stretch = 0; stretch < 7; ++stretch) {
    MovingSpan own;
    for (int k = 0; k < 50; ++k) {
      const double time = 50.0 * stretch + k, speed = uniform(random) * (1.0 + (stretch == 3 ? 1.0 : 0.0));
      whole.add(time, speed);
      own.add(time, speed);
    }
    of_stretches.add(own);
  }
  EXPECT_EQ(of_stretches.top_speed(), whole.top_speed());
  for (double threshold = 0.0; threshold < 2.0; threshold += 0.01) {
    if (threshold >= whole.top_speed()) break;
    EXPECT_EQ(of_stretches.first_above(threshold), whole.first_above(threshold)) << threshold;
    EXPECT_EQ(of_stretches.last_above(threshold), whole.last_above(threshold)) << threshold;
  }
  EXPECT_TRUE(std::isnan(of_stretches.first_above(whole.top_speed())));
}

}  // namespace
}  // namespace heft::data

#include "heft/data/differentiate.hpp"

#include <array>
#include <cmath>
#include <numbers>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/host/error.hpp"
#include "support/temporary_folder.hpp"

namespace heft::data {
namespace {

using heft::test::message_of;
using std::numbers::pi;
using testing::HasSubstr;

Eigen::VectorXd even_time(int count, double rate) {
  return Eigen::VectorXd::LinSpaced(count, 0.0, (count - 1) / rate);
}

/// Even time stamps with every one moved by up to `part` of a period.
Eigen::VectorXd jittering_time(int count, double rate, double part, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> jitter(-part, part);
  Eigen::VectorXd time = even_time(count, rate);
  for (double& t : time) t += jitter(random) / rate;
  return time;
}

Eigen::VectorXd sine(const Eigen::VectorXd& time, double frequency, double phase = 0.0) {
  return (2.0 * pi * frequency * time.array() + phase).sin();
}

double rms(const Eigen::MatrixXd& x) { return std::sqrt(x.squaredNorm() / static_cast<double>(x.size())); }

// --- low-pass ---

/// Gain of the two passes at f: one over 1 + (tan(πf/fs)/tan(πfc/fs))⁸.
double analytic_gain(double frequency, double rate, double cutoff) {
  return 1.0 / (1.0 + std::pow(std::tan(pi * frequency / rate) / std::tan(pi * cutoff / rate), 8));
}

TEST(LowPass, HasTheAnalyticGainAndNoPhase) {
  const double rate = 200.0;
  const int count = 8000;
  const Eigen::VectorXd time = even_time(count, rate);
  for (const double cutoff : {2.0, 10.0, 60.0}) {
    for (const double ratio : {0.25, 0.8, 1.0, 1.3}) {
      const double frequency = ratio * cutoff;
      const Eigen::VectorXd input = sine(time, frequency, 0.4);
      const Eigen::VectorXd output = low_pass_zero_phase(input, rate, cutoff);
      // Zero phase: output is the input times a real gain. The middle half is free of the ends' transients.
      // A time stamp of 30 s is rounded to 4e-15 s, which at 78 Hz is 2e-12 of the input's phase.
      const Eigen::VectorXd error = output - analytic_gain(frequency, rate, cutoff) * input;
      EXPECT_LT(error.segment(count / 4, count / 2).cwiseAbs().maxCoeff(), 1e-11)
          << cutoff << " Hz, " << frequency;
    }
  }
}

TEST(LowPass, HalvesASineAtTheCutOff) {
  const Eigen::VectorXd input = sine(even_time(4000, 100.0), 5.0);
  const Eigen::VectorXd output = low_pass_zero_phase(input, 100.0, 5.0);
  EXPECT_NEAR(output.segment(1000, 2000).cwiseAbs().maxCoeff(), 0.5, 1e-9);
}

TEST(LowPass, LeavesAStraightLineAlone) {
  // Odd reflection continues a line as a line, so not even the ends may move (start-up decays to 8e-4 of the
  // slope over one filter period).
  const Eigen::VectorXd line = 3.0 + 2.0 * even_time(1000, 100.0).array();
  const Eigen::VectorXd output = low_pass_zero_phase(line, 100.0, 4.0);
  EXPECT_LT((output - line).cwiseAbs().maxCoeff(), 1e-3);
  EXPECT_LT((output - line).segment(300, 400).cwiseAbs().maxCoeff(), 1e-12);
  const Eigen::VectorXd constant = Eigen::VectorXd::Constant(100, 7.0);
  EXPECT_LT((low_pass_zero_phase(constant, 100.0, 4.0) - constant).cwiseAbs().maxCoeff(), 1e-14);
}

TEST(LowPass, KeepsTheMeanAtAVeryLowCutOff) {
  // 1e-5 of the rate: coefficient form would lose the gain at zero frequency to cancellation.
  const Eigen::VectorXd constant = Eigen::VectorXd::Constant(20000, 1.0);
  EXPECT_LT((low_pass_zero_phase(constant, 1000.0, 0.01).array() - 1.0).abs().maxCoeff(), 1e-12);
}

TEST(LowPass, IsTheSameForthAndBack) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  const Eigen::VectorXd input = Eigen::VectorXd::NullaryExpr(3000, [&] { return normal(random); });
  const Eigen::VectorXd forth = low_pass_zero_phase(input, 100.0, 8.0);
  const Eigen::VectorXd back = low_pass_zero_phase(input.reverse().eval(), 100.0, 8.0).reverse();
  EXPECT_LT((forth - back).segment(500, 2000).cwiseAbs().maxCoeff(), 1e-10);
}

TEST(LowPass, FiltersColumnsOneByOne) {
  Eigen::MatrixXd both(500, 2);
  both << sine(even_time(500, 100.0), 3.0), sine(even_time(500, 100.0), 20.0);
  const Eigen::MatrixXd filtered = low_pass_zero_phase(both, 100.0, 10.0);
  EXPECT_EQ(filtered.col(0), low_pass_zero_phase(both.col(0), 100.0, 10.0));
  EXPECT_EQ(filtered.col(1), low_pass_zero_phase(both.col(1), 100.0, 10.0));
}

TEST(LowPass, TakesRecordsShorterThanItsMemory) {
  EXPECT_TRUE(low_pass_zero_phase(sine(even_time(5, 100.0), 3.0), 100.0, 0.5).allFinite());
  EXPECT_EQ(low_pass_zero_phase(Eigen::VectorXd::Ones(1), 100.0, 0.5)(0, 0), 1.0);
}

TEST(LowPass, RefusesACutOffOutsideTheBand) {
  const Eigen::VectorXd x = Eigen::VectorXd::Zero(10);
  for (const double cutoff : {0.0, -1.0, 50.0, 80.0, std::nan("")}) {
    EXPECT_THAT(message_of<DataError>([&] { low_pass_zero_phase(x, 100.0, cutoff); }),
                HasSubstr("expected more than 0 and less than half the rate, 50 Hz"));
  }
}

// --- differences ---

TEST(Differentiate, IsExactForPolynomialsOnAnyTimeStamps) {
  const Eigen::VectorXd time = jittering_time(50, 10.0, 0.4, 11);
  const Eigen::ArrayXd t = time.array();
  const Eigen::VectorXd quartic = 1.0 + 2.0 * t - t.square() + 0.5 * t.cube() - 0.1 * t.pow(4);
  const Eigen::VectorXd slope = 2.0 - 2.0 * t + 1.5 * t.square() - 0.4 * t.cube();
  EXPECT_LT((differentiate(time, quartic, 5) - slope).cwiseAbs().maxCoeff(), 1e-10);
  const Eigen::VectorXd parabola = 5.0 - 3.0 * t + 4.0 * t.square();
  EXPECT_LT((differentiate(time, parabola, 3) - Eigen::VectorXd(-3.0 + 8.0 * t)).cwiseAbs().maxCoeff(),
            1e-10);
}

TEST(Differentiate, LosesOfASineWhatTheStencilsSeriesSays) {
  const double rate = 100.0, frequency = 2.0, step = 2.0 * pi * frequency / rate;
  const Eigen::VectorXd time = even_time(1000, rate);
  const Eigen::VectorXd exact = 2.0 * pi * frequency * sine(time, frequency, pi / 2);
  const Eigen::VectorXd input = sine(time, frequency);
  // Central stencils on an even grid: gains sin(ωh)/ωh and (8 sin ωh - sin 2ωh)/(6ωh).
  const Eigen::VectorXd three = differentiate(time, input, 3);
  const Eigen::VectorXd five = differentiate(time, input, 5);
  const double gain3 = std::sin(step) / step;
  const double gain5 = (8.0 * std::sin(step) - std::sin(2.0 * step)) / (6.0 * step);
  EXPECT_LT((three - gain3 * exact).segment(1, 998).cwiseAbs().maxCoeff(), 1e-11);
  EXPECT_LT((five - gain5 * exact).segment(2, 996).cwiseAbs().maxCoeff(), 1e-11);
  EXPECT_NEAR(1.0 - gain3, step * step / 6.0, 1e-4);
  EXPECT_NEAR(1.0 - gain5, std::pow(step, 4) / 30.0, 1e-6);
}

TEST(Differentiate, IsExactlyZeroForAConstant) {
  // However large: joints at rest must not show rounding noise.
  const Eigen::VectorXd time = jittering_time(100, 1000.0, 0.4, 6);
  EXPECT_EQ(differentiate(time, Eigen::VectorXd::Constant(100, 1e6 / 3.0)), Eigen::VectorXd::Zero(100));
}

TEST(Differentiate, TakesShortRecordsWithWhatThereIs) {
  EXPECT_EQ(differentiate(Eigen::Vector2d(0, 2), Eigen::Vector2d(1, 5)), Eigen::Vector2d(2, 2));
  EXPECT_LT(
      (differentiate(Eigen::Vector3d(0, 1, 2), Eigen::Vector3d(0, 1, 4)) - Eigen::Vector3d(0, 2, 4)).norm(),
      1e-14);
}

TEST(Differentiate, RefusesOneSampleAndOddStencils) {
  EXPECT_THROW(differentiate(Eigen::VectorXd::Zero(1), Eigen::VectorXd::Zero(1)), DataError);
  EXPECT_THROW(differentiate(Eigen::VectorXd::Zero(3), Eigen::VectorXd::Zero(2)), DataError);
  EXPECT_THAT(
      message_of<DataError>([] { differentiate(Eigen::Vector3d(0, 1, 2), Eigen::Vector3d(0, 1, 2), 4); }),
      HasSubstr("stencil of 4 samples; expected 3 or 5"));
}

// --- resampling ---

TEST(Resample, IsExactForCubicsOnJitteringTime) {
  const Eigen::VectorXd time = jittering_time(80, 20.0, 0.4, 5);
  const auto cubic = [](const Eigen::VectorXd& t) {
    return Eigen::VectorXd(1.0 - t.array() + 2.0 * t.array().square() - 0.7 * t.array().cube());
  };
  const Eigen::VectorXd at = Eigen::VectorXd::LinSpaced(333, time[0], time[79]);
  EXPECT_LT((resample(time, cubic(time), at) - cubic(at)).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(Resample, BringsBackASineOfFourthOrder) {
  // Halving the step must divide the error by about sixteen, ends included.
  double before = 0.0;
  for (const int count : {200, 400, 800}) {
    const Eigen::VectorXd time = Eigen::VectorXd::LinSpaced(count, 0.0, 4.0);
    const Eigen::VectorXd at = Eigen::VectorXd::LinSpaced(5000, 0.0, 4.0);
    const double error = (resample(time, sine(time, 3.0), at) - sine(at, 3.0)).cwiseAbs().maxCoeff();
    if (before > 0.0) {
      EXPECT_GT(before / error, 12.0) << count;
    }
    before = error;
  }
  EXPECT_LT(before, 1e-6);
}

TEST(Resample, MeetsItsSamplesAndHoldsTheEnds) {
  const Eigen::VectorXd time = jittering_time(30, 10.0, 0.4, 8);
  const Eigen::VectorXd x = sine(time, 0.7);
  EXPECT_LT((resample(time, x, time) - x).cwiseAbs().maxCoeff(), 1e-14);
  const Eigen::MatrixXd outside = resample(time, x, Eigen::Vector2d(time[0] - 1.0, time[29] + 1.0));
  EXPECT_EQ(outside(0, 0), x[0]);
  EXPECT_EQ(outside(1, 0), x[29]);
}

TEST(Resample, DrawsAStraightLineAcrossAGap) {
  Eigen::VectorXd time(200);
  time << even_time(100, 100.0), (even_time(100, 100.0).array() + 3.0).matrix();
  const Eigen::VectorXd x = sine(time, 1.1);
  const double from = time[99], to = time[100];
  const Eigen::VectorXd at = Eigen::VectorXd::LinSpaced(50, from, to);
  const Eigen::VectorXd line = x[99] + (at.array() - from) / (to - from) * (x[100] - x[99]);
  EXPECT_LT((resample(time, x, at) - line).cwiseAbs().maxCoeff(), 1e-12);
  const std::vector<TimeGap> gaps = find_gaps(time);
  ASSERT_EQ(gaps.size(), 1u);
  EXPECT_EQ(gaps[0].begin, from);
  EXPECT_EQ(gaps[0].end, to);
}

TEST(Resample, TakesSignalsWithoutColumns) {  // and, under UBSan, points at none of their rows
  const Eigen::VectorXd at = Eigen::VectorXd::LinSpaced(7, 0.0, 1.0);
  for (const Eigen::Index n : {1, 3, 20}) {
    const Eigen::MatrixXd result =
        resample(Eigen::VectorXd::LinSpaced(n, 0.0, 1.0), Eigen::MatrixXd(n, 0), at);
    EXPECT_EQ(result.rows(), 7);
    EXPECT_EQ(result.cols(), 0);
  }
}

TEST(Resample, TakesOneTwoAndThreeSamples) {
  EXPECT_EQ(resample(Eigen::VectorXd::Zero(1), Eigen::VectorXd::Constant(1, 4.0), Eigen::Vector2d(-1, 1)),
            Eigen::Vector2d(4, 4));
  EXPECT_EQ(resample(Eigen::Vector2d(0, 2), Eigen::Vector2d(0, 4), Eigen::VectorXd::Constant(1, 0.5))(0, 0),
            1.0);
  EXPECT_NEAR(
      resample(Eigen::Vector3d(0, 1, 2), Eigen::Vector3d(0, 1, 4), Eigen::VectorXd::Constant(1, 1.5))(0, 0),
      2.25, 1e-14);
}

TEST(Resample, PutsAWholeLogOnAnEvenGrid) {
  Log log;
  log.time = jittering_time(1000, 100.0, 0.3, 21);
  log.q = sine(log.time, 0.5);
  log.tau = sine(log.time, 0.5, 1.0);
  log.extra.emplace_back("other", sine(log.time, 0.5, 2.0));
  EXPECT_FALSE(is_uniform(log.time));
  const Log even = resample_uniform(log, 100.0);
  EXPECT_TRUE(is_uniform(even.time));
  EXPECT_EQ(even.time[0], log.time[0]);
  EXPECT_EQ(even.time[even.num_samples() - 1], log.time[999]);
  EXPECT_NEAR(even.num_samples(), 1000, 1);
  EXPECT_LT((even.q - sine(even.time, 0.5)).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_LT((even.tau - sine(even.time, 0.5, 1.0)).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_LT((even.extra[0].second - sine(even.time, 0.5, 2.0)).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_EQ(even.qd.cols(), 0);
  EXPECT_THROW(resample_uniform(log, -1.0), DataError);
}

// --- Savitzky-Golay ---

/// Value or derivative of 1 - 2x + 0.5x² + x³ - 0.3x⁴ + ..., up to `order`.
double polynomial(double x, int order, int derivative) {
  const std::array<double, 6> factors{1.0, -2.0, 0.5, 1.0, -0.3, 0.2};
  double sum = 0.0;
  for (int j = derivative; j <= order; ++j) {
    double factor = factors[static_cast<std::size_t>(j)];
    for (int s = 0; s < derivative; ++s) factor *= j - s;
    sum += factor * std::pow(x, j - derivative);
  }
  return sum;
}

TEST(SavitzkyGolay, IsExactForPolynomialsUpToItsOrderEndsIncluded) {
  const double rate = 50.0;
  const Eigen::VectorXd time = even_time(101, rate).array() - 1.0;
  for (const int order : {2, 3, 4, 5}) {
    for (const int window : {7, 21, 101}) {
      for (const int derivative : {0, 1, 2}) {
        const Eigen::VectorXd signal = time.unaryExpr([&](double x) { return polynomial(x, order, 0); });
        const Eigen::VectorXd expected =
            time.unaryExpr([&](double x) { return polynomial(x, order, derivative); });
        // Rounding of the samples (1e-15) grows with the rate to the power of the derivative.
        EXPECT_LT((savitzky_golay(signal, rate, window, order, derivative) - expected).cwiseAbs().maxCoeff(),
                  3e-14 * std::pow(rate, derivative))
            << order << " " << window << " " << derivative;
      }
    }
  }
}

TEST(SavitzkyGolay, IsNotExactBeyondItsOrder) {
  const Eigen::VectorXd time = even_time(101, 50.0).array() - 1.0;
  const Eigen::VectorXd fourth = time.array().pow(4);
  EXPECT_GT((savitzky_golay(fourth, 50.0, 21, 2) - fourth).cwiseAbs().maxCoeff(), 1e-4);
}

TEST(SavitzkyGolay, HasTheTabledWeights) {
  // Savitzky and Golay's table: quadratic smoothing over five samples is (-3 12 17 12 -3)/35, the first
  // derivative (-2 -1 0 1 2)/10, the second (2 -1 -2 -1 2)/7.
  Eigen::VectorXd impulse = Eigen::VectorXd::Zero(21);
  impulse[10] = 1.0;
  const auto weights = [&](int derivative) {
    return Eigen::VectorXd(savitzky_golay(impulse, 1.0, 5, 2, derivative)).segment(8, 5).reverse().eval();
  };
  Eigen::VectorXd table(5);
  table << -3, 12, 17, 12, -3;
  EXPECT_LT((weights(0) - table / 35.0).cwiseAbs().maxCoeff(), 1e-15);
  table << -2, -1, 0, 1, 2;
  EXPECT_LT((weights(1) - table / 10.0).cwiseAbs().maxCoeff(), 1e-15);
  table << 2, -1, -2, -1, 2;
  EXPECT_LT((weights(2) - table / 7.0).cwiseAbs().maxCoeff(), 1e-15);
}

TEST(SavitzkyGolay, HasNoPhase) {
  const double rate = 200.0;
  const Eigen::VectorXd input = sine(even_time(4000, rate), 5.0, 0.4);
  const int window = savitzky_golay_window(8.0, rate, 4);
  const Eigen::VectorXd output = savitzky_golay(input, rate, window, 4);
  const auto inner = [](const Eigen::VectorXd& x) { return x.segment(500, 3000); };
  const double gain = inner(output).dot(inner(input)) / inner(input).squaredNorm();
  EXPECT_LT((inner(output) - gain * inner(input)).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(SavitzkyGolay, HalvesASineAtTheCutOffOfItsWindow) {
  for (const int order : {2, 4, 6}) {
    const double periods = order == 2 ? 1.28 : order == 4 ? 1.94 : 2.59;
    const double rate = 1000.0;
    const double cutoff = 5.0;
    const int window = savitzky_golay_window(cutoff, rate, order);
    EXPECT_NEAR(window * cutoff / rate, periods, 0.01);
    const Eigen::VectorXd input = sine(even_time(5000, rate), cutoff);
    const Eigen::VectorXd output = savitzky_golay(input, rate, window, order);
    // One sample more or less of the window changes the gain by less than a hundredth.
    EXPECT_NEAR(output.segment(1500, 2000).cwiseAbs().maxCoeff(), 0.5, 0.01);
    EXPECT_LE(output.segment(1500, 2000).cwiseAbs().maxCoeff(), 0.5);
  }
}

TEST(SavitzkyGolay, TakesRecordsShorterThanItsWindow) {
  const Eigen::VectorXd time = even_time(6, 10.0);
  const Eigen::VectorXd parabola = time.array().square();
  EXPECT_LT((savitzky_golay(parabola, 10.0, 21, 2, 1) - 2.0 * time).cwiseAbs().maxCoeff(), 1e-13);
  EXPECT_LT((savitzky_golay(parabola, 10.0, 21, 4, 2).array() - 2.0).abs().maxCoeff(), 1e-11);
  EXPECT_EQ(savitzky_golay(Eigen::MatrixXd::Constant(1, 2, 3.0), 10.0, 5, 2),
            Eigen::MatrixXd::Constant(1, 2, 3.0));
}

TEST(SavitzkyGolay, RefusesWhatIsNoFilter) {
  const Eigen::MatrixXd x = Eigen::MatrixXd::Zero(50, 1);
  EXPECT_THAT(message_of<DataError>([&] { savitzky_golay(x, 10.0, 6, 2); }),
              HasSubstr("window of 6 samples"));
  EXPECT_THAT(message_of<DataError>([&] { savitzky_golay(x, 10.0, 3, 4); }), HasSubstr("above the order"));
  EXPECT_THAT(message_of<DataError>([&] { savitzky_golay(x, 10.0, 7, 1, 2); }),
              HasSubstr("polynomial order 1"));
  EXPECT_THAT(message_of<DataError>([&] { savitzky_golay(x, 10.0, 7, 4, 3); }), HasSubstr("derivative 3"));
  EXPECT_THAT(message_of<DataError>([&] { savitzky_golay_window(5.0, 10.0, 4); }),
              HasSubstr("less than half the rate, 5 Hz"));
}

// --- the cut-off from the motion ---

/// The Hann window spreads a line over two lines of 1/T to either side; 3/T holds all but 1e-4 of its power.
double resolution(const Eigen::VectorXd& time) { return 3.0 / (time[time.size() - 1] - time[0]); }

TEST(Bandwidth, IsThatOfTheFastestSine) {
  const Eigen::VectorXd time = even_time(4000, 200.0);
  const Eigen::VectorXd q = sine(time, 0.3) + 0.5 * sine(time, 1.5);
  EXPECT_NEAR(motion_bandwidth(q, 200.0), 1.5, resolution(time));
}

TEST(Bandwidth, DoesNotTakeEncoderNoiseForMotion) {
  std::mt19937 random(17);
  const Eigen::VectorXd time = even_time(20000, 1000.0);
  const Eigen::VectorXd clean = 0.5 * sine(time, 0.3) + 0.25 * sine(time, 1.0);
  const Eigen::VectorXd coarse = (clean / 1e-4).array().round() * 1e-4;  // a resolution of 1e-4 rad
  std::normal_distribution<double> noise(0.0, 3e-4);
  const Eigen::VectorXd noisy = clean + Eigen::VectorXd::NullaryExpr(20000, [&] { return noise(random); });
  EXPECT_NEAR(motion_bandwidth(coarse, 1000.0), 1.0, resolution(time));
  EXPECT_NEAR(motion_bandwidth(noisy, 1000.0), 1.0, resolution(time));
}

TEST(Bandwidth, IsZeroWhenNothingMoves) {
  EXPECT_EQ(motion_bandwidth(Eigen::MatrixXd::Constant(1000, 2, 0.7), 100.0), 0.0);
  EXPECT_EQ(motion_bandwidth(Eigen::MatrixXd::Zero(5, 1), 100.0), 0.0);
}

TEST(Bandwidth, LeavesRestingJointsOut) {
  // A joint that only trembles at 20 Hz while another one moves.
  const Eigen::VectorXd time = even_time(4000, 200.0);
  Eigen::MatrixXd q(4000, 2);
  q << sine(time, 0.5), 2e-3 * sine(time, 20.0);
  EXPECT_NEAR(motion_bandwidth(q, 200.0), 0.5, resolution(time));
}

TEST(Bandwidth, DoesNotTakeJitteringTimeStampsForMotion) {
  // Positions of an even clock with time stamps off by up to 0.4 periods: as host computers log them.
  const Eigen::VectorXd time = even_time(10000, 1000.0);
  const Eigen::VectorXd stamps = jittering_time(10000, 1000.0, 0.4, 31);
  EXPECT_NEAR(motion_bandwidth(resample(stamps, sine(time, 0.6), time), 1000.0), 0.6, resolution(time));
}

// --- derive_motion ---

Log sine_log(const Eigen::VectorXd& time) {
  Log log;
  log.path = "sine.csv";
  log.time = time;
  log.q.resize(time.size(), 2);
  log.q << sine(time, 0.8, 0.3), 0.5 * sine(time, 1.7);
  return log;
}

/// Largest error of the derived channels against the closed form, first and last 0.5 s left out.
std::pair<double, double> errors(const Log& log) {
  const Eigen::VectorXd& t = log.time;
  const double w1 = 2 * pi * 0.8, w2 = 2 * pi * 1.7;
  Eigen::MatrixXd qd(t.size(), 2), qdd(t.size(), 2);
  qd << w1 * sine(t, 0.8, 0.3 + pi / 2), 0.5 * w2 * sine(t, 1.7, pi / 2);
  qdd << -w1 * w1 * sine(t, 0.8, 0.3), -0.5 * w2 * w2 * sine(t, 1.7);
  double velocity = 0.0, acceleration = 0.0;
  for (Eigen::Index k = 0; k < t.size(); ++k) {
    if (t[k] < t[0] + 0.5 || t[k] > t[t.size() - 1] - 0.5) continue;
    velocity = std::max(velocity, (log.qd.row(k) - qd.row(k)).cwiseAbs().maxCoeff());
    acceleration = std::max(acceleration, (log.qdd.row(k) - qdd.row(k)).cwiseAbs().maxCoeff());
  }
  return {velocity, acceleration};
}

TEST(DeriveMotion, FindsTheDerivativesOfASine) {
  Log log = sine_log(even_time(4000, 200.0));
  const Eigen::MatrixXd q = log.q;
  const MotionReport report = derive_motion(log);
  EXPECT_TRUE(report.cutoff_chosen);
  EXPECT_NEAR(report.bandwidth, 1.7, resolution(log.time));
  EXPECT_NEAR(report.cutoff, 10.0 * report.bandwidth, 1e-12);
  EXPECT_FALSE(report.resampled);
  EXPECT_TRUE(report.velocity_derived);
  EXPECT_TRUE(report.acceleration_derived);
  EXPECT_EQ(log.q, q);
  const auto [velocity, acceleration] = errors(log);
  EXPECT_LT(velocity, 1e-4);      // of 5.3 rad/s
  EXPECT_LT(acceleration, 2e-3);  // of 57 rad/s²
}

TEST(DeriveMotion, KeepsAJitteringLogsTimeStamps) {
  Log log = sine_log(jittering_time(4000, 100.0, 0.4, 2));
  const Eigen::VectorXd time = log.time;
  const MotionReport report = derive_motion(log);
  EXPECT_TRUE(report.resampled);
  EXPECT_EQ(log.time, time);
  EXPECT_EQ(log.qd.rows(), 4000);
  const auto [velocity, acceleration] = errors(log);
  EXPECT_LT(velocity, 5e-3);
  EXPECT_LT(acceleration, 5e-2);
}

TEST(DeriveMotion, SuppressesEncoderNoise) {
  const double rate = 1000.0, step = 1e-4;
  Log log = sine_log(even_time(8000, rate));
  log.q = (log.q / step).array().round() * step;
  const MotionReport report = derive_motion(log);
  const auto [velocity, acceleration] = errors(log);
  // Rounding is white noise of step/√12; through an ideal low-pass at f_c the k-th derivative has the rms
  // σ (2π)^k sqrt(2/f_s · f_c^(2k+1)/(2k+1)). Five times that holds the largest of some 14000 samples.
  // (Unfiltered, the second difference would be off by some 70 rad/s².)
  const auto largest = [&](int k) {
    return 5.0 * step / std::sqrt(12.0) * std::pow(2.0 * pi, k) *
           std::sqrt(2.0 / rate * std::pow(report.cutoff, 2 * k + 1) / (2 * k + 1));
  };
  EXPECT_LT(velocity, largest(1));
  EXPECT_LT(acceleration, largest(2));
}

TEST(DeriveMotion, DerivesBySavitzkyAndGolayWhenTold) {
  Log log;
  log.time = even_time(4000, 500.0);
  log.q = sine(log.time, 0.5);
  std::mt19937 random(11);
  std::normal_distribution<double> noise(0.0, 1e-4);
  for (double& q : log.q.reshaped()) q += noise(random);
  MotionOptions options;
  options.method = DerivativeMethod::kSavitzkyGolay;
  options.smooth_position = true;
  const MotionReport report = derive_motion(log, options);
  EXPECT_GT(report.cutoff, 3.0);
  const auto inner_rms = [](const Eigen::MatrixXd& x) { return rms(x.middleRows(250, 3500)); };
  const Eigen::VectorXd qdd = -pi * pi * sine(log.time, 0.5);
  EXPECT_LT(inner_rms(log.q - sine(log.time, 0.5)), 3e-5);
  EXPECT_LT(inner_rms(log.qd - pi * sine(log.time, 0.5, pi / 2)), 2e-3);
  EXPECT_LT(inner_rms(log.qdd - qdd), 0.02 * inner_rms(qdd));
}

TEST(DeriveMotion, LeavesLoggedChannelsAlone) {
  Log log = sine_log(even_time(2000, 200.0));
  log.qd = Eigen::MatrixXd::Constant(2000, 2, 1.25);
  const MotionReport report = derive_motion(log);
  EXPECT_FALSE(report.velocity_derived);
  EXPECT_TRUE(report.acceleration_derived);
  EXPECT_EQ(log.qd, Eigen::MatrixXd::Constant(2000, 2, 1.25));
  EXPECT_LT(log.qdd.cwiseAbs().maxCoeff(), 1e-9) << "acceleration must come from the logged velocity";
  log.qdd.setConstant(7.0);
  const MotionReport nothing = derive_motion(log);
  EXPECT_FALSE(nothing.acceleration_derived);
  EXPECT_EQ(log.qdd(5, 0), 7.0);
}

TEST(DeriveMotion, ReplacesThemWhenTold) {
  Log log = sine_log(even_time(4000, 200.0));
  log.qd = Eigen::MatrixXd::Zero(4000, 2);
  log.qdd = Eigen::MatrixXd::Zero(4000, 2);
  MotionOptions options;
  options.from_position = true;
  options.smooth_position = true;
  options.cutoff = 20.0;
  const MotionReport report = derive_motion(log, options);
  EXPECT_EQ(report.cutoff, 20.0);
  EXPECT_FALSE(report.cutoff_chosen);
  EXPECT_LT(errors(log).first, 1e-4);
  EXPECT_LT(rms((log.q - sine_log(log.time).q).middleRows(200, 3600)), 1e-6);
}

TEST(DeriveMotion, RefusesACutOffAboveHalfTheRate) {
  Log log = sine_log(even_time(2000, 100.0));
  MotionOptions options;
  options.cutoff = 60.0;
  EXPECT_EQ(
      message_of<DataError>([&] { derive_motion(log, options); }),
      "sine.csv: cut-off 60 Hz; the log has 100 samples a second; expected more than 0 and less than 50 Hz; "
      "choose a lower cut-off");
  EXPECT_EQ(log.qd.cols(), 0) << "a refused log must stay as it was";
  options.cutoff = -1.0;
  EXPECT_THROW(derive_motion(log, options), DataError);
}

TEST(DeriveMotion, RefusesAHandfulOfSamples) {
  Log log = sine_log(even_time(4, 100.0));
  EXPECT_THAT(message_of<DataError>([&] { derive_motion(log); }),
              HasSubstr("sine.csv: 4 samples; expected at least 5"));
}

TEST(DeriveMotion, StandsStillWhenTheRobotDoes) {
  Log log;
  log.time = even_time(1000, 100.0);
  log.q = Eigen::MatrixXd::Constant(1000, 3, 0.4);
  const MotionReport report = derive_motion(log);
  EXPECT_EQ(report.bandwidth, 0.0);
  EXPECT_EQ(report.cutoff, 10.0);
  EXPECT_LT(log.qdd.cwiseAbs().maxCoeff(), 1e-9);
}

TEST(DeriveMotion, ReportsGaps) {
  Log log;
  Eigen::VectorXd time(2000);
  time << even_time(1000, 100.0), (even_time(1000, 100.0).array() + 12.0).matrix();
  log = sine_log(time);
  const MotionReport report = derive_motion(log);
  ASSERT_EQ(report.gaps.size(), 1u);
  EXPECT_NEAR(report.gaps[0].begin, 9.99, 1e-9);
  EXPECT_NEAR(report.gaps[0].end, 12.0, 1e-9);
  EXPECT_TRUE(log.qdd.allFinite());
}

}  // namespace
}  // namespace heft::data

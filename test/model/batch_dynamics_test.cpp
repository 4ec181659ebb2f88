/// Dynamics in lanes against the same states one by one, whose truth is tested elsewhere (closed forms, KDL).
#include "heft/model/batch_dynamics.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/core/dynamics/joint_space.hpp"
#include "heft/host/error.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/model/robot_of.hpp"
#include "support/random_arm.hpp"

namespace heft::model {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using ::testing::HasSubstr;

/// Products and sums are fused elsewhere, differently in one state and in several.
#if defined(__x86_64__) && !defined(__FMA__)
constexpr double kTolerance = 0.0;
#else
constexpr double kTolerance = 1e-12;
#endif

std::vector<Lanes> available_lanes() {
  std::vector<Lanes> all;
  for (const Lanes lanes : {Lanes::kBaseline, Lanes::kAvx2, Lanes::kAvx512}) {
    if (is_available(lanes)) all.push_back(lanes);
  }
  return all;
}

struct States {
  MatrixXd q, qd, qdd;
};

States random_motion(test::Random& random, Index states, Index joints) {
  States m{MatrixXd(states, joints), MatrixXd(states, joints), MatrixXd(states, joints)};
  for (Index s = 0; s < states; ++s) {
    for (Index j = 0; j < joints; ++j) {
      m.q(s, j) = test::uniform(random, -3, 3);
      // A joint at rest now and then: the sign of its velocity is 0.
      m.qd(s, j) = test::uniform(random, 0, 1) < 0.1 ? 0.0 : test::uniform(random, -2, 2);
      m.qdd(s, j) = test::uniform(random, -5, 5);
    }
  }
  return m;
}

/// Equal as numbers, or within rounding where the compiler fuses; NaN equals NaN.
void expect_same(const MatrixXd& found, const MatrixXd& expected, const std::string& what) {
  ASSERT_EQ(found.rows(), expected.rows()) << what;
  ASSERT_EQ(found.cols(), expected.cols()) << what;
  const double scale = kTolerance > 0 && expected.size() > 0 ? expected.cwiseAbs().maxCoeff() : 0.0;
  for (Index c = 0; c < expected.cols(); ++c) {
    for (Index r = 0; r < expected.rows(); ++r) {
      const double a = found(r, c), b = expected(r, c);
      const bool same = a == b || (std::isnan(a) && std::isnan(b)) || std::abs(a - b) <= kTolerance * scale;
      ASSERT_TRUE(same) << what << " (" << r << ", " << c << "): " << a << " against " << b;
    }
  }
}

/// Compares everything of a robot in all lanes and for numbers of states around their widths.
template <int N>
void compare_all(const ArmModel<double, N>& arm, test::Random& random, int& compared) {
  const Robot robot = robot_of(arm, "arm");
  const Dynamics one_by_one(robot);
  for (const Lanes lanes : available_lanes()) {
    const BatchDynamics batch(robot, lanes);
    for (const Index states : {1, 2, 3, 7, 8, 9, 21}) {
      SCOPED_TRACE(std::string(to_string(lanes)) + ", " + std::to_string(N) + " joints, " +
                   std::to_string(states) + " states");
      const States m = random_motion(random, states, N);
      MatrixXd tau(states, N), gravity(states, N), mass(states, N * N), acceleration(states, N);
      std::vector<MatrixXd> regressor(N, MatrixXd(states, 14 * N));
      JointVector<double, N> rotor;
      for (int j = 0; j < N; ++j) rotor[j] = arm.actuation[static_cast<std::size_t>(j)].rotor_inertia;
      for (Index s = 0; s < states; ++s) {
        const VectorXd q = m.q.row(s), qd = m.qd.row(s), qdd = m.qdd.row(s);
        tau.row(s) = one_by_one.inverse_dynamics(q, qd, qdd);
        gravity.row(s) = one_by_one.gravity_torque(q);
        const MatrixXd M = one_by_one.mass_matrix(q), Y = one_by_one.regressor(q, qd, qdd);
        mass.row(s) = Eigen::Map<const Eigen::RowVectorXd>(M.data(), N * N);
        for (int j = 0; j < N; ++j) regressor[static_cast<std::size_t>(j)].row(s) = Y.row(j);
        JointVector<double, N> a;
        const JointVector<double, N> bias = one_by_one.inverse_dynamics(q, qd, VectorXd::Zero(N));
        ASSERT_EQ((forward_dynamics<double, N>(M, bias, rotor, qdd, a)), Status::kOk);
        acceleration.row(s) = a;
      }
      expect_same(batch.inverse_dynamics(m.q, m.qd, m.qdd), tau, "torque");
      expect_same(batch.gravity_torque(m.q), gravity, "gravity");
      const std::vector<MatrixXd> rows = batch.regressor_rows(m.q, m.qd, m.qdd);
      ASSERT_EQ(rows.size(), regressor.size());
      for (std::size_t j = 0; j < rows.size(); ++j) {
        expect_same(rows[j], regressor[j], "row of joint " + std::to_string(j + 1));
      }
      MatrixXd found(states, N * N);
      batch.mass_matrix(m.q, found);
      expect_same(found, mass, "mass matrix");
      found.resize(states, N);
      batch.forward_dynamics(m.q, m.qd, m.qdd, found);
      expect_same(found, acceleration, "acceleration");
      // Couplings add to all of the mass matrix: H q̈ = τ − h.
      const MatrixXd half = 0.1 * MatrixXd::Random(N, N);
      const MatrixXd drives = half * half.transpose() + MatrixXd(rotor.asDiagonal());
      batch.forward_dynamics(m.q, m.qd, m.qdd, drives, found);
      for (Index s = 0; s < states; ++s) {
        const VectorXd q = m.q.row(s), qd = m.qd.row(s), torque = m.qdd.row(s), a = found.row(s);
        const VectorXd rest = one_by_one.inverse_dynamics(q, qd, a) + drives * a - torque;
        EXPECT_LT(rest.norm(), 1e-9 * (1.0 + torque.norm() + (drives * a).norm()));
      }
      ++compared;
    }
  }
}

template <int N = 1>
void compare_all_sizes(test::Random& random, int& compared) {
  compare_all<N>(test::random_arm<N>(random, 0.3), random, compared);
  if constexpr (N < kMaxJoints) compare_all_sizes<N + 1>(random, compared);
}

TEST(BatchDynamics, IsThatOfOneStateAtATimeToTheLastBit) {
  test::Random random(31);
  int compared = 0;
  compare_all_sizes(random, compared);
  EXPECT_GE(compared, kMaxJoints * 7);
}

/// Joint axes along coordinate axes of their frames, whose columns are exchanged and not turned.
TEST(BatchDynamics, IsThatOfOneStateAtATimeForAxesOfEveryDirection) {
  test::Random random(32);
  ArmModel<double, 6> arm = test::random_arm<6>(random, 0.0);
  constexpr std::array<std::array<double, 3>, 6> kAxes = {
      {{0, 1, 0}, {0, 0, -1}, {1, 0, 0}, {0, -1, 0}, {-1, 0, 0}, {0, 0, 1}}};
  for (std::size_t j = 0; j < 6; ++j) arm.joints[j].axis = kAxes[j];
  int compared = 0;
  compare_all<6>(arm, random, compared);
  EXPECT_GE(compared, 7);
}

TEST(BatchDynamics, GivesTheColumnsAskedForInTheirOrder) {
  test::Random random(33);
  const Robot robot = robot_of(test::random_arm<4>(random, 0.3), "arm");
  const States m = random_motion(random, 37, 4);
  const std::vector<std::vector<int>> columns = {{50, 3, 12, 40}, {}, {0, 22, 42, 29, 54}, {39}};
  for (const Lanes lanes : available_lanes()) {
    const BatchDynamics batch(robot, lanes);
    const std::vector<MatrixXd> all = batch.regressor_rows(m.q, m.qd, m.qdd);
    // What was there before must not shine through, even where a column is known to be zero.
    RegressorRows rows;
    rows.resize(37, {4, 4, 4, 4});
    for (std::size_t j = 0; j < 4; ++j) rows[j].setConstant(7.0);
    batch.regressor_rows(m.q, m.qd, m.qdd, columns, rows);
    ASSERT_EQ(rows.size(), 4U);
    for (std::size_t j = 0; j < 4; ++j)
      expect_same(rows[j], all[j](Eigen::all, columns[j]), to_string(lanes));
  }
}

TEST(RegressorRows, BeginEveryColumnOnACacheLineAndShareNone) {
  RegressorRows rows;
  for (const Index m : {1, 7, 64, 1000}) {
    rows.resize(m, {3, 0, 5}, 8);
    double value = 0.0;
    for (std::size_t j = 0; j < rows.size(); ++j) {
      EXPECT_EQ(rows[j].rows(), m);
      for (Index c = 0; c < rows[j].cols(); ++c) {
        EXPECT_EQ(reinterpret_cast<std::uintptr_t>(rows[j].col(c).data()) % 64, 0U) << m << " rows, column " << c;
        rows[j].col(c).setConstant(value++);
      }
    }
    std::fill_n(rows.spare(), std::max<Index>(m, 8), -1.0);
    value = 0.0;
    for (std::size_t j = 0; j < rows.size(); ++j) {
      for (Index c = 0; c < rows[j].cols(); ++c, ++value)
        EXPECT_TRUE((rows[j].col(c).array() == value).all()) << m << " rows, column " << c;
    }
  }
}

TEST(BatchDynamics, TakesRowsOutOfTheMiddleOfALogAndWritesThemThere) {
  test::Random random(34);
  const Robot robot = robot_of(test::random_arm<6>(random, 0.0), "arm");
  const States m = random_motion(random, 60, 6);
  for (const Lanes lanes : available_lanes()) {
    const BatchDynamics batch(robot, lanes);
    const MatrixXd whole = batch.inverse_dynamics(m.q, m.qd, m.qdd);
    MatrixXd tau = MatrixXd::Constant(60, 6, 7.0);
    for (const auto& [first, count] : {std::pair<Index, Index>{0, 3}, {3, 19}, {22, 38}}) {
      batch.inverse_dynamics(m.q.middleRows(first, count), m.qd.middleRows(first, count),
                             m.qdd.middleRows(first, count), tau.middleRows(first, count));
      const Index left = 60 - first - count;
      EXPECT_TRUE((tau.bottomRows(left).array() == 7.0).all()) << "written beyond row " << first + count;
    }
    expect_same(tau, whole, to_string(lanes));
  }
}

TEST(BatchDynamics, AnswersNanForOneStateWithoutHarmToItsNeighbours) {
  test::Random random(35);
  const Robot robot = robot_of(test::random_arm<6>(random, 0.0), "arm");
  States m = random_motion(random, 16, 6);
  for (const Lanes lanes : available_lanes()) {
    const BatchDynamics batch(robot, lanes);
    const MatrixXd good = batch.inverse_dynamics(m.q, m.qd, m.qdd);
    States bad = m;
    bad.q(5, 2) = std::numeric_limits<double>::infinity();
    const MatrixXd tau = batch.inverse_dynamics(bad.q, bad.qd, bad.qdd);
    for (Index s = 0; s < 16; ++s) {
      if (s == 5) {
        EXPECT_TRUE(std::isnan(tau(s, 0))) << to_string(lanes);
      } else {
        EXPECT_EQ(tau.row(s), good.row(s)) << to_string(lanes) << ", state " << s;
      }
    }
  }
}

TEST(BatchDynamics, NamesTheStateWhoseMassMatrixIsNotPositiveDefinite) {
  // One prismatic joint on a turning one: at travel 0 only the negative inertia is left.
  ArmModel<double, 2> arm;
  arm.joints[1].type = JointType::kPrismatic;
  arm.joints[1].axis = {1, 0, 0};
  arm.links[1][kMass] = 1.0;
  arm.links[0][kIzz] = -0.5;
  const Robot robot = robot_of(arm, "hollow");
  MatrixXd q = MatrixXd::Constant(20, 2, 2.0);
  q(13, 1) = 0.1;
  const MatrixXd rest = MatrixXd::Zero(20, 2);
  MatrixXd qdd(20, 2);
  for (const Lanes lanes : available_lanes()) {
    const BatchDynamics batch(robot, lanes);
    try {
      batch.forward_dynamics(q, rest, rest, qdd);
      ADD_FAILURE() << to_string(lanes) << " accepted it";
    } catch (const ModelError& error) {
      EXPECT_THAT(error.what(),
                  HasSubstr("robot \"hollow\": the mass matrix at state 13 is not positive definite"));
    }
    EXPECT_NO_THROW(
        batch.forward_dynamics(q.topRows(13), rest.topRows(13), rest.topRows(13), qdd.topRows(13)));
  }
}

TEST(BatchDynamics, RefusesSizesThatDoNotFit) {
  test::Random random(36);
  const BatchDynamics batch(robot_of(test::random_arm<3>(random, 0.0), "arm"));
  const MatrixXd good = MatrixXd::Zero(5, 3), narrow = MatrixXd::Zero(5, 2), brief = MatrixXd::Zero(4, 3);
  const auto message = [&](auto&& call) -> std::string {
    try {
      call();
    } catch (const ModelError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_EQ(message([&] { batch.inverse_dynamics(narrow, good, good); }),
            "robot \"arm\": q of 5 × 2 values; expected 5 × 3");
  EXPECT_EQ(message([&] { batch.inverse_dynamics(good, good, brief); }),
            "robot \"arm\": qdd of 4 × 3 values; expected 5 × 3");
  EXPECT_EQ(message([&] { batch.regressor_rows(good, good, good, std::vector<int>{42}); }),
            "robot \"arm\": column 42 of the regressor; expected 0 to 41");
  MatrixXd qdd(5, 3);
  EXPECT_EQ(message([&] { batch.forward_dynamics(good, good, good, MatrixXd::Zero(2, 3), qdd); }),
            "robot \"arm\": drives of 2 × 3 values; expected 3 × 3");
  EXPECT_EQ(batch.inverse_dynamics(good.topRows(0), good.topRows(0), good.topRows(0)).rows(), 0);
}

TEST(BatchDynamics, TakesTheWidestLanesThatThereAre) {
  test::Random random(37);
  const Robot robot = robot_of(test::random_arm<3>(random, 0.0), "arm");
  EXPECT_EQ(BatchDynamics(robot).lanes(), available_lanes().back());
  EXPECT_TRUE(is_available(Lanes::kBaseline));
}

/// What the linker could give to the rest of the program from files that are compiled for newer processors: nothing but
/// functions of packs as wide as theirs.
TEST(LaneSymbols, OfNewerInstructionsAreOfTypesThatNoOtherFileHas) {
#if defined(HEFT_NM) && defined(__x86_64__)
  const std::string command = std::string(HEFT_NM) + " -A -C " + HEFT_MODEL_ARCHIVE + " 2>&1";
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen(command.c_str(), "r"), pclose);
  ASSERT_TRUE(pipe);
  std::string text;
  std::array<char, 4096> piece{};
  while (const std::size_t size = fread(piece.data(), 1, piece.size(), pipe.get()))
    text.append(piece.data(), size);
  int looked_at = 0;
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t end = text.find('\n', at);
    const std::string line = text.substr(at, end - at);
    at = end == std::string::npos ? text.size() : end + 1;
    for (const auto& [file, type] : {std::pair<const char*, const char*>{"avx2.cpp.", "Pack<double, 4>"},
                                     {"avx512.cpp.", "Pack<double, 8>"}}) {
      const bool here = line.find(file) != std::string::npos, wide = line.find(type) != std::string::npos;
      const bool shared = line.find(" W ") != std::string::npos || line.find(" V ") != std::string::npos ||
                          line.find(" u ") != std::string::npos;
      looked_at += here ? 1 : 0;
      if (here && shared) {
        EXPECT_TRUE(wide) << "the linker may give this to code for older processors: " << line;
      }
      EXPECT_FALSE(wide && !here) << "a type of " << file << " elsewhere: " << line;
    }
  }
  EXPECT_GE(looked_at, 20);
#else
  GTEST_SKIP() << "no files for newer instructions, or no nm";
#endif
}

}  // namespace
}  // namespace heft::model

// Fits with physically possible links against solutions found by other means.
#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/model/physical_links.hpp"
#include "identify/physical.hpp"

namespace heft::identify {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// The prior only where the data are silent.
PhysicalOptions vanishing_prior() {
  PhysicalOptions options;
  options.prior_share = 0.0;
  return options;
}

double uniform(std::mt19937_64& generator, double from, double to) {
  return std::uniform_real_distribution<double>(from, to)(generator);
}

/// Parameters of a body made of a few point masses around a centre.
InertialParameters<double> random_body(std::mt19937_64& generator) {
  InertialParameters<double> link{};
  const double center[3] = {uniform(generator, -0.1, 0.1), uniform(generator, -0.1, 0.1),
                            uniform(generator, 0, 0.3)};
  for (int k = 0; k < 8; ++k) {
    const double m = uniform(generator, 0.2, 1.0);
    double r[3];
    for (int i = 0; i < 3; ++i) r[i] = center[i] + uniform(generator, -0.15, 0.15);
    link[kMass] += m;
    link[kMcx] += m * r[0];
    link[kMcy] += m * r[1];
    link[kMcz] += m * r[2];
    link[kIxx] += m * (r[1] * r[1] + r[2] * r[2]);
    link[kIyy] += m * (r[0] * r[0] + r[2] * r[2]);
    link[kIzz] += m * (r[0] * r[0] + r[1] * r[1]);
    link[kIxy] -= m * r[0] * r[1];
    link[kIxz] -= m * r[0] * r[2];
    link[kIyz] -= m * r[1] * r[2];
  }
  return link;
}

/// A chain with axes crossed by turns.
model::Robot make_arm(int n, unsigned seed) {
  std::mt19937_64 generator(seed);
  model::Robot robot;
  robot.name = "arm";
  for (int i = 0; i < n; ++i) {
    model::RobotJoint joint;
    joint.name = "joint" + std::to_string(i + 1);
    joint.link_name = "link" + std::to_string(i + 1);
    if (i % 2 == 1) joint.joint.rotation = {1, 0, 0, 0, 0, -1, 0, 1, 0};
    if (i > 0 && i % 2 == 0) joint.joint.rotation = {1, 0, 0, 0, 0, 1, 0, -1, 0};
    joint.joint.position = {i > 0 ? 0.05 : 0.0, 0.02, i > 0 ? 0.25 : 0.1};
    joint.link = random_body(generator);
    joint.actuation = {uniform(generator, 0.1, 0.4), uniform(generator, 1, 3), uniform(generator, 1, 4),
                       uniform(generator, -0.5, 0.5)};
    robot.joints.push_back(joint);
  }
  return robot;
}

struct Data {
  regression::RegressionColumns columns;
  regression::BaseParameters base;
  regression::TriangularFactor factor;
  MatrixXd W;
  VectorXd y;
};

/// Rows of random motion, torque from parameters x, white noise.
Data make_data(const model::Robot& robot, const VectorXd& x, int samples, double noise, unsigned seed) {
  regression::RegressionColumns columns(robot, {});
  regression::BaseParameters base = regression::find_base_parameters(columns);
  const int n = columns.num_joints(), b = base.count();
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> normal;
  MatrixXd W(samples * n, b);
  VectorXd y(samples * n);
  for (int k = 0; k < samples; ++k) {
    VectorXd q(n), qd(n), qdd(n);
    for (int i = 0; i < n; ++i) {
      q[i] = uniform(generator, -3, 3);
      qd[i] = uniform(generator, -2, 2);
      qdd[i] = uniform(generator, -4, 4);
    }
    const MatrixXd Y = columns.regressor(q, qd, qdd);
    for (int i = 0; i < b; ++i) W.block(k * n, i, n, 1) = Y.col(base.kept[static_cast<std::size_t>(i)]);
    y.segment(k * n, n) = Y * x;
    for (int i = 0; i < n; ++i) y[k * n + i] += noise * normal(generator);
  }
  regression::TriangularFactor factor(b);
  factor.add(W, y);
  return {std::move(columns), std::move(base), std::move(factor), std::move(W), std::move(y)};
}

/// A prior some way off: other bodies, nothing known of friction.
VectorXd other_prior(const regression::RegressionColumns& columns, unsigned seed) {
  std::mt19937_64 generator(seed);
  VectorXd prior = VectorXd::Zero(columns.count());
  for (int i = 0; i < columns.num_joints(); ++i) {
    const auto body = random_body(generator);
    for (int k = 0; k < 10; ++k) prior[10 * i + k] = body[static_cast<std::size_t>(k)];
  }
  return prior;
}

/// Pseudo-inertia written out once more, entry by entry.
Eigen::Matrix4d pseudo_inertia(const VectorXd& x, int link) {
  const auto p = x.segment<10>(10 * link);
  const double half = 0.5 * (p[kIxx] + p[kIyy] + p[kIzz]);
  Eigen::Matrix4d P;
  P << half - p[kIxx], -p[kIxy], -p[kIxz], p[kMcx],  //
      -p[kIxy], half - p[kIyy], -p[kIyz], p[kMcy],   //
      -p[kIxz], -p[kIyz], half - p[kIzz], p[kMcz],   //
      p[kMcx], p[kMcy], p[kMcz], p[kMass];
  return P;
}

bool is_feasible(const regression::RegressionColumns& columns, const VectorXd& x) {
  for (int i = 0; i < columns.num_joints(); ++i) {
    if (Eigen::LLT<Eigen::Matrix4d>(pseudo_inertia(x, i)).info() != Eigen::Success) return false;
  }
  for (int k = 0; k < columns.count(); ++k) {
    if (columns[k].kind != regression::ColumnKind::kLink &&
        columns[k].kind != regression::ColumnKind::kOffset && x[k] < 0)
      return false;
  }
  return true;
}

/// Least squared error over physical parameters by another method: Newton's method in the parameters themselves
/// with a logarithmic barrier, no prior, no Cholesky coordinates. Exact to `degree` times the last weight.
double barrier_optimum(const Data& data, VectorXd x, double last_weight) {
  const int p = data.columns.count(), n = data.columns.num_joints();
  const MatrixXd A = data.W * data.base.regrouping;
  // Basis of the pseudo-inertia in the ten parameters.
  std::vector<Eigen::Matrix4d> basis;
  for (int k = 0; k < 10; ++k) basis.push_back(pseudo_inertia(VectorXd::Unit(10, k), 0));
  const auto objective = [&](const VectorXd& at, double weight) {
    if (!is_feasible(data.columns, at)) return std::numeric_limits<double>::infinity();
    double value = (A * at - data.y).squaredNorm();
    for (int i = 0; i < n; ++i) value -= weight * std::log(pseudo_inertia(at, i).determinant());
    for (int k = 10 * n; k < p; ++k) {
      if (data.columns[k].kind != regression::ColumnKind::kOffset) value -= weight * std::log(at[k]);
    }
    return value;
  };
  for (double weight = 1e3; weight >= last_weight; weight *= 0.2) {
    for (int iteration = 0; iteration < 60; ++iteration) {
      VectorXd gradient = 2.0 * A.transpose() * (A * x - data.y);
      MatrixXd hessian = 2.0 * A.transpose() * A;
      for (int i = 0; i < n; ++i) {
        const Eigen::Matrix4d inverse = pseudo_inertia(x, i).inverse();
        for (int k = 0; k < 10; ++k) {
          const Eigen::Matrix4d K = inverse * basis[static_cast<std::size_t>(k)];
          gradient[10 * i + k] -= weight * K.trace();
          for (int l = 0; l < 10; ++l) {
            hessian(10 * i + k, 10 * i + l) +=
                weight * (K * inverse * basis[static_cast<std::size_t>(l)]).trace();
          }
        }
      }
      for (int k = 10 * n; k < p; ++k) {
        if (data.columns[k].kind == regression::ColumnKind::kOffset) continue;
        gradient[k] -= weight / x[k];
        hessian(k, k) += weight / (x[k] * x[k]);
      }
      // Directions without any effect run off to large bodies; a far ball holds them.
      hessian.diagonal().array() += 1e-9;
      gradient += 1e-9 * x;
      const VectorXd step = -solve_symmetric(hessian, gradient);
      const double decrement = -gradient.dot(step);
      if (!(decrement > 1e-6 * weight)) break;
      double length = 1.0;
      const double value = objective(x, weight);
      while (length > 1e-12 && !(objective(x + length * step, weight) < value - 0.1 * length * decrement)) {
        length *= 0.5;
      }
      x += length * step;
    }
  }
  return (A * x - data.y).squaredNorm();
}

/// Truth that no robot can have: a wrist with a negative principal inertia and a joint that gains energy.
VectorXd impossible_truth(const regression::RegressionColumns& columns) {
  VectorXd x = columns.values(columns.robot());
  const int last = columns.num_joints() - 1;
  x[10 * last + kIxx] -= 0.35;
  x[10 * last + kMcx] += 0.8;
  for (int k = 0; k < columns.count(); ++k) {
    if (columns[k].kind == regression::ColumnKind::kViscous && columns[k].joint == 0) x[k] = -1.5;
    if (columns[k].kind == regression::ColumnKind::kRotorInertia && columns[k].joint == last) x[k] = -0.1;
  }
  return x;
}

TEST(PhysicalFit, RecoversAPhysicalTruthWithoutNoise) {
  for (const int n : {1, 2, 4, 6}) {
    const model::Robot robot = make_arm(n, 10U + static_cast<unsigned>(n));
    const regression::RegressionColumns columns(robot, {});
    const VectorXd x = columns.values(robot);
    const Data data = make_data(robot, x, 200, 0.0, 3);
    const PhysicalFit fit =
        fit_physical(data.columns, data.base, data.factor, other_prior(columns, 5), vanishing_prior());
    const VectorXd beta = data.base.regrouping * x;
    EXPECT_TRUE(fit.converged) << n << ": " << fit.summary;
    EXPECT_LT((fit.beta - beta).cwiseAbs().maxCoeff(), 1e-6) << n << ": " << fit.summary;
    EXPECT_TRUE(is_feasible(columns, fit.x)) << n;
    EXPECT_TRUE(fit.at_boundary.empty()) << n;
  }
}

TEST(PhysicalFit, IsLeastSquaresWhereThatIsPhysical) {
  const model::Robot robot = make_arm(3, 21);
  const regression::RegressionColumns columns(robot, {});
  const Data data = make_data(robot, columns.values(robot), 1000, 0.3, 4);
  const PhysicalFit fit =
      fit_physical(data.columns, data.base, data.factor, other_prior(columns, 6), vanishing_prior());
  ASSERT_TRUE(fit.converged) << fit.summary;
  const VectorXd free = least_squares(data.W, data.y);
  const double least = (data.W * free - data.y).squaredNorm();
  EXPECT_NEAR(fit.unconstrained_squared_error, least, 1e-8 * least);
  EXPECT_LT(fit.squared_error, least * (1 + 1e-6)) << fit.summary;
  EXPECT_NEAR(fit.squared_error, (data.W * fit.beta - data.y).squaredNorm(), 1e-9 * least);
  // In standard deviations of the estimate.
  const MatrixXd covariance = 0.09 * pseudo_inverse(data.W.transpose() * data.W);
  const VectorXd off = (fit.beta - free).cwiseQuotient(covariance.diagonal().cwiseSqrt());
  EXPECT_LT(off.cwiseAbs().maxCoeff(), 0.05);
}

TEST(PhysicalFit, OfAPendulumIsTheBestOfAllActiveSets) {
  // One joint about a level axis: inertia, two first moments, friction and offset. A body with any inertia and
  // first moment exists if its mass is chosen for it, so the only limits are inertia, Coulomb, viscous >= 0:
  // eight active sets, tried out one by one.
  model::Robot robot = make_arm(1, 31);
  robot.gravity = {9.81, 0, 0};
  const regression::RegressionColumns columns(robot, {});
  int clipped = 0;
  for (unsigned seed = 0; seed < 12; ++seed) {
    std::mt19937_64 generator(seed);
    VectorXd x = columns.values(robot);
    for (int k = 0; k < columns.count(); ++k) {
      if (columns[k].name == "Ia1") x[k] = 0;
      if (columns[k].name == "Izz1") x[k] = uniform(generator, -0.2, 0.5);
      if (columns[k].name == "Fc1" || columns[k].name == "Fv1") x[k] = uniform(generator, -1, 2);
    }
    const Data data = make_data(robot, x, 300, 0.2, seed);
    ASSERT_EQ(data.base.count(), 6);
    std::vector<int> limited;
    for (int i = 0; i < 6; ++i) {
      const std::string& name = columns[data.base.kept[static_cast<std::size_t>(i)]].name;
      if (name == "Izz1" || name == "Ia1" || name == "Fc1" || name == "Fv1") limited.push_back(i);
    }
    ASSERT_EQ(limited.size(), 3U);
    double best = std::numeric_limits<double>::infinity();
    for (unsigned set = 0; set < 8; ++set) {
      MatrixXd W = data.W;
      for (unsigned k = 0; k < 3; ++k) {
        if ((set >> k) & 1U) W.col(limited[k]).setZero();
      }
      const VectorXd beta = pseudo_inverse(W) * data.y;
      bool allowed = true;
      for (const int i : limited) allowed = allowed && beta[i] >= -1e-12;
      if (allowed) best = std::min(best, (W * beta - data.y).squaredNorm());
      if (set == 0 && !allowed) ++clipped;
    }
    const PhysicalFit fit =
        fit_physical(data.columns, data.base, data.factor, other_prior(columns, 7), vanishing_prior());
    EXPECT_TRUE(fit.converged) << seed << ": " << fit.summary;
    EXPECT_LT(fit.squared_error, best * (1 + 1e-4)) << seed << ": " << fit.summary;
    EXPECT_GT(fit.squared_error, best * (1 - 1e-9)) << seed;
  }
  EXPECT_GE(clipped, 4);
}

TEST(PhysicalFit, ReachesTheOptimumThatABarrierMethodFinds) {
  for (const int n : {2, 3}) {
    const model::Robot robot = make_arm(n, 40U + static_cast<unsigned>(n));
    const regression::RegressionColumns columns(robot, {});
    const Data data = make_data(robot, impossible_truth(columns), 150, 0.5, 8);
    const PhysicalFit fit =
        fit_physical(data.columns, data.base, data.factor, other_prior(columns, 9), vanishing_prior());
    ASSERT_TRUE(fit.converged) << fit.summary;
    const VectorXd start = columns.values(robot);
    const double best = barrier_optimum(data, start, 1e-4);
    EXPECT_GT(best, 1.05 * fit.unconstrained_squared_error) << "the limits have to matter";
    EXPECT_NEAR(fit.squared_error, best, 2e-4 * best) << fit.summary;
    EXPECT_LE(fit.limit_squared_error - fit.gap, best * (1 + 1e-6));
    EXPECT_TRUE(is_feasible(columns, fit.x));
    ASSERT_FALSE(fit.at_boundary.empty());
    EXPECT_EQ(fit.at_boundary.front(), n);
    std::vector<std::string> zero;
    for (const int k : fit.at_zero) zero.push_back(columns[k].name);
    EXPECT_EQ(std::count(zero.begin(), zero.end(), "Fv1"), 1);
  }
}

TEST(PhysicalFit, OfSevenJointsProvesItsOwnOptimality) {
  const model::Robot robot = make_arm(7, 50);
  const regression::RegressionColumns columns(robot, {});
  const Data data = make_data(robot, impossible_truth(columns), 400, 0.5, 10);
  const PhysicalFit fit = fit_physical(data.columns, data.base, data.factor, other_prior(columns, 11));
  EXPECT_TRUE(fit.converged) << fit.summary;
  EXPECT_LT(fit.gap, 2e-4 * fit.limit_squared_error) << fit.summary;
  EXPECT_GE(fit.squared_error, fit.limit_squared_error * (1 - 2e-4));
  EXPECT_TRUE(is_feasible(columns, fit.x));
  ASSERT_FALSE(fit.at_boundary.empty());
  EXPECT_EQ(fit.at_boundary.front(), 7);
}

TEST(PhysicalFit, DoesNotDependOnTheUnitOfTheRows) {
  const model::Robot robot = make_arm(3, 60);
  const regression::RegressionColumns columns(robot, {});
  const Data data = make_data(robot, impossible_truth(columns), 200, 0.5, 12);
  regression::TriangularFactor scaled(data.factor.columns());
  scaled.add(data.factor, 1e4);
  const VectorXd prior = other_prior(columns, 13);
  const PhysicalFit one = fit_physical(data.columns, data.base, data.factor, prior);
  const PhysicalFit other = fit_physical(data.columns, data.base, scaled, prior);
  EXPECT_LT((one.x - other.x).cwiseAbs().maxCoeff(), 1e-5);
}

TEST(PhysicalFit, LeavesThePriorWhereTheDataAreSilent) {
  // The prior is right: nothing moves, not even what no motion shows.
  const model::Robot robot = make_arm(3, 70);
  const regression::RegressionColumns columns(robot, {});
  const VectorXd x = columns.values(robot);
  const Data data = make_data(robot, x, 200, 0.0, 14);
  const PhysicalFit fit = fit_physical(data.columns, data.base, data.factor, x);
  EXPECT_LT((fit.x - x).cwiseAbs().maxCoeff(), 1e-6);
  // A log in which nothing moved says nothing at all.
  regression::TriangularFactor none(data.base.count());
  const PhysicalFit silent = fit_physical(data.columns, data.base, none, x);
  for (int k = 0; k < columns.count(); ++k) {
    EXPECT_NEAR(silent.x[k], x[k], 1e-9) << columns[k].name;
  }
}

TEST(PhysicalFit, ReplacesPriorLinksThatCannotExist) {
  const model::Robot robot = make_arm(4, 80);
  const regression::RegressionColumns columns(robot, {});
  const VectorXd truth = columns.values(robot);
  const Data data = make_data(robot, truth, 300, 0.2, 15);
  VectorXd prior = truth;
  prior.segment<10>(0).setZero();  // nothing there
  prior[20 + kIzz] = 1e-6;         // inertia about an axis far too small
  prior[30] = -2.0;                // negative mass
  const PhysicalFit fit = fit_physical(data.columns, data.base, data.factor, prior, vanishing_prior());
  EXPECT_TRUE(fit.converged) << fit.summary;
  EXPECT_EQ(fit.repaired_prior, (std::vector<int>{1, 3, 4}));
  EXPECT_TRUE(is_feasible(columns, fit.x));
  EXPECT_LT(fit.squared_error, 1.0001 * fit.unconstrained_squared_error) << fit.summary;

  // A point mass is a limit of bodies: usable, but it must not forbid any inertia.
  VectorXd points = truth;
  for (int i = 0; i < 4; ++i) {
    const Eigen::Vector3d h = truth.segment<3>(10 * i + 1);
    const Eigen::Matrix3d I =
        (h.squaredNorm() * Eigen::Matrix3d::Identity() - h * h.transpose()) / truth[10 * i];
    points.segment<6>(10 * i + 4) << I(0, 0), I(0, 1), I(1, 1), I(0, 2), I(1, 2), I(2, 2);
  }
  const PhysicalFit from_points =
      fit_physical(data.columns, data.base, data.factor, points, vanishing_prior());
  EXPECT_LT(from_points.squared_error, 1.0001 * from_points.unconstrained_squared_error)
      << from_points.summary;
}

TEST(PhysicalFit, KeepsToTheShareThatThePriorMayCost) {
  const model::Robot robot = make_arm(4, 85);
  const regression::RegressionColumns columns(robot, {});
  const Data data = make_data(robot, impossible_truth(columns), 60, 0.5, 17);
  // A prior far too light pulls hard.
  const VectorXd prior = 1e-3 * other_prior(columns, 18);
  double before = std::numeric_limits<double>::infinity();
  for (const double share : {0.1, 0.01, 0.001, 0.0}) {
    PhysicalOptions options;
    options.prior_weight = 100.0;
    options.prior_share = share;
    const PhysicalFit fit = fit_physical(data.columns, data.base, data.factor, prior, options);
    EXPECT_TRUE(fit.converged) << fit.summary;
    EXPECT_LE(fit.squared_error, (1.0 + share + 1e-6) * fit.limit_squared_error) << share;
    EXPECT_LT(fit.squared_error, before) << share;
    before = fit.squared_error;
  }
}

TEST(PhysicalFit, ReachesTheSameOptimumFromAnyPrior) {
  const model::Robot robot = make_arm(5, 87);
  const regression::RegressionColumns columns(robot, {});
  const Data data = make_data(robot, impossible_truth(columns), 100, 0.5, 21);
  const VectorXd good = columns.values(robot);
  std::vector<VectorXd> priors{good, other_prior(columns, 22), 1e-3 * good, 1e3 * good,
                               VectorXd::Zero(good.size())};
  priors.push_back(good);
  priors.back().segment<10>(30) *= 1e-3;
  priors.push_back(good);
  priors.back().segment<10>(20) *= 1e2;
  priors.push_back(good);
  priors.back().segment(50, columns.count() - 50).setConstant(1e-4);  // friction that is hardly any
  double reference = 0.0;
  for (std::size_t k = 0; k < priors.size(); ++k) {
    const PhysicalFit fit = fit_physical(data.columns, data.base, data.factor, priors[k]);
    EXPECT_TRUE(fit.converged) << k << ": " << fit.summary;
    EXPECT_LE(fit.squared_error, 1.0501 * fit.limit_squared_error) << k;
    if (k == 0) reference = fit.limit_squared_error;
    EXPECT_NEAR(fit.limit_squared_error, reference, 3e-4 * reference) << k << ": " << fit.summary;
    EXPECT_LT(fit.iterations, 1500) << k;
    if (k == 2) {
      EXPECT_FALSE(fit.rescaled_prior.empty());
    }
    if (k == 0) {
      EXPECT_TRUE(fit.rescaled_prior.empty());
    }
    if (k == 4) {
      EXPECT_EQ(fit.repaired_prior, (std::vector<int>{1, 2, 3, 4, 5}));
    }
  }
}

TEST(PhysicalFit, PriorFadesAsRowsComeIn) {
  const model::Robot robot = make_arm(3, 86);
  const regression::RegressionColumns columns(robot, {});
  const VectorXd prior = other_prior(columns, 19);
  double pull[2];
  for (int k = 0; k < 2; ++k) {
    const Data data = make_data(robot, columns.values(robot), k == 0 ? 40 : 4000, 0.5, 20);
    const PhysicalFit fit = fit_physical(data.columns, data.base, data.factor, prior);
    const PhysicalFit free = fit_physical(data.columns, data.base, data.factor, prior, vanishing_prior());
    pull[k] = (fit.beta - free.beta).norm();
    EXPECT_GT(pull[k], 1e-6);
  }
  EXPECT_LT(pull[1], 0.05 * pull[0]);
}

TEST(PhysicalFit, RefusesSizesThatDoNotBelongTogether) {
  const model::Robot robot = make_arm(2, 90);
  const regression::RegressionColumns columns(robot, {});
  const VectorXd x = columns.values(robot);
  const Data data = make_data(robot, x, 60, 0.1, 16);
  EXPECT_THROW(fit_physical(columns, data.base, data.factor, x.head(5)), ModelError);
  EXPECT_THROW(fit_physical(columns, data.base, regression::TriangularFactor(3), x), ModelError);
  VectorXd missing = x;
  missing[3] = std::numeric_limits<double>::quiet_NaN();
  try {
    fit_physical(columns, data.base, data.factor, missing);
    FAIL() << "a prior with NaN was taken";
  } catch (const ModelError& error) {
    EXPECT_NE(std::string(error.what()).find(columns[3].name), std::string::npos) << error.what();
  }
}

TEST(PhysicalLink, NeedsMassAndTheTriangleOfInertias) {
  std::mt19937_64 generator(1);
  const auto body = random_body(generator);
  EXPECT_TRUE(model::is_physical(body));
  auto light = body;
  light[kMass] = -1;
  EXPECT_FALSE(model::is_physical(light));
  auto thin = body;  // Izz above Ixx + Iyy
  thin[kIzz] = body[kIxx] + body[kIyy] + 0.01;
  EXPECT_FALSE(model::is_physical(thin));
  auto far = body;  // first moment that the inertia cannot carry
  far[kMcx] += 5;
  EXPECT_FALSE(model::is_physical(far));
  EXPECT_FALSE(model::is_physical({}));
  // A speck of dust is a body too.
  auto speck = body;
  for (double& value : speck) value *= 1e-9;
  EXPECT_TRUE(model::is_physical(speck));
}

TEST(PhysicalLink, NearestIsPhysicalAndNoFurtherThanOthers) {
  std::mt19937_64 generator(2);
  for (int k = 0; k < 50; ++k) {
    auto link = random_body(generator);
    EXPECT_EQ(model::nearest_physical(link), link);
    for (double& value : link) value += uniform(generator, -0.5, 0.5);
    const auto nearest = model::nearest_physical(link);
    EXPECT_TRUE(model::is_physical(nearest));
    // Projection on a convex set: the way to any member makes an obtuse angle with the way to the link.
    const auto matrix = [](const InertialParameters<double>& p) {
      return pseudo_inertia(Eigen::Map<const VectorXd>(p.data(), 10), 0);
    };
    const Eigen::Matrix4d out = matrix(link) - matrix(nearest);
    const Eigen::Matrix4d in = matrix(random_body(generator)) - matrix(nearest);
    EXPECT_LT((out * in).trace(), 1e-3);
  }
}

TEST(MassMatrix, OfPhysicalLinksIsPositiveEverywhere) {
  const model::Robot robot = make_arm(6, 100);
  const model::MassMatrixCheck check = model::check_mass_matrix(robot, 500, 1);
  EXPECT_EQ(check.poses, 500);
  EXPECT_EQ(check.not_positive, 0);
  EXPECT_EQ(check.not_positive_with_rotors, 0);
  const MatrixXd M = model::Dynamics(robot).mass_matrix(check.worst_pose);
  EXPECT_NEAR(check.smallest_eigenvalue, M.selfadjointView<Eigen::Lower>().eigenvalues().minCoeff(), 1e-12);
}

TEST(MassMatrix, ShowsALinkThatCannotExist) {
  model::Robot robot = make_arm(3, 101);
  robot.joints[2].link[kIzz] = -0.05;
  for (auto& joint : robot.joints) joint.actuation.rotor_inertia = 0.0;
  const model::MassMatrixCheck check = model::check_mass_matrix(robot, 200, 2);
  EXPECT_EQ(check.not_positive, 200);
  EXPECT_EQ(check.not_positive_with_rotors, 200);
  EXPECT_LT(check.smallest_eigenvalue, -0.04);
  // The motor carries it, whether it is at the joint or shared with the one before.
  robot.joints[2].actuation.rotor_inertia = 3.0;
  EXPECT_EQ(model::check_mass_matrix(robot, 200, 2).not_positive_with_rotors, 0);
  robot.joints[2].actuation.rotor_inertia = 0.0;
  GearCoupling<double> coupling;
  coupling.driving = 1;
  coupling.driven = 2;
  coupling.ratio = 0.1;
  coupling.rotor_inertia = 3.0;
  robot.couplings.push_back(coupling);
  EXPECT_EQ(model::check_mass_matrix(robot, 200, 2).not_positive_with_rotors, 0);
}

TEST(MassMatrix, ShowsARotorThatTakesInertiaAway) {
  model::Robot robot = make_arm(3, 101);
  for (auto& joint : robot.joints) joint.actuation.rotor_inertia = 0.0;
  robot.joints[0].actuation.rotor_inertia = -100.0;
  const model::MassMatrixCheck check = model::check_mass_matrix(robot, 200, 2);
  EXPECT_EQ(check.not_positive, 0);
  EXPECT_EQ(check.not_positive_with_rotors, 200);
}

}  // namespace
}  // namespace heft::identify

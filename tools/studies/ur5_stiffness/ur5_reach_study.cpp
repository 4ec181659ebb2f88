// How far the arm reaches, and closed forms of an arm of two joints.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <tuple>

#include <Eigen/Core>

#include "heft/host/decompositions.hpp"
#include "heft/urdf/urdf_import.hpp"

#include "ur5_stiffness_setup.hpp"

namespace heft::studies {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

constexpr double kStatedReach = 0.850;  // of the maker [m]

double distance_at(const model::Kinematics& kinematics, const VectorXd& q) {
  return kinematics.tip(q).position.norm();
}

/// Largest slope and curvature of the distance from the base.
std::pair<double, double> shape_of_distance(const model::Kinematics& kinematics, const VectorXd& q) {
  const Index n = q.size();
  constexpr double h = 1e-4;
  VectorXd slope(n);
  MatrixXd curvature(n, n);
  const auto at = [&](Index i, double a, Index j, double b) {
    VectorXd moved = q;
    moved[i] += a;
    moved[j] += b;
    return distance_at(kinematics, moved);
  };
  for (Index i = 0; i < n; ++i) {
    slope[i] = (at(i, h, i, 0) - at(i, -h, i, 0)) / (2 * h);
    for (Index j = 0; j < n; ++j) {
      curvature(i, j) = (at(i, h, j, h) - at(i, h, j, -h) - at(i, -h, j, h) + at(i, -h, j, -h)) / (4 * h * h);
    }
  }
  return {slope.cwiseAbs().maxCoeff(), eigenvalues_of(0.5 * (curvature + curvature.transpose())).maxCoeff()};
}

/// (71), (77), (81) on an arm of two joints, against the closed forms: largest relative error.
double check_planar_arm() {
  const double l1 = 0.4, l2 = 0.3, k1 = 8000.0, k2 = 3000.0;
  const model::Kinematics arm(model::make_standard_dh_robot("planar", {{l1, 0, 0, 1}, {l2, 0, 0, 1}}));
  double worst = 0.0;
  for (const double q2 : {0.3, 1.1, -2.0}) {
    const VectorXd q = Eigen::Vector2d(0.7, q2), k = Eigen::Vector2d(k1, k2);
    const Eigen::Matrix2d C = stiffness::cartesian_stiffness(arm, q, k).compliance.topLeftCorner<2, 2>();
    const double x = l1 * std::cos(q[0]) + l2 * std::cos(q[0] + q2),
                 y = l1 * std::sin(q[0]) + l2 * std::sin(q[0] + q2);
    const double s = l2 * std::sin(q[0] + q2), c = l2 * std::cos(q[0] + q2);
    Eigen::Matrix2d closed;
    closed << y * y / k1 + s * s / k2, -x * y / k1 - c * s / k2, -x * y / k1 - c * s / k2,
        x * x / k1 + c * c / k2;
    worst = std::max(worst, (C - closed).cwiseAbs().maxCoeff() / closed.cwiseAbs().maxCoeff());
    const Eigen::Matrix2d square = closed * closed;
    const double root = std::sqrt(std::pow(square(0, 0) - square(1, 1), 2) + 4 * square(0, 1) * square(0, 1));
    const stiffness::PrincipalDeflections p = stiffness::principal_deflections(C);
    worst = std::max(worst,
                     std::abs(p.magnitudes[0] / std::sqrt(0.5 * (square(0, 0) + square(1, 1) + root)) - 1.0));
  }
  return worst;
}

}  // namespace

ReachStudy study_reach(const model::Kinematics& kinematics) {
  ReachStudy reach;
  reach.pose = degrees({0, -90, 0, -90, 0, 0});
  const Vector3d tip = kinematics.tip(reach.pose).position;
  reach.distance = tip.norm();
  reach.height = tip.z();
  std::tie(reach.slope, reach.curvature) = shape_of_distance(kinematics, reach.pose);
  reach.maximum = stiffness::maximum_reach(kinematics);
  reach.turned_wrist = distance_at(kinematics, degrees({0, -90, 0, -90, 180, 0}));
  reach.ratio = kStatedReach / reach.distance;
  reach.turned_ratio = kStatedReach / reach.turned_wrist;
  const model::Kinematics of_urdf(urdf::load_urdf(urdf::resolve_robot("ur5")));
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> turn(-std::numbers::pi, std::numbers::pi);
  for (int k = 0; k < 200; ++k) {
    VectorXd q(6);
    for (double& v : q) v = turn(random);
    reach.urdf_distance =
        std::max(reach.urdf_distance, std::abs(distance_at(kinematics, q) - distance_at(of_urdf, q)));
  }
  reach.planar_arm = check_planar_arm();
  return reach;
}

}  // namespace heft::studies

#include "terminal_link_sections.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>

#include <Eigen/LU>

#include "heft/core/control/joint_controller.hpp"
#include "heft/core/dynamics/regressor.hpp"
#include "heft/core/estimate/covariance_recursion.hpp"
#include "heft/core/estimate/factored_equations.hpp"
#include "heft/core/estimate/terminal_link_estimator.hpp"
#include "heft/host/decompositions.hpp"
#include "terminal_link_setup.hpp"

namespace heft::studies {
namespace {

using namespace terminal_link;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kPeriod = 0.005;
constexpr double kNoise = 10.0;  // σ of the measured accelerations [rad/s²]

LinkRegressor<double, kN> link_columns(const Motion& m) {
  LinkRegressor<double, kN> Y;
  link_regressor<Arm>(joint_trigonometry<Arm>(m.q), m.q, m.qd, m.qdd, Y);
  return Y;
}

/// Columns of R and c of the terminal link: α, Ī (11, 22, 33, 12, 13, 23), F, d, m.
Eigen::Matrix<double, kN, 12> terminal_columns(const Motion& m) {
  const LinkRegressor<double, kN> Y = link_columns(m);
  constexpr int kLast = kParametersPerLink * (kN - 1);
  constexpr std::array<int, 9> kOrder = {kMcx, kMcy, kMcz, kIxx, kIyy, kIzz, kIxy, kIxz, kIyz};
  Eigen::Matrix<double, kN, 12> R = Eigen::Matrix<double, kN, 12>::Zero();
  for (std::size_t c = 0; c < kOrder.size(); ++c) {
    R.col(static_cast<int>(c)) = Y.col(kLast + kOrder[c]);
  }
  R(kN - 1, 9) = velocity_sign(m.qd[kN - 1], 0.0);
  R(kN - 1, 10) = m.qd[kN - 1];
  R.col(11) = Y.col(kLast + kMass);
  return R;
}

std::array<double, 4> rms_of_inboard(const std::vector<Vector>& torques) {
  Vector squares = Vector::Zero();
  for (const Vector& tau : torques) {
    squares += tau.cwiseAbs2();
  }
  squares = 1e3 * (squares / static_cast<double>(torques.size())).cwiseSqrt();
  return {squares[0], squares[1], squares[2], squares[3]};
}

}  // namespace

const std::vector<std::string>& terminal_parameter_names() {
  static const std::vector<std::string> names = {
      "Δα6x [g m]",    "Δα6y [g m]",    "Δα6z [g m]",    "ΔĪ6_11 [g m²]", "ΔĪ6_22 [g m²]", "ΔĪ6_33 [g m²]",
      "ΔĪ6_12 [g m²]", "ΔĪ6_13 [g m²]", "ΔĪ6_23 [g m²]", "ΔF6 [mN m]",    "Δd6 [g m²/s]",  "Δm6 [g]"};
  return names;
}

MassColumnCheck check_mass_column() {
  const FourierTrajectory validation = validation_trajectory();
  Eigen::Matrix<double, 12, 12> normal = Eigen::Matrix<double, 12, 12>::Zero();
  Eigen::Matrix<double, 12, 1> right = Eigen::Matrix<double, 12, 1>::Zero();
  for (int j = 0; j < 4000; ++j) {
    const Motion m = at(validation, j * kPeriod);
    const auto R = terminal_columns(m);
    const Vector difference = true_torque(m, true) - true_torque(m, false);
    normal += R.transpose() * R;
    right += R.transpose() * difference;
  }
  // Columns scaled to one before solving.
  const Eigen::Matrix<double, 12, 1> scale = normal.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::Matrix<double, 12, 12> scaled = scale.asDiagonal() * normal * scale.asDiagonal();
  const Eigen::Matrix<double, 12, 1> b = scale.cwiseProduct(right);
  const VectorXd all = scale.cwiseProduct(solve_symmetric(scaled, b).col(0));
  const VectorXd some =
      scale.head<11>().cwiseProduct(solve_symmetric(scaled.topLeftCorner<11, 11>(), b.head<11>()).col(0));

  const auto& with = model::KawasakiArmWithPayload::kModel;
  const auto& without = model::KawasakiArm::kModel;
  InertialParameters<double> change{};
  for (std::size_t i = 0; i < change.size(); ++i) {
    change[i] = 1e3 * (with.links[5][i] - without.links[5][i]);
  }
  MassColumnCheck check;
  check.truth = {
      change[kMcx], change[kMcy],
      change[kMcz], change[kIxx],
      change[kIyy], change[kIzz],
      change[kIxy], change[kIxz],
      change[kIyz], 1e3 * (with.actuation[5].coulomb_friction - without.actuation[5].coulomb_friction),
      0.0,          change[kMass]};
  for (int i = 0; i < 11; ++i) {
    check.without_mass.push_back(1e3 * some[i]);
  }
  for (int i = 0; i < 12; ++i) {
    check.with_mass.push_back(1e3 * all[i]);
  }
  return check;
}

UncorrectedRows check_uncorrected_rows() {
  const FourierTrajectory validation = validation_trajectory();
  const auto& with = model::KawasakiArmWithPayload::kModel;
  const auto& without = model::KawasakiArm::kModel;
  const double mass = with.links[5][kMass] - without.links[5][kMass];

  // Base values in the kept columns and zero in the dropped ones (link 5 without α_y and Ī33, link 6 without α_z and
  // Ī22; friction has no part in rows 1..4), against the truth. Lumped coefficients of link 5 belong to the
  // augmented link: own parameters about its origin plus everything outboard as a point mass at the next origin.
  const auto augmented = [](const InertialParameters<double>& own, double outboard) {
    constexpr double kR = 0.1;  // r5 = (0, 0.1, 0)
    InertialParameters<double> p = own;
    p[kMass] = 0;
    p[kMcy] += outboard * kR;
    p[kIxx] += outboard * kR * kR;
    p[kIzz] += outboard * kR * kR;
    return p;
  };
  const InertialParameters<double> link5 = augmented(with.links[4], with.links[5][kMass]);
  const InertialParameters<double> link6 = with.links[5];
  InertialParameters<double> kept5{}, kept6{};
  kept5[kMcx] = link5[kMcx];
  kept5[kMcz] = link5[kMcz] + link6[kMcz];
  kept5[kIxx] = link5[kIxx] - link5[kIzz] + link6[kIyy];
  kept5[kIyy] = link5[kIyy] + link6[kIyy];
  kept5[kIxy] = link5[kIxy];
  kept5[kIxz] = link5[kIxz];
  kept5[kIyz] = link5[kIyz] - 0.1 * link6[kMcz];
  kept6[kMcx] = link6[kMcx];
  kept6[kMcy] = link6[kMcy];
  kept6[kIxx] = link6[kIxx] - link6[kIyy];
  kept6[kIzz] = link6[kIzz];
  kept6[kIxy] = link6[kIxy];
  kept6[kIxz] = link6[kIxz];
  kept6[kIyz] = link6[kIyz];

  // Reduced parameters: the estimate replaces links 5 and 6, the rest stays nominal.
  Parameters replaced = parameters_without_payload();
  replaced.links[4] = parameters_with_payload().links[4];
  replaced.links[5] = parameters_with_payload().links[5];
  InertialParameters<double> payload{};
  for (std::size_t i = 0; i < payload.size(); ++i) {
    payload[i] = with.links[5][i] - without.links[5][i];
  }
  const Parameters carried = corrected_for_payload(parameters_without_payload(), payload);

  std::vector<Vector> none, perfect, base_values, in_reduced, with_mass;
  for (int j = 0; j < 4000; ++j) {
    const Motion m = at(validation, j * kPeriod);
    const LinkRegressor<double, kN> Y = link_columns(m);
    const Vector truth = inverse_dynamics<Arm>(parameters_with_payload(), m.q, m.qd, m.qdd);
    const Vector before = inverse_dynamics<Arm>(parameters_without_payload(), m.q, m.qd, m.qdd);
    none.push_back(truth - before);
    // Links 5 and 6 right in every coefficient the estimate has: only Δm at O5 is missing, and rows 5 and 6 do not see
    // it. Of link 5 the estimate has no Δα5y; its other changes belong to the same point mass.
    perfect.push_back(mass * Y.col(kParametersPerLink * 5 + kMass));
    // Links 1..4 with their nominal lumped coefficients, i.e. with the masses outboard of them at their far ends.
    const auto lumped = [&](const InertialParameters<double>& p5, const InertialParameters<double>& p6) {
      Vector tau = Vector::Zero();
      for (int c = 1; c < kParametersPerLink; ++c) {
        tau +=
            Y.col(40 + c) * p5[static_cast<std::size_t>(c)] + Y.col(50 + c) * p6[static_cast<std::size_t>(c)];
      }
      return tau;
    };
    // What links 5 and 6 contribute as lumped coefficients truly, plus the mass that links 1..4 lack.
    base_values.push_back(lumped(link5, link6) - lumped(kept5, kept6) + mass * (Y.col(40 + kMass)));
    in_reduced.push_back(truth - inverse_dynamics<Arm>(replaced, m.q, m.qd, m.qdd));
    with_mass.push_back(truth - inverse_dynamics<Arm>(carried, m.q, m.qd, m.qdd));
  }
  return {rms_of_inboard(none), rms_of_inboard(perfect), rms_of_inboard(base_values),
          rms_of_inboard(in_reduced), rms_of_inboard(with_mass)};
}

MassFromDifference mass_from_difference(int seed) {
  constexpr int kFirst = 3;  // k = 4
  using Layout = TerminalLayout<Arm, kFirst>;
  const FourierTrajectory exciting = exciting_trajectory();
  // Without payload, with it under the same noise, with it under noise of its own.
  constexpr std::array<bool, 3> kPayload = {false, true, true};
  std::array<LayoutVector<kFirst>, 3> instrumental, least_squares;
  JointAccelerationModel<double, kN> joint_model;
  const auto fit = fit_joint_model(kPeriod, kNoise, seed);
  for (std::size_t run = 0; run < kPayload.size(); ++run) {
    const bool payload = kPayload[run];
    (void)joint_model.configure(fit);
    Noise noise(run == 2 ? seed + 1000 : seed);
    System<kFirst> iv, ls;
    for (int j = 0; j < 20000; ++j) {
      const Motion m = at(exciting, j * kPeriod);
      const Vector tau = true_torque(m, payload);
      const Vector measured = m.qdd + noise(kNoise);
      std::array<TerminalRows<double, Layout>, 2> rows{};
      terminal_rows<Arm, kFirst, 2>(terminal_trigonometry<Arm, kFirst>(m.q), m.q, m.qd,
                                    {measured, joint_model.update(motor_input(m, tau))}, 0.0, rows);
      iv.add(rows[0], rows[1], tau);
      ls.add(rows[0], rows[0], tau);
    }
    (void)iv.solve();
    (void)ls.solve();
    instrumental[run] = iv.solution();
    least_squares[run] = ls.solution();
  }
  // α4z + α5y (core/estimate/README.md, section 7) is one parameter of link 4; a mass at O5 moves it by 0.1 m times the mass.
  InertialParameters<double> unit{};
  unit[kMass] = 1;
  const LayoutVector<kFirst> slope =
      layout_parameters<kFirst>(corrected_for_payload(parameters_without_payload(), unit),
                                model::KawasakiArm::kModel) -
      layout_parameters<kFirst>(parameters_without_payload(), model::KawasakiArm::kModel);
  int column = -1;
  for_inertial<kFirst>([&](std::size_t link, std::size_t entry, int c) {
    if (link == kFirst && entry >= kPhx && entry <= kPhz && std::abs(slope[c]) > 0.05) {
      column = c;
    }
  });
  const auto mass = [&](const std::array<LayoutVector<kFirst>, 3>& x, std::size_t run) {
    return 1e3 * (x[run] - x[0])[column] / slope[column];
  };
  return {mass(instrumental, 1), mass(least_squares, 1), mass(instrumental, 2), mass(least_squares, 2)};
}

std::vector<RankCheck> check_ranks() {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> angle(-3.1, 3.1), rate(-4.0, 4.0), acceleration(-20.0, 20.0);
  constexpr int kStates = 60;
  std::vector<RankCheck> checks;
  for (int k = 6; k >= 1; --k) {
    const int links = kN - k + 1;
    const int columns = 12 * links;
    MatrixXd A(kStates * links, columns);
    for (int s = 0; s < kStates; ++s) {
      Motion m;
      for (int i = 0; i < kN; ++i) {
        m.q[i] = angle(random);
        m.qd[i] = rate(random);
        m.qdd[i] = acceleration(random);
      }
      const LinkRegressor<double, kN> Y = link_columns(m);
      for (int r = 0; r < links; ++r) {
        const int row = s * links + r;
        A.row(row).setZero();
        A.row(row).head(10 * links) = Y.row(k - 1 + r).tail(10 * links);
        A(row, 10 * links + 2 * r) = velocity_sign(m.qd[k - 1 + r], 0.0);
        A(row, 10 * links + 2 * r + 1) = m.qd[k - 1 + r];
      }
    }
    // Columns that no motion fills hold rounding errors; scaling must not blow them up.
    const double largest = A.colwise().norm().maxCoeff();
    for (int c = 0; c < columns; ++c) {
      const double norm = A.col(c).norm();
      if (norm > 1e-12 * largest) {
        A.col(c) /= norm;
      } else {
        A.col(c).setZero();
      }
    }
    const VectorXd sigma = singular_values(triangle_of(A));
    RankCheck check;
    check.k = k;
    check.columns = 11 * links;
    for (int i = 0; i < columns; ++i) {
      check.rank += sigma[i] > 1e-9 * sigma[0] ? 1 : 0;
    }
    const double dropped = check.rank < columns ? std::max(sigma[check.rank], 1e-300) : 1e-300;
    check.gap = std::log10(sigma[check.rank - 1] / dropped);
    checks.push_back(check);
  }
  return checks;
}

FormCheck check_forms(int seed, int samples) {
  using Layout = TerminalLayout<Arm, 4>;
  using Row = std::array<double, Layout::kParameters>;
  const ArmModel<double, kN> nominal = nominal_arm(seed);
  const LayoutVector<4> start = layout_parameters<4>(Parameters{reduced_links(nominal)}, nominal);
  Row prior{}, variance{}, precision{};
  constexpr double kPrecision = 1e-3;
  for (std::size_t i = 0; i < prior.size(); ++i) {
    prior[i] = start[static_cast<int>(i)];
    precision[i] = kPrecision;
    variance[i] = 1 / kPrecision;
  }
  CovarianceRecursion<double, Layout> covariance;
  covariance.reset(prior, variance);
  NormalEquations<double, Layout> information;
  information.reset(prior, precision);
  FactoredEquations<double, Layout, false> factored;
  // The factored form starts from equations that have collected the first half of the run.
  const int hand_over = samples / 2;

  Eigen::Matrix<long double, kBase, kBase> phi = Eigen::Matrix<long double, kBase, kBase>::Zero();
  Eigen::Matrix<long double, kBase, 1> right;
  for (int i = 0; i < kBase; ++i) {
    phi(i, i) = static_cast<long double>(kPrecision);
    right[i] = static_cast<long double>(kPrecision) * static_cast<long double>(start[i]);
  }
  const FourierTrajectory exciting = exciting_trajectory();
  JointAccelerationModel<double, kN> joint_model;
  (void)joint_model.configure(fit_joint_model(kPeriod, kNoise, seed));
  Noise noise(seed);
  for (int j = 0; j < samples; ++j) {
    const Motion m = at(exciting, j * kPeriod);
    const Vector tau = true_torque(m);
    const Vector measured = m.qdd + noise(kNoise);
    const auto w = rows_at<4>(m.q, m.qd, measured);
    const auto z = rows_at<4>(m.q, m.qd, joint_model.update(motor_input(m, tau)));
    const auto W = as_matrix<4>(w);
    const auto Z = as_matrix<4>(z);
    for (int r = 0; r < Layout::kRows; ++r) {
      const std::size_t i = static_cast<std::size_t>(r);
      (void)covariance.add(r, z[i], w[i], tau[4 + r]);
      information.add(r, z[i], w[i], tau[4 + r]);
      if (j >= hand_over) {
        (void)factored.add(r, z[i], w[i], tau[4 + r]);
      }
      phi += Z.row(r).transpose().cast<long double>() * W.row(r).cast<long double>();
      right += Z.row(r).transpose().cast<long double>() * static_cast<long double>(tau[4 + r]);
    }
    if (j + 1 == hand_over) {
      (void)factored.start(information.matrix(), information.right_side(), false);
    }
  }
  const Eigen::Matrix<double, kBase, 1> batch = phi.partialPivLu().solve(right).cast<double>();
  StagedSolver<double, Layout> solver;
  solver.start(information.matrix(), information.right_side(), false);
  while (!solver.advance(50)) {
  }
  const auto difference = [&](const Row& x) {
    double largest = 0;
    for (int i = 0; i < kBase; ++i) {
      largest = std::max(largest, std::abs(x[static_cast<std::size_t>(i)] - batch[i]));
    }
    return largest / batch.cwiseAbs().maxCoeff();
  };
  return {difference(covariance.solution()), difference(solver.solution()), difference(factored.solution())};
}

std::vector<StartupPoint> startup(bool rotor_inertia, double period, int seed,
                                  const std::vector<int>& samples) {
  using Estimator = TerminalLinkEstimator<Arm, 4>;
  const FourierTrajectory exciting = exciting_trajectory();
  const ArmModel<double, kN> nominal = nominal_arm(seed);
  Vector coulomb, viscous;
  for (int i = 0; i < kN; ++i) {
    coulomb[i] = nominal.actuation[static_cast<std::size_t>(i)].coulomb_friction;
    viscous[i] = nominal.actuation[static_cast<std::size_t>(i)].viscous_friction;
  }
  Estimator estimator;
  (void)estimator.configure({}, Parameters{reduced_links(nominal)}, coulomb, viscous);
  JointAccelerationModel<double, kN> joint_model;
  (void)joint_model.configure(fit_joint_model(period, kNoise, seed));
  System<4> unchecked;
  Noise noise(seed);
  const Base rms = column_rms(exciting, 0.005, 4000);
  std::vector<StartupPoint> points;
  for (int j = 0; j < samples.back(); ++j) {
    const Motion m = at(exciting, j * period);
    const Vector tau = true_torque(m);
    const Vector epsilon = noise(kNoise);
    const Vector measured_tau = rotor_inertia ? (tau - kRotor.cwiseProduct(epsilon)).eval() : tau;
    const auto w = rows_at<4>(m.q, m.qd, m.qdd + epsilon);
    const auto z = rows_at<4>(m.q, m.qd, joint_model.update(motor_input(m, tau)));
    Estimator::Record record;
    (void)estimator.update_rows(w, z, m.qd, measured_tau, record);
    unchecked.add(w, z, measured_tau);
    if (j + 1 == samples[points.size()]) {
      StartupPoint point;
      point.samples = j + 1;
      point.source = static_cast<int>(estimator.source());
      LayoutVector<4> x;
      for (int i = 0; i < kBase; ++i) {
        x[i] = estimator.estimate()[static_cast<std::size_t>(i)];
      }
      point.handed_out = relative_error(to_publication(x), rms);
      point.unchecked = unchecked.solve() ? relative_error(to_publication(unchecked.solution()), rms)
                                          : std::numeric_limits<double>::infinity();
      points.push_back(point);
    }
  }
  return points;
}

}  // namespace heft::studies

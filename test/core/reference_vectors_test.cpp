// Torque, mass matrix and lumped regressor against the vectors of an independent program (Pinocchio 4.1.0).
#include <filesystem>
#include <fstream>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heft/core/dynamics/joint_space.hpp"
#include "heft/core/dynamics/lumped_regressor.hpp"
#include "heft/model/named_arms.hpp"
#include "support/measured_data.hpp"

namespace heft {
namespace {

using Vector = JointVector<double, 6>;

Vector vector_of(const nlohmann::json& values) {
  Vector v;
  for (int i = 0; i < 6; ++i) {
    v[i] = values.at(static_cast<std::size_t>(i)).get<double>();
  }
  return v;
}

Eigen::MatrixXd matrix_of(const nlohmann::json& rows) {
  Eigen::MatrixXd m(static_cast<Eigen::Index>(rows.size()), static_cast<Eigen::Index>(rows.at(0).size()));
  for (Eigen::Index i = 0; i < m.rows(); ++i) {
    for (Eigen::Index j = 0; j < m.cols(); ++j) {
      m(i, j) = rows.at(static_cast<std::size_t>(i)).at(static_cast<std::size_t>(j)).get<double>();
    }
  }
  return m;
}

/// @param unit  SI torque over the file's torque unit (that of Kawasaki and Nishimura's arm is in g, m, s)
template <typename Description>
void expect_reference(const std::string& file, double unit) {
  const std::filesystem::path path = std::filesystem::path(HEFT_REFERENCE_DIR) / file;
  HEFT_NEEDS_MEASURED_DATA(path);
  std::ifstream in(path);
  const nlohmann::json reference = nlohmann::json::parse(in);
  const auto& model = Description::kModel;
  const DynamicArm<double, 6> dynamic(model);
  using Arm = StaticArm<double, Description>;
  constexpr double kTolerance = 1e-12;
  int states = 0;
  for (const auto& state : reference.at("states")) {
    const Vector q = vector_of(state.at("q")), qd = vector_of(state.at("qd")),
                 qdd = vector_of(state.at("qdd"));
    const Vector rigid = vector_of(state.at("tau_rigid")) * unit, full = vector_of(state.at("tau")) * unit;
    const Eigen::MatrixXd M = matrix_of(state.at("M")) * unit;
    const Eigen::MatrixXd W = matrix_of(state.at("W"));
    const double size = std::max(rigid.cwiseAbs().maxCoeff(), 1e-12);

    EXPECT_LT((inverse_dynamics(dynamic, q, qd, qdd) - rigid).cwiseAbs().maxCoeff(), kTolerance * size);
    EXPECT_LT((inverse_dynamics<Arm>(ConstantParameters<double, Description>{}, q, qd, qdd) - rigid)
                  .cwiseAbs()
                  .maxCoeff(),
              kTolerance * size);
    Vector with_friction = inverse_dynamics(dynamic, q, qd, qdd);
    for (int i = 0; i < 6; ++i) {
      with_friction[i] += friction_torque(model.actuation[static_cast<std::size_t>(i)], qd[i], 0.0);
    }
    EXPECT_LT((with_friction - full).cwiseAbs().maxCoeff(),
              kTolerance * std::max(size, full.cwiseAbs().maxCoeff()));

    MassMatrix<double, 6> mass;
    mass_matrix(dynamic, joint_trigonometry<DynamicArm<double, 6>>(q), q, mass);
    EXPECT_LT((mass - M).cwiseAbs().maxCoeff(), kTolerance * M.cwiseAbs().maxCoeff());

    LinkRegressor<double, 6> Y;
    link_regressor(dynamic, joint_trigonometry<DynamicArm<double, 6>>(q), q, qd, qdd, Y);
    LumpedRegressor<double, 6> lumped;
    lumped_regressor<double, 6>(Y, qd, 0.0, lumped);
    EXPECT_LT((lumped - W).cwiseAbs().maxCoeff(), kTolerance * W.cwiseAbs().maxCoeff());
    ++states;
  }
  EXPECT_EQ(states, 20);

  // The coefficients, in the file's units; Coulomb and viscous are torques and scale like the rest.
  const auto x = lumped_parameters(model);
  for (int i = 0; i < 66; ++i) {
    EXPECT_NEAR(x[i], reference.at("x").at(static_cast<std::size_t>(i)).get<double>() * unit,
                1e-12 * unit * 2000)
        << "coefficient " << i;
  }
}

TEST(ReferenceVectors, PublicationArm) { expect_reference<model::KawasakiArm>("paper6r.json", 1e-3); }
TEST(ReferenceVectors, Ur5) { expect_reference<model::Ur5Arm>("ur5.json", 1.0); }

}  // namespace
}  // namespace heft

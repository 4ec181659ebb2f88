// The two arms of the reference vectors, read from their URDF: torque and mass matrix of another program.

#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heft/model/dynamics.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "support/measured_data.hpp"
#include "urdf/comparison.hpp"

namespace heft::urdf {
namespace {

struct Arm {
  const char* urdf;
  const char* reference;
  double to_si;  ///< factor from the file's torque and inertia to Nm and kg·m²
};

class ReferenceVectors : public testing::TestWithParam<Arm> {};

Eigen::VectorXd vector_of(const nlohmann::json& values) {
  const auto list = values.get<std::vector<double>>();
  return Eigen::Map<const Eigen::VectorXd>(list.data(), static_cast<Eigen::Index>(list.size()));
}

TEST_P(ReferenceVectors, AreReproducedFromTheUrdf) {
  const std::filesystem::path path = std::filesystem::path(HEFT_REFERENCE_DIR) / GetParam().reference;
  HEFT_NEEDS_MEASURED_DATA(path);
  const nlohmann::json reference = nlohmann::json::parse(std::ifstream(path));
  const model::Dynamics dynamics(load_urdf(resolve_robot(GetParam().urdf)));
  ASSERT_EQ(reference["states"].size(), 20u);
  for (const nlohmann::json& state : reference["states"]) {
    SCOPED_TRACE(state["id"]);
    const Eigen::VectorXd q = vector_of(state["q"]), qd = vector_of(state["qd"]),
                          qdd = vector_of(state["qdd"]);
    const double unit = GetParam().to_si;
    // 1e-12 of the largest entry is what the vectors' README expects of a correct implementation.
    EXPECT_LE(relative_error(dynamics.inverse_dynamics(q, qd, qdd), unit * vector_of(state["tau_rigid"])),
              1e-12);
    EXPECT_LE(relative_error(dynamics.joint_torque(q, qd, qdd), unit * vector_of(state["tau"])), 1e-12);
    Eigen::MatrixXd mass(6, 6);
    for (int row = 0; row < 6; ++row)
      mass.row(row) = unit * vector_of(state["M"][static_cast<std::size_t>(row)]).transpose();
    EXPECT_LE(relative_error(dynamics.mass_matrix(q), mass), 1e-12);
  }
}

INSTANTIATE_TEST_SUITE_P(Urdf, ReferenceVectors,
                         testing::Values(Arm{"kawasaki6r", "paper6r.json", 1e-3},
                                         Arm{"ur5", "ur5.json", 1.0}),
                         [](const auto& arm) { return std::string(arm.param.urdf); });

}  // namespace
}  // namespace heft::urdf

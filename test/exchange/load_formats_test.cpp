// Loads in other programs' forms: read back by the conventions of their documents with KDL's bodies, rotations and wrenches.
#include <array>
#include <cctype>
#include <cstdlib>
#include <functional>
#include <limits>
#include <map>
#include <numbers>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <kdl/frames.hpp>
#include <kdl/rigidbodyinertia.hpp>

#include "heft/exchange/load_formats.hpp"
#include "heft/host/error.hpp"
#include "support/random_arm.hpp"

namespace heft::exchange {
namespace {

using ::testing::HasSubstr;

/// Numbers of a text in order; a digit within a word is none.
std::vector<double> numbers_in(const std::string& text) {
  std::vector<double> found;
  const char* at = text.c_str();
  while (*at != '\0') {
    const bool in_word = at != text.c_str() && (std::isalnum(static_cast<unsigned char>(at[-1])) ||
                                                at[-1] == '_' || at[-1] == '^' || at[-1] == '[');
    const bool starts = std::isdigit(static_cast<unsigned char>(*at)) ||
                        (*at == '-' && std::isdigit(static_cast<unsigned char>(at[1])));
    if (starts && (!in_word || at[-1] == '[')) {
      char* end = nullptr;
      found.push_back(std::strtod(at, &end));
      at = end;
    } else {
      ++at;
    }
  }
  return found;
}

/// xx, yy, zz, xy, xz, yz about the centre of mass.
using Entries = std::array<double, 6>;
KDL::RigidBodyInertia body(double mass, const KDL::Vector& com, const Entries& i) {
  return KDL::RigidBodyInertia(mass, com, KDL::RotationalInertia(i[0], i[1], i[2], i[3], i[4], i[5]));
}

/// Principal moments about axes turned by R, at the centre of mass.
KDL::RigidBodyInertia turned(double mass, const KDL::Vector& com, const KDL::Rotation& R, double x, double y,
                             double z) {
  return KDL::Frame(R, com) *
         KDL::RigidBodyInertia(mass, KDL::Vector::Zero(), KDL::RotationalInertia(x, y, z, 0, 0, 0));
}

using Reader = std::function<KDL::RigidBodyInertia(const std::vector<double>&)>;

/// How each form is read, by its document: order, unit, frame.
const std::map<std::string, Reader>& readers() {
  constexpr double kRadians = std::numbers::pi / 180.0;
  static const std::map<std::string, Reader> all{
      // m, cx cy cz, Ixx Iyy Izz Ixy Ixz Iyz, transition time
      {"ur-script",
       [](const auto& v) {
         return body(v.at(0), {v[1], v[2], v[3]}, {v[4], v[5], v[6], v[7], v[8], v.at(9)});
       }},
      // m, x y z, ixx ixy ixz iyy iyz izz, transition time
      {"ur-ros2",
       [](const auto& v) {
         return body(v.at(0), {v[1], v[2], v[3]}, {v[4], v[7], v[9], v[5], v[6], v.at(8)});
       }},
      {"franka",
       [](const auto& v) {
         return body(v.at(0), {v[1], v[2], v[3]}, {v[4], v[8], v.at(12), v[5], v[6], v[9]});
       }},
      // behind mass and centre of mass sixteen numbers of a transformation that does nothing
      {"franka-desk",
       [](const auto& v) {
         return body(v.at(0), {v[1], v[2], v[3]}, {v[20], v[24], v.at(28), v[21], v[22], v[25]});
       }},
      // [1] of LOAD_DATA, M, X Y Z [mm], A B C [deg] about z, y', x'', J
      {"kuka",
       [](const auto& v) {
         return turned(v.at(1), KDL::Vector(v[2], v[3], v[4]) / 1000.0,
                       KDL::Rotation::RPY(kRadians * v[7], kRadians * v[6], kRadians * v[5]), v[8], v[9],
                       v.at(10));
       }},
      // mass, cog [mm], aom w x y z, ix iy iz
      {"abb",
       [](const auto& v) {
         return turned(v.at(0), KDL::Vector(v[1], v[2], v[3]) / 1000.0,
                       KDL::Rotation::Quaternion(v[5], v[6], v[7], v[4]), v[8], v[9], v.at(10));
       }},
      // kg, cm, kgf cm s²
      {"fanuc",
       [](const auto& v) {
         constexpr double kUnit = 9.80665 * 0.01;
         return body(v.at(0), KDL::Vector(v[1], v[2], v[3]) / 100.0,
                     {kUnit * v[4], kUnit * v[5], kUnit * v.at(6), 0, 0, 0});
       }},
      // xyz, rpy, mass, ixx ixy ixz iyy iyz izz
      {"urdf",
       [](const auto& v) {
         return body(v.at(6), {v[0], v[1], v[2]}, {v[7], v[10], v[12], v[8], v[9], v.at(11)});
       }},
      // pos, mass, xx yy zz xy xz yz
      {"mjcf", [](const auto& v) {
         return body(v.at(3), {v[0], v[1], v[2]}, {v[4], v[5], v[6], v[7], v[8], v.at(9)});
       }}};
  return all;
}

KDL::Vector random_vector(test::Random& random, double size) {
  return {test::uniform(random, -size, size), test::uniform(random, -size, size),
          test::uniform(random, -size, size)};
}

/// Force and moment at the flange that give a body with ten parameters a motion, written out:
/// f = m a + α × mc + ω × (ω × mc), n = I α + ω × I ω + mc × a.
KDL::Wrench wrench_of(const InertialParameters<double>& p, const KDL::Twist& acceleration,
                      const KDL::Vector& w) {
  const KDL::Vector mc(p[kMcx], p[kMcy], p[kMcz]);
  const auto I = [&](const KDL::Vector& v) {
    return KDL::Vector(p[kIxx] * v.x() + p[kIxy] * v.y() + p[kIxz] * v.z(),
                       p[kIxy] * v.x() + p[kIyy] * v.y() + p[kIyz] * v.z(),
                       p[kIxz] * v.x() + p[kIyz] * v.y() + p[kIzz] * v.z());
  };
  const KDL::Vector a = acceleration.vel, alpha = acceleration.rot;
  return {p[kMass] * a + alpha * mc + w * (w * mc), I(alpha) + w * I(w) + mc * a};
}

/// Largest difference of the two wrenches over the largest part of one of them.
double difference(const KDL::RigidBodyInertia& read, const InertialParameters<double>& p,
                  test::Random& random) {
  const KDL::Twist acceleration(random_vector(random, 10.0), random_vector(random, 20.0));
  const KDL::Vector w = random_vector(random, 5.0);
  const KDL::Wrench expected = wrench_of(p, acceleration, w);
  // Of a body that turns with ω about the flange's origin, which rests: f = I a + v × I v.
  const KDL::Twist v(KDL::Vector::Zero(), w);
  const KDL::Wrench found = read * acceleration + v * (read * v);
  double most = 0.0, error = 0.0;
  for (int k = 0; k < 6; ++k) {
    most = std::max(most, std::abs(expected(k)));
    error = std::max(error, std::abs(found(k) - expected(k)));
  }
  return error / most;
}

TEST(LoadFormats, GiveTheSameWrenchReadBackAsTheirDocumentsSay) {
  ASSERT_EQ(load_formats().size(), readers().size());
  for (const LoadFormat& format : load_formats()) {
    const Reader& read = readers().at(std::string(format.id));
    test::Random random(7);
    double worst = 0.0;
    for (int k = 0; k < 10000; ++k) {
      InertialParameters<double> p = test::random_body(random);
      if (format.id == "fanuc") {  // has no products of inertia about the centre of mass
        Load load = load_of(p, "body");
        load.inertia = Eigen::Matrix3d(load.inertia.diagonal().asDiagonal());
        const Eigen::Vector3d c = load.com;
        const Eigen::Matrix3d I =
            load.inertia + load.mass * (c.squaredNorm() * Eigen::Matrix3d::Identity() - c * c.transpose());
        p = {load.mass, load.mass * c[0], load.mass * c[1], load.mass * c[2], I(0, 0),
             I(0, 1),   I(1, 1),          I(0, 2),          I(1, 2),          I(2, 2)};
      }
      worst =
          std::max(worst, difference(read(numbers_in(to_text(load_of(p, "body"), format.id))), p, random));
    }
    EXPECT_LT(worst, 1e-9) << format.id;
  }
}

TEST(LoadFormats, AreWrittenAsTheirProgramsTakeThem) {
  Load load;
  load.mass = 2.5;
  load.com = {0.01, -0.02, 0.08};
  load.inertia = Eigen::Vector3d(0.01, 0.02, 0.025).asDiagonal();
  EXPECT_EQ(to_text(load, "ur-script", {.transition_time = 0.5}),
            "set_target_payload(2.5, [0.01, -0.02, 0.08], [0.01, 0.02, 0.025, 0, 0, 0], 0.5)\n");
  EXPECT_EQ(to_text(load, "kuka"),
            "LOAD_DATA[1]={M 2.5,CM {X 10,Y -20,Z 80,A 0,B 0,C 0},J {X 0.01,Y 0.02,Z 0.025}}\n");
  EXPECT_EQ(to_text(load, "abb"),
            "PERS loaddata heft_load := [2.5, [10, -20, 80], [1, 0, 0, 0], 0.01, 0.02, 0.025];\n");
  EXPECT_EQ(to_text(load, "franka"),
            "robot.setLoad(2.5, {{0.01, -0.02, 0.08}}, {{0.01, 0, 0, 0, 0.02, 0, 0, 0, 0.025}});\n");
  EXPECT_THAT(to_text(load, "urdf", {.link = "flange"}), HasSubstr("<parent link=\"flange\"/>"));
}

TEST(LoadFormats, SayWhatAScheduleOfFanucLeavesOut) {
  Load load;
  load.mass = 1.0;
  load.inertia << 0.02, 0.004, 0.0, 0.004, 0.02, 0.0, 0.0, 0.0, 0.02;
  EXPECT_THAT(to_text(load, "fanuc"),
              HasSubstr("without the products of inertia, up to 0.004 kg·m² (20 % of"));
}

TEST(LoadFormats, TakeALoadThatIsAPoint) {
  Load load;
  load.mass = 1.2;
  load.com = {0.0, 0.0, 0.1};
  EXPECT_EQ(to_text(load, "ur-script"), "set_target_payload(1.2, [0, 0, 0.1], [0, 0, 0, 0, 0, 0], 0)\n");
  // A point's inertia about the flange is that of its mass there; what the shift leaves of it is rounding.
  const InertialParameters<double> p = make_inertial_parameters<double>(2.8, {0.03, 0.17, 0.16}, {0, 0, 0, 0, 0, 0});
  EXPECT_TRUE(load_of(p, "a point").inertia.isZero(0.0));
  EXPECT_THAT(to_text(load, "mjcf"), HasSubstr("diaginertia=\"0 0 0\""));
  for (const LoadFormat& format : load_formats()) EXPECT_FALSE(to_text(load, format.id).empty()) << format.id;
}

TEST(LoadFormats, RefuseWhatNoBodyCanHave) {
  Load sound;
  sound.mass = 1.0;
  sound.inertia = 0.01 * Eigen::Matrix3d::Identity();
  std::vector<std::pair<const char*, Load>> impossible(5, {"", sound});
  impossible[0] = {"mass of 0 kg", sound}, impossible[0].second.mass = 0.0;
  impossible[1] = {"mass of -1 kg", sound}, impossible[1].second.mass = -1.0;
  impossible[2] = {"not finite", sound},
  impossible[2].second.com[1] = std::numeric_limits<double>::quiet_NaN();
  impossible[3] = {"physically impossible", sound}, impossible[3].second.inertia(2, 2) = 0.03;
  impossible[4] = {"not symmetric", sound}, impossible[4].second.inertia(0, 1) = 0.005;
  for (const auto& [words, load] : impossible) {
    for (const LoadFormat& format : load_formats()) {
      try {
        to_text(load, format.id);
        ADD_FAILURE() << format.id << " took a load with " << words;
      } catch (const ModelError& error) {
        EXPECT_THAT(error.what(), HasSubstr(words)) << format.id;
      }
    }
  }
  EXPECT_THROW(load_of({1.0, 0, 0, 0, 0.01, 0, 0.01, 0, 0, 0.05}, "a load"), ModelError);
  EXPECT_THROW(to_text(sound, "ur-script", {.transition_time = -1.0}), InputError);
  try {
    to_text(sound, "kukka");
    ADD_FAILURE() << "a form that does not exist";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("'kukka'; expected one of ur-script, ur-ros2"));
  }
}

}  // namespace
}  // namespace heft::exchange

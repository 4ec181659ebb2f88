/// The whole way in simulation: a log of an arm with an effect that nobody declared, its diagnosis, and the
/// tracking that the found effect buys.
#include <cmath>
#include <cstdint>
#include <iostream>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heft/host/file.hpp"
#include "support/run_heft.hpp"

namespace heft {
namespace {

using Json = nlohmann::json;
using test::Outcome;
using ::testing::ElementsAre;

constexpr std::size_t kJoints = 4;
/// Share of the tracking error that has to go.
constexpr double kLeastGain = 0.4;

/// Sums of sines in every joint, within the SCARA's limits: joints creep through their reversals
/// and are quick between them.
Json fourier_motion(std::uint64_t seed, int harmonics) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> phase(0.0, 2.0 * std::numbers::pi), share(0.6, 1.0);
  const std::vector<double> reach = {0.8, 0.8, 0.04, 1.2};  // [rad, m]
  Json amplitude = Json::array(), frequency = Json::array(), phases = Json::array();
  for (std::size_t j = 0; j < kJoints; ++j) {
    std::vector<double> a, f, p;
    for (int k = 1; k <= harmonics; ++k) {
      a.push_back(reach[j] * share(random) / k);
      f.push_back(0.1 * (k + 0.1 * static_cast<double>(j)));
      p.push_back(phase(random));
    }
    amplitude.push_back(a), frequency.push_back(f), phases.push_back(p);
  }
  return {{"kind", "fourier"},      {"q0", {0.2, 0.9, 0.1, 0.0}},
          {"amplitude", amplitude}, {"frequency_hz", frequency},
          {"phase", phases},        {"ramp", 1.5}};
}

/// A SCARA whose URDF knows neither the gripper that it carries, nor its friction, nor one effect.
class ClosedLoop : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string urdf = host::read_file(HEFT_URDF_DIR "/scara.urdf", "URDF");
    const auto replace = [&](const std::string& from, const std::string& to) {
      ASSERT_NE(urdf.find(from), std::string::npos) << from;
      urdf.replace(urdf.find(from), from.size(), to);
    };
    replace(R"(<mass value="0.25"/>)", R"(<mass value="1.5"/>)");
    replace(R"(ixx="0.000064583" ixy="0" ixz="0" iyy="0.000064583" iyz="0" izz="0.0001125")",
            R"(ixx="0.012" ixy="0" ixz="0" iyy="0.015" iyz="0" izz="0.02")");
    folder_.write("arm.urdf", urdf);
  }

  std::string path(const std::string& name) const { return folder_.path(name); }

  Json scenario(const Json& effect, std::uint64_t seed, double duration, int harmonics) const {
    return {{"robot", "arm.urdf"},
            {"duration", duration},
            {"sample_rate", 1000},
            {"log_rate", 200},
            {"seed", seed},
            {"reference", fourier_motion(seed, harmonics)},
            {"friction", {{"coulomb", {4.0, 2.0, 12.0, 0.15}}, {"viscous", {2.0, 1.0, 40.0, 0.05}}}},
            {"sensors",
             {{"encoder_resolution", {2e-5, 2e-5, 2e-6, 2e-5}}, {"torque_noise", {0.15, 0.1, 0.5, 0.02}}}},
            {"effects", {effect}}};
  }

  void simulate(const std::string& name, Json scenario) const {
    scenario["controller"] = {
        {"kind", "pd_gravity"}, {"kp", {3000, 1500, 20000, 50}}, {"kd", {150, 80, 900, 2}}};
    folder_.write(name + ".json", scenario.dump());
    succeed({"simulate", "--scenario", path(name + ".json"), "-o", path(name + ".csv")});
  }

  /// RMS error of computed torque along a motion that neither log holds, when it believes a model [rad, m].
  std::vector<double> tracking_error(const Json& effect, const std::string& model) const {
    Json motion = scenario(effect, 3, 10.0, 3);
    // Half of it leaves a limit cycle on the falling branch of Stribeck friction, whatever is fed forward.
    motion["controller"] = {{"kind", "track"}, {"bandwidth_hz", 6}};
    folder_.write("motion.json", motion.dump());
    const Outcome tracked = succeed(
        {"track", "--scenario", path("motion.json"), "--model", path(model), "--from", "1.5", "--json", "-"});
    if (tracked.exit_code != 0) return std::vector<double>(kJoints, std::nan(""));
    const Json controller = Json::parse(tracked.out).at("controllers").at(2);
    EXPECT_EQ(controller.at("controller"), "computed torque, nominal");
    return controller.at("rms_error");
  }

  /// Logs, fit without the effect, diagnosis, and tracking with either model.
  void close(const Json& effect) const {
    simulate("train", scenario(effect, 1, 24.0, 4));
    simulate("validate", scenario(effect, 2, 16.0, 4));
    const std::vector<std::string> logs = {"--urdf",          "scara",      "--log",
                                           path("train.csv"), "--validate", path("validate.csv")};
    std::vector<std::string> identify = {"identify", "--method", "physical", "-o", path("before.json")};
    identify.insert(identify.end(), logs.begin(), logs.end());
    succeed(identify);
    std::vector<std::string> diagnose = {"diagnose", "-o", path("after.json"), "--json", path("d.json")};
    diagnose.insert(diagnose.end(), logs.begin(), logs.end());
    succeed(diagnose);
    if (HasFailure()) return;

    const Json found = Json::parse(host::read_file(path("d.json"), "result"));
    std::vector<Json> named;
    for (const Json& one : found.at("effects")) named.push_back({one.at("kind"), one.at("joint")});
    EXPECT_THAT(named, ElementsAre(Json{effect.at("kind"), effect.at("joint")})) << found.at("verdict");

    // A fit that bends bodies and friction to an effect may track worse than the effect alone explains. What
    // feeding forward buys shows against the diagnosed model without its effects.
    Json without = Json::parse(host::read_file(path("after.json"), "model"));
    without.erase("effects");
    folder_.write("without.json", without.dump());

    const std::size_t joint = effect.at("joint").get<std::size_t>() - 1;
    const std::vector<double> after = tracking_error(effect, "after.json");
    record("after", after, joint);
    for (const char* model : {"before", "without"}) {
      const std::vector<double> error = tracking_error(effect, model + std::string(".json"));
      record(model, error, joint);
      EXPECT_LT(after.at(joint), (1.0 - kLeastGain) * error.at(joint)) << model;
      EXPECT_LT(overall(after), (1.0 - kLeastGain) * overall(error)) << model;
    }
  }

 private:
  static Outcome succeed(const std::vector<std::string>& arguments) {
    Outcome outcome = test::run_heft(arguments);
    EXPECT_EQ(outcome.exit_code, 0) << arguments.front() << ": " << outcome.err;
    return outcome;
  }
  static double overall(const std::vector<double>& rms) {
    double squares = 0.0;
    for (const double value : rms) squares += value * value;
    return std::sqrt(squares / static_cast<double>(rms.size()));
  }
  static void record(const std::string& model, const std::vector<double>& rms, std::size_t joint) {
    const std::string figures = std::to_string(1e3 * rms.at(joint)) + " mrad at the joint, " +
                                std::to_string(1e3 * overall(rms)) + " over all";
    RecordProperty(model, figures);
    std::cout << "tracking error, " << model << ": " << figures << '\n';
  }

  test::TemporaryFolder folder_;
};

TEST_F(ClosedLoop, TracksBetterOnceStribeckFrictionIsFound) {
  close({{"kind", "stribeck"}, {"joint", 2}, {"Fs", 3.0}, {"vs", 0.2}});
}

TEST_F(ClosedLoop, TracksBetterOnceTorqueRippleIsFound) {
  close({{"kind", "ripple"}, {"joint", 1}, {"A", 4.0}, {"n", 12}, {"phase", 0.5}});
}

TEST_F(ClosedLoop, TracksBetterOnceASpringIsFound) {
  close({{"kind", "spring"}, {"joint", 2}, {"k", 12.0}, {"q0", 0.4}});
}

}  // namespace
}  // namespace heft

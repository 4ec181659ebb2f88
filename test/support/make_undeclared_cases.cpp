/// @file
/// Writes simulated cases with undeclared effects into folders, to be looked at and to be diagnosed by hand.
#include <array>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "heft/data/log.hpp"
#include "heft/host/file.hpp"
#include "support/undeclared_case.hpp"

namespace {

using heft::test::UndeclaredCase;
using heft::test::UndeclaredEffect;
using Json = nlohmann::ordered_json;

Json list(const Eigen::VectorXd& v) { return std::vector<double>(v.data(), v.data() + v.size()); }

Json effect_json(const UndeclaredEffect& e, const UndeclaredCase& c) {
  Json json;
  json["kind"] = e.kind;
  json["joint"] = e.joint >= 0 ? Json(e.joint + 1) : Json(nullptr);
  if (e.kind == "wrist_coupling") {
    json["joint"] = 5;
    json["joints"] = {5, 6};
  } else {
    json["joints"] = e.joint >= 0 ? Json::array({e.joint + 1}) : Json::array();
  }
  if (!e.variant.empty() && e.kind == "offset") json["variant"] = e.variant;
  Json parameters(Json::value_t::object);
  for (const auto& [name, value] : e.parameters) parameters[name] = value;
  if (e.kind == "payload_change") {
    parameters["com"] = e.com;
    parameters["event"] = e.variant;
  }
  for (const heft::test::ContactEvent& event : e.events) {
    parameters["events"].push_back({{"log", "train"},
                                    {"t0", event.start},
                                    {"duration", event.duration},
                                    {"force", {event.force.x(), event.force.y(), event.force.z()}}});
  }
  json["parameters"] = parameters;
  json["main_joint"] = e.main_joint + 1;
  json["excess_over_noise"] = c.excess[e.main_joint];
  json["excess_over_noise_train"] = c.excess_train[e.main_joint];
  return json;
}

Json truth_json(const UndeclaredCase& c) {
  Json json;
  const int n = c.robot.num_joints();
  json["case"] = c.name;
  json["robot"] = c.arm;
  json["joints"] = n;
  json["rate_hz"] = c.rate;
  json["has_qd"] = c.has_qd;
  json["gravity"] = c.robot.gravity;
  json["train_seconds"] = static_cast<double>(c.train.time.size()) / c.rate;
  json["validate_seconds"] = static_cast<double>(c.validate.time.size()) / c.rate;
  json["kind"] = c.kind;
  json["joint"] = nullptr;
  json["effects"] = Json::array();
  bool hard = false;
  for (const UndeclaredEffect& e : c.effects) {
    json["effects"].push_back(effect_json(e, c));
    hard = hard || (e.kind == "contact" ? c.excess_train : c.excess)[e.main_joint] < 0.9;
  }
  if (!c.effects.empty()) json["joint"] = json["effects"][0]["joint"];
  json["hard"] = hard;
  json["fraction_scored"] = c.kind != "none" && c.kind != "outside";
  json["noise_floor_rmse"] = list(c.noise_floor);
  json["baseline_validate_rmse"] = list(c.baseline_validate);
  json["baseline_train_rmse"] = list(c.baseline_train);
  std::vector<double> coulomb, viscous;
  for (const heft::model::RobotJoint& joint : c.truth.joints) {
    coulomb.push_back(joint.actuation.coulomb_friction);
    viscous.push_back(joint.actuation.viscous_friction);
  }
  json["declared_friction"] = {{"coulomb", coulomb}, {"viscous", viscous}};
  for (const heft::model::RobotJoint& joint : c.truth.joints) {
    json["true_link_parameters"].push_back(std::vector<double>(joint.link.begin(), joint.link.end()));
  }
  return json;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Writes simulated cases with undeclared effects: robot.urdf, train.csv, validate.csv, truth.json.");
  std::string out, kind, arm;
  std::vector<std::uint64_t> seeds;
  bool work = false;
  std::array<double, 3> gravity{0.0, 0.0, -9.81};
  app.add_option("OUT", out, "Folder for the cases")->required();
  app.add_option("--kind", kind, "One kind, or several with a plus between; all without it");
  app.add_option("--arm", arm, "scara4, arm6, arm7, heavy6, desk6, gantry5 or polar6; the first three without it");
  app.add_option("--seeds", seeds, "First and last seed")->expected(2)->required();
  app.add_flag("--work", work, "The arm goes from pose to pose with rests, in place of exciting motion");
  app.add_option("--gravity", gravity, "In the frame of the base [m/s²]: 9.81 0 0 for a wall, 0 0 9.81 for a ceiling");
  CLI11_PARSE(app, argc, argv);
  std::vector<std::string> kinds{kind};
  if (kind.empty()) {
    kinds = heft::test::undeclared_kinds();
    kinds.emplace_back("none");
    for (const std::string& outside : heft::test::outside_kinds()) kinds.push_back(outside);
  }
  const std::vector<std::string> arms =
      arm.empty() ? heft::test::undeclared_arms() : std::vector<std::string>{arm};
  try {
    for (std::uint64_t seed = seeds[0]; seed <= seeds[1]; ++seed) {
      for (const std::string& k : kinds) {
        for (const std::string& a : arms) {
          if (k.find("wrist_coupling") != std::string::npos && (a == "scara4" || a == "gantry5")) continue;
          const auto start = std::chrono::steady_clock::now();
          const UndeclaredCase c = heft::test::make_undeclared_case(
              k, a, seed, work ? heft::test::CaseMotion::kWork : heft::test::CaseMotion::kExciting, gravity);
          const std::filesystem::path folder = std::filesystem::path(out) / c.name;
          std::filesystem::create_directories(folder);
          heft::host::write_file_atomically((folder / "robot.urdf").string(), c.urdf);
          heft::data::write_log((folder / "train.csv").string(), c.train);
          heft::data::write_log((folder / "validate.csv").string(), c.validate);
          heft::host::write_file_atomically((folder / "truth.json").string(), truth_json(c).dump(1) + "\n");
          std::string line = fmt::format("{:<36} {:4.0f} Hz", c.name, c.rate);
          for (const UndeclaredEffect& e : c.effects) {
            line += fmt::format("  joint {} excess {:.2f} train {:.2f}", e.main_joint + 1,
                                c.excess[e.main_joint], c.excess_train[e.main_joint]);
            for (const auto& [name, value] : e.parameters) line += fmt::format(" {}={:.4g}", name, value);
          }
          line += fmt::format("  others {:.2f}", c.excess.maxCoeff());
          line += fmt::format(
              "  {:.1f} s", std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
          std::puts(line.c_str());
          std::fflush(stdout);
        }
      }
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "make_undeclared_cases: %s\n", error.what());
    return 1;
  }
  return 0;
}

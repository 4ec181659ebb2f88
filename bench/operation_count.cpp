// What one sample of the control loop costs, counted by running the production templates with a scalar that counts.
// `operation_count [--json FILE]`
#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "heft/host/file.hpp"
#include "operation_count.hpp"

namespace heft::bench {
namespace {

/// Prints what a facade costs.
nlohmann::ordered_json facade(const char* words, const Result& result) {
  const double n = static_cast<double>(result.count);
  const auto mean = [&](std::int64_t v) { return static_cast<double>(v) / n; };
  fmt::print("{}, {} joints: {:.0f} mul, {:.0f} add, {:.1f} div, {:.1f} trig; worst {} mul, {} add{}\n",
             words, kN, mean(result.total.mul), mean(result.total.add), mean(result.total.div),
             mean(result.total.trig), result.worst.mul, result.worst.add,
             result.same_numbers ? "" : "   NOT THE SAME NUMBERS AS DOUBLE");
  nlohmann::ordered_json stages;
  for (const auto& [stage, cost] : result.stages) {
    stages[stage] = as_json(cost, n);
  }
  return {{"mean", as_json(result.total, n)},
          {"worst_sample", as_json(result.worst, 1)},
          {"stages", stages},
          {"same_numbers_as_double", result.same_numbers}};
}

nlohmann::ordered_json document(int k, int parameters, const std::vector<Result>& results) {
  nlohmann::ordered_json forms = nlohmann::ordered_json::array();
  for (const Result& r : results) {
    const double n = static_cast<double>(r.count);
    nlohmann::ordered_json stages;
    for (const auto& [stage, cost] : r.stages) {
      stages[stage] = as_json(cost, n);
    }
    forms.push_back({{"form", r.form},
                     {"method", r.least_squares ? "least squares" : "instrumental variables"},
                     {"shared_forward_pass", r.shared},
                     {"solve_every", r.form == "information" ? kSolveEvery : 1},
                     {"mean", as_json(r.total, n)},
                     {"worst_sample", as_json(r.worst, 1)},
                     {"stages", stages},
                     {"difference_to_batch", r.batch_difference},
                     {"same_numbers_as_double", r.same_numbers}});
  }
  return {{"arm", "terminal-link-6r"},
          {"k", k},
          {"parameters", parameters},
          {"publication", {{"mul", 1800}, {"add", 1500}}},
          {"forms", forms}};
}

void print(int k, int parameters, const std::vector<Result>& results) {
  fmt::print("\nk = {}, {} parameters{}\n", k, parameters,
             k == 5 ? "   (Kawasaki and Nishimura, 1984: about 1800 multiplications, 1500 additions)" : "");
  fmt::print("  {:<12} {:<6} {:<8} {:>8} {:>8} {:>6} {:>6} {:>6}   {:>10} {:>10}   {}\n", "form", "method",
             "forward", "mul", "add", "div", "sqrt", "trig", "worst mul", "worst add", "against batch");
  for (const Result& r : results) {
    const double n = static_cast<double>(r.count);
    const auto mean = [&](std::int64_t v) { return static_cast<double>(v) / n; };
    fmt::print(
        "  {:<12} {:<6} {:<8} {:>8.1f} {:>8.1f} {:>6.1f} {:>6.2f} {:>6.1f}   {:>10} {:>10}   {:.1e}{}\n",
        r.form, r.least_squares ? "LS" : "IV", r.shared ? "shared" : "own", mean(r.total.mul),
        mean(r.total.add), mean(r.total.div), mean(r.total.sqrt), mean(r.total.trig), r.worst.mul,
        r.worst.add, r.batch_difference, r.same_numbers ? "" : "   NOT THE SAME NUMBERS AS DOUBLE");
  }
  if (k == 5) {
    for (const Result& r : results) {
      const double n = static_cast<double>(r.count);
      std::string line;
      for (const auto& [stage, cost] : r.stages) {
        line += fmt::format("  {} {:.0f}/{:.0f}", stage, static_cast<double>(cost.mul) / n,
                            static_cast<double>(cost.add) / n);
      }
      fmt::print("    {} {}{}:{}\n", r.form, r.least_squares ? "LS" : "IV", r.shared ? " shared" : "", line);
    }
  }
}

int main_with(const std::string& json_path) {
  fmt::print(
      "Operations a sample, arm of Kawasaki and Nishimura (1984), counted by running the production code.\n"
      "Information form: solve every {} samples, its cost included. Means are over steady state, worst "
      "samples\n"
      "over the whole run, start-up and hand-over included. Outlier gate on. A sine or cosine counts as one "
      "trig\n"
      "call; core's own polynomials need 10 multiplications and 9 additions for each.\n",
      kSolveEvery);
  nlohmann::ordered_json by_k = nlohmann::ordered_json::array();
  nlohmann::ordered_json main_document;
  for (const int k : {5, 6, 4, 3, 2, 1}) {
    const std::vector<Result> results = estimator_forms(k);
    print(k, estimator_parameters(k), results);
    by_k.push_back(document(k, estimator_parameters(k), results));
  }
  main_document = by_k.front();
  const OperationCount torque = computed_torque_cost();
  fmt::print(
      "\ncomputed torque of the controller (nominal torque, all six joints): {} mul, {} add, {} trig\n",
      torque.mul, torque.add, torque.trig);
  main_document["control_sample"] =
      facade("\none sample of a loop that follows its load (LoadObserver, a row a sample, and ArmTorque)",
             control_sample(false));
  main_document["watched_sample"] =
      facade("the same with ContactMonitor on the torque that the observer explains", control_sample(true));
  main_document["terminal_link_controller"] =
      facade("one cycle of TerminalLinkController, k = 5, a sample of its estimator every five",
             controller_sample());
  main_document["adaptive_controller"] =
      facade("one cycle of AdaptiveController, geometry of run time", adaptive_sample());
  main_document["arm_estimating_controller"] =
      facade("one cycle of ArmEstimatingController", arm_estimating_sample());
  main_document["directional_least_squares"] =
      facade("one sample of DirectionalLeastSquares, 12 parameters", directional_sample());
  main_document["extended_kalman_filter"] = facade("one sample of ExtendedKalmanFilter", extended_sample());
  main_document["unscented_kalman_filter"] = facade("one sample of UnscentedKalmanFilter", unscented_sample());
  main_document["nominal_torque"] = as_json(torque, 1);
  const OperationCount contacts = monitor_cost();
  fmt::print("contact monitor by itself, worst sample (all six joints): {} mul, {} add, {} trig\n",
             contacts.mul, contacts.add, contacts.trig);
  main_document["contact_monitor"] = as_json(contacts, 1);
  main_document["all_k"] = by_k;
  if (!json_path.empty()) {
    host::write_file_atomically(json_path, main_document.dump(2) + "\n");
  }
  return 0;
}

}  // namespace
}  // namespace heft::bench

int main(int argc, char** argv) {
  std::string json;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--json") == 0 && i + 1 < argc) {
      json = argv[++i];
    } else {
      fmt::print(stderr, "usage: operation_count [--json FILE]\n");
      return 2;
    }
  }
  try {
    return heft::bench::main_with(json);
  } catch (const std::exception& error) {
    fmt::print(stderr, "operation_count: {}\n", error.what());
    return 1;
  }
}

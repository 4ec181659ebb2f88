#include "heft/report/motion.hpp"

#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "host/json.hpp"
#include "page_lines.hpp"
#include "safety_words.hpp"

namespace heft::report {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// The same motion as a scenario of `simulate` states it: q0 + Σ A sin(2π f t + φ).
nlohmann::ordered_json scenario_reference(const excite::ExcitationTrajectory& motion) {
  // a (1 − cos kωt) / kω + b sin kωt / kω = a / kω + A sin(kωt + φ) with A sin φ = −a / kω, A cos φ = b / kω
  const Index n = motion.num_joints(), K = motion.num_harmonics();
  VectorXd q0 = motion.start;
  MatrixXd amplitude(n, K), frequency(n, K), phase(n, K);
  for (Index k = 0; k < K; ++k) {
    const double f = static_cast<double>(k + 1) / motion.period, w = 2.0 * std::numbers::pi * f;
    for (Index j = 0; j < n; ++j) {
      const double a = motion.sine(j, k) / w, b = motion.cosine(j, k) / w;
      q0[j] += a;
      amplitude(j, k) = std::hypot(a, b);
      phase(j, k) = std::atan2(-a, b);
      frequency(j, k) = f;
    }
  }
  return {{"kind", "fourier"},
          {"q0", host::json_array(q0)},
          {"amplitude", rows_of(amplitude)},
          {"frequency_hz", rows_of(frequency)},
          {"phase", rows_of(phase)}};
}

page::Table parameter_table(const excite::ExcitationDesign& design, const excite::ExcitationScore& score) {
  page::Table table({"parameter", "unit", "present value", "expected std", "% of value"});
  const VectorXd values = design.values();
  for (Index i = 0; i < score.std.size(); ++i) {
    const auto k = static_cast<std::size_t>(i);
    const double share = score.std[i] / std::abs(values[i]);
    table.add_row({design.names()[k], design.units()[k], page::number(values[i], 4),
                   page::number(score.std[i], 3), share < 10.0 ? percent_text(share) : "–"});
  }
  return table;
}

page::PlotSpec history_plot(const excite::Excitation& design, const std::string& label) {
  page::PlotSpec spec;
  spec.title = "Cost along the best search";
  spec.x_label = "iteration";
  spec.y_label = label;
  page::Series series{"", {}, {}};
  for (std::size_t i = 0; i < design.history.size(); ++i) {
    series.x.push_back(static_cast<double>(i));
    series.y.push_back(design.history[i]);
  }
  spec.series.push_back(std::move(series));
  return spec;
}

double less(double value, double reference) { return 100.0 * (1.0 - value / reference); }

std::string scaling_text(const excite::ExcitingMotion& motion) {
  return fmt::format("columns scaled to norm 1, rows {}",
                     motion.design->options().weights != excite::RowWeights::kUnit
                         ? "over the torque noise of their joint"
                         : "as they are");
}

std::string noise_text(const excite::ExcitingMotion& motion) {
  using Noise = excite::ExcitingMotion::Noise;
  switch (motion.noise) {
    case Noise::kStated: return "white torque noise as the limits file states it";
    case Noise::kShareOfLimits:
      return fmt::format("white torque noise of {:g} % of each torque limit", motion.noise_percent);
    case Noise::kOne: break;
  }
  return "white torque noise of 1 N·m (N), for want of torque limits";
}

std::string parameters_text(const excite::ExcitingMotion& motion) {
  const excite::ExcitationOptions& options = motion.design->options();
  if (options.payload_only) return "of the last link alone, the arm being known";
  const regression::ModelStructure& structure = options.structure;
  return fmt::format("base parameters of rigid bodies{}{}{}", structure.rotor_inertia ? ", rotors" : "",
                     structure.coulomb ? ", Coulomb and viscous friction" : "",
                     structure.offset ? ", offsets" : "");
}

std::string std_text(const excite::ExcitingMotion& motion) {
  return fmt::format("for {} and a row every {:g} ms", noise_text(motion),
                     1e3 / motion.design->options().sample_rate);
}

std::string random_text(const excite::ExcitingMotion& motion) {
  const excite::RandomMotions& random = *motion.random;
  return fmt::format(
      "{} random motions inside the same limits{}: median condition number {}, standard deviation {}: this "
      "one has {} % less",
      random.count, motion.given.empty() ? "" : ", with the given logs", page::number(random.condition, 3),
      page::number(random.mean_std, 3),
      page::number(less(motion.excitation.score.mean_std, random.mean_std), 3));
}

std::string about(const excite::ExcitationTrajectory& motion) {
  return fmt::format("{:g} s, {} harmonics of {:g} s", motion.duration, motion.num_harmonics(),
                     motion.period);
}

std::string reasons_text(const host::Judgement& judgement) {
  std::string text;
  for (const std::string& reason : judgement.reasons) text += reason + ".\n";
  return text;
}

}  // namespace

std::string brief(const excite::ExcitingMotion& motion) {
  return fmt::format("{} parameters at a condition number of {}.", motion.design->num_parameters(),
                     page::number(motion.excitation.score.condition, 3));
}

std::string full(const excite::ExcitingMotion& motion) {
  const excite::ExcitationScore& score = motion.excitation.score;
  std::string text = fmt::format(
      "{}: {}, at rest at both ends\n"
      "{} parameters: {}{}\n"
      "Condition number {}: {}; {} with unweighted rows\n"
      "log det F {}; expected standard deviation {} (geometric mean), {}\n",
      motion.robot.name, about(motion.excitation.trajectory), motion.design->num_parameters(),
      parameters_text(motion),
      motion.given.empty()
          ? ""
          : fmt::format("; {} log{} given", motion.given.size(), motion.given.size() == 1 ? "" : "s"),
      page::number(score.condition, 3), scaling_text(motion), page::number(score.condition_unit_rows, 3),
      page::number(score.log_det, 4), page::number(score.mean_std, 3), std_text(motion));
  const auto before = motion.design->given_score();
  if (!motion.given.empty() && before) {
    text += fmt::format("The given logs alone: condition number {}, standard deviation {}: {} % less now\n",
                        page::number(before->condition, 3), page::number(before->mean_std, 3),
                        page::number(less(score.mean_std, before->mean_std), 3));
  } else if (!motion.given.empty()) {
    text += "The given logs alone do not determine all of them\n";
  }
  if (motion.random) text += random_text(motion) + '\n';
  text += reasons_text(motion.judgement) + safety_text(motion);
  text += fmt::format("Limits with {:g} % to spare; nearest: {}\n{}", 100.0 * motion.limits.margin,
                      motion.use.worst, limit_table(motion).to_text(2));
  return text;
}

std::string json(const excite::ExcitingMotion& motion) {
  const excite::ExcitationTrajectory& trajectory = motion.excitation.trajectory;
  const excite::ExcitationScore& score = motion.excitation.score;
  const excite::ExcitationDesign& design = *motion.design;
  nlohmann::ordered_json json{
      {"robot", motion.robot.name},
      {"duration", trajectory.duration},
      {"period", trajectory.period},
      {"harmonics", trajectory.num_harmonics()},
      {"cost",
       motion.design->options().cost == excite::ExcitationCost::kCondition ? "condition" : "d-optimal"},
      {"seed", design.options().seed},
      {"parameters", nlohmann::ordered_json::array()},
      {"columns", parameters_text(motion)},
      {"condition_number", host::number_or_null(score.condition)},
      {"condition_number_scaling", scaling_text(motion)},
      {"condition_number_unweighted_rows", host::number_or_null(score.condition_unit_rows)},
      {"log_det", host::number_or_null(score.log_det)},
      {"torque_noise", host::json_array(design.torque_noise())},
      {"sample_rate", design.options().sample_rate},
      {"std_geometric_mean", host::number_or_null(score.mean_std)},
      {"std_principal_axes_geometric_mean", host::number_or_null(score.volume_std)}};
  const VectorXd values = design.values();
  for (Index i = 0; i < score.std.size(); ++i) {
    const auto k = static_cast<std::size_t>(i);
    json["parameters"].push_back({{"name", design.names()[k]},
                                  {"expression", design.expressions()[k]},
                                  {"unit", design.units()[k]},
                                  {"value", values[i]},
                                  {"std", host::number_or_null(score.std[i])}});
  }
  if (!motion.given.empty()) {
    const auto before = motion.design->given_score();
    json["given"] = {{"logs", motion.given},
                     {"condition_number", before ? host::number_or_null(before->condition) : nullptr},
                     {"std_geometric_mean", before ? host::number_or_null(before->mean_std) : nullptr}};
  }
  if (motion.random) {
    const excite::RandomMotions& random = *motion.random;
    json["random"] = {{"count", random.count},
                      {"median_condition_number", host::number_or_null(random.condition)},
                      {"median_std_geometric_mean", host::number_or_null(random.mean_std)},
                      {"median_std_principal_axes_geometric_mean", host::number_or_null(random.volume_std)},
                      {"std_reduction_percent", host::number_or_null(less(score.mean_std, random.mean_std))},
                      {"std_principal_axes_reduction_percent",
                       host::number_or_null(less(score.volume_std, random.volume_std))}};
  }
  add_safety(motion, json);
  json["trajectory"] = {{"start", host::json_array(trajectory.start)},
                        {"sine", rows_of(trajectory.sine)},
                        {"cosine", rows_of(trajectory.cosine)},
                        {"reference", scenario_reference(trajectory)}};
  const std::vector<double>& costs = motion.excitation.costs;
  json["costs_of_starts"] =
      host::json_array(Eigen::Map<const VectorXd>(costs.data(), static_cast<Index>(costs.size())));
  json["history"] = motion.excitation.history;
  return json.dump(2);
}

page::Page page(const excite::ExcitingMotion& motion) {
  const excite::ExcitationScore& score = motion.excitation.score;
  page::Page page = page::new_page(fmt::format("{}: exciting motion", motion.robot.name),
                                   about(motion.excitation.trajectory));
  page.verdict(brief(motion), tone_of(motion));
  for (const std::string& reason : motion.judgement.reasons) page.paragraph(reason + ".");
  page.facts(
      {{"condition number", page::number(score.condition, 3), scaling_text(motion)},
       {"expected standard deviation", page::number(score.mean_std, 3), "geometric mean over the parameters"},
       {"smallest distance between links",
        std::isfinite(motion.use.link_distance) ? page::number(1e3 * motion.use.link_distance, 3) + " mm"
                                                : "–",
        motion.use.closest_links},
       {"largest tool speed", page::number(motion.use.tool_speed, 3) + " m/s",
        std::isfinite(motion.limits.tool_speed) ? fmt::format("limit {:g} m/s", motion.limits.tool_speed)
                                                : std::string("no limit")},
       {"margin", fmt::format("{:g} %", 100.0 * motion.limits.margin), "nearest: " + motion.use.worst}});
  page.paragraph(fmt::format("Parameters: {}. Standard deviations {}. {}", parameters_text(motion),
                             std_text(motion), motion.random ? random_text(motion) + "." : ""));
  add_safety(motion, page);
  page.heading("Search");
  page.plot(
      history_plot(motion.excitation, motion.design->options().cost == excite::ExcitationCost::kCondition
                                          ? "log condition number"
                                          : "−log det F / 2b"));
  page.heading("Parameters");
  page.table(parameter_table(*motion.design, score), "Present values are those of the robot's description.");
  return page;
}

namespace {

page::Table stroke_table(const excite::FrictionMotion& motion) {
  page::Table table({"joint", "speed [rad/s, m/s]", "from [rad, m]", "to", "begin [s]", "end [s]"});
  for (const excite::Stroke& stroke : motion.strokes) {
    table.add_row({std::to_string(stroke.joint + 1), page::number(stroke.speed, 3),
                   page::number(stroke.from, 3), page::number(stroke.to, 3),
                   fmt::format("{:.2f}", stroke.begin), fmt::format("{:.2f}", stroke.end)});
  }
  return table;
}

std::string strokes_in_words(const excite::FrictionMotion& motion) {
  return fmt::format("{} strokes at constant speed, both ways, joint by joint", motion.strokes.size());
}

}  // namespace

std::string brief(const excite::FrictionMotion& motion) { return strokes_in_words(motion) + "."; }

std::string full(const excite::FrictionMotion& motion) {
  std::string text = fmt::format("{}: {}, {:.4g} s\n{}{}", motion.robot.name, strokes_in_words(motion),
                                 motion.path.duration(), reasons_text(motion.judgement), safety_text(motion));
  text += fmt::format("Limits with {:g} % to spare; nearest: {}\n{}\nConstant speeds:\n{}",
                      100.0 * motion.limits.margin, motion.use.worst, limit_table(motion).to_text(2),
                      stroke_table(motion).to_text(2));
  return text;
}

std::string json(const excite::FrictionMotion& motion) {
  nlohmann::ordered_json json{{"robot", motion.robot.name},
                              {"for", "friction"},
                              {"duration", motion.path.duration()},
                              {"pose", host::json_array(motion.pose)},
                              {"strokes", nlohmann::ordered_json::array()}};
  for (const excite::Stroke& stroke : motion.strokes) {
    json["strokes"].push_back({{"joint", stroke.joint + 1},
                               {"speed", stroke.speed},
                               {"begin", stroke.begin},
                               {"end", stroke.end},
                               {"from", stroke.from},
                               {"to", stroke.to}});
  }
  add_safety(motion, json);
  return json.dump(2);
}

page::Page page(const excite::FrictionMotion& motion) {
  page::Page page = page::new_page(fmt::format("{}: strokes for friction", motion.robot.name),
                                   fmt::format("{:.4g} s", motion.path.duration()));
  page.verdict(brief(motion), tone_of(motion));
  for (const std::string& reason : motion.judgement.reasons) page.paragraph(reason + ".");
  page.table(stroke_table(motion), "Stretches at constant speed");
  add_safety(motion, page);
  return page;
}

}  // namespace heft::report

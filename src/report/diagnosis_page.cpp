#include "diagnosis_result.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <tuple>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "heft/host/words.hpp"
#include "heft/statistics/binned_means.hpp"
#include "heft/statistics/spectrum.hpp"
#include "page_lines.hpp"
#include "torque_score.hpp"

namespace heft::report {
namespace {

using diagnose::Diagnosis;
using diagnose::Finding;
using diagnose::Traces;
using Eigen::Index;
using page::number;

bool usable(const Traces& traces, int joint) {
  return traces.time.size() > 1 && traces.before.rows() == traces.time.size() &&
         traces.after.rows() == traces.time.size() && joint < traces.before.cols() &&
         joint < traces.after.cols();
}

/// What shows on training logs alone.
bool is_event(EffectKind effect) { return effect.is<Contact>() || effect.is<PayloadChange>(); }

double rate_of(const Traces& traces) {
  const double mean = static_cast<double>(traces.time.size() - 1) / (traces.time[traces.time.size() - 1] - traces.time[0]);
  const double first = 1.0 / (traces.time[1] - traces.time[0]);
  return first < 1.01 * mean ? mean : first;  // rows that a gap reaches are missing
}

/// The rows of logs that no gap reaches.
std::vector<Traces> outside_gaps(std::vector<Traces> logs) {
  for (Traces& log : logs) {
    if (log.in_gap.size() == 0 || log.in_gap.maxCoeff() == 0.0) continue;
    std::vector<Index> rows;
    for (Index i = 0; i < log.in_gap.size(); ++i) {
      if (log.in_gap[i] == 0.0) rows.push_back(i);
    }
    for (Eigen::VectorXd* values : {&log.time, &log.in_gap}) *values = (*values)(rows).eval();
    for (Eigen::MatrixXd* values : {&log.q, &log.qd, &log.before, &log.after}) *values = (*values)(rows, Eigen::all).eval();
  }
  return logs;
}

/// One column of every log, one after the other.
Eigen::VectorXd joined(const std::vector<const Traces*>& logs, const Eigen::MatrixXd Traces::*matrix,
                       int joint) {
  Index rows = 0;
  for (const Traces* log : logs) rows += (log->*matrix).rows();
  Eigen::VectorXd all(rows);
  rows = 0;
  for (const Traces* log : logs) {
    all.segment(rows, (log->*matrix).rows()) = (log->*matrix).col(joint);
    rows += (log->*matrix).rows();
  }
  return all;
}

/// Mean over a sliding window of some samples.
Eigen::VectorXd sliding_mean(const Eigen::VectorXd& values, Index window) {
  Eigen::VectorXd sums(values.size() + 1);
  sums[0] = 0.0;
  for (Index i = 0; i < values.size(); ++i) sums[i + 1] = sums[i] + values[i];
  return Eigen::VectorXd::NullaryExpr(values.size(), [&](Index i) {
    const Index from = std::max<Index>(0, i - window / 2), to = std::min(values.size(), i + window / 2 + 1);
    return (sums[to] - sums[from]) / static_cast<double>(to - from);
  });
}

/// Window of the residual over time [s].
constexpr double kWindow = 0.02;

page::PlotSpec over_time(const Traces& log, int joint, const std::string& unit) {
  page::PlotSpec spec;
  spec.title = "Over time";
  spec.x_label = "time [s]";
  spec.y_label = fmt::format("residual [{}]", unit);
  // The ends, which count nowhere, stay out; a spike at a reversal may leave the drawing.
  const Index end =
      std::min<Index>(log.time.size() / 4, static_cast<Index>(validate::kScoreEnd * rate_of(log)));
  const Index rows = log.time.size() - 2 * end;
  const auto window = static_cast<Index>(kWindow * rate_of(log));
  const Eigen::VectorXd time = log.time.segment(end, rows);
  double reach = 0.0;
  for (const auto& [label, residual, hue] :
       {std::tuple{"before", &log.before, kBefore}, std::tuple{"after", &log.after, kAfter}}) {
    const Eigen::VectorXd mean = sliding_mean(residual->col(joint), window).segment(end, rows);
    spec.series.push_back(page::line(label, time, mean, hue));
    Eigen::VectorXd size = mean.cwiseAbs();
    const auto high = size.begin() + static_cast<Index>(0.997 * static_cast<double>(rows));
    std::nth_element(size.begin(), high, size.end());
    reach = std::max(reach, 1.25 * *high);
  }
  if (reach > 0.0) spec.y_range = {-reach, reach};
  return spec;
}

page::PlotSpec over_bins(const std::string& title, const std::string& x_label, const Eigen::VectorXd& x,
                         const Eigen::VectorXd& before, const Eigen::VectorXd& after,
                         const std::string& unit) {
  Eigen::MatrixXd both(before.size(), 2);
  both << before, after;
  const statistics::BinnedMeans bins = statistics::binned_means(x, both);
  page::PlotSpec spec;
  spec.title = title;
  spec.x_label = x_label;
  spec.y_label = fmt::format("mean residual [{}]", unit);
  spec.series = {page::line("before", bins.x, bins.means.col(0), kBefore),
                 page::line("after", bins.x, bins.means.col(1), kAfter)};
  return spec;
}

page::PlotSpec spectrum(const Traces& log, int joint, const std::string& unit) {
  page::PlotSpec spec;
  spec.title = "Spectrum";
  spec.x_label = "frequency [Hz]";
  spec.y_label = fmt::format("amplitude density [{}/√Hz]", unit);
  spec.log_x = spec.log_y = true;
  const double rate = rate_of(log);
  const statistics::AmplitudeDensity before = statistics::amplitude_density(log.before.col(joint), rate),
                                     after = statistics::amplitude_density(log.after.col(joint), rate);
  spec.series = {page::line("before", before.frequency, before.density, kBefore),
                 page::line("after", after.frequency, after.density, kAfter)};
  return spec;
}

/// Without an effect what is shown is one model: one curve, without a legend.
void leave_one_curve(const Diagnosis& diagnosis, page::PlotSpec& spec) {
  if (!diagnosis.findings.empty() || spec.series.size() < 2) return;
  spec.series.erase(spec.series.begin());
  spec.series.front().label.clear();
}

/// Moments of an event and the log that they are of; no log: the first.
struct EventMarks {
  std::vector<page::Mark> marks;
  std::string log;
};

/// Residual of a joint before and after: over time, against velocity and position, its spectrum.
void add_joint(page::Page& page, const Diagnosis& diagnosis, const std::string& title,
               const std::vector<Traces>& traces, int joint, bool prismatic, const EventMarks& events) {
  std::vector<const Traces*> logs;
  for (const Traces& log : traces) {
    if (usable(log, joint)) logs.push_back(&log);
  }
  if (logs.empty()) return;
  const std::string unit = prismatic ? "N" : "N·m", length = prismatic ? "m" : "rad";
  const Eigen::VectorXd before = joined(logs, &Traces::before, joint),
                        after = joined(logs, &Traces::after, joint);
  const auto own =
      std::find_if(logs.begin(), logs.end(), [&](const Traces* log) { return log->log == events.log; });
  const Traces& over = own != logs.end() ? **own : *logs.front();
  std::vector<page::PlotSpec> plots{over_time(over, joint, unit)};
  if (logs.size() > 1)
    plots.front().title += " (" + std::filesystem::path(over.log).filename().string() + ")";
  plots.front().marks = events.marks;
  plots.push_back(over_bins("Against velocity", fmt::format("velocity [{}/s]", length),
                            joined(logs, &Traces::qd, joint), before, after, unit));
  plots.push_back(over_bins("Against position", fmt::format("position [{}]", length),
                            joined(logs, &Traces::q, joint), before, after, unit));
  plots.push_back(spectrum(*logs.front(), joint, unit));
  for (page::PlotSpec& plot : plots) leave_one_curve(diagnosis, plot);
  page.plots(title, small(std::move(plots)));
}

/// Joint with the largest error that is left, as a share of its torque; -1: not known.
int worst_joint(const Diagnosis& diagnosis) {
  const validate::Score& score = diagnosis.validate_after;
  const Eigen::VectorXd& percent = score.band > 0.0 ? score.in_band_percent_of_max : score.percent_of_max;
  if (percent.size() == 0) return -1;
  Index worst = 0;
  percent.maxCoeff(&worst);
  return static_cast<int>(worst);
}

EventMarks marks_of(const Finding& finding) {
  EventMarks events;
  std::vector<page::Mark>& marks = events.marks;
  if (!finding.event_logs.empty()) events.log = finding.event_logs.front();
  for (std::size_t k = 0; k < finding.events.size(); ++k) {
    if (k < finding.event_logs.size() && finding.event_logs[k] != events.log) continue;
    marks.push_back({page::Mark::Direction::kVertical, finding.events[k].first, k == 0 ? "contact" : ""});
  }
  for (const auto& [name, value] : finding.parameters) {
    if (finding.effect.is<PayloadChange>() && name == "time")
      marks.push_back({page::Mark::Direction::kVertical, value, "load changes"});
  }
  return events;
}

/// @param train, validate  without the rows that a gap reaches
void add_residuals(page::Page& page, const Diagnosis& diagnosis, const std::vector<Traces>& train,
                   const std::vector<Traces>& validate) {
  const model::Robot& robot = diagnosis.after;
  const auto prismatic = [&](int j) { return torque_unit(robot, j) == "N"; };
  const auto log_name = [](const std::vector<Traces>& traces, const char* what) {
    return fmt::format("{} log{}", what, traces.size() > 1 ? "s" : "");
  };
  struct Shown {
    std::string why;
    bool training;
    EventMarks events;
  };
  std::map<int, Shown> shown;  // in the order of the joints
  const auto show = [&](int joint, const std::string& why, bool training, const EventMarks& events) {
    if (joint >= 0 && joint < robot.num_joints()) shown.try_emplace(joint, Shown{why, training, events});
  };
  page.heading("Residuals");
  page.paragraph(
      fmt::format("Measured minus predicted torque{}. So that noise drops out, means are drawn: over {:g} ms "
                  "of time, over samples "
                  "of about the same velocity, position, frequency.",
                  diagnosis.findings.empty()
                      ? " of the model without effects"
                      : ". Before: rigid bodies, Coulomb and viscous friction. After: with the effects",
                  1e3 * kWindow));
  for (const diagnose::NotExplained& u : diagnosis.not_explained)
    show(u.joint, "not explained by the arm model", false, {});
  for (const Finding& finding : diagnosis.findings) {
    const int joint = finding.joint >= 0 ? finding.joint : finding.main_joint;
    std::vector<std::string> names;
    for (const Finding& other : diagnosis.findings) {
      if ((other.joint >= 0 ? other.joint : other.main_joint) == joint)
        names.push_back(effect_name(other.effect));
    }
    show(joint, fmt::format("{}", fmt::join(names, ", ")), is_event(finding.effect), marks_of(finding));
  }
  for (const diagnose::Unexplained& u : diagnosis.unexplained)
    show(u.joint, "unexplained: " + u.what, false, {});
  show(worst_joint(diagnosis), "the largest error left", false, {});
  for (const auto& [joint, what] : shown) {
    const std::vector<Traces>& traces = what.training ? train : validate;
    add_joint(page, diagnosis,
              fmt::format("Joint {}: {} ({})", joint + 1, what.why,
                          log_name(traces, what.training ? "training" : "validation")),
              traces, joint, prismatic(joint), what.events);
  }
  std::vector<page::PlotSpec> others;
  for (int j = 0; j < robot.num_joints(); ++j) {
    if (shown.contains(j)) continue;
    if (validate.empty() || !usable(validate.front(), j)) continue;
    others.push_back(over_time(validate.front(), j, torque_unit(robot, j)));
    others.back().title = fmt::format("Joint {}", j + 1);
    leave_one_curve(diagnosis, others.back());
  }
  page.plots("The other joints (validation log)", small(std::move(others)));
}

/// Column of a matrix, each value the mean of some samples.
std::vector<double> means(const Eigen::Ref<const Eigen::VectorXd>& values, Index samples) {
  std::vector<double> out;
  for (Index from = 0; from < values.size(); from += samples)
    out.push_back(values.segment(from, std::min(samples, values.size() - from)).mean());
  return out;
}

/// The residuals of each log, before and after, thinned to about as many rows as a plot has pixels.
void add_files(page::Page& page, bool one_model, const std::vector<Traces>& train, const std::vector<Traces>& validate) {
  constexpr Index kMostRows = 1500;
  for (const auto* logs : {&train, &validate}) {
    for (const Traces& log : *logs) {
      const Index rows = log.time.size(), samples = std::max<Index>(1, (rows + kMostRows - 1) / kMostRows);
      if (log.after.rows() != rows || log.before.rows() != rows) continue;
      page::DataFile file = residual_file(log.log, samples);
      file.columns.push_back({"time", {}});
      for (Index k = 0; k < rows; k += samples) file.columns.back().values.push_back(log.time[k]);
      for (Index j = 0; j < log.after.cols(); ++j) {
        const std::string name = fmt::format("residual{}", j + 1);
        if (!one_model) file.columns.push_back({name + "_before", means(log.before.col(j), samples)});
        file.columns.push_back({one_model ? name : name + "_after", means(log.after.col(j), samples)});
      }
      page.file(file);
    }
  }
}

/// Error on the validation logs as a share of each joint's torque.
void add_bars(page::Page& page, const Diagnosis& diagnosis) {
  const validate::Score &before = diagnosis.validate_identified, &after = diagnosis.validate_after;
  if (before.percent_of_max.size() == 0 || before.percent_of_max.size() != after.percent_of_max.size())
    return;
  page::PlotSpec spec;
  spec.title = "Validation error of each joint, unfiltered";
  spec.y_label = "RMSE [% of the joint's largest torque]";
  spec.height = 210;
  for (Index j = 0; j < before.percent_of_max.size(); ++j)
    spec.categories.push_back(fmt::format("joint {}", j + 1));
  const auto heights = [](const Eigen::VectorXd& v) { return std::vector<double>(v.begin(), v.end()); };
  spec.series = {page::bars("identified", heights(before.percent_of_max), kBefore),
                 page::bars("diagnosed", heights(after.percent_of_max), kAfter)};
  leave_one_curve(diagnosis, spec);
  page.plot(spec);
}

std::vector<page::Fact> facts_of(const Diagnosis& diagnosis) {
  std::vector<page::Fact> facts;
  facts.push_back({"effects found", fmt::format("{}", diagnosis.findings.size()),
                   fmt::format("{} candidates tried", diagnosis.candidates)});
  const int best = most_improved_joint(diagnosis);
  if (!diagnosis.findings.empty() && best >= 0) {
    const double from = diagnosis.validate_identified.rmse[best], to = diagnosis.validate_after.rmse[best];
    facts.push_back(
        {fmt::format("validation error, joint {}", best + 1), change_percent(from, to),
         fmt::format("{} → {} {}", number(from, 3), number(to, 3), torque_unit(diagnosis.after, best))});
  }
  const validate::Score& after = diagnosis.validate_after;
  if (after.percent_of_max.size() > 0) {
    facts.push_back({"error left, mean of the joints", number(after.percent_of_max.mean(), 2) + " %",
                     "of the joint's largest torque, unfiltered"});
  }
  facts.push_back(
      {"unexplained",
       diagnosis.unexplained.empty() ? "nothing" : fmt::format("{}", diagnosis.unexplained.size()),
       "above noise"});
  return facts;
}

/// The effects with their terms and their evidence.
void add_effects(page::Page& page, const Diagnosis& diagnosis) {
  if (diagnosis.findings.empty()) return;
  page.heading("What is missing");
  page::Table effects({"", "effect", "term", "parameters", "motion that shows it"});
  int rank = 0;
  for (const Finding* effect : by_kind(diagnosis)) {
    const Finding& finding = *effect;
    const char* where = finding.left_out.empty() ? "" : " (not in the model written)";
    effects.add_row({fmt::format("{}", ++rank), host::capital(finding_in_place(diagnosis, finding)) + where,
                     effect_equation(finding), parameters_in_words(finding, diagnosis.after),
                     shown_by(finding)});
  }
  page.table(effects);
  page.table(ranking_table(diagnosis, diagnosis.after),
             "±: 95 % intervals. Evidence: p and ΔBIC account for residuals correlated in time and for all candidates tried; "
             "blocks not fitted: fall of the error in cross-validation.");
  if (const page::Table table = moved_by_joint_table(diagnosis); !table.rows().empty())
    page.table(table, "What they move, by joint: torque over the training motion");
  if (const page::Table table = moved_by_kind_table(diagnosis); !table.rows().empty())
    page.table(
        table,
        "What they move, by kind; gear: values that strain-wave joints of this size do not have (other gears may)");
}

void add_unexplained(page::Page& page, const Diagnosis& diagnosis) {
  if (diagnosis.unexplained.empty()) return;
  page.heading("Unexplained");
  page::Table table({"joint", "what is left", "evidence"});
  for (const diagnose::Unexplained& u : diagnosis.unexplained) {
    table.add_row({u.joint < 0 ? "–" : fmt::format("{}", u.joint + 1), u.what, evidence_in_words(u)});
  }
  page.table(table);
}

void add_ceiling(page::Page& page, const Diagnosis& diagnosis) {
  if (diagnosis.ceilings.empty()) return;
  page.heading("What could be explained");
  page.plot(ceiling_bars(diagnosis));
  page.table(
      ceiling_table(diagnosis),
      "Validation. Explainable is what functions of no particular form, of position, velocity, acceleration, load "
      "and what the joint did a moment before, explain on stretches that they were not fitted to: at least that much. "
      "They are a measure of what is left, and in no model.");
  page.paragraph(ceiling_in_words(diagnosis));
}

void add_errors(page::Page& page, const Diagnosis& diagnosis) {
  page.heading("Given, identified, diagnosed");
  if (diagnosis.validate_after.rmse.size() > 0) {
    const model::Robot& robot = diagnosis.after;
    page.table(models_table(diagnosis.validate_given, diagnosis.validate_identified, diagnosis.validate_after,
                            robot),
               "Validation, not seen by the fit. " + models_in_words() + " " +
                   score_meaning(diagnosis.validate_after));
    const std::size_t logs =
        std::min(diagnosis.validate_each_identified.size(), diagnosis.validate_each_after.size());
    for (std::size_t k = 0; logs > 1 && k < logs; ++k) {
      page.table(models_table(diagnosis.validate_each_given[k], diagnosis.validate_each_identified[k],
                              diagnosis.validate_each_after[k], robot),
                 file_name_of(diagnosis.validate_each_after[k].log));
    }
    page.table(models_table(diagnosis.train_given, diagnosis.train_identified, diagnosis.train_after, robot),
               "Training.");
    if (diagnosis.validate_torque.rmse_in_band.size() > 0) page.paragraph(relative_error_in_words(diagnosis));
  }
  for (const std::string& line : errors_that_rise(diagnosis)) page.note("Worse: " + line);
}

void add_refusals(page::Page& page, const Diagnosis& diagnosis) {
  constexpr std::size_t kMost = 20;
  if (diagnosis.refusals.empty()) return;
  page.heading("Refused");
  page.table(
      refusal_table(diagnosis, kMost),
      fmt::format("{} of {} that were considered and not taken; share of the joint's squared error that each "
                  "would have explained",
                  std::min(kMost, diagnosis.refusals.size()), diagnosis.refusals.size()));
}

}  // namespace

page::Page page(const Diagnosis& diagnosis, const DiagnosisContext& context) {
  page::Page page = page::new_page(fmt::format("{}: diagnosis", diagnosis.after.name),
                                   fmt::format("trained on {}; judged on {}", file_names_of(context.train),
                                               file_names_of(context.validate)));
  for (const auto* logs : {&diagnosis.train, &diagnosis.validate}) {
    for (const Traces& log : *logs) {
      if (log.time.size() < 2) continue;
      add_log_line(page,
                   {log.log, rate_of(log), log.time[log.time.size() - 1] - log.time[0], diagnosis.cutoff});
    }
  }
  page.verdict(brief(diagnosis), judgement_of(diagnosis, context));
  page.facts(facts_of(diagnosis));
  add_bars(page, diagnosis);
  add_effects(page, diagnosis);
  add_ceiling(page, diagnosis);
  add_unexplained(page, diagnosis);
  const std::vector<Traces> train = outside_gaps(diagnosis.train), validate = outside_gaps(diagnosis.validate);
  add_residuals(page, diagnosis, train, validate);
  add_files(page, diagnosis.findings.empty(), train, validate);
  add_curves(page, diagnosis);
  add_errors(page, diagnosis);
  add_refusals(page, diagnosis);
  page.heading("Again");
  page.preformatted(context.command);
  page.paragraph(fmt::format(
      "The search reads positions through a zero-phase low-pass of {}; {:.1f} s of training motion.",
      cutoff_in_words(diagnosis), diagnosis.seconds));
  for (const std::string& line : diagnosis.notes) page.note(line);
  return page;
}

}  // namespace heft::report

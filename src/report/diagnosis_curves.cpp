// Curves of each joint in the page of a diagnosis: friction, the loop at reversals, the residual over position and velocity.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "diagnosis_result.hpp"
#include "torque_score.hpp"

namespace heft::report {
namespace {

using diagnose::Diagnosis;
using diagnose::JointCurves;

page::PlotSpec curve(const std::string& title, const std::string& x_label, const std::string& unit,
                     const JointCurves::Curve& of) {
  page::PlotSpec spec;
  spec.title = title;
  spec.x_label = x_label;
  spec.y_label = fmt::format("torque beside the rigid bodies [{}]", unit);
  spec.series = {page::band("measured, 95 %", of.x, of.low, of.high, page::Hue::kNeutral),
                 page::line("measured", of.x, of.measured, page::Hue::kNeutral),
                 page::line("before", of.x, of.before, kBefore), page::line("after", of.x, of.after, kAfter)};
  return spec;
}

page::MapSpec map_of(const JointCurves& curves, int joint, const std::string& length,
                     const std::string& unit) {
  page::MapSpec spec;
  spec.title = fmt::format("Joint {}: size of the mean residual after", joint + 1);
  spec.x_label = fmt::format("position [{}]", length);
  spec.y_label = fmt::format("velocity [{}/s]", length);
  spec.value_label = unit;
  spec.x = curves.position;
  spec.y = curves.velocity;
  spec.values = curves.residual.cwiseAbs();
  spec.height = 300;
  double largest = 0.0;
  for (const double v : spec.values.reshaped()) {
    if (std::isfinite(v)) largest = std::max(largest, v);
  }
  constexpr int kLevels = 6;
  for (int k = 1; k < kLevels; ++k) spec.levels.push_back(largest * k / kLevels);
  return spec;
}

}  // namespace

void add_curves(page::Page& page, const Diagnosis& diagnosis) {
  if (diagnosis.curves.empty()) return;
  page.heading("Friction, reversals and what is left (validation)");
  page.paragraph(
      "What the measured torque holds beside that of the rigid bodies of the model after: means over velocity, and over "
      "the way since the joint turned back, along the direction after the turn. The maps show how large the mean residual "
      "of the model after is: dark where it is small, or where the motion never was.");
  for (std::size_t j = 0; j < diagnosis.curves.size(); ++j) {
    const JointCurves& curves = diagnosis.curves[j];
    const auto joint = static_cast<int>(j);
    const std::string unit = torque_unit(diagnosis.after, joint), length = unit == "N" ? "m" : "rad";
    std::vector<page::PlotSpec> plots;
    if (curves.friction.x.size() > 1)
      plots.push_back(curve("Friction", fmt::format("velocity [{}/s]", length), unit, curves.friction));
    if (curves.reversal.x.size() > 1)
      plots.push_back(
          curve("Around reversals", fmt::format("way since the turn [{}]", length), unit, curves.reversal));
    page.plots(fmt::format("Joint {}", j + 1), small(std::move(plots)));
    if (!curves.position.empty()) page.plot(map_of(curves, joint, length, unit));
  }
}

}  // namespace heft::report

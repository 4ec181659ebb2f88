/// @file
/// How well controllers track a motion: one scenario of the simulator under several of them, side by side.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/host/verdict.hpp"
#include "heft/model/model_file.hpp"
#include "heft/sim/scenario.hpp"
#include "heft/track/controllers.hpp"

namespace heft::track {

struct Options {
  /// The arm that the controllers believe in, effects included; absent: the scenario's robot and friction, without load and
  /// effects.
  std::optional<model::ModelFile> model;
  double from{0.0};                        ///< errors count from here on [s]
  std::function<void(double)> progress{};  ///< called with 0..1; may be empty
};

/// One controller's motion.
struct Run {
  std::string name;      ///< "PD"
  Eigen::VectorXd time;  ///< samples [s]
  Eigen::MatrixXd
      error;  ///< reference minus position, samples × joints [rad, m]; of the link where the joint is elastic
  Eigen::MatrixXd torque;  ///< samples × joints [N·m, N]; may be empty

  /// Root mean square error over samples and joints.
  double rms() const;
};

/// A load taken up or put down.
struct LoadEvent {
  double time{0.0};  ///< [s]
  bool grasp{true};
};

/// A comparison. Runs are in the order of Method.
struct Tracking {
  std::string scenario;  ///< its file
  std::string robot;
  double duration{0.0};     ///< [s]
  double sample_rate{0.0};  ///< [Hz]
  double from{0.0};         ///< errors count from here on [s]
  ControllerSettings settings;
  int model_effects{0};  ///< effects, elastic joints and gear couplings that the controllers know of

  std::vector<Run> runs;     ///< whole
  std::vector<Run> counted;  ///< from `from` on
  double settled{0.0};       ///< 1 s after the last load event [s]
  std::vector<Run> after;    ///< from `settled` on; empty without load events
  std::vector<LoadEvent> events;

  LoadTrace load;            ///< the estimate of Method::kEstimated
  double true_mass{0.0};     ///< of the load at the end [kg]
  double largest_mass{0.0};  ///< of the loads of the scenario [kg]

  /// By the mass against the truth, and by the tracking with the estimated load against that with nominal values.
  host::Judgement judgement;
  std::vector<std::string> notes;  ///< what a user should know besides

  /// The estimate at the end [kg]; NaN: the motion did not determine it.
  double mass() const;
  double mass_half_width() const;
  /// The runs that the judgement is about.
  const std::vector<Run>& judged() const { return after.empty() ? counted : after; }
  bool usable() const { return judgement.usable(); }
};

/// Runs the scenario under PD, PD with gravity, computed torque with nominal values, computed torque with the load that is
/// estimated while the arm moves, and adaptive control of the load, all with the same bandwidth. A controller of kind "track"
/// in the scenario sets what they share.
///
/// @throws ModelError for a scenario without reference, settings outside their ranges, a model of another robot
Tracking track(const sim::Scenario& scenario, const Options& options = {});

}  // namespace heft::track

/// @file
/// How well controllers track a motion: one scenario of the simulator under several of them, side by side.
#pragma once

#include <cstdint>
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

/// How wrong the controllers' arm is: masses, centres of mass and friction of every link and joint, each by a share of its own,
/// drawn uniformly from `least` to `most`, of either sign.
struct WrongModel {
  double least{0.1}, most{0.3};  ///< 0 ≤ least ≤ most < 1
  std::uint64_t seed{1};
  /// Root mean square of the shares: what ControllerSettings::doubt is then.
  double doubt() const;
};

struct Options {
  /// The arm that the controllers believe in, effects included; absent: the scenario's robot and friction, without load and
  /// effects.
  std::optional<model::ModelFile> model;
  /// Makes the nominal arm of the controllers wrong. Two controllers join the others: computed torque with the arm as it was
  /// before (Method::kIdentified), and with links, friction and load estimated (Method::kArmEstimated).
  std::optional<WrongModel> wrong;
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
  /// Distance of the tool (the robot's tip) from where the reference has it, samples [m]; may be empty.
  Eigen::VectorXd tool_error{};

  /// Root mean square error over samples and joints.
  double rms() const;
  /// Largest error of a joint.
  double peak() const;
  /// Root mean square and largest error of the tool [m]; NaN without.
  double tool_rms() const;
  double tool_peak() const;
};

/// A load taken up or put down.
struct LoadEvent {
  double time{0.0};  ///< [s]
  bool grasp{true};
};

/// A comparison. Runs are in the order of Method, as far as a method takes part.
struct Tracking {
  std::string scenario;  ///< its file
  std::string robot;
  double duration{0.0};     ///< [s]
  double sample_rate{0.0};  ///< [Hz]
  double from{0.0};         ///< errors count from here on [s]
  ControllerSettings settings;
  std::optional<WrongModel> wrong;
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
  const Run& judged(Method method) const { return judged()[static_cast<std::size_t>(method)]; }
  /// Computed torque with what is estimated: the load, or the arm where it is wrong.
  Method estimating() const { return wrong ? Method::kArmEstimated : Method::kEstimated; }
  bool usable() const { return judgement.usable(); }
};

/// Runs the scenario under PD, PD with gravity, computed torque with nominal values, computed torque with the load that is
/// estimated while the arm moves, and adaptive control of the load, all with the same bandwidth. A controller of kind "track"
/// in the scenario sets what they share.
///
/// @throws ModelError for a scenario without reference, settings outside their ranges, a model of another robot
Tracking track(const sim::Scenario& scenario, const Options& options = {});

/// One scenario with several loads.
struct LoadComparison {
  std::vector<double> masses;      ///< [kg]
  std::vector<Tracking> tracking;  ///< one a mass
  host::Judgement judgement;       ///< of all
  bool usable() const { return judgement.usable(); }
};

/// The same for each of these masses in the place of that of every load that the scenario grasps; its inertia grows with the
/// mass, and with mass zero nothing is grasped.
///
/// @throws ModelError as track(), and for a scenario without a grasp, no mass or a negative one
LoadComparison compare_loads(const sim::Scenario& scenario, const std::vector<double>& masses,
                             const Options& options = {});

}  // namespace heft::track

/// @file
/// What a payload estimation gives, and how it is shown: text, JSON, page.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>

#include "heft/host/verdict.hpp"
#include "heft/page/page.hpp"
#include "tracking_runs.hpp"

namespace heft::report {

/// Estimated numbers of one kind. NaN deviation: not identifiable.
struct Estimate {
  Eigen::VectorXd value;
  Eigen::VectorXd std;  ///< standard deviations
  std::vector<bool> identifiable;
  Eigen::VectorXd half_width{};  ///< of the 95 % interval; empty: statistics::kNormal95 standard deviations
};

/// The load's mass jumped.
struct MassChange {
  double time{0.0};                                              ///< [s]
  double mass{0.0};                                              ///< new mass of the load [kg]
  double mass_before{std::numeric_limits<double>::quiet_NaN()};  ///< [kg]
  double std{std::numeric_limits<double>::quiet_NaN()};          ///< of `mass` [kg]
};

/// Mass found on a log without load.
struct ZeroCheck {
  std::string log;
  double mass{0.0};        ///< [kg]
  double std{0.0};         ///< [kg]
  double half_width{0.0};  ///< of its 95 % interval [kg]
};

/// A share of a standard deviation.
struct StdPart {
  std::string source;
  double std{0.0};
};

/// A payload run over one log.
struct PayloadResult {
  std::string robot;
  std::string log;
  int rows{0};  ///< k: the lowest joint whose torque is used
  int samples{0};
  Estimate mass;                   ///< 1 [kg]
  Estimate first_moment;           ///< 3, in the flange frame [kg·m]; empty: not shown
  Estimate com;                    ///< 3, in the flange frame [m]
  host::Judgement judgement;       ///< how far to trust it
  bool contradicts_itself{false};  ///< no load can be what was found
  Estimate torque_scale;  ///< a joint: what it feels of the load against all joints together; may be empty
  Estimate inertia;       ///< 6: Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the flange frame [kg·m²]
  std::optional<double> converged_at;  ///< [s]
  std::vector<MassChange> changes;
  std::optional<double> true_mass;  ///< where it is known, for marks in plots [kg]
  /// Torque error per joint without and with the load found [N·m, N]; empty when not computed.
  Eigen::VectorXd rmse_before, rmse_after;
  Eigen::VectorXd rmse_after_friction;                      ///< with the friction found as well; may be empty
  Eigen::VectorXd rmse_in_band_before, rmse_in_band_after;  ///< may be empty
  double band{0.0};                                         ///< of the latter [Hz]
  std::string rmse_meaning;                                 ///< sentence that defines them
  std::string frame;                                        ///< "the frame of tool0"; empty: the flange frame
  std::string missing;  ///< why the mass is not told, and what motion would; may be empty
  double cutoff{0.0};   ///< of the causal low-pass [Hz]; 0: not stated
  bool has_model_covariance{true};
  std::vector<StdPart> mass_std_parts;  ///< where the mass' standard deviation comes from; may be empty
  int blocks{0};                        ///< independent blocks behind the interval; 0: not stated
  double block_length{0.0};             ///< [s]
  std::vector<ZeroCheck> zero_checks;
  std::vector<std::string> notes;
  /// History for the plots: samples each.
  Eigen::VectorXd time, mass_history, mass_std_history;
};

/// Fields as the contract of the JSON results names them; more where there is more.
nlohmann::ordered_json to_json(const PayloadResult& result);
/// For the terminal.
std::string to_text(const PayloadResult& result);
/// One sentence: the mass with its interval, or why there is none.
std::string verdict_of(const PayloadResult& result);
/// Adds verdict, facts, plots and tables to a page.
void add_to(page::Page& page, const PayloadResult& result);

}  // namespace heft::report

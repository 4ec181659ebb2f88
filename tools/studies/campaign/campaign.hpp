/// @file
/// A simulated measuring campaign: an arm whose parameters are known, logs as a robot would give them, a model
/// identified from them, and the five acceptance criteria judged on it.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/data/log.hpp"
#include "heft/host/verdict.hpp"
#include "heft/identify/fit.hpp"
#include "heft/identify/fit_record.hpp"
#include "heft/model/model_file.hpp"
#include "heft/model/robot.hpp"
#include "heft/validate/acceptance.hpp"
#include "heft/validate/score.hpp"
#include "heft/validate/torque_trace.hpp"

namespace heft::studies {

/// Settings of a campaign.
struct CampaignSettings {
  model::Robot nominal;          ///< as its URDF has it: links are taken from here, actuation is not
  std::uint64_t seed{1};         ///< of the true arm, the motions and the noise
  int repeats{10};               ///< experiments without load, same motion, other noise
  double duration{20.0};         ///< of one experiment [s]
  double sample_rate{1000.0};    ///< [Hz]
  double position_noise{0.001};  ///< standard deviation of an encoder reading [rad, m]
  double torque_noise{0.5};      ///< standard deviation of a reported torque [N·m, N]
  /// Loads that experiments are made with [kg]; the first is none.
  std::vector<double> payloads{0.0, 2.0, 5.0, 10.0};
  double identified_payload{5.0}, judged_payload{8.0};  ///< [kg]
  bool traces{false};  ///< keep torque over time on the motion judged on, for plots
};

/// One experiment.
struct Experiment {
  std::string name;       ///< "exciting-0kg-1"
  bool exciting{true};    ///< the motion trained on; false: the one judged on
  double payload{0.0};    ///< [kg]
  std::uint64_t seed{0};  ///< of its noise
  data::Log log;
};

/// Closed loop with one model.
struct TrackingResult {
  std::string name;
  Eigen::VectorXd time;
  Eigen::MatrixXd error;  ///< reference minus true position, rows × n [rad, m]
  Eigen::VectorXd rms;    ///< n
  double total() const { return rms.norm(); }
};

/// Score of the model identified with one load, on the other motion with the same or another load.
struct PayloadScore {
  double trained{0.0}, judged{0.0};  ///< [kg]
  validate::Score score;
};

struct CampaignResult {
  model::Robot truth;      ///< without load
  model::Robot datasheet;  ///< URDF links, drives as the data sheet has them
  std::vector<Experiment> experiments;
  identify::Fit fit;                                   ///< of the first experiment without load
  Eigen::VectorXd beta_true, shares, errors, scatter;  ///< b
  identify::CountedParameters counted;
  validate::Score holdout;                     ///< of `fit` on the motion judged on
  std::optional<validate::TorqueTrace> trace;  ///< of the same, if asked for
  std::vector<PayloadScore> payloads;
  double load_difference_true{0.0}, load_difference{0.0}, load_difference_std{0.0};  ///< [kg]
  std::vector<TrackingResult> tracking;  ///< datasheet, identified, bare URDF
  std::vector<validate::Criterion> criteria;
  double condition{0.0};  ///< of the exciting motion, see excite::ExcitationScore

  /// One criterion missed is bad, one not judged doubtful.
  host::Judgement judgement() const { return validate::judge(criteria); }
  bool usable() const { return judgement().usable(); }
  /// The model identified without load.
  model::ModelFile model_file() const;
  /// The arm as it is in truth.
  model::ModelFile true_model_file() const;
};

/// The arm that is measured: links of the nominal one with mass, centre of mass and central inertia each off by
/// 10 to 25 %, up or down, with drives that are off from their data sheet likewise.
/// @param datasheet  out: the nominal links with the drives' data sheet; may be null
model::Robot perturbed_arm(const model::Robot& nominal, std::uint64_t seed,
                           model::Robot* datasheet = nullptr);

/// A load at the flange: an aluminium ball 30 mm in front of it, its centre 36 mm off the flange's axis. Parameters
/// about the last link's frame.
InertialParameters<double> campaign_load(const model::Robot& robot, double mass);

/// Runs everything on all processors.
/// @param progress  called with 0..1 and what is being done; may be empty
CampaignResult run_campaign(const CampaignSettings& settings,
                            const std::function<void(double, const std::string&)>& progress = {});

}  // namespace heft::studies

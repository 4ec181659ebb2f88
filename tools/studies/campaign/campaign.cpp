#include "campaign.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <random>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Core>

#include "heft/data/motion_stream.hpp"
#include "heft/excite/excitation_design.hpp"
#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"
#include "heft/host/parallel.hpp"
#include "heft/identify/fit_record.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/sim/simulator.hpp"
#include "heft/track/controllers.hpp"
#include "heft/validate/acceptance.hpp"

namespace heft::studies {
namespace {

using Eigen::Index;

/// Natural frequency of every position loop [Hz]. It closes on the encoder's noisy readings and on the drives' own
/// velocity, in experiments as in the tracking comparison.
constexpr double kBandwidthHz = 3.0;
/// Rows of joints slower than this are left to the judging: a joint that sticks takes any torque below its
/// friction [rad/s, m/s].
constexpr double kStandstillSpeed = 0.03;
/// Blend from rest into a motion, left out of tracking errors [s].
constexpr double kSettle = 1.0;

/// A designed motion as the simulator follows it.
class DesignedMotion : public sim::Reference {
 public:
  explicit DesignedMotion(excite::ExcitationTrajectory motion) : motion_(std::move(motion)) {}
  int num_joints() const override { return motion_.num_joints(); }
  void evaluate(double t, Eigen::Ref<Eigen::VectorXd> q, Eigen::Ref<Eigen::VectorXd> qd,
                Eigen::Ref<Eigen::VectorXd> qdd) const override {
    Eigen::VectorXd position, velocity, acceleration;
    motion_.evaluate(t, position, velocity, acceleration);
    q = position;
    qd = velocity;
    qdd = acceleration;
  }

 private:
  excite::ExcitationTrajectory motion_;
};

/// 1 plus or minus 10 to 25 %.
double off(std::mt19937_64& random) {
  const double size = std::uniform_real_distribution<double>(0.10, 0.25)(random);
  return std::bernoulli_distribution(0.5)(random) ? 1.0 + size : 1.0 - size;
}

InertialParameters<double> sum(const InertialParameters<double>& a, const InertialParameters<double>& b,
                               double factor = 1.0) {
  InertialParameters<double> result = a;
  for (std::size_t i = 0; i < result.size(); ++i) result[i] += factor * b[i];
  return result;
}

/// Mass, centre of mass and central inertia, each times its factor: a possible body stays possible.
InertialParameters<double> scaled(const InertialParameters<double>& link, double mass, double com,
                                  double inertia) {
  if (!(link[kMass] > 0)) return link;
  sim::Body body;
  body.mass = link[kMass];
  body.com = Eigen::Vector3d(link[kMcx], link[kMcy], link[kMcz]) / link[kMass];
  Eigen::Matrix3d about;
  about << link[kIxx], link[kIxy], link[kIxz], link[kIxy], link[kIyy], link[kIyz], link[kIxz], link[kIyz],
      link[kIzz];
  body.inertia = about - body.mass * (body.com.squaredNorm() * Eigen::Matrix3d::Identity() -
                                      body.com * body.com.transpose());
  body.mass *= mass;
  body.com *= com;
  body.inertia *= inertia;
  return sim::inertial_parameters(body);
}

model::Robot with_load(model::Robot robot, double mass) {
  if (mass > 0) robot.joints.back().link = sum(robot.joints.back().link, campaign_load(robot, mass));
  return robot;
}

/// What all experiments share.
struct Setup {
  const CampaignSettings* settings{nullptr};
  model::Robot truth, datasheet;
  std::shared_ptr<const sim::Reference> exciting, judged;
  Eigen::VectorXd inertia;  ///< that PD gains would be scaled with
};

/// Simulation of an arm under computed torque with these parameters along a motion.
sim::SimulationSettings loop_of(const Setup& setup, const model::Robot& arm, const model::Robot& believed,
                                const std::shared_ptr<const sim::Reference>& motion, std::uint64_t seed) {
  const CampaignSettings& settings = *setup.settings;
  const int n = arm.num_joints();
  track::ControllerSettings tracking;
  tracking.bandwidth_hz = kBandwidthHz;
  tracking.inertia = setup.inertia;
  tracking.torque_limit = sim::effort_limits_of(arm);
  sim::SimulationSettings simulation;
  simulation.robot = arm;
  simulation.duration = settings.duration;
  simulation.sample_rate = settings.sample_rate;
  simulation.initial_position.resize(n);
  Eigen::VectorXd qd(n), qdd(n);
  motion->evaluate(0.0, simulation.initial_position, qd, qdd);
  simulation.loads = sim::friction_of(arm);
  simulation.torque_limit = tracking.torque_limit;
  simulation.reference = motion;
  simulation.controller = track::make_controller(track::Method::kComputedTorque, believed, tracking);
  simulation.sensors.position_noise = Eigen::VectorXd::Constant(n, settings.position_noise);
  simulation.sensors.torque_noise = Eigen::VectorXd::Constant(n, settings.torque_noise);
  simulation.seed = seed;
  return simulation;
}

/// What a robot's own log would hold: time, position, torque.
data::Log measure(const Setup& setup, const Experiment& experiment) {
  sim::SimulationResult result =
      sim::simulate(loop_of(setup, with_load(setup.truth, experiment.payload), setup.datasheet,
                            experiment.exciting ? setup.exciting : setup.judged, experiment.seed));
  data::Log log;
  log.path = experiment.name;
  log.time = std::move(result.log.time);
  log.q = std::move(result.log.q);
  log.tau = std::move(result.log.tau);
  return log;
}

TrackingResult track(const Setup& setup, const std::string& name, const model::Robot& believed,
                     std::uint64_t seed) {
  const Index n = setup.truth.num_joints();
  sim::SimulationSettings simulation = loop_of(setup, setup.truth, believed, setup.judged, seed);
  simulation.log_truth = true;
  const sim::SimulationResult result = sim::simulate(simulation);
  Eigen::MatrixXd q_true(result.log.time.size(), n);
  for (Index j = 0; j < n; ++j) {
    const std::string column = fmt::format("q_true{}", j + 1);
    const auto found = std::find_if(result.log.extra.begin(), result.log.extra.end(),
                                    [&](const auto& extra) { return extra.first == column; });
    q_true.col(j) = found->second;
  }
  Index first = 0;
  while (first < result.log.time.size() && result.log.time[first] < kSettle) ++first;
  const Index rows = result.log.time.size() - first;
  TrackingResult tracking{name, result.log.time.tail(rows), (result.log.qref - q_true).bottomRows(rows), {}};
  tracking.rms = (tracking.error.colwise().squaredNorm() / static_cast<double>(rows)).cwiseSqrt();
  return tracking;
}

/// Mass that is on the last link in one fit and not in the other, by weighted least squares over all base
/// parameters: Δβ = G Δx with Δx the ten of the last link.
void find_load_difference(const identify::Fit& less, const identify::Fit& more, CampaignResult& result) {
  const int n = less.columns->num_joints();
  const Eigen::MatrixXd G = less.base.regrouping.middleCols(10 * (n - 1), 10);
  const Eigen::MatrixXd covariance = less.covariance + more.covariance;
  // Each parameter by its own standard deviation: a covariance from few blocks has no inverse.
  const Eigen::VectorXd weight = covariance.diagonal().cwiseSqrt().cwiseInverse();
  Eigen::MatrixXd A = weight.asDiagonal() * G;
  const Eigen::VectorXd scale = A.colwise().norm().cwiseMax(1e-12);
  A = A * scale.cwiseInverse().asDiagonal();
  const Eigen::MatrixXd inverse = pseudo_inverse(A) * weight.asDiagonal();
  const Eigen::RowVectorXd mass = inverse.row(0) / scale[0];
  result.load_difference = mass * (more.beta - less.beta);
  result.load_difference_std = std::sqrt((mass * covariance * mass.transpose()).value());
}

double worst_of(const Eigen::VectorXd& values, const std::vector<bool>& counted, Index* at) {
  double worst = kNaN;
  for (Index i = 0; i < values.size(); ++i) {
    if (!counted[static_cast<std::size_t>(i)]) continue;
    if (!(values[i] <= worst)) {
      worst = values[i];
      *at = i;
    }
  }
  return worst;
}

/// In band: the model's own error. The note gives it unfiltered, and how much of that the sensor's noise makes alone.
void judge_torque(validate::Criterion& criterion, const validate::Score& score,
                  const CampaignSettings& settings) {
  Index at = 0, raw_at = 0;
  validate::judge(criterion, score.in_band_percent_of_max.maxCoeff(&at));
  const double raw = score.percent_of_max.maxCoeff(&raw_at);
  criterion.notes.push_back(fmt::format(
      "worst: joint {}, band {:.3g} Hz; unfiltered {:.2f} % in joint {}, of which the torque sensor's own "
      "noise makes {:.2f} %",
      at + 1, score.band, raw, raw_at + 1, 100.0 * settings.torque_noise / score.max_torque[raw_at]));
}

/// Places in the list of criteria.
enum : std::size_t { kRecovery, kPrediction, kTracking, kPayload, kRepeatability };

/// The steps of a campaign. Each puts its part into the result; later ones use it.
class Campaign {
 public:
  using Progress = std::function<void(double, const std::string&)>;

  Campaign(const CampaignSettings& settings, const Progress& progress)
      : settings_(settings), progress_(progress) {
    setup_.settings = &settings_;
    setup_.truth = perturbed_arm(settings.nominal, settings.seed, &setup_.datasheet);
    result_.truth = setup_.truth;
    result_.datasheet = setup_.datasheet;
    result_.criteria = validate::acceptance_criteria();
  }

  CampaignResult run() {
    design_motions();
    plan_experiments();
    simulate_experiments();
    identify_models();
    judge_parameters();
    judge_prediction();
    judge_loads();
    judge_tracking();
    judge_repeatability();
    return std::move(result_);
  }

 private:
  void design_motions();
  void plan_experiments();
  std::size_t add_experiment(bool exciting, double payload, const std::string& name);
  void simulate_experiments();
  void identify_models();
  void judge_parameters();
  void note_parameters(Index worst);
  void judge_prediction();
  void judge_loads();
  void score_loads();
  void judge_tracking();
  void judge_repeatability();

  /// Progress of one step, which takes this part of the whole.
  std::function<void(double)> part(double from, double to, const std::string& what) const {
    if (!progress_) return {};
    return [this, from, to, what](double done) { progress_(from + done * (to - from), what); };
  }
  /// The model identified from the first experiment with this load.
  const identify::Fit& fit_with(double payload) const;
  std::string parameter_name(Index i) const {
    return result_.fit.base.name(*result_.fit.columns, static_cast<int>(i));
  }
  const data::Log& log_judged_on() const { return result_.experiments[judged_.front()].log; }
  bool counts(Index i) const { return result_.counted.counted[static_cast<std::size_t>(i)]; }

  const CampaignSettings& settings_;
  const Progress& progress_;
  Setup setup_;
  CampaignResult result_;
  // Places in the list of experiments.
  std::vector<std::size_t> trained_;  ///< each gives one of fits_; first settings_.repeats without load
  std::vector<std::size_t> judged_;   ///< one a load of the settings
  std::size_t judged_heavy_{0};       ///< with the load that the model was not identified with
  std::vector<identify::Fit> fits_;
};

// Designed for the heaviest load, so that limits hold with every one.
void Campaign::design_motions() {
  const double heaviest = std::max(settings_.judged_payload,
                                   *std::max_element(settings_.payloads.begin(), settings_.payloads.end()));
  const model::Robot loaded = with_load(setup_.datasheet, heaviest);
  excite::MotionLimits limits =
      excite::limits_of(loaded, {.full_turns = true,
                                 .tool_speed = std::numeric_limits<double>::infinity(),
                                 .shapes = {},
                                 .without_bodies = true});
  limits.margin = 0.2;  // the true arm needs more torque than the data sheet says
  excite::ExcitationOptions excitation;
  excitation.duration = settings_.duration;
  excitation.harmonics = static_cast<int>(std::lround(0.5 * settings_.duration));
  excitation.structure = {true, true, true, true, {}};
  excitation.starts = 4;
  excitation.finalists = 1;
  excitation.iterations = 60;
  excitation.seed = settings_.seed;
  const excite::Excitation excited =
      excite::ExcitationDesign(loaded, limits, excitation).optimize(part(0.0, 0.1, "designing motions"));
  result_.condition = excited.score.condition;
  setup_.exciting = std::make_shared<DesignedMotion>(excited.trajectory);
  excitation.seed = settings_.seed + 1000;
  setup_.judged = std::make_shared<DesignedMotion>(excite::ExcitationDesign(loaded, limits, excitation)
                                                       .optimize(part(0.1, 0.2, "designing motions"))
                                                       .trajectory);
  setup_.inertia = track::mean_inertia(setup_.datasheet, *setup_.exciting, settings_.duration);
}

std::size_t Campaign::add_experiment(bool exciting, double payload, const std::string& name) {
  const std::uint64_t noise = settings_.seed * 100 + result_.experiments.size() + 1;
  result_.experiments.push_back({name, exciting, payload, noise, {}});
  return result_.experiments.size() - 1;
}

void Campaign::plan_experiments() {
  std::vector<std::size_t> loads;
  for (int k = 0; k < settings_.repeats; ++k)
    trained_.push_back(add_experiment(true, 0.0, fmt::format("exciting-0kg-{}", k + 1)));
  for (const double payload : settings_.payloads) {
    if (payload > 0) loads.push_back(add_experiment(true, payload, fmt::format("exciting-{:g}kg", payload)));
    judged_.push_back(add_experiment(false, payload, fmt::format("judged-{:g}kg", payload)));
  }
  const double other = settings_.judged_payload;
  judged_heavy_ = add_experiment(false, other, fmt::format("judged-{:g}kg", other));
  loads.push_back(add_experiment(true, other, fmt::format("exciting-{:g}kg", other)));
  trained_.insert(trained_.end(), loads.begin(), loads.end());
}

void Campaign::simulate_experiments() {
  host::for_each_parallel(
      result_.experiments.size(),
      [&](std::size_t k) {
        Experiment& experiment = result_.experiments[k];
        experiment.log = measure(setup_, experiment);
      },
      part(0.2, 0.5, "simulating experiments"));
}

void Campaign::identify_models() {
  fits_.resize(trained_.size());
  host::for_each_parallel(
      trained_.size(),
      [&](std::size_t k) {
        const data::MotionStream stream(result_.experiments[trained_[k]].log);
        identify::FitOptions options;
        options.test_bias = k == 0;
        options.observation.standstill_speed = kStandstillSpeed;
        fits_[k] = identify::fit(settings_.nominal, {&stream}, options);
      },
      part(0.5, 0.85, "identifying"));
  result_.fit = fits_.front();
}

const identify::Fit& Campaign::fit_with(double payload) const {
  for (std::size_t k = 0; k < trained_.size(); ++k) {
    if (result_.experiments[trained_[k]].payload == payload) return fits_[k];
  }
  throw ModelError(
      fmt::format("campaign: no experiment with {} kg; expected one among the payloads", payload));
}

void Campaign::judge_parameters() {
  const identify::Fit& fit = result_.fit;
  result_.beta_true = fit.base.regrouping * fit.columns->values(setup_.truth);
  result_.errors = validate::relative_errors(fit.beta, result_.beta_true);
  result_.shares = identify::torque_shares(fit, result_.beta_true, data::MotionStream(log_judged_on()));
  result_.counted = identify::counted_parameters(fit, result_.shares);
  Index worst = 0;
  validate::judge(result_.criteria[kRecovery],
                  100.0 * worst_of(result_.errors, result_.counted.counted, &worst));
  note_parameters(worst);
}

/// Which parameter was worst, how many intervals hold, and which parameters do not count.
void Campaign::note_parameters(Index worst) {
  const identify::Fit& fit = result_.fit;
  std::string weak, open;
  int inside = 0;
  for (Index i = 0; i < result_.shares.size(); ++i) {
    if (counts(i)) {
      inside += std::abs(fit.beta[i] - result_.beta_true[i]) <= fit.half_width[i] ? 1 : 0;
      continue;
    }
    std::string& names = fit.determined[static_cast<std::size_t>(i)] ? weak : open;
    names += (names.empty() ? "" : ", ") + parameter_name(i);
  }
  std::vector<std::string>& notes = result_.criteria[kRecovery].notes;
  notes.push_back(fmt::format(
      "worst: {}; {} of {} base parameters counted; the 95 % intervals hold the truth of {} of them",
      parameter_name(worst), result_.counted.count(), result_.shares.size(), inside));
  if (!weak.empty()) {
    notes.push_back(
        fmt::format("not counted, move less than {:g} % of any joint's torque (most are 0 in truth): {}",
                    100.0 * identify::kCountedShare, weak));
  }
  if (!open.empty()) notes.push_back("not counted, the log does not determine them: " + open);
}

void Campaign::judge_prediction() {
  const data::MotionStream stream(log_judged_on());
  validate::ScoreOptions scoring;
  if (settings_.traces) {
    result_.trace.emplace(stream.summary().samples, setup_.truth.num_joints());
    scoring.rows = [this](const Eigen::VectorXd& time, const Eigen::MatrixXd& measured,
                          const Eigen::MatrixXd& predicted) {
      result_.trace->add(time, measured, predicted);
    };
  }
  result_.holdout = validate::score(result_.fit.robot, stream, scoring);
  judge_torque(result_.criteria[kPrediction], result_.holdout, settings_);
}

/// Each model on the other motion with the same load; at last the one identified with one load, with another load.
void Campaign::score_loads() {
  std::vector<std::pair<double, std::size_t>> pairs;
  for (std::size_t k = 0; k < settings_.payloads.size(); ++k)
    pairs.emplace_back(settings_.payloads[k], judged_[k]);
  pairs.emplace_back(settings_.identified_payload, judged_heavy_);
  for (const auto& [payload, log] : pairs) {
    const Experiment& experiment = result_.experiments[log];
    model::Robot robot = fit_with(payload).robot;
    if (experiment.payload != payload) {
      // The difference between the two loads is known; the load identified with is not.
      InertialParameters<double>& last = robot.joints.back().link;
      last = sum(last, campaign_load(robot, experiment.payload));
      last = sum(last, campaign_load(robot, payload), -1.0);
    }
    const data::MotionStream stream(experiment.log);
    validate::ScoreOptions scoring;
    scoring.band = result_.holdout.band;
    result_.payloads.push_back({payload, experiment.payload, validate::score(robot, stream, scoring)});
  }
}

void Campaign::judge_loads() {
  score_loads();
  validate::Criterion& criterion = result_.criteria[kPayload];
  judge_torque(criterion, result_.payloads.back().score, settings_);
  result_.load_difference_true = settings_.judged_payload - settings_.identified_payload;
  find_load_difference(fit_with(settings_.identified_payload), fit_with(settings_.judged_payload), result_);
  criterion.notes.push_back(
      fmt::format("difference of the loads as identified: {:.3f} kg ± {:.3f} kg (standard deviation), in "
                  "truth {:.3g} kg: {:.1f} %",
                  result_.load_difference, result_.load_difference_std, result_.load_difference_true,
                  100.0 * std::abs(result_.load_difference / result_.load_difference_true - 1.0)));
}

void Campaign::judge_tracking() {
  model::Robot bare = settings_.nominal;
  for (model::RobotJoint& joint : bare.joints) joint.actuation = {};
  const std::array<std::pair<const char*, const model::Robot*>, 3> models{
      {{"URDF with the drives' data sheet", &setup_.datasheet},
       {"identified", &result_.fit.robot},
       {"URDF alone", &bare}}};
  result_.tracking.resize(models.size());
  host::for_each_parallel(
      models.size(),
      [&](std::size_t k) {
        const auto& [name, believed] = models[k];
        result_.tracking[k] = track(setup_, name, *believed, settings_.seed * 100 + 99);
      },
      part(0.85, 1.0, "closing the loop"));
  validate::judge(result_.criteria[kTracking],
                  100.0 * (1.0 - result_.tracking[1].total() / result_.tracking[0].total()));
}

void Campaign::judge_repeatability() {
  std::vector<Eigen::VectorXd> betas;
  for (int k = 0; k < settings_.repeats; ++k) betas.push_back(fits_[static_cast<std::size_t>(k)].beta);
  result_.scatter = validate::relative_scatter(betas);
  Index worst = 0;
  validate::Criterion& criterion = result_.criteria[kRepeatability];
  validate::judge(criterion, 100.0 * worst_of(result_.scatter, result_.counted.counted, &worst));
  criterion.notes.push_back(
      fmt::format("worst: {}; {} experiments", parameter_name(worst), settings_.repeats));
}

}  // namespace

model::Robot perturbed_arm(const model::Robot& nominal, std::uint64_t seed, model::Robot* datasheet) {
  std::mt19937_64 random(seed);
  model::Robot sheet = nominal, truth = nominal;
  for (std::size_t j = 0; j < nominal.joints.size(); ++j) {
    const model::RobotJoint& joint = nominal.joints[j];
    // Drives of the size that the joint's torque and speed ask for. Shares as measured on a UR10e.
    const double torque = std::isfinite(joint.effort_limit) ? joint.effort_limit : 50.0;
    const double speed = std::isfinite(joint.velocity_limit) ? joint.velocity_limit : 2.0;
    const JointActuation<double> drive{0.01 * torque, 0.05 * torque, 0.15 * torque / speed, 0.0};
    sheet.joints[j].actuation = drive;
    truth.joints[j].actuation = {drive.rotor_inertia * off(random), drive.coulomb_friction * off(random),
                                 drive.viscous_friction * off(random),
                                 0.005 * torque * (off(random) > 1.0 ? 1.0 : -1.0)};
    const double mass = off(random), com = off(random), inertia = off(random);
    truth.joints[j].link = scaled(joint.link, mass, com, inertia);
  }
  sheet.couplings.clear();
  truth.couplings.clear();
  if (datasheet != nullptr) *datasheet = sheet;
  return truth;
}

InertialParameters<double> campaign_load(const model::Robot& robot, double mass) {
  constexpr double kAluminium = 2700.0;  // [kg/m³]
  const double radius = std::cbrt(3.0 * mass / (4.0 * std::numbers::pi * kAluminium));
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(robot.tip_rotation.data());
  const Eigen::Map<const Eigen::Vector3d> p(robot.tip_position.data());
  sim::Body body;
  body.mass = mass;
  body.com = p + R * Eigen::Vector3d(0.03, 0.02, 0.03 + radius);
  body.inertia = 0.4 * mass * radius * radius * Eigen::Matrix3d::Identity();
  return sim::inertial_parameters(body);
}

model::ModelFile CampaignResult::model_file() const {
  model::ModelFile file = fit.model_file();
  file.provenance.logs = {experiments.front().name + ".csv"};
  return file;
}

model::ModelFile CampaignResult::true_model_file() const {
  model::ModelFile file = model::make_model(truth);
  file.provenance.method = "simulated truth";
  return file;
}

CampaignResult run_campaign(const CampaignSettings& settings,
                            const std::function<void(double, const std::string&)>& progress) {
  return Campaign(settings, progress).run();
}

}  // namespace heft::studies

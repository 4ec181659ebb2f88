/// @file
/// Links, friction and load of an arm while it moves, from a model that is roughly right.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include <Eigen/Core>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/dynamics/detail/mass_bounds.hpp"
#include "heft/core/dynamics/detail/rigid_arm.hpp"
#include "heft/core/dynamics/detail/usable_model.hpp"
#include "heft/core/dynamics/joint_space.hpp"
#include "heft/core/dynamics/regressor.hpp"
#include "heft/core/dynamics/run_time_arm.hpp"
#include "heft/core/estimate/detail/load_priors.hpp"
#include "heft/core/estimate/detail/sample_faults.hpp"
#include "heft/core/estimate/innovation_gate.hpp"
#include "heft/core/estimate/recursive_least_squares.hpp"
#include "heft/core/filter/aligned_motion.hpp"
#include "heft/core/numeric_range.hpp"
#include "heft/core/physical_body.hpp"
#include "heft/core/run_clock.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// Recursive least squares for all links and the friction of all joints at once, around the values of a model that is known to
/// some share of them (`doubt`), with a load on the last link. LoadObserver is for an arm that is known: what its model lacks
/// goes into the load there. Here it goes where the prior says it may be, and a parameter that the motion does not show stays
/// the model's. The past is forgotten within `memory` of motion, back to the prior.
///
/// A load that is gripped or put down changes the last link alone. Torques that suddenly differ from those of the estimate by more
/// than they use to (Record::surprised), or attach() and detach(), widen the variances of that link's ten parameters to the prior's;
/// what is known of the other links and of friction stays.
///
/// model() lies between the model of the start and the estimate, where it would have left least of the torques of the last tenths
/// of a second, each judged before it went into the estimate: what explains them worse than the model of the start has no weight.
///
/// Whether the estimate makes a good model in other motions than those of the past seconds is not known; for computed torque in
/// the present one it need not. A mass matrix that is not between `least_inertia` and `most_inertia` times the model's at
/// the present pose is refused; where the one before it is not either, the model of the start comes back.
///
/// An arm at rest teaches nothing after `longest_rest`, nor do joints at their torque limits; around a reversal a joint counts less.
///
/// Cost of an update, p = 13 n parameters: n recursions of 1.5 p² multiplications, regressor and leak, with 6 joints up to 81 000
/// after a change of load; of other samples, the filters. 8 p² bytes in double. No allocation, no exception, every loop bounded.
///
/// @tparam Description  RunTimeArm<N, ...>
template <typename Description, typename Scalar>
class ArmEstimator {
  using Source = detail::ArmSource<Description>;
  static_assert(!Source::kIsStatic, "links that are estimated are known at run time only: RunTimeArm");

 public:
  static constexpr int kNumJoints = Source::kNumJoints;
  /// Ten a link, the last link first, then Coulomb, viscous and offset friction of each joint.
  static constexpr int kParameters = 13 * kNumJoints;
  using Vector = JointVector<Scalar, kNumJoints>;
  using Model = ArmModel<Scalar, kNumJoints>;
  using Estimator = RecursiveLeastSquares<Scalar, kParameters>;

  struct Config {
    /// Standard deviation of masses, centres of mass, inertia and friction, as a share of their values, > 0.
    Scalar doubt{static_cast<Scalar>(0.2)};
    Scalar mass_prior{0};  ///< standard deviation of the load's mass; 0: a tenth of the arm's mass [kg]
    Vector noise_std = Vector::Zero();        ///< of the torque, n [N·m, N]; 0: from friction and weight
    Scalar memory{static_cast<Scalar>(0.5)};  ///< time constant of forgetting, in motion, > 0 [s]
    Scalar filter_hz{20};     ///< poles of the filter that motion and torque pass, see AlignedMotion [Hz]
    Scalar update_rate{100};  ///< > 0 [Hz]
    Scalar sign_width{static_cast<Scalar>(0.02)};  ///< of the Coulomb sign [rad/s, m/s]
    Scalar uncertain_speed{
        static_cast<Scalar>(0.06)};  ///< slower, the sign of friction is not known, > 0 [rad/s, m/s]
    Vector torque_limit = Vector::Constant(static_cast<Scalar>(1e30));  ///< > 0 [N·m, N]
    Scalar longest_rest{
        static_cast<Scalar>(0.5)};  ///< all joints slower than uncertain_speed for longer: rest, > 0 [s]
    Scalar least_inertia{static_cast<Scalar>(0.1)};  ///< 0 < least ≤ 1
    Scalar most_inertia{100};                        ///< ≥ 1
  };

  /// Treatment of a sample.
  struct Record {
    bool new_estimate{false};      ///< model() changed
    bool estimate_refused{false};  ///< its mass matrix is out of bounds
    bool surprised{false};         ///< as after a change of load: the last link counts as unknown
    bool settling{false};          ///< filters settle: nothing is estimated
    bool at_rest{false};           ///< longer than `longest_rest`: nothing is estimated
    std::uint32_t clipped{0};      ///< bit i: torque i does not count
  };

  /// Starts at the model, without load; add() brings the rest.
  /// @return kOutOfRange (settings, or friction whose square is beyond kLargestWeight), kNonFiniteInput (model): state kept
  Status configure(const Model& model, const Config& config = {}) noexcept {
    if (!in_range(config)) {
      return Status::kOutOfRange;
    }
    if (!detail::is_usable_model(model)) {
      return Status::kNonFiniteInput;
    }
    Aligned aligned;
    Drive drive;
    if (aligned.configure(config.filter_hz, config.sign_width) != Status::kOk) {
      return Status::kOutOfRange;
    }
    if (const Status status = drive.configure(model.actuation, config.sign_width); status != Status::kOk) {
      return status;
    }
    const Priors priors(model, model.actuation);
    Row variance{}, prior{};
    set_variances(model, config, priors, variance);
    parameters_of(model, prior);
    typename Estimator::Config settings;
    using std::exp;
    settings.forgetting_factor = exp(Scalar(-1) / (config.memory * config.update_rate));
    Vector noise_variance;
    for (int i = 0; i < kNumJoints; ++i) {
      const Scalar noise = config.noise_std[i] > Scalar(0) ? config.noise_std[i] : priors.noise[i];
      noise_variance[i] = Priors::at_least(noise * noise, 1e-9);
      // The recursion would refuse every row of a joint that has more.
      const Scalar friction =
          static_cast<Scalar>(0.5) * model.actuation[static_cast<std::size_t>(i)].coulomb_friction;
      if (!is_usable_weight(noise_variance[i] + friction * friction)) {
        return Status::kOutOfRange;
      }
    }
    if (const Status status = recursion_.configure(settings, prior, variance); status != Status::kOk) {
      return status;
    }
    variance_ = noise_variance;
    config_ = config;
    nominal_.set_model(model);
    trial_.set_model(model);
    model_ = model;
    prior_ = prior;
    found_ = false;
    aligned_ = aligned;
    drive_ = drive;
    clock_.reset();
    doubt_.setOnes();
    omega_ = static_cast<Scalar>(6.283185307179586) * config.filter_hz;
    missed_ = until_update_ = rest_ = widening_ = calm_ = along_ = across_ = Scalar(0);
    bare_ = model.links[kNumJoints - 1];
    loaded_ = declared_ = false;
    weight_ = Scalar(1);
    weight_share_ = Scalar(1) - exp(Scalar(-1) / (static_cast<Scalar>(kProof) * config.update_rate));
    change_.reset();
    started_ = false;
    configured_ = true;
    return Status::kOk;
  }

  /// A joint effect, a gear coupling or an elastic joint of the model. Before the first sample.
  /// @return see DriveTorque; kNotConfigured; state kept unless kOk
  template <typename Part>
  Status add(const Part& part) noexcept {
    const Status status = configured_ ? drive_.add(part) : Status::kNotConfigured;
    if (status == Status::kOk) {
      adopt(prior_);  // with an offset, if it was one
    }
    return status;
  }

  /// Temperatures of the joints from now on, n [°C]; not a number: not known, and friction that follows one is that at its T0.
  void set_temperature(const Vector& temperature) noexcept { drive_.set_temperature(temperature); }

  /// Replaces gravity, in the base frame; finite [m/s²].
  void set_gravity(const std::array<Scalar, 3>& gravity) noexcept {
    nominal_.set_gravity(gravity);
    model_.gravity = gravity;
  }

  /// Takes one sample.
  /// @param q    encoder positions, n [rad, m]
  /// @param qd   velocities of any source, n; their sign decides about friction [rad/s, m/s]
  /// @param tau  torques that acted since the sample before, n, link side [N·m, N]
  /// @param dt   since the sample before, refused ones included, > 0, at most 1e6 [s]
  /// @param cut  bit i: torque i was cut at a limit and does not count
  /// @return kNonFiniteInput, kOutOfRange (dt), kNotConfigured: the sample leaves no trace but its time
  Status update(const Vector& q, const Vector& qd, const Vector& tau, Scalar dt, Record& record,
                std::uint32_t cut = 0) noexcept {
    record = Record{};
    if (!configured_) {
      return Status::kNotConfigured;
    }
    if (const Status time = check_step(dt); time != Status::kOk) {
      return time;
    }
    const Scalar elapsed = missed_ + dt;
    if (!all_usable(q) || !all_usable(qd) || !all_usable(tau)) {
      missed_ = started_ && elapsed < static_cast<Scalar>(kLongestStep) ? elapsed : Scalar(0);
      return Status::kNonFiniteInput;
    }
    if (!started_) {
      faults_.start(dt);
      settling_ = Scalar(2) * static_cast<Scalar>(kSettled) / omega_;
      last_q_ = q;
      last_qd_ = qd;
    }
    const Status status = filter(q, qd, tau, elapsed);
    missed_ = status == Status::kOk ? Scalar(0) : elapsed;
    if (status != Status::kOk) {
      return status;
    }
    clock_.advance(started_ ? elapsed : Scalar(0));
    started_ = true;
    record.new_estimate = declared_;
    declared_ = false;
    look(q, qd, tau, elapsed, cut, record);
    until_update_ -= elapsed;
    // Half a sample early rather than late, so that rounding of sample times does not skip one.
    if (until_update_ > static_cast<Scalar>(0.5) * elapsed) {
      return Status::kOk;
    }
    until_update_ = Scalar(1) / config_.update_rate;
    if (!record.settling && !record.at_rest && aligned_.settled()) {
      estimate(record);
    }
    return Status::kOk;
  }

  /// Something was gripped, or taken in place of what was there, just now: nothing is known of the last link. The model keeps what it
  /// has until the torques show another.
  /// @return kNotConfigured
  Status attach() noexcept {
    widening_ = configured_ ? static_cast<Scalar>(kSettled) / omega_ : widening_;
    loaded_ = true;
    return status();
  }

  /// The same where the new load is roughly known: the model takes it up at once.
  /// @param expected  about the last link frame
  /// @return kNonFiniteInput, kNotPositiveDefinite: nothing is declared; kNotConfigured
  Status attach(const InertialParameters<Scalar>& expected) noexcept {
    const Status physical = check_physical(expected);
    if (!configured_ || physical != Status::kOk) {
      return configured_ ? physical : Status::kNotConfigured;
    }
    replace_last_link(expected);
    loaded_ = true;
    return Status::kOk;
  }

  /// The load was put down just now: the last link is what it was before anything was gripped.
  /// @return kNotConfigured
  Status detach() noexcept {
    if (configured_) {
      replace_last_link({});
      loaded_ = false;
    }
    return status();
  }

  /// Links with the load on the last one, rotors and friction as they are believed to be.
  const Model& model() const noexcept { return model_; }
  /// Share of the estimate in model(), 0 to 1; the rest is the model of the start.
  const Scalar& weight() const noexcept { return weight_; }
  const Estimator& recursion() const noexcept { return recursion_; }
  Status status() const noexcept { return configured_ ? Status::kOk : Status::kNotConfigured; }

 private:
  using Drive = detail::DriveOf<Description, Scalar>;
  using Aligned = AlignedMotion<Scalar, kNumJoints>;
  using Priors = detail::LoadPriors<Scalar, kNumJoints>;
  using Row = typename Estimator::Row;
  using Dynamic = DynamicArm<Scalar, kNumJoints>;
  using Mass = MassMatrix<Scalar, kNumJoints>;
  static constexpr int kFriction = kParametersPerLink * kNumJoints;  ///< first of its parameters
  static constexpr double kSettled = 10;  ///< time constants after which a filter has forgotten the past
  /// Root mean square of innovations that another load gives, over what they usually are, and how fast that follows.
  static constexpr double kSurprise = 2.5, kWidening = 0.01;
  /// In which the estimate proves better than the model of the start [s].
  static constexpr double kProof = 0.1;
  /// Where a centre of mass of nothing stated may be [m], and friction that is stated as none [N·m].
  static constexpr double kPlace = 0.02, kSomeFriction = 0.1;

  static bool in_range(const Config& c) noexcept {
    const auto positive = [](const Scalar& value) { return value > Scalar(0) && is_usable(value); };
    for (int i = 0; i < kNumJoints; ++i) {
      if (!(c.noise_std[i] >= Scalar(0)) || !is_usable(c.noise_std[i]) || !(c.torque_limit[i] > Scalar(0))) {
        return false;
      }
    }
    // λᵖ ≥ 1e-12, see RecursiveLeastSquares
    return positive(c.doubt) && c.mass_prior >= Scalar(0) && is_usable(c.mass_prior) && positive(c.memory) &&
           positive(c.update_rate) && c.memory * c.update_rate * Scalar(27) > Scalar(kParameters) &&
           positive(c.uncertain_speed) && positive(c.longest_rest) && positive(c.least_inertia) &&
           c.least_inertia <= Scalar(1) && c.most_inertia >= Scalar(1) && is_usable(c.most_inertia);
  }

  /// The last link comes first: see RecursiveLeastSquares::widen.
  static constexpr std::size_t first_of(std::size_t link) noexcept {
    return static_cast<std::size_t>(kParametersPerLink) * (static_cast<std::size_t>(kNumJoints) - 1 - link);
  }

  static void parameters_of(const Model& model, Row& x) noexcept {
    for (std::size_t j = 0; j < static_cast<std::size_t>(kNumJoints); ++j) {
      for (std::size_t p = 0; p < 10; ++p) {
        x[first_of(j) + p] = model.links[j][p];
      }
      const std::size_t at = kFriction + 3 * j;
      x[at] = model.actuation[j].coulomb_friction;
      x[at + 1] = model.actuation[j].viscous_friction;
      x[at + 2] = model.actuation[j].friction_offset;
    }
  }

  static void set_variances(const Model& model, const Config& config, const Priors& priors,
                            Row& variance) noexcept {
    const Scalar load =
        config.mass_prior > Scalar(0) ? config.mass_prior : static_cast<Scalar>(0.3) * priors.mass;
    const auto square = [](const Scalar& value) { return value * value + static_cast<Scalar>(1e-10); };
    for (std::size_t j = 0; j < static_cast<std::size_t>(kNumJoints); ++j) {
      const InertialParameters<Scalar>& link = model.links[j];
      const Scalar added = j + 1 == static_cast<std::size_t>(kNumJoints) ? load : Scalar(0);
      const Scalar length = priors.length;
      const Scalar m = link[kMass];
      using std::sqrt;
      const Scalar moment = sqrt(link[kMcx] * link[kMcx] + link[kMcy] * link[kMcy] + link[kMcz] * link[kMcz]);
      const Scalar inertia = link[kIxx] + link[kIyy] + link[kIzz];
      variance[first_of(j)] = square(config.doubt * m) + square(added);
      for (std::size_t p = 1; p < 4; ++p) {
        variance[first_of(j) + p] =
            square(config.doubt * (moment + static_cast<Scalar>(kPlace) * m)) + square(added * length);
      }
      for (std::size_t p = 4; p < 10; ++p) {
        variance[first_of(j) + p] = square(config.doubt * inertia) + square(added * length * length);
      }
      const JointActuation<Scalar>& drive = model.actuation[j];
      const Scalar level = drive.coulomb_friction + static_cast<Scalar>(kSomeFriction);
      const std::size_t at = kFriction + 3 * j;
      variance[at] = square(config.doubt * level);
      variance[at + 1] = square(config.doubt * (drive.viscous_friction + level));
      variance[at + 2] = square(config.doubt * level);
    }
  }

  Status filter(const Vector& q, const Vector& qd, const Vector& tau, const Scalar& elapsed) noexcept {
    const auto memory = drive_.memory();
    const Status taken =
        aligned_.update(q, qd, q, tau, elapsed, [this](const Vector& at, const Vector& rate, Vector& left) {
          Vector known;
          for (int i = 0; i < kNumJoints; ++i) {
            known[i] = added_offset(static_cast<std::size_t>(i));
          }
          drive_.add_couplings(rate, Vector::Zero(), known);
          if (drive_.has_effects()) {
            Vector load;
            bias_torque(nominal_, joint_trigonometry<Dynamic>(at), at, rate, load);
            if (const Status status = drive_.add_effects(clock_.seconds(), at, rate, load, known);
                status != Status::kOk) {
              return status;
            }
          }
          left -= known;
          return Status::kOk;
        });
    if (taken != Status::kOk) {
      drive_.go_back(memory);
    }
    return taken;
  }

  /// Faults, rest, and how well the friction is known.
  void look(const Vector& q, const Vector& qd, const Vector& tau, const Scalar& elapsed, std::uint32_t cut,
            Record& record) noexcept {
    const auto found =
        faults_.look(last_q_, last_qd_, q, qd, tau, config_.torque_limit, elapsed, omega_, cut);
    last_q_ = q;
    last_qd_ = qd;
    const Scalar wait = Scalar(2) * static_cast<Scalar>(kSettled) / omega_;
    settling_ = found.disturbed || found.frozen != 0 ? wait
                : settling_ > elapsed                ? settling_ - elapsed
                                                     : Scalar(0);
    clipped_ = found.clipped;
    using std::exp;
    const Scalar forget = exp(-elapsed * omega_ / Scalar(3));
    bool slow = true;
    for (int i = 0; i < kNumJoints; ++i) {
      const bool uncertain = qd[i] < config_.uncertain_speed && qd[i] > -config_.uncertain_speed;
      doubt_[i] = uncertain ? Scalar(1) : doubt_[i] * forget;
      slow = slow && uncertain;
    }
    const Scalar rest = slow ? rest_ + elapsed : Scalar(0);
    record.at_rest = rest > config_.longest_rest;
    rest_ = record.at_rest ? config_.longest_rest : rest;
    record.clipped = clipped_;
    record.settling = settling_ > Scalar(0);
  }

  void estimate(Record& record) noexcept {
    const Vector& q = aligned_.q();
    const auto trig = joint_trigonometry<Dynamic>(q);
    link_regressor(nominal_, trig, q, aligned_.qd(), aligned_.qdd(), regressor_);
    Vector tau = Vector::Zero();
    drive_.add_inertia(aligned_.qdd(), tau);
    tau = aligned_.tau() - tau;
    std::uint32_t usable = 0;
    Vector scatter;
    for (int i = 0; i < kNumJoints; ++i) {
      const Scalar friction = static_cast<Scalar>(0.5) * doubt_[i] *
                              drive_.actuation()[static_cast<std::size_t>(i)].coulomb_friction;
      scatter[i] = variance_[i] + friction * friction;
      const bool good = is_usable(tau[i]) && is_usable(regressor_.row(i).cwiseAbs().sum());
      usable |= good ? std::uint32_t{1} << i : 0U;
    }
    usable &= ~clipped_;
    record.surprised = compare(tau, scatter, usable);
    watch_load(record.surprised);
    if (widening_ > Scalar(0)) {
      widening_ -= Scalar(1) / config_.update_rate;
      for (int p = 0; p < kParametersPerLink; ++p) {
        recursion_.widen(p);
      }
    }
    for (int i = 0; i < kNumJoints; ++i) {
      if ((usable >> i & 1U) != 0) {
        set_row(i);
        typename Estimator::Record taken;
        static_cast<void>(
            recursion_.add(row_, tau[i], scatter[i] * change_.usual() * change_.usual(), gate_, taken));
      }
    }
    recursion_.forget();
    take(q, record);
  }

  /// The filters hold torques of the load before: nothing is learnt until they have forgotten it.
  void replace_last_link(const InertialParameters<Scalar>& load) noexcept {
    for (int p = 0; p < kParametersPerLink; ++p) {
      const std::size_t k = static_cast<std::size_t>(p);
      recursion_.replace(p, bare_[k] + load[k]);
    }
    const Scalar wait = static_cast<Scalar>(kSettled) / omega_;
    settling_ = settling_ > wait ? settling_ : wait;
    Record record;
    take(last_q_, record);
    declared_ = record.new_estimate;
  }

  void set_row(int i) noexcept {
    row_ = Row{};
    for (int j = i; j < kNumJoints; ++j) {
      const std::size_t first = first_of(static_cast<std::size_t>(j));
      for (int p = 0; p < kParametersPerLink; ++p) {
        row_[first + static_cast<std::size_t>(p)] = regressor_(i, kParametersPerLink * j + p);
      }
    }
    const std::size_t at = static_cast<std::size_t>(kFriction + 3 * i);
    row_[at] = aligned_.sign()[i];
    row_[at + 1] = aligned_.qd()[i];
    row_[at + 2] = Scalar(1);
  }

  /// What the estimate leaves of the torques before it has seen them, and what the model of the start leaves. Sets weight_.
  /// @return true: more than it uses to leave, as after a change of load
  bool compare(const Vector& tau, const Vector& scatter, std::uint32_t usable) noexcept {
    const Row& x = recursion_.solution();
    Scalar surprise(0), along(0), across(0), rows(0);
    for (int i = 0; i < kNumJoints; ++i) {
      if ((usable >> i & 1U) == 0) {
        continue;
      }
      set_row(i);
      Scalar left = tau[i], of_start = tau[i];
      for (std::size_t p = 0; p < row_.size(); ++p) {
        left -= row_[p] * x[p];
        of_start -= row_[p] * prior_[p];
      }
      const Scalar inverse = Scalar(1) / scatter[i], gained = of_start - left;
      surprise += left * left * inverse;
      along += of_start * gained * inverse;
      across += gained * gained * inverse;
      rows += Scalar(1);
    }
    if (!(rows > Scalar(0)) || !is_usable(surprise) || !is_usable(along) || !is_usable(across)) {
      return false;
    }
    along_ += weight_share_ * (along - along_);
    across_ += weight_share_ * (across - across_);
    weight_ = !(along_ < across_) ? Scalar(1) : along_ > Scalar(0) ? along_ / across_ : Scalar(0);
    using std::sqrt;
    return change_.refuses(sqrt(surprise / rows), static_cast<Scalar>(kSurprise),
                           static_cast<Scalar>(kWidening));
  }

  /// Widens after a surprise until the filters have forgotten the load before; notes the last link as it is while nothing is gripped.
  void watch_load(bool surprised) noexcept {
    // The model of the start surprises as well.
    loaded_ = loaded_ || (surprised && calm_ > config_.memory);
    if (surprised) {
      widening_ = static_cast<Scalar>(kSettled) / omega_;
      calm_ = Scalar(0);
    } else if (!loaded_) {
      bare_ = link_of(recursion_.solution(), kNumJoints - 1);
    }
    calm_ += calm_ > config_.memory ? Scalar(0) : Scalar(1) / config_.update_rate;
  }

  /// The estimate becomes the model, where feedback may be made of it.
  void take(const Vector& q, Record& record) noexcept {
    const Row& x = recursion_.solution();
    for (std::size_t p = 0; p < row_.size(); ++p) {
      row_[p] = prior_[p] + weight_ * (x[p] - prior_[p]);
    }
    if (within_bounds(row_, q)) {
      adopt(row_);
      found_ = record.new_estimate = true;
      return;
    }
    record.estimate_refused = true;
    // What was in bounds at the poses of before may be as bad at this one.
    parameters_of(model_, row_);
    if (found_ && !within_bounds(row_, q)) {
      adopt(prior_);
      found_ = false;
      record.new_estimate = true;
    }
  }

  /// least M₀ < M < most M₀ at this pose, as quadratic forms, with rotors.
  bool within_bounds(const Row& x, const Vector& q) noexcept {
    const auto trig = joint_trigonometry<Dynamic>(q);
    Mass nominal, found;
    mass_matrix(nominal_, trig, q, nominal);
    for (int j = 0; j < kNumJoints; ++j) {
      trial_.set_link(j, link_of(x, static_cast<std::size_t>(j)));
    }
    mass_matrix(trial_, trig, q, found);
    for (int i = 0; i < kNumJoints; ++i) {
      const Scalar rotor = drive_.actuation()[static_cast<std::size_t>(i)].rotor_inertia;
      nominal(i, i) += rotor;
      found(i, i) += rotor;
    }
    return detail::between<Scalar, kNumJoints>(found, nominal, config_.least_inertia, config_.most_inertia);
  }

  void adopt(const Row& x) noexcept {
    for (std::size_t j = 0; j < static_cast<std::size_t>(kNumJoints); ++j) {
      const std::size_t at = kFriction + 3 * j;
      model_.links[j] = link_of(x, j);
      model_.actuation[j].coulomb_friction = x[at] > Scalar(0) ? x[at] : Scalar(0);
      model_.actuation[j].viscous_friction = x[at + 1] > Scalar(0) ? x[at + 1] : Scalar(0);
      model_.actuation[j].friction_offset = x[at + 2] + added_offset(j);
    }
  }

  /// Of Offset effects: known, as all effects are, and not looked for [N·m, N].
  Scalar added_offset(std::size_t joint) const noexcept {
    return drive_.actuation()[joint].friction_offset - prior_[kFriction + 3 * joint + 2];
  }

  static InertialParameters<Scalar> link_of(const Row& x, std::size_t j) noexcept {
    InertialParameters<Scalar> link;
    for (std::size_t p = 0; p < link.size(); ++p) {
      link[p] = x[first_of(j) + p];
    }
    return link;
  }

  Config config_{};
  Dynamic nominal_, trial_;
  Model model_{};
  Drive drive_;
  Aligned aligned_;
  detail::SampleFaults<Scalar, kNumJoints> faults_;
  Estimator recursion_;
  InnovationGate<Scalar> gate_;  ///< never rejects
  LinkRegressor<Scalar, kNumJoints> regressor_;
  Row row_{}, prior_{};
  RunClock<Scalar> clock_;
  Vector variance_ = Vector::Ones(), doubt_ = Vector::Ones(), last_q_ = Vector::Zero(),
         last_qd_ = Vector::Zero();
  Scalar omega_{1}, missed_{0}, settling_{0}, until_update_{0}, rest_{0};
  InnovationGate<Scalar> change_;
  InertialParameters<Scalar> bare_{};  ///< last link without load
  Scalar widening_{0};                 ///< the last link counts as unknown for so long [s]
  Scalar calm_{0};                     ///< since the last surprise, at most a little above `memory` [s]
  /// Of the residual of the model of the start along what the estimate changes of it, and of that change: see compare().
  Scalar along_{0}, across_{0}, weight_{1};
  Scalar weight_share_{1};  ///< of an update in along_ and across_
  std::uint32_t clipped_{0};
  bool loaded_{false};    ///< something was gripped
  bool declared_{false};  ///< model() has changed with a declared load
  bool found_{false};     ///< the model is an estimate, not that of the start
  bool started_{false}, configured_{false};
};

}  // namespace heft

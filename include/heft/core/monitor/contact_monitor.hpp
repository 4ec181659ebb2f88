/// @file
/// Did the arm touch something? Torque from outside against thresholds of free motion.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/dynamics/lagrangian.hpp"
#include "heft/core/filter/kept_decay.hpp"
#include "heft/core/monitor/contact_deviation.hpp"
#include "heft/core/monitor/contact_thresholds.hpp"
#include "heft/core/monitor/load_change_test.hpp"
#include "heft/core/monitor/momentum_observer.hpp"
#include "heft/core/numeric_range.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// What a sample began, ended or decided.
enum class ContactEvent : std::uint8_t {
  kNone,
  kContact,    ///< something touches the arm
  kReleased,   ///< nothing does any more
  kLoadChange  ///< it was no contact: the flange carries another load, which is part of the model from now on
};

/// Name of an event, for people. Static storage, never null.
constexpr const char* to_string(ContactEvent event) noexcept {
  switch (event) {
    case ContactEvent::kNone: return "none";
    case ContactEvent::kContact: return "contact";
    case ContactEvent::kReleased: return "released";
    case ContactEvent::kLoadChange: return "load change";
  }
  return "unknown event";
}

/// Watches an arm for contacts.
///
/// The torque from outside (MomentumObserver) also holds what the model misses, most of it friction. ContactDeviation filters
/// it; the residual and its change are compared with thresholds for what the joint does: rest, turn or move
/// (ContactThresholds). Whichever is larger against its threshold finds a contact, and the contact ends when that one is quiet
/// again.
///
/// A deviation that lasts and follows the poses as the weight of a body on the flange does is no contact but a change of
/// load: its weight belongs to the model from then on.
///
/// @code
/// lagrangian_terms(arm, trig, q, qd, terms);
/// if (monitor.wants_load_columns()) load_columns(arm, trig, q, columns);
/// status = monitor.update(terms, columns, qd, tau, friction, period, record);
/// @endcode
template <typename Scalar, int N>
class ContactMonitor {
 public:
  using Vector = JointVector<Scalar, N>;
  using Observer = MomentumObserver<Scalar, N>;
  using Deviation = ContactDeviation<Scalar, N>;
  using Thresholds = ContactThresholds<Scalar, N>;

  struct Record;
  /// Called from update() with every sample that begins, ends or decides something.
  using Callback = void (*)(const Record& record, void* context) noexcept;

  struct Config {
    Thresholds thresholds{};
    typename Observer::Matrix motor_inertia = Observer::Matrix::Zero();  ///< as in MomentumObserver::Config
    Scalar longest_period{static_cast<Scalar>(0.1)};                     ///< as there [s]
    Scalar confirmation{0};  ///< a deviation above its threshold counts after that time [s]; 0 to 10
    /// A contact ends when all deviations have stayed below kQuiet of their thresholds for that time [s]; 0 to 10.
    Scalar release{static_cast<Scalar>(0.1)};
    /// A contact also ends when its deviation has stood still for that long [s], 0.1 to 1000, within what free motion may
    /// show: after a push the friction of a joint at rest holds another torque than before.
    Scalar stand_still{3};
    /// A load change is decided no earlier after the beginning [s]; 0.1 to 1000.
    Scalar persistence{static_cast<Scalar>(1.5)};
    /// Share of the squared deviation that a body has to explain, 0.5 to 1: 0.9 leaves a push at one link out, whose
    /// torques have other signs.
    Scalar load_share{static_cast<Scalar>(0.9)};
    Callback callback{nullptr};
    void* context{nullptr};
  };

  struct Record : Deviation::Record {
    /// What was compared with what: residual or change, whichever is larger against its threshold; during a contact
    /// whichever found it [N·m, N].
    Vector deviation = Vector::Zero(), threshold = Vector::Zero();
    bool judged{false};   ///< false while the filters settle: at the start and after gaps
    bool contact{false};  ///< something touches the arm
    std::array<bool, static_cast<std::size_t>(N)> above{};  ///< joints whose threshold is exceeded
    int joint{-1};     ///< whose deviation is largest against its threshold, counted from 0; -1: not judged
    int direction{0};  ///< of the torque from outside on that joint: 1 along positive q, -1 against
    ContactEvent event{ContactEvent::kNone};
    std::array<Scalar, 4>
        load{};  ///< kLoadChange: added mass [kg] and first moment in the last link frame [kg·m]
  };

  /// @return kOutOfRange, state kept
  Status configure(const Config& config) noexcept {
    const auto within = [](Scalar value, Scalar low, Scalar high) { return value >= low && value <= high; };
    const Thresholds& t = config.thresholds;
    const bool valid = t.is_valid() && within(config.confirmation, Scalar(0), Scalar(10)) &&
                       within(config.release, Scalar(0), Scalar(10)) &&
                       within(config.stand_still, static_cast<Scalar>(0.1), Scalar(1000)) &&
                       within(config.persistence, static_cast<Scalar>(0.1), Scalar(1000)) &&
                       within(config.load_share, static_cast<Scalar>(0.5), Scalar(1));
    if (!valid) return Status::kOutOfRange;
    typename Observer::Config observer;
    observer.bandwidth = kUnfiltered;
    observer.motor_inertia = config.motor_inertia;
    observer.longest_period = config.longest_period;
    if (const Status status = observer_.configure(observer); status != Status::kOk) return status;
    deviation_.configure(t);
    config_ = config;
    reset();
    configured_ = true;
    return Status::kOk;
  }

  /// Forgets the past, loads included.
  void reset() noexcept {
    observer_.reset();
    deviation_.reset();
    state_ = State{};
    load_.fill(Scalar(0));
  }

  /// True while the next sample needs load_columns(): during a contact, and with a load that was found.
  bool wants_load_columns() const noexcept { return state_.contact || carries_load(); }

  /// Takes one sample.
  /// @param terms     lagrangian_terms() at this q, q̇
  /// @param columns   load_columns() at this q; not looked at unless wants_load_columns()
  /// @param qd        velocities, n [rad/s, m/s]
  /// @param tau       torque measured at the motors, n [N·m, N]
  /// @param friction  what of it the model gives to friction, gears and joint effects, n [N·m, N]; thresholds of heft were
  ///                  learnt with a sign of friction 0.01 rad/s (m/s) wide, see velocity_sign
  /// @param period    time since the last sample that was taken, > 0 [s]
  /// @return as MomentumObserver::update; anything but kOk keeps the state, and a record that says nothing
  Status update(const LagrangianTerms<Scalar, N>& terms, const LoadColumns<Scalar, N>& columns,
                const Vector& qd, const Vector& tau, const Vector& friction, Scalar period,
                Record& record) noexcept {
    const bool with_columns = wants_load_columns();
    LagrangianTerms<Scalar, N> loaded = terms;
    bool usable = true;
    for (int i = 0; with_columns && i < N; ++i) {
      for (int a = 0; a < 4; ++a) {
        usable = usable && is_usable(columns(i, a));
        loaded.gradient[i] -= columns(i, a) * load_[static_cast<std::size_t>(a)];
      }
    }
    const Status status = !configured_ ? Status::kNotConfigured
                          : !usable    ? Status::kNonFiniteInput
                                       : observer_.update(loaded, qd, tau, friction, period);
    go_on(status, qd, with_columns ? &columns : nullptr, period, record);
    return status;
  }

  /// The same from the torque that the model explains between two samples, in a loop that has it anyway, as LoadObserver does:
  ///
  /// @code
  /// status = load.update(q, qd, tau, dt, seen);                        // with Config::explains
  /// if (seen.changed) monitor.reset();                                 // what the flange carries is the observer's business
  /// if (load.explained().valid) status = monitor.update(load.explained(), tau, record);
  /// @endcode
  ///
  /// No load is looked for, wants_load_columns() has no meaning here. See MomentumObserver::update.
  /// @param explained  LoadObserver::explained(), or any type with these members
  /// @param tau        torque measured at the motors, mean over the period, n [N·m, N]
  template <typename Explained>
  Status update(const Explained& explained, const Vector& tau, Record& record) noexcept {
    const Status status = !configured_ ? Status::kNotConfigured
                          : !all_usable(explained.qd)
                              ? Status::kNonFiniteInput
                              : observer_.update(explained.torque, tau, explained.period);
    go_on(status, explained.qd, nullptr, explained.period, record);
    return status;
  }

  bool contact() const noexcept { return state_.contact; }
  /// Body that load changes have added: mass [kg], first moment in the last link frame [kg·m].
  const std::array<Scalar, 4>& load() const noexcept { return load_; }
  const Config& config() const noexcept { return config_; }

 private:
  struct State {
    Vector followed = Vector::Zero();  ///< mean of the residual during a contact
    LoadChangeTest<Scalar, N> body;
    Scalar settled{0};  ///< time since the start or the last gap [s]
    Scalar above{0}, below{0}, still{0};
    Scalar lasted{0};  ///< time since a change began the contact [s]
    bool contact{false};
    bool by_change{false};  ///< whether the change found the contact, not the residual itself
  };

  /// @param status   of the observer's update
  /// @param columns  nullptr: no load is looked for
  void go_on(Status status, const Vector& qd, const LoadColumns<Scalar, N>* columns, Scalar period,
             Record& record) noexcept {
    if (status == Status::kOk && period > config_.longest_period) {
      state_.settled = Scalar(0);
      deviation_.restart();
    }
    if (status != Status::kOk || !observer_.running()) {
      record = Record{};
      return;
    }
    deviation_.update(observer_.residual(), observer_.explained(), qd, period, patience(), record);
    decide(columns, period, record);
    if (record.event != ContactEvent::kNone && config_.callback != nullptr) {
      config_.callback(record, config_.context);
    }
  }

  bool carries_load() const noexcept {
    for (const Scalar& value : load_) {
      if (value != Scalar(0)) return true;
    }
    return false;
  }

  void decide(const LoadColumns<Scalar, N>* columns, Scalar period, Record& record) noexcept {
    const bool settling = state_.settled < Deviation::kSettling / config_.thresholds.adaptation;
    if (settling) state_.settled += period;
    record.contact = state_.contact;
    record.judged = !settling;
    record.event = ContactEvent::kNone;
    record.load = {};
    const Scalar largest = compare(record);
    record.above = {};
    if (settling) {
      record.joint = -1;
      record.direction = 0;
      return;
    }
    const bool above = largest > Scalar(1);
    if (above) mark(record);
    if (!state_.contact) {
      state_.above = above ? state_.above + period : Scalar(0);
      if (!above || state_.above < config_.confirmation) return;
      state_.contact = true;
      state_.by_change = changes(record);
      state_.below = Scalar(0);
      state_.still = Scalar(0);
      state_.lasted = Scalar(0);
      state_.followed = record.residual;
      state_.body.reset();
      record.event = ContactEvent::kContact;
    } else {
      state_.lasted += period;
      const bool quiet = is_quiet(largest, record);
      state_.below = quiet ? state_.below + period : Scalar(0);
      if (quiet && state_.below >= config_.release) {
        end(ContactEvent::kReleased, record);
      } else if (stands_still(period, record)) {
        for (int j = 0; j < N; ++j) deviation_.accept(j);
        end(ContactEvent::kReleased, record);
      } else if (columns != nullptr) {
        look_for_load(*columns, period, record);
      }
    }
    record.contact = state_.contact;
  }

  /// Multiple of its threshold below which a change is quiet, while the contact lasts that it began; else 0. What the
  /// residual was before says less the longer it is ago.
  Scalar patience() const noexcept {
    return state_.contact && state_.by_change ? kQuiet * (Scalar(1) + kFading * state_.lasted) : Scalar(0);
  }

  /// Residual and change of each joint against their thresholds.
  /// @return the largest of them in thresholds
  Scalar compare(Record& record) const noexcept {
    const bool held = state_.contact && state_.by_change;
    Scalar largest(0);
    record.joint = 0;
    for (int j = 0; j < N; ++j) {
      const Scalar change = size(record.change[j]) / record.change_threshold[j];
      const Scalar level = size(record.residual[j]) / record.level_threshold[j];
      const bool by_change = held || change > level;
      const Scalar share = by_change ? change : level;
      record.deviation[j] = by_change ? record.change[j] : record.residual[j];
      record.threshold[j] = by_change ? record.change_threshold[j] : record.level_threshold[j];
      if (share > largest) {
        largest = share;
        record.joint = j;
      }
    }
    record.direction = record.deviation[record.joint] < Scalar(0) ? -1 : 1;
    return largest;
  }

  /// Which joints are above their thresholds.
  void mark(Record& record) const noexcept {
    for (int j = 0; j < N; ++j)
      record.above[static_cast<std::size_t>(j)] = size(record.deviation[j]) > record.threshold[j];
  }

  /// Whether the change of any joint is above its threshold.
  bool changes(const Record& record) const noexcept {
    for (int j = 0; j < N; ++j) {
      if (size(record.change[j]) > record.change_threshold[j]) return true;
    }
    return false;
  }

  /// Whether nothing touches the arm any more, given the largest of compare().
  bool is_quiet(Scalar largest, const Record& record) const noexcept {
    if (!state_.by_change) return largest < kQuiet;
    if (!(largest < patience())) return false;
    for (int j = 0; j < N; ++j) {
      if (!(size(record.residual[j]) < record.level_threshold[j])) return false;
    }
    return true;
  }

  static Scalar size(Scalar value) noexcept { return value < Scalar(0) ? -value : value; }

  /// Whether every residual has stood still, within what free motion may show.
  bool stands_still(Scalar period, const Record& record) noexcept {
    const Scalar follow = Scalar(1) - forgetting_(config_.thresholds.adaptation * period);
    bool still = true;
    for (int j = 0; j < N; ++j) {
      Scalar& followed = state_.followed[j];
      const Scalar apart = record.residual[j] - followed;
      const Scalar half = static_cast<Scalar>(0.5) * record.threshold[j];
      const Scalar limit = record.level_threshold[j];
      still = still && apart < half && apart > -half && followed < limit && followed > -limit;
      followed += follow * apart;
    }
    state_.still = still ? state_.still + period : Scalar(0);
    return state_.still >= config_.stand_still;
  }

  void look_for_load(const LoadColumns<Scalar, N>& columns, Scalar period, Record& record) noexcept {
    state_.body.add(columns, -record.deviation, record.threshold, period);
    if (state_.body.duration() < config_.persistence || !state_.body.poses_differ()) return;
    std::array<Scalar, 4> body{};
    if (state_.body.explained(body) < config_.load_share) return;
    record.load = body;
    for (std::size_t a = 0; a < body.size(); ++a) load_[a] += body[a];
    observer_.reset();
    deviation_.restart();
    state_.settled = Scalar(0);
    end(ContactEvent::kLoadChange, record);
  }

  void end(ContactEvent event, Record& record) noexcept {
    state_.contact = false;
    state_.above = Scalar(0);
    record.event = event;
  }

  /// Part of its threshold below which a deviation is no contact any more: free motion reaches half of it every few seconds.
  static constexpr Scalar kQuiet{static_cast<Scalar>(0.7)};
  /// Thresholds a second by which the residual of free motion moves away from what it was.
  static constexpr Scalar kFading{1};
  /// Bandwidth at which the observer passes the torque from outside on as it is [1/s]; ContactDeviation filters it.
  static constexpr Scalar kUnfiltered{1e5};

  Observer observer_;
  Deviation deviation_;
  KeptDecay<Scalar> forgetting_;  ///< of the mean of the residual, over a period
  Config config_{};
  State state_{};
  std::array<Scalar, 4> load_{};
  bool configured_{false};
};

}  // namespace heft

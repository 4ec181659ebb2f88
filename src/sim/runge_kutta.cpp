/// Pairs of Runge-Kutta methods from sample to sample.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include <fmt/format.h>

#include "heft/host/numbers.hpp"
#include "integrator.hpp"

namespace heft::sim {
namespace {

constexpr std::size_t kMostStages = 7;

/// A pair of methods on the same stages, of which the last is the first of the next step.
template <std::size_t Stages>
struct Pair {
  static constexpr std::size_t kStages = Stages;
  std::array<std::array<double, Stages>, Stages> a;  ///< row of the last stage: the solution
  std::array<double, Stages> c;
  std::array<double, Stages> error;  ///< solution less the one of the lower order
  double power;                      ///< of the error estimate's growth with the step, inverted, negative
};

/// The classical method of order 4 with the one of order 3 that puts the slope at the end in place of the fourth stage
/// (Hairer, Norsett and Wanner, 1993, section II.4).
constexpr Pair<5> kFourth = {{{{0.0},
                               {1.0 / 2.0},
                               {0.0, 1.0 / 2.0},
                               {0.0, 0.0, 1.0},
                               {1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0}}},
                             {0.0, 1.0 / 2.0, 1.0 / 2.0, 1.0, 1.0},
                             {0.0, 0.0, 0.0, 1.0 / 6.0, -1.0 / 6.0},
                             -1.0 / 4.0};

/// Orders 5 and 4 of Dormand and Prince (1980).
constexpr Pair<7> kFifth = {
    {{{0.0},
      {1.0 / 5.0},
      {3.0 / 40.0, 9.0 / 40.0},
      {44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0},
      {19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0},
      {9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0},
      {35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0}}},
    {0.0, 1.0 / 5.0, 3.0 / 10.0, 4.0 / 5.0, 8.0 / 9.0, 1.0, 1.0},
    {71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0},
    -1.0 / 5.0};

constexpr double kSafety = 0.9, kSmallest = 0.2, kLargest = 5.0;  // factors from one step size to the next
constexpr double kNegligible = 1e-4;  // error at which the step grows by kLargest, whatever the order
constexpr int kStepsOfFifth = 64;     // after which the fourth order is tried again
constexpr int kMostHalvings = 10;  // of a step in search of the time at which an event function is positive
constexpr int kMostSearches = 60;  // for the time of an event; a handful is usual
constexpr int kMostSecants = 20;   // of these; then halves

class RungeKutta final : public Integrator {
 public:
  RungeKutta(System& system, const SolverSettings& settings)
      : Integrator(system, settings),
        size_(state_.size()),
        roots_(events_.size(), 1.0),
        roots_after_(events_.size(), 1.0) {
    for (std::vector<double>& k : slopes_) k.assign(size_ + 1, 0.0);
    trial_.assign(size_, 0.0);
    if (settings.max_step > 0.0) largest_step_ = settings.max_step;
  }

  void start(double t, const double* q, const double* qd, const double* z) override {
    counts_.restarts += started_ ? 1 : 0;
    started_ = true;
    t_ = t;
    std::copy(q, q + n_, state_.begin());
    std::copy(qd, qd + n_, state_.begin() + n_);
    std::copy(z, z + m_, state_.begin() + 2 * n_);
    evaluate(t_, state_.data(), slopes_[0].data());
    take_roots();
    // As large as the error control lets it be; it shrinks by factors of five.
    if (!(step_ > 0.0)) step_ = kFirstStep;
  }

  Stop advance(double t_stop) override {
    while (t_stop - t_ > 1e-14 * std::max(1.0, std::abs(t_stop))) {
      const double left = t_stop - t_;
      choose_order(left);
      // Equal steps up to the stop.
      const double wanted = std::min(step_, largest_step_);
      const double h = wanted >= left ? left : left / std::ceil(left / wanted);
      if (!(steps_left_ >= 1.0)) throw_used_up();
      steps_left_ -= 1.0;
      const double error = try_step(h), power = fifth_ ? kFifth.power : kFourth.power;
      if (!(error <= 1.0)) {
        ++counts_.failed_steps;
        step_ =
            h * (std::isfinite(error) ? std::max(kSmallest, kSafety * std::pow(error, power)) : kSmallest);
        if (!(step_ > 4e-16 * std::max(1.0, std::abs(t_)))) throw_no_step("Runge-Kutta, step at rounding");
        continue;
      }
      ++counts_.steps;
      since_ += fifth_ ? 1 : 0;
      const double factor =
          error > kNegligible ? std::clamp(kSafety * std::pow(error, power), kSmallest, kLargest) : kLargest;
      // A step cut short by the stop says nothing against a longer one.
      step_ = std::min(h < wanted ? std::max(wanted, h * factor) : h * factor, kLongestStep);
      if (find_event(h)) return Stop::kEvent;
      accept(left == h ? t_stop : t_ + h);
    }
    t_ = t_stop;
    return Stop::kReached;
  }
  Stop advance_freely(double t_out, double) override { return advance(t_out); }

  void kick(const double*, const double* after, const double* rates) override {
    std::copy(after, after + n_, slopes_[0].begin() + n_);
    std::copy(rates, rates + m_, slopes_[0].begin() + 2 * n_);
    take_roots();
  }

  const double* acceleration() const override { return slopes_[0].data() + n_; }

  void add_counts(SolverCounts& counts) const override { counts += counts_; }

 private:
  static constexpr double kFirstStep = 1e-3, kLongestStep = 1.0;  // [s]

  /// The fourth order takes two thirds of the work a step, as long as one step reaches the stop.
  void choose_order(double left) {
    if (fifth_ && since_ >= kStepsOfFifth) {
      fifth_ = false;
      since_ = 0;
      step_ = std::max(step_, left);
    } else if (!fifth_ && step_ < left) {
      fifth_ = true;
      since_ = 0;
    }
  }

  /// Slopes of a state: velocities, accelerations, rates of the extra states.
  void evaluate(double t, const double* x, double* slope) {
    ++counts_.evaluations;
    std::copy(x + n_, x + 2 * n_, slope);
    try {
      system_.evaluate(t, x, x + n_, x + 2 * n_, slope + n_, slope + 2 * n_);
    } catch (const SimulationError&) {
      throw;
    } catch (const std::exception& e) {
      throw SimulationError(e.what());
    }
  }

  /// Event functions where evaluate() was called last.
  void roots_at(double t, const double* x, std::vector<double>& g) {
    if (system_.num_roots() == 0) return;
    ++counts_.event_evaluations;
    system_.roots_there(t, x, x + n_, x + 2 * n_, g.data());
  }
  void take_roots() { roots_at(t_, state_.data(), roots_); }

  /// trial_ and the slopes of a step of h. Returns its error over the tolerance, root of the mean of squares.
  double try_step(double h) { return fifth_ ? try_step<kFifth>(h) : try_step<kFourth>(h); }

  template <const auto& kPair>
  double try_step(double h) {
    constexpr std::size_t kStages = kPair.kStages;
    stages<kPair>(h, std::make_index_sequence<kStages - 1>());
    double sum = 0.0;
    for (std::size_t i = 0; i < size_; ++i) {
      double e = 0.0;
      for (std::size_t k = 0; k < kStages; ++k) {
        if (kPair.error[k] != 0.0) e += kPair.error[k] * slopes_[k][i];
      }
      const double weight =
          settings_.relative_tolerance * std::max(std::abs(state_[i]), std::abs(trial_[i])) +
          settings_.absolute_tolerance;
      sum += (h * e / weight) * (h * e / weight);
    }
    last_ = kStages - 1;
    return std::sqrt(sum / static_cast<double>(size_));
  }

  template <const auto& kPair, std::size_t... Before>
  void stages(double h, std::index_sequence<Before...>) {
    (stage<kPair, Before + 1>(h, std::make_index_sequence<Before + 1>()), ...);
  }
  template <const auto& kPair, std::size_t Stage, std::size_t... Before>
  void stage(double h, std::index_sequence<Before...>) {
    const std::array<const double*, sizeof...(Before)> k{slopes_[Before].data()...};
    for (std::size_t i = 0; i < size_; ++i) {
      double slope = 0.0;
      ((kPair.a[Stage][Before] != 0.0 ? void(slope += kPair.a[Stage][Before] * k[Before][i]) : void()), ...);
      trial_[i] = state_[i] + h * slope;
    }
    evaluate(t_ + kPair.c[Stage] * h, trial_.data(), slopes_[Stage].data());
  }

  void accept(double t) {
    t_ = t;
    state_.swap(trial_);
    slopes_[0].swap(slopes_[last_]);
    roots_.swap(roots_after_);
  }

  /// Whether an event function fell through zero; one that stays there did not.
  static bool fell(double before, double after) {
    return after <= 0.0 && before >= 0.0 && !(before == 0.0 && after == 0.0);
  }

  /// Whether an event function fell through zero in the step of h just tried; if so, ends at the first such time, on its far
  /// side.
  bool find_event(double h) {
    roots_at(t_ + h, trial_.data(), roots_after_);
    bool any = false;
    for (std::size_t k = 0; k < roots_.size(); ++k) any = any || fell(roots_[k], roots_after_[k]);
    if (!any) return false;
    // At `low` none has fallen, at `high` one has. A function that is zero at the beginning rises first.
    double low = 0.0, high = h, least_low = least(roots_), least_high = least(roots_after_);
    for (int halving = 0; halving < kMostHalvings && !(least_low > 0.0); ++halving) {
      const double at = 0.5 * high;
      least_low = least_after(at);
      if (least_low > 0.0) {
        low = at;
      } else {
        high = at;
        least_high = least_low;
      }
    }
    high = narrowed(low, high, least_low, least_high, 100.0 * 2.2e-16 * (std::abs(t_) + h));
    (void)least_after(high);
    for (std::size_t k = 0; k < events_.size(); ++k) events_[k] = fell(roots_[k], roots_after_[k]) ? -1 : 0;
    accept(t_ + high);
    return true;
  }

  /// The far end of the bracket, as close to the near one as asked, by false position; an end that stays twice counts half.
  double narrowed(double low, double high, double least_low, double least_high, double close) {
    int stayed = 0;
    for (int search = 0; search < kMostSearches && high - low > close; ++search) {
      const bool secant = search < kMostSecants && least_low > 0.0 && least_high < 0.0;
      const double at = std::clamp(
          secant ? low + (high - low) * least_low / (least_low - least_high) : 0.5 * (low + high),
          low + 0.25 * close, high - 0.25 * close);
      const double value = least_after(at);
      if (value > 0.0) {
        low = at;
        least_low = value;
        if (stayed > 0) least_high *= 0.5;
        stayed = 1;
      } else {
        high = at;
        least_high = value;
        if (stayed < 0) least_low *= 0.5;
        stayed = -1;
      }
    }
    return high;
  }

  /// Smallest of the event functions that were not negative at the beginning of the step.
  double least(const std::vector<double>& g) const {
    double smallest = kInfinity;
    for (std::size_t k = 0; k < g.size(); ++k) {
      if (!(roots_[k] < 0.0)) smallest = std::min(smallest, g[k]);
    }
    return smallest;
  }
  double least_after(double h) {
    (void)try_step(h);
    roots_at(t_ + h, trial_.data(), roots_after_);
    return least(roots_after_);
  }

  std::size_t size_;
  std::array<std::vector<double>, kMostStages> slopes_;
  std::size_t last_{0};  ///< slope at the end of the step tried
  std::vector<double> trial_;
  std::vector<double> roots_, roots_after_;  ///< event functions at t_ and after the step tried
  double step_{0.0};                         ///< that the error control would take next
  double largest_step_{kInfinity};
  bool started_{false};
  bool fifth_{false};
  int since_{0};  ///< steps of the fifth order since the fourth was tried
  SolverCounts counts_;
};

}  // namespace

std::unique_ptr<Integrator> make_runge_kutta(System& system, const SolverSettings& settings) {
  return std::make_unique<RungeKutta>(system, settings);
}

}  // namespace heft::sim

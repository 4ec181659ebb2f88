/// The search over motions: several starts, Ceres' line search, a barrier that is lowered step by step.
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>

#include <ceres/gradient_problem.h>
#include <ceres/gradient_problem_solver.h>
#include <fmt/format.h>
#include <glog/logging.h>

#include "design_impl.hpp"
#include "heft/host/error.hpp"
#include "heft/host/parallel.hpp"

namespace heft::excite {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Weight of the barrier in the short search from every start, then in the steps of a finalist. The objective is a
/// logarithm, so 1 is a factor e and the last step is within 0.1 % of the limits' worth.
constexpr double kFirstBarrier = 0.05;
constexpr std::array<double, 3> kBarriers = {1e-2, 1e-3, 1e-4};

/// Keeps Ceres from writing to standard error: users need not know that a line search restarts.
class Quiet {
 public:
  Quiet() : before_(FLAGS_minloglevel) { FLAGS_minloglevel = google::GLOG_FATAL; }
  ~Quiet() { FLAGS_minloglevel = before_; }
  Quiet(const Quiet&) = delete;
  Quiet& operator=(const Quiet&) = delete;

 private:
  int before_;
};

/// The point evaluated last, and its objective: an iteration of the search mostly ends where it looked last.
struct Known {
  VectorXd x;
  double pure{0.0};
};

class Cost final : public ceres::FirstOrderFunction {
 public:
  Cost(const ExcitationDesign::Impl& design, int size, double barrier, Known& known)
      : design_(design), size_(size), barrier_(barrier), known_(known) {}
  int NumParameters() const override { return size_; }
  bool Evaluate(const double* parameters, double* cost, double* gradient) const override {
    const Eigen::Map<const VectorXd> x(parameters, size_);
    VectorXd g;
    double pure = 0.0;
    if (!design_.evaluate(x, barrier_, *cost, gradient != nullptr ? &g : nullptr, &pure)) return false;
    known_ = {x, pure};
    if (gradient != nullptr) Eigen::Map<VectorXd>(gradient, size_) = g;
    return true;
  }

 private:
  const ExcitationDesign::Impl& design_;
  int size_;
  double barrier_;
  Known& known_;
};

/// Notes the objective at every iteration.
class History final : public ceres::IterationCallback {
 public:
  History(const ExcitationDesign::Impl& design, const VectorXd& x, const Known& known,
          std::vector<double>& values, const std::function<void()>& step)
      : design_(design), x_(x), known_(known), values_(values), step_(step) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary&) override {
    double cost = 0.0, pure = 0.0;
    if (known_.x.size() == x_.size() && known_.x == x_) {
      values_.push_back(known_.pure);
    } else if (design_.evaluate(x_, 0.0, cost, nullptr, &pure)) {
      values_.push_back(pure);
    }
    if (step_) step_();
    return ceres::SOLVER_CONTINUE;
  }

 private:
  const ExcitationDesign::Impl& design_;
  const VectorXd& x_;
  const Known& known_;
  std::vector<double>& values_;
  const std::function<void()>& step_;
};

/// One search, continued from its present point.
struct Search {
  VectorXd x;
  double value{std::numeric_limits<double>::quiet_NaN()};  ///< objective
  std::vector<double> history;
  bool works{false};
};

void minimise(const ExcitationDesign::Impl& design, Search& search, double barrier, int iterations,
              const std::function<void()>& step) {
  Known known;
  ceres::GradientProblem problem(new Cost(design, static_cast<int>(search.x.size()), barrier, known));
  ceres::GradientProblemSolver::Options options;
  options.line_search_direction_type = ceres::BFGS;
  options.max_num_iterations = iterations;
  options.function_tolerance = 1e-6;
  options.gradient_tolerance = 1e-6;
  // Next to a limit the stretch that the line search looks for, between too short a step and none at all, is narrow.
  options.max_num_line_search_step_size_iterations = 40;
  options.logging_type = ceres::SILENT;
  options.update_state_every_iteration = true;
  VectorXd x = search.x;
  History history(design, x, known, search.history, step);
  options.callbacks.push_back(&history);
  ceres::GradientProblemSolver::Summary summary;
  ceres::Solve(options, problem, x.data(), &summary);
  double cost = 0.0, pure = known.pure;
  const bool same = known.x.size() > 0 && known.x == x;
  if (same || (x.allFinite() && design.evaluate(x, 0.0, cost, nullptr, &pure))) {
    search.x = x;
    search.value = pure;
    search.works = true;
  }
}

/// Searches from several starts, of which the best are taken to the end.
class MultiStart {
 public:
  MultiStart(const ExcitationDesign::Impl& design, const std::function<void(double)>& progress)
      : design_(design),
        progress_(progress),
        finalists_(std::clamp(design.options.finalists, 1, design.options.starts)),
        searches_(static_cast<std::size_t>(design.options.starts)),
        order_(searches_.size()) {
    std::iota(order_.begin(), order_.end(), 0);
  }

  /// A short search from every start.
  void try_all() {
    run(searches_.size(), [&](std::size_t i) {
      Search& search = searches_[i];
      const std::uint64_t seed = design_.options.seed + 0x9e3779b97f4a7c15ULL * static_cast<std::uint64_t>(i);
      const ExcitationTrajectory motion = design_.random_motion(seed);
      // Drawn together until the barrier, infinite a little before the limits, has a value.
      double value = 0.0;
      for (const double factor : {0.9, 0.7, 0.5, 0.3, 0.1}) {
        search.x = design_.encode(design_.scaled(motion, factor));
        if (design_.evaluate(search.x, kFirstBarrier, value, nullptr)) break;
      }
      minimise(design_, search, kFirstBarrier, first_iterations(), step_);
    });
  }

  /// The best ones to the end.
  void finish() {
    run(static_cast<std::size_t>(finalists_), [&](std::size_t i) {
      Search& search = searches_[static_cast<std::size_t>(order_[i])];
      if (!search.works) return;
      const int each = std::max(1, design_.options.iterations / static_cast<int>(kBarriers.size()));
      for (const double barrier : kBarriers) minimise(design_, search, barrier, each, step_);
    });
  }

  int winner() const { return order_[0]; }
  const Search& best() const { return searches_[static_cast<std::size_t>(order_[0])]; }

  /// Objective of every start; NaN where it has none.
  std::vector<double> costs() const {
    std::vector<double> costs;
    for (const Search& search : searches_) costs.push_back(search.works ? search.value : std::nan(""));
    return costs;
  }

 private:
  int first_iterations() const { return std::max(1, 3 * design_.options.iterations / 20); }

  /// Runs jobs, shows progress, and puts the searches in order.
  void run(std::size_t count, const std::function<void(std::size_t)>& job) {
    const double expected = static_cast<double>(design_.options.starts) * first_iterations() +
                            static_cast<double>(finalists_) * design_.options.iterations;
    std::function<void(double)> watch;
    if (progress_) watch = [&](double) { progress_(std::min(1.0, static_cast<double>(steps_) / expected)); };
    host::for_each_parallel(count, job, watch, static_cast<std::size_t>(std::max(0, design_.options.threads)));
    std::stable_sort(order_.begin(), order_.end(), [&](int a, int b) {
      const Search &A = searches_[static_cast<std::size_t>(a)], &B = searches_[static_cast<std::size_t>(b)];
      if (A.works != B.works) return A.works;
      return A.works && A.value < B.value;
    });
  }

  const ExcitationDesign::Impl& design_;
  const std::function<void(double)>& progress_;
  int finalists_;
  std::vector<Search> searches_;
  std::vector<int> order_;  ///< best first
  std::atomic<long> steps_{0};
  const std::function<void()> step_ = [this] { ++steps_; };
};

}  // namespace

Excitation ExcitationDesign::Impl::optimize(const std::function<void(double)>& progress) const {
  const Quiet quiet;
  const auto refuse = [&](const MatrixXd& information, const std::string& motion) {
    throw NotIdentifiableError(fmt::format(
        "robot \"{}\": {} of {} harmonics over {:.4g} s determines all {} parameters; undetermined: {}. More "
        "harmonics (--harmonics), a shorter period, which makes accelerations larger, or wider limits are "
        "needed",
        columns.robot().name, motion, options.harmonics, options.duration, b(),
        weakest(information + given_noise)));
  };

  MultiStart starts(*this, progress);
  starts.try_all();
  MatrixXd by_noise, by_unit;
  if (!starts.best().works) {
    information(random_motion(options.seed), by_noise, by_unit);
    refuse(by_noise, "no motion tried");
  }
  starts.finish();

  Excitation result;
  result.winner = starts.winner();
  result.history = starts.best().history;
  result.costs = starts.costs();
  result.scale = drawn_together(decode(starts.best().x), fine, 0.998, result.trajectory);
  information(result.trajectory, by_noise, by_unit);
  result.score = score_of(by_noise + given_noise, by_unit + given_unit);
  // Beyond this the fit divides by nothing: one part in 10⁵ of a column decides.
  if (!(result.score.condition < 1e5)) {
    refuse(by_noise,
           fmt::format("not even the best motion found (condition number {:.3g})", result.score.condition));
  }
  if (progress) progress(1.0);
  return result;
}

}  // namespace heft::excite

/// The search over motions: several starts, Ceres' line search, a barrier that is lowered step by step.
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <exception>
#include <limits>
#include <mutex>
#include <numeric>
#include <thread>

#include <ceres/gradient_problem.h>
#include <ceres/gradient_problem_solver.h>
#include <fmt/format.h>
#include <glog/logging.h>

#include "design_impl.hpp"
#include "heft/host/error.hpp"

namespace heft::excite {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Weight of the barrier in the first look at every start, then in the steps of a finalist. The objective is a
/// logarithm, so 1 is a factor e and the last step is within 0.1 % of the limits' worth.
constexpr double kFirstBarrier = 0.05;
constexpr std::array<double, 3> kBarriers = {1e-2, 1e-3, 1e-4};

/// Keeps Ceres from writing to standard error: a line search that restarts is no news to a user.
class Quiet {
 public:
  Quiet() : before_(FLAGS_minloglevel) { FLAGS_minloglevel = google::GLOG_FATAL; }
  ~Quiet() { FLAGS_minloglevel = before_; }
  Quiet(const Quiet&) = delete;
  Quiet& operator=(const Quiet&) = delete;

 private:
  int before_;
};

class Cost final : public ceres::FirstOrderFunction {
 public:
  Cost(const ExcitationDesign::Impl& design, int size, double barrier)
      : design_(design), size_(size), barrier_(barrier) {}
  int NumParameters() const override { return size_; }
  bool Evaluate(const double* parameters, double* cost, double* gradient) const override {
    const Eigen::Map<const VectorXd> x(parameters, size_);
    VectorXd g;
    if (!design_.evaluate(x, barrier_, *cost, gradient != nullptr ? &g : nullptr)) return false;
    if (gradient != nullptr) Eigen::Map<VectorXd>(gradient, size_) = g;
    return true;
  }

 private:
  const ExcitationDesign::Impl& design_;
  int size_;
  double barrier_;
};

/// Notes the objective at every iteration.
class History final : public ceres::IterationCallback {
 public:
  History(const ExcitationDesign::Impl& design, const VectorXd& x, std::vector<double>& values,
          const std::function<void()>& step)
      : design_(design), x_(x), values_(values), step_(step) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary&) override {
    double cost = 0.0, pure = 0.0;
    if (design_.evaluate(x_, 0.0, cost, nullptr, &pure)) values_.push_back(pure);
    if (step_) step_();
    return ceres::SOLVER_CONTINUE;
  }

 private:
  const ExcitationDesign::Impl& design_;
  const VectorXd& x_;
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
  ceres::GradientProblem problem(new Cost(design, static_cast<int>(search.x.size()), barrier));
  ceres::GradientProblemSolver::Options options;
  options.line_search_direction_type = ceres::BFGS;
  options.max_num_iterations = iterations;
  options.function_tolerance = 1e-5;
  options.gradient_tolerance = 1e-6;
  options.logging_type = ceres::SILENT;
  options.update_state_every_iteration = true;
  VectorXd x = search.x;
  History history(design, x, search.history, step);
  options.callbacks.push_back(&history);
  ceres::GradientProblemSolver::Summary summary;
  ceres::Solve(options, problem, x.data(), &summary);
  double cost = 0.0, pure = 0.0;
  if (x.allFinite() && design.evaluate(x, 0.0, cost, nullptr, &pure)) {
    search.x = x;
    search.value = pure;
    search.works = true;
  }
}

/// job(0) .. job(count − 1) on so many threads; `watch` is called meanwhile from the calling one.
void in_parallel(int count, int threads, const std::function<void(int)>& job,
                 const std::function<void()>& watch) {
  std::atomic<int> next{0}, done{0};
  std::exception_ptr failure;
  std::mutex guard;
  const auto work = [&] {
    for (int i = next++; i < count; i = next++) {
      try {
        job(i);
      } catch (...) {
        const std::lock_guard<std::mutex> lock(guard);
        if (!failure) failure = std::current_exception();
      }
      ++done;
    }
  };
  std::vector<std::thread> pool;
  for (int t = 0; t < std::min(threads, count); ++t) pool.emplace_back(work);
  while (done < count) {
    if (watch) watch();
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  for (std::thread& thread : pool) thread.join();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace

Excitation ExcitationDesign::Impl::optimize(const std::function<void(double)>& progress) const {
  const int threads = options.threads > 0
                          ? options.threads
                          : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  const Quiet quiet;
  const int finalists = std::clamp(options.finalists, 1, options.starts);
  const int first = std::max(1, options.iterations / 5);
  const double expected =
      static_cast<double>(options.starts) * first + static_cast<double>(finalists) * options.iterations;
  std::atomic<long> steps{0};
  const std::function<void()> step = [&] { ++steps; };
  const auto watch = [&] {
    if (progress) progress(std::min(1.0, static_cast<double>(steps) / expected));
  };

  const auto refuse = [&](const MatrixXd& information, const std::string& motion) {
    throw NotIdentifiableError(fmt::format(
        "robot \"{}\": {} of {} harmonics over {:.4g} s determines all {} parameters; undetermined: {}. More "
        "harmonics (--harmonics), a shorter period, which makes accelerations larger, or wider limits are "
        "needed",
        columns.robot().name, motion, options.harmonics, options.duration, b(),
        weakest(information + given_noise)));
  };

  // A look at every start.
  std::vector<Search> searches(static_cast<std::size_t>(options.starts));
  in_parallel(
      options.starts, threads,
      [&](int i) {
        Search& search = searches[static_cast<std::size_t>(i)];
        const std::uint64_t seed = options.seed + 0x9e3779b97f4a7c15ULL * static_cast<std::uint64_t>(i);
        const ExcitationTrajectory motion = random_motion(seed);
        // Drawn together until the barrier, infinite a little before the limits, has a value.
        double value = 0.0;
        for (const double factor : {0.9, 0.7, 0.5, 0.3, 0.1}) {
          search.x = encode(scaled(motion, factor));
          if (evaluate(search.x, kFirstBarrier, value, nullptr)) break;
        }
        minimise(*this, search, kFirstBarrier, first, step);
      },
      watch);

  std::vector<int> order(searches.size());
  std::iota(order.begin(), order.end(), 0);
  const auto better = [&](int a, int b) {
    const Search &A = searches[static_cast<std::size_t>(a)], &B = searches[static_cast<std::size_t>(b)];
    if (A.works != B.works) return A.works;
    return A.works && A.value < B.value;
  };
  std::stable_sort(order.begin(), order.end(), better);
  if (!searches[static_cast<std::size_t>(order[0])].works) {
    MatrixXd by_noise, by_unit;
    information(random_motion(options.seed), by_noise, by_unit);
    refuse(by_noise, "no motion tried");
  }

  // The best to the end.
  in_parallel(
      finalists, threads,
      [&](int i) {
        Search& search = searches[static_cast<std::size_t>(order[static_cast<std::size_t>(i)])];
        if (!search.works) return;
        const int each = std::max(1, options.iterations / static_cast<int>(kBarriers.size()));
        for (const double barrier : kBarriers) minimise(*this, search, barrier, each, step);
      },
      watch);
  std::stable_sort(order.begin(), order.end(), better);

  Excitation result;
  result.winner = order[0];
  const Search& best = searches[static_cast<std::size_t>(order[0])];
  result.history = best.history;
  for (const Search& search : searches) result.costs.push_back(search.works ? search.value : std::nan(""));
  result.scale = drawn_together(decode(best.x), fine, 0.998, result.trajectory);
  MatrixXd by_noise, by_unit;
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

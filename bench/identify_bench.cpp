// Throughput and memory of identification: samples of log per second, and peak memory against the length of the
// log, which must not grow with it. `identify_bench --check-memory SHORT LONG` asserts that on logs of so many
// samples (10000 and 100000 when not given) and measures nothing else.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <numbers>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <malloc.h>
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#include <Eigen/Core>

#include "heft/data/log_set.hpp"
#include "heft/data/motion_stream.hpp"
#include "heft/host/file.hpp"
#include "heft/host/parallel.hpp"
#include "heft/identify/fit.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/regression/base_parameters.hpp"
#include "heft/regression/observations.hpp"
#include "heft/regression/regression_columns.hpp"
#include "heft/regression/triangular_factor.hpp"
#include "heft/urdf/urdf_import.hpp"

namespace {

using namespace heft;
namespace fs = std::filesystem;

constexpr double kSampleRate = 1000.0;  // [Hz]

/// A folder of its own, gone at the end.
class ScratchFolder {
 public:
  ScratchFolder() {
    std::string pattern = (fs::temp_directory_path() / "heft_bench_XXXXXX").string();
    if (::mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("no temporary folder for the logs");
    path_ = pattern;
  }
  ~ScratchFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  std::string path(const std::string& name) const { return (path_ / name).string(); }

 private:
  fs::path path_;
};

const ScratchFolder& scratch() {
  static const ScratchFolder folder;
  return folder;
}

model::Robot robot() { return urdf::load_urdf(HEFT_BENCH_URDF); }

// -----------------------------------------------------------------------------------------------------
// Children: each measured run is a process of its own, so that its peak memory is its own.

struct Run {
  bool ok{false};
  double seconds{0.0};
  double processor_seconds{0.0};  ///< of the program itself, on all processors together
  double peak_megabytes{0.0};
  std::string said;  ///< standard output and error
};

/// Runs `body` in a child; what it returns is the exit code.
Run run_in_child(const std::function<int()>& body) {
  const std::string said = scratch().path("said.txt");
  std::fflush(nullptr);
  const auto begin = std::chrono::steady_clock::now();
  const pid_t child = ::fork();
  if (child < 0) throw std::runtime_error("cannot start a process");
  if (child == 0) {
    const int file = ::open(said.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    ::dup2(file, STDOUT_FILENO);
    ::dup2(file, STDERR_FILENO);
    int code = 1;
    try {
      code = body();
    } catch (const std::exception& error) {
      fmt::print("{}\n", error.what());
    }
    std::fflush(nullptr);
    ::_exit(code);
  }
  int status = 0;
  rusage usage{};
  if (::wait4(child, &status, 0, &usage) != child) throw std::runtime_error("a child process got lost");
  Run run;
  run.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  run.processor_seconds = static_cast<double>(usage.ru_utime.tv_sec) + 1e-6 * static_cast<double>(usage.ru_utime.tv_usec);
  run.ok = WIFEXITED(status) && WEXITSTATUS(status) == 0;
  run.peak_megabytes = static_cast<double>(usage.ru_maxrss) / 1024.0;  // kB on Linux
  run.said = host::read_file(said, "output");
  return run;
}

/// Memory of this process so far [MB]: a child begins with it, so no smaller peak can be seen.
double own_megabytes() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

// -----------------------------------------------------------------------------------------------------
// Logs.

/// A periodic motion (20 s, ten harmonics) at 1 kHz with its torque; encoder noise 2e-5 rad, torque noise
/// 0.5 N·m. Written as it goes: one period is kept.
void write_synthetic_log(const std::string& path, long samples) {
  model::Robot truth = robot();
  for (std::size_t k = 0; k < truth.joints.size(); ++k) {
    for (double& value : truth.joints[k].link) value *= 0.8 + 0.1 * static_cast<double>(k);
    truth.joints[k].actuation = {1.0, 6.0, 4.0, 0.5};
  }
  const model::Dynamics dynamics(truth);
  const int n = truth.num_joints();
  constexpr double kPeriod = 20.0;
  constexpr int kHarmonics = 10;
  constexpr long kRows = static_cast<long>(kPeriod * kSampleRate);
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> uniform(-0.35, 0.35);
  const Eigen::MatrixXd a = Eigen::MatrixXd::NullaryExpr(n, kHarmonics, [&] { return uniform(random); });
  const Eigen::MatrixXd b = Eigen::MatrixXd::NullaryExpr(n, kHarmonics, [&] { return uniform(random); });
  Eigen::MatrixXd period(std::min(kRows, samples), 2 * n);
  for (Eigen::Index row = 0; row < period.rows(); ++row) {
    Eigen::VectorXd q = Eigen::VectorXd::Zero(n), qd = q, qdd = q;
    for (int h = 0; h < kHarmonics; ++h) {
      // q̇ = Σ a cos(ω t) + b sin(ω t),   ω = 2π (h+1) / T
      const double omega = 2.0 * std::numbers::pi * (h + 1) / kPeriod;
      const double angle = omega * static_cast<double>(row) / kSampleRate;
      q += (a.col(h) * std::sin(angle) - b.col(h) * std::cos(angle)) / omega;
      qd += a.col(h) * std::cos(angle) + b.col(h) * std::sin(angle);
      qdd += omega * (b.col(h) * std::cos(angle) - a.col(h) * std::sin(angle));
    }
    period.row(row) << q.transpose(), dynamics.joint_torque(q, qd, qdd).transpose();
  }

  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "wb"), &std::fclose);
  if (!file) throw std::runtime_error("cannot write " + path);
  std::normal_distribution<double> noise;
  std::string text = "time";
  for (int j = 1; j <= n; ++j) text += fmt::format(",q{}", j);
  for (int j = 1; j <= n; ++j) text += fmt::format(",tau{}", j);
  text += '\n';
  for (long row = 0; row < samples; ++row) {
    fmt::format_to(std::back_inserter(text), "{:.3f}", static_cast<double>(row) / kSampleRate);
    for (int j = 0; j < 2 * n; ++j) {
      const double value = period(row % kRows, j) + (j < n ? 2e-5 : 0.5) * noise(random);
      fmt::format_to(std::back_inserter(text), ",{:.6f}", value);
    }
    text += '\n';
    if (text.size() > 1u << 16 || row + 1 == samples) {
      if (std::fwrite(text.data(), 1, text.size(), file.get()) != text.size())
        throw std::runtime_error("cannot write " + path + ": is the disk full?");
      text.clear();
    }
  }
}

/// Path of a log of so many samples, made when first asked for. A child makes it, to keep this process small.
std::string log_of(long samples) {
  const std::string path = scratch().path(fmt::format("log_{}.csv", samples));
  if (!fs::exists(path)) {
    const Run run = run_in_child([&] {
      write_synthetic_log(path, samples);
      return 0;
    });
    if (!run.ok) throw std::runtime_error("making a log failed: " + run.said);
  }
  return path;
}

// -----------------------------------------------------------------------------------------------------
// The stages. Each takes a log of so many samples through, in a child.

data::MotionStream stream_of(const std::string& log) {
  data::LogRequirements needs;
  needs.num_joints = 6;
  needs.torque = true;
  return data::MotionStream(log, needs);
}

/// Reads the log alone, into memory.
int take_text(const std::string& log) { return std::isfinite(data::read_log(log, {}).tau.sum()) ? 0 : 1; }

/// Reads the log, checks it for unit slips and keeps its rows, as every command does first.
int take_log(const std::string& log) {
  data::LogFiles files;
  files.train = {log};
  const data::LogSet logs = data::open_logs(robot().joint_specs(), files);
  return logs.train().size() == 1 ? 0 : 1;
}

/// The same, and derives the motion.
int take_motion(const std::string& log) {
  const data::MotionStream stream = stream_of(log);
  double sum = 0.0;
  stream.for_each([&](const data::MotionChunk& chunk) { sum += chunk.qdd.sum(); });
  return std::isfinite(sum) ? 0 : 1;
}

/// The same, and the filtered rows of the base regressor with their torque.
int take_rows(const std::string& log) {
  const data::MotionStream stream = stream_of(log);
  const regression::RegressionColumns columns(robot(), {});
  const regression::BaseParameters base = regression::find_base_parameters(columns);
  double sum = 0.0;
  regression::for_each_observation(columns, base.kept, {&stream}, {},
                                   [&](const regression::ObservationRows& rows) { sum += rows.W.sum(); });
  return std::isfinite(sum) ? 0 : 1;
}

/// The same, and the triangular factors, solved: parameters, intervals, links, bias test.
int take_fit(const std::string& log) {
  const data::MotionStream stream = stream_of(log);
  const identify::Fit fit = identify::fit(robot(), {&stream});
  return fit.beta.allFinite() ? 0 : 1;
}

/// The command, started as a user starts it.
int take_command(const std::string& log) {
  const std::string out = scratch().path("model.json");
  ::execl(HEFT_BENCH_COMMAND, "heft", "identify", "--urdf", HEFT_BENCH_URDF, "--log", log.c_str(), "-o",
          out.c_str(), static_cast<char*>(nullptr));
  throw std::runtime_error(fmt::format("cannot start {}: {}", HEFT_BENCH_COMMAND, std::strerror(errno)));
}

struct Stage {
  const char* name;
  int (*take)(const std::string& log);
};
constexpr Stage kText{"text", &take_text};
constexpr Stage kLog{"read", &take_log};
constexpr Stage kMotion{"motion", &take_motion};
constexpr Stage kRegressorRows{"rows", &take_rows};
constexpr Stage kFit{"fit", &take_fit};
constexpr Stage kCommand{"command", &take_command};

void stage(benchmark::State& state, const Stage& which) {
  const long samples = state.range(0);
  const std::string log = log_of(samples);
  double peak = 0.0, processor = 0.0;
  for (auto _ : state) {
    const Run run = run_in_child([&] { return which.take(log); });
    if (!run.ok) {
      state.SkipWithError(run.said.c_str());
      return;
    }
    state.SetIterationTime(run.seconds);
    peak = std::max(peak, run.peak_megabytes);
    processor += run.processor_seconds;
  }
  const double megabytes = static_cast<double>(fs::file_size(log)) / 1e6;
  state.counters["processor_s"] = benchmark::Counter(processor, benchmark::Counter::kAvgIterations);
  state.counters["MB_a_core_second"] =
      megabytes * static_cast<double>(state.iterations()) / std::max(processor, 1e-9);
  state.counters["samples_per_second"] =
      benchmark::Counter(static_cast<double>(samples), benchmark::Counter::kIsIterationInvariantRate);
  state.counters["peak_MB"] = peak;
  state.counters["log_MB"] = static_cast<double>(fs::file_size(log)) / (1024.0 * 1024.0);
}

void at_three_lengths(benchmark::internal::Benchmark* b) {
  b->Arg(10'000)->Arg(100'000)->Arg(1'000'000)->Iterations(1)->UseManualTime()->Unit(benchmark::kMillisecond);
}
BENCHMARK_CAPTURE(stage, text, kText)->Name("log/text")->Apply(at_three_lengths);
BENCHMARK_CAPTURE(stage, read, kLog)->Name("log/read")->Apply(at_three_lengths);
BENCHMARK_CAPTURE(stage, motion, kMotion)->Name("log/motion")->Apply(at_three_lengths);
BENCHMARK_CAPTURE(stage, rows, kRegressorRows)->Name("log/rows")->Apply(at_three_lengths);
BENCHMARK_CAPTURE(stage, fit, kFit)->Name("log/fit")->Apply(at_three_lengths);
BENCHMARK_CAPTURE(stage, command, kCommand)->Name("log/command")->Apply(at_three_lengths);

// -----------------------------------------------------------------------------------------------------
// The two inner loops, in this process.

void regressor(benchmark::State& state) {
  const regression::RegressionColumns columns(robot(), {});
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> uniform(-3.0, 3.0);
  const Eigen::MatrixXd states =
      Eigen::MatrixXd::NullaryExpr(3 * columns.num_joints(), 256, [&] { return uniform(random); });
  const int n = columns.num_joints();
  Eigen::Index k = 0;
  for (auto _ : state) {
    const auto x = states.col(k);
    benchmark::DoNotOptimize(columns.regressor(x.head(n), x.segment(n, n), x.tail(n)));
    k = (k + 1) % states.cols();
  }
  state.counters["samples_per_second"] =
      benchmark::Counter(1.0, benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(regressor);

/// Pieces of so many rows of each joint.
void triangular_factor(benchmark::State& state) {
  const regression::RegressionColumns columns(robot(), {});
  const int p = regression::find_base_parameters(columns).count(), n = columns.num_joints();
  const Eigen::Index rows = state.range(0);
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  const Eigen::MatrixXd W = Eigen::MatrixXd::NullaryExpr(rows, p, [&] { return normal(random); });
  const Eigen::VectorXd y = Eigen::VectorXd::NullaryExpr(rows, [&] { return normal(random); });
  std::vector<regression::TriangularFactor> factors(static_cast<std::size_t>(n),
                                                    regression::TriangularFactor(p));
  for (auto _ : state) {
    for (regression::TriangularFactor& factor : factors) factor.add(W, y);
  }
  benchmark::DoNotOptimize(factors);
  state.counters["samples_per_second"] =
      benchmark::Counter(static_cast<double>(rows), benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(triangular_factor)->Arg(100)->Arg(1000)->ArgName("rows")->Unit(benchmark::kMicrosecond);

// -----------------------------------------------------------------------------------------------------

/// 0 when the longer log takes at most a tenth more memory.
int check_memory(long short_log, long long_log) {
  bool grows = false;
  for (const Stage& which : {kFit, kCommand}) {
    double peak[2] = {0.0, 0.0};
    for (const long samples : {short_log, long_log}) {
      const std::string log = log_of(samples);
      const double floor = own_megabytes();
      const Run run = run_in_child([&] {
        // As the command does: threads come and go, and freed memory in a heap for each differs from run to run.
        ::mallopt(M_ARENA_MAX, static_cast<int>(std::max(1U, std::thread::hardware_concurrency())));
        return which.take(log);
      });
      if (!run.ok) {
        fmt::print(stderr, "{}: failed on {} samples: {}\n", which.name, samples, run.said);
        return 1;
      }
      if (run.peak_megabytes <= floor) {
        fmt::print(stderr, "{}: its peak of {:.1f} MB cannot be seen below the {:.1f} MB of this program\n",
                   which.name, run.peak_megabytes, floor);
        return 1;
      }
      peak[samples == long_log ? 1 : 0] = run.peak_megabytes;
    }
    const bool too_much = peak[1] > 1.1 * peak[0];
    fmt::print(
        "{}: peak memory {:.1f} MB on {} samples, {:.1f} MB on {} samples: {:+.1f} %, at most +10 %: {}\n",
        which.name, peak[0], short_log, peak[1], long_log, 100.0 * (peak[1] / peak[0] - 1.0),
        too_much ? "missed" : "kept");
    grows = grows || too_much;
  }
  return grows ? 1 : 0;
}

void explain() {
  fmt::print(stderr, R"(
UR10e, 1 kHz, a CSV log of time, q1..q6, tau1..tau6; N samples is N rows. Cases with an N are processes of
their own:
  log/text/N      reads the log alone, into memory, which therefore grows
  log/read/N      reads the log, checks it for unit slips, rows kept for later passes
  log/motion/N    the same, then grid, cut-off, velocity and acceleration
  log/rows/N      the same, then the base regressor at every sample, low-pass and decimation with the torque
  log/fit/N       the same, then triangular factors, solution, intervals, link parameters, bias test
  log/command/N   `heft identify` from start to exit, model file written
  regressor       the full regressor at one state
  triangular_factor/rows   QR update by so many samples, a factor a joint
samples_per_second  samples of log over wall time; a plain Python script: bench/identify_baseline.py
processor_s         processor time of the program, all threads together
MB_a_core_second    size of the log over processor_s: the figure of log/text
peak_MB             largest resident memory of the process; not to grow with N
log_MB              size of the log
)");
}

}  // namespace

int main(int argc, char** argv) {
  try {
    if (argc > 1 && std::strcmp(argv[1], "--check-memory") == 0) {
      const long short_log = argc == 4 ? std::atol(argv[2]) : 10'000;
      const long long_log = argc == 4 ? std::atol(argv[3]) : 100'000;
      if ((argc != 2 && argc != 4) || short_log < 1 || long_log <= short_log) {
        fmt::print(stderr,
                   "identify_bench: expected --check-memory, or --check-memory SHORT LONG in samples\n");
        return 2;
      }
      return check_memory(short_log, long_log);
    }
    benchmark::Initialize(&argc, argv);
    if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
    benchmark::RunSpecifiedBenchmarks();
    benchmark::Shutdown();
  } catch (const std::exception& error) {
    fmt::print(stderr, "identify_bench: {}\n", error.what());
    return 1;
  }
  explain();
  return 0;
}

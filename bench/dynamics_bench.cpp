// Dynamics of many states with geometry of run time: heft one by one and in lanes, KDL, and Pinocchio and MuJoCo where they
// are there (bench/dynamics installs them). All in one run on the same numbers, turn by turn, and compared before they
// are timed. `dynamics_bench -h`
#include <time.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "dynamics_contest.hpp"
#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/dynamics/joint_space.hpp"
#include "heft/core/dynamics/regressor.hpp"
#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/model/batch_dynamics.hpp"
#include "heft/model/named_arms.hpp"
#include "heft/model/robot_of.hpp"
#include "heft/page/table.hpp"
#include "heft/urdf/urdf_import.hpp"

namespace heft::bench {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

const char* to_string(Quantity quantity) {
  switch (quantity) {
    case Quantity::kTorque: return "inverse dynamics";
    case Quantity::kRegressor: return "regressor rows";
    case Quantity::kMassMatrix: return "mass matrix";
    case Quantity::kAcceleration: return "forward dynamics";
  }
  return "?";
}

/// Random motion, so that nothing is predicted.
StateSet random_states(const model::Robot& robot, Index count) {
  const Index n = robot.num_joints();
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  StateSet s{MatrixXd(count, n), MatrixXd(count, n), MatrixXd(count, n), MatrixXd(count, n)};
  for (Index k = 0; k < count; ++k) {
    for (Index j = 0; j < n; ++j)
      s.q(k, j) = 3 * uniform(random), s.qd(k, j) = 2 * uniform(random), s.qdd(k, j) = 10 * uniform(random);
  }
  model::BatchDynamics(robot, model::Lanes::kBaseline).inverse_dynamics(s.q, s.qd, s.qdd, s.tau);
  return s;
}

/// Core's templates, one state at a time: what a controller calls.
template <int N>
std::vector<Contestant> one_by_one(const model::Robot& robot) {
  using Arm = DynamicArm<double, N>;
  using Vector = JointVector<double, N>;
  const Arm arm(model::to_arm_model<N>(robot));
  const Eigen::VectorXd x = link_parameters_of(robot);
  const std::string name = "heft, one by one";
  return {{name, Quantity::kTorque,
           [arm](const StateSet& s, Results& out) {
             for (Index k = 0; k < s.q.rows(); ++k)
               out.values.row(k) =
                   inverse_dynamics(arm, Vector(s.q.row(k)), Vector(s.qd.row(k)), Vector(s.qdd.row(k)));
           }},
          {name, Quantity::kRegressor,
           [arm, x](const StateSet& s, Results& out) {
             LinkRegressor<double, N> Y;
             for (Index k = 0; k < s.q.rows(); ++k) {
               const Vector q = s.q.row(k);
               link_regressor(arm, joint_trigonometry<Arm>(q), q, Vector(s.qd.row(k)), Vector(s.qdd.row(k)), Y);
               if (out.checked) out.values.row(k) = Y * x;
             }
           }},
          {name, Quantity::kMassMatrix,
           [arm](const StateSet& s, Results& out) {
             MassMatrix<double, N> M;
             for (Index k = 0; k < s.q.rows(); ++k) {
               const Vector q = s.q.row(k);
               mass_matrix(arm, joint_trigonometry<Arm>(q), q, M);
               out.values.row(k) = M.reshaped();
             }
           }},
          {name, Quantity::kAcceleration, [arm](const StateSet& s, Results& out) {
             MassMatrix<double, N> M;
             Vector bias, qdd;
             for (Index k = 0; k < s.q.rows(); ++k) {
               const Vector q = s.q.row(k);
               const JointTrigonometry<Arm> trig = joint_trigonometry<Arm>(q);
               mass_matrix(arm, trig, q, M);
               bias_torque(arm, trig, q, Vector(s.qd.row(k)), bias);
               if (forward_dynamics<double, N>(M, bias, Vector::Zero(), Vector(s.tau.row(k)), qdd) == Status::kOk)
                 out.values.row(k) = qdd;
             }
           }}};
}

std::vector<Contestant> in_lanes(const model::Robot& robot, model::Lanes lanes) {
  const auto batch = std::make_shared<model::BatchDynamics>(robot, lanes);
  const Index n = robot.num_joints();
  const std::string name = fmt::format("heft, {} lanes", to_string(lanes));
  // Of each joint the columns of its own link and those outboard of it; the others are zero.
  std::vector<std::vector<int>> columns(static_cast<std::size_t>(n));
  for (Index j = 0; j < n; ++j) {
    for (Index c = 10 * j; c < 10 * n; ++c) columns[static_cast<std::size_t>(j)].push_back(static_cast<int>(c));
  }
  const auto rows = std::make_shared<model::RegressorRows>();
  const Eigen::VectorXd x = link_parameters_of(robot);
  return {{name, Quantity::kTorque,
           [batch](const StateSet& s, Results& out) {
             batch->inverse_dynamics(s.q, s.qd, s.qdd, out.values);
           }},
          {name, Quantity::kRegressor,
           [batch, columns, rows, x, n](const StateSet& s, Results& out) {
             /// As a fit takes them: used before they leave the cache.
             constexpr Index kBlock = 256;
             for (Index first = 0; first < s.q.rows(); first += kBlock) {
               const Index size = std::min(kBlock, s.q.rows() - first);
               batch->regressor_rows(s.q.middleRows(first, size), s.qd.middleRows(first, size),
                                     s.qdd.middleRows(first, size), columns, *rows);
               for (Index j = 0; out.checked && j < n; ++j)
                 out.values.col(j).segment(first, size) = (*rows)[static_cast<std::size_t>(j)] * x.tail(10 * (n - j));
             }
           }},
          {name, Quantity::kMassMatrix,
           [batch](const StateSet& s, Results& out) { batch->mass_matrix(s.q, out.values); }},
          {name, Quantity::kAcceleration, [batch](const StateSet& s, Results& out) {
             batch->forward_dynamics(s.q, s.qd, s.tau, out.values);
           }}};
}

/// Processor time of this thread [ns].
double now() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) * 1e9 + static_cast<double>(t.tv_nsec);
}

struct Figure {
  std::string robot;
  Contestant contestant;
  Results results;
  std::vector<double> times{};  ///< [ns] a state, one a round

  std::string name() const {
    return fmt::format("{}: {}: {}", robot, to_string(contestant.quantity), contestant.name);
  }
  double least() const { return *std::min_element(times.begin(), times.end()); }
  double median() const {
    std::vector<double> sorted = times;
    std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2), sorted.end());
    return sorted[sorted.size() / 2];
  }
};

/// All that compute a robot's dynamics, checked against each other.
/// @throws ModelError when two differ
std::vector<Figure> figures_of(const std::string& robot_name, model::Robot robot, const StateSet& states) {
  // The others have no rotors.
  for (model::RobotJoint& joint : robot.joints) joint.actuation = {};
  // No other sizes, which the compiler would weigh against each other when it inlines.
  std::vector<Contestant> all = robot.num_joints() == 6 ? one_by_one<6>(robot) : one_by_one<7>(robot);
  const auto add = [&](std::vector<Contestant> more) { all.insert(all.end(), more.begin(), more.end()); };
  for (const model::Lanes lanes : {model::Lanes::kBaseline, model::Lanes::kAvx2, model::Lanes::kAvx512}) {
    if (model::is_available(lanes)) add(in_lanes(robot, lanes));
  }
  add(pinocchio_contestants(robot));
  add(kdl_contestants(robot));
  add(mujoco_contestants(robot));
  const Index n = robot.num_joints();
  std::vector<Figure> figures;
  for (const Contestant& contestant : all) {
    const bool mass = contestant.quantity == Quantity::kMassMatrix;
    Figure figure{robot_name, contestant, {MatrixXd::Zero(states.q.rows(), mass ? n * n : n), true}};
    contestant.compute(states, figure.results);
    const auto first = std::find_if(figures.begin(), figures.end(), [&](const Figure& f) {
      return f.contestant.quantity == contestant.quantity;
    });
    if (first != figures.end()) {
      const double difference = (figure.results.values - first->results.values).cwiseAbs().maxCoeff() /
                                first->results.values.cwiseAbs().maxCoeff();
      if (!(difference < 1e-9)) {
        throw ModelError(fmt::format("{} differs from {} by {:.1e} of the largest; expected the same arm",
                                     figure.name(), first->contestant.name, difference));
      }
    }
    figure.results.checked = false;
    figures.push_back(std::move(figure));
  }
  return figures;
}

void print(const std::vector<Figure>& figures) {
  page::Table table({"robot", "", "", "ns a state", "median", "of one by one"});
  const Figure* reference = nullptr;
  for (const Figure& f : figures) {
    if (reference == nullptr || reference->robot != f.robot ||
        reference->contestant.quantity != f.contestant.quantity)
      reference = &f;
    table.add_row({f.robot, to_string(f.contestant.quantity), f.contestant.name, fmt::format("{:.1f}", f.least()),
                   fmt::format("{:.1f}", f.median()), fmt::format("{:.2f}", f.least() / reference->least())});
  }
  fmt::print("{}", table.to_text(0));
}

constexpr const char* kUsage =
    "usage: dynamics_bench [--json FILE] [--only TEXT] [--rounds N] [--list]\n"
    "  Time of dynamics with geometry of run time, of one core: the least of N rounds (200), all turn by turn.\n"
    "  --only TEXT  what has TEXT in its name, as --list prints them\n"
    "  --json FILE  figures for bench/compare_runs\n"
    "A round computes 520 states twice and times the second. Instructions: bench/count_instructions.\n";

struct Options {
  std::string json, only;
  int rounds{200};
  bool list{false};
};

int run(const Options& options) {
  constexpr Index kStates = 520;  // five blocks
  std::vector<Figure> figures;
  const std::vector<std::pair<std::string, model::Robot>> robots = {
      {"UR5, 6 joints", model::robot_of(model::Ur5Arm::kModel, "ur5")},
      {"Panda, 7 joints", urdf::load_urdf(HEFT_BENCH_URDF_DIR "/panda.urdf")}};
  std::vector<StateSet> states;
  for (const auto& [name, robot] : robots) {
    states.push_back(random_states(robot, kStates));
    for (Figure& figure : figures_of(name, robot, states.back())) {
      if (figure.name().find(options.only) != std::string::npos) figures.push_back(std::move(figure));
    }
  }
  std::stable_sort(figures.begin(), figures.end(), [](const Figure& a, const Figure& b) {
    return std::pair(b.robot, a.contestant.quantity) < std::pair(a.robot, b.contestant.quantity);
  });
  if (options.list) {
    for (const Figure& figure : figures) fmt::print("{}\n", figure.name());
    return 0;
  }
  for (int round = 0; round < options.rounds; ++round) {
    for (Figure& figure : figures) {
      const StateSet& s = states[figure.robot == robots.front().first ? 0 : 1];
      // Once for the caches, in which the one before has left its own.
      figure.contestant.compute(s, figure.results);
      const double start = now();
      figure.contestant.compute(s, figure.results);
      figure.times.push_back((now() - start) / static_cast<double>(kStates));
    }
  }
  if (options.rounds > 0) print(figures);
  if (!options.json.empty()) {
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const Figure& f : figures)
      list.push_back({{"name", f.name()}, {"unit", "ns a state"}, {"least", f.least()}, {"median", f.median()}});
    host::write_file_atomically(options.json, nlohmann::ordered_json{{"figures", list}}.dump(2) + "\n");
  }
  return 0;
}

}  // namespace
}  // namespace heft::bench

int main(int argc, char** argv) {
  heft::bench::Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string option = argv[i];
    const bool more = i + 1 < argc;
    if (option == "--json" && more) {
      options.json = argv[++i];
    } else if (option == "--only" && more) {
      options.only = argv[++i];
    } else if (option == "--rounds" && more) {
      options.rounds = std::atoi(argv[++i]);
    } else if (option == "--list") {
      options.list = true;
    } else {
      std::fputs(heft::bench::kUsage, option == "-h" || option == "--help" ? stdout : stderr);
      return option == "-h" || option == "--help" ? 0 : 2;
    }
  }
  try {
    return heft::bench::run(options);
  } catch (const std::exception& error) {
    fmt::print(stderr, "dynamics_bench: {}\n", error.what());
    return 1;
  }
}

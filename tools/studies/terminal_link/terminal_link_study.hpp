/// @file
/// The whole open-loop reproduction: all runs, and the table of claims they are compared with.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "terminal_link_protocol.hpp"
#include "terminal_link_sections.hpp"

namespace heft::studies {

struct StudyOptions {
  int seeds{20};
  int other_trajectories{6};
  int other_seeds{3};  ///< seeds a trajectory
  std::vector<double> periods{0.005, 0.001};
  std::function<void(double)> progress;  ///< share done, from the calling thread
};

/// One run.
struct ProtocolRun {
  bool rotor_inertia{false};
  double period{0.005};
  int trajectory{0};  ///< 0: the given one, else number of a random one
  int seed{1};
  std::vector<ProtocolPoint> points;
};

/// A row of the table in core/estimate/README.md, section 10, or one of its further requirements.
struct Claim {
  std::string id;        ///< short, for machines
  std::string text;      ///< what is claimed
  std::string scenario;  ///< "A", "B" or ""
  std::string expected;  ///< as stated
  std::string found;     ///< as printed here
  std::vector<double> values;
  bool holds{false};
};

struct Study {
  StudyOptions options;
  std::vector<ProtocolRun> runs;        ///< on the given trajectory, σ = 10 rad/s²
  std::vector<ProtocolRun> other_runs;  ///< other exciting trajectories
  std::vector<ProtocolRun> quiet_runs;  ///< σ = 0.3 rad/s²
  std::vector<ProtocolRun> noise_free;
  std::vector<std::vector<StartupPoint>> startup[2][2];  ///< [scenario][0: 5 ms, 1: 1 ms], one list a seed
  MassColumnCheck mass_column;
  UncorrectedRows uncorrected_rows;
  std::vector<MassFromDifference> masses;  ///< one a seed
  std::vector<RankCheck> ranks;
  FormCheck forms;
  std::vector<Claim> table;         ///< rows of the table
  std::vector<Claim> requirements;  ///< further requirements and figures of the corrected equations
  bool holds() const;
};

/// Runs everything on all processors. Takes seconds to a minute.
Study run_study(const StudyOptions& options);

/// Mean, standard deviation and root mean square over the seeds of one quantity.
struct Spread {
  double mean{0}, deviation{0}, rms{0}, smallest{0}, largest{0};
  int count{0};
};
Spread spread(const std::vector<double>& values);

/// One quantity of all seeds of a scenario, period, method and number of samples.
std::vector<double> values_of(const std::vector<ProtocolRun>& runs, bool rotor_inertia, double period,
                              ProtocolMethod method, int samples,
                              const std::function<double(const ProtocolPoint&)>& quantity);

/// The error e of all seeds of a scenario, period, method and number of samples.
Spread errors_of(const std::vector<ProtocolRun>& runs, bool rotor_inertia, double period,
                 ProtocolMethod method, int samples);

/// A value inside [low, high] once it is rounded to the digits the bounds are printed with.
bool in_range(double value, double low, double high, int decimals);

}  // namespace heft::studies

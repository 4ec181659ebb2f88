/// @file
/// The next experiment: a motion along which rival explanations of a residual predict torques that are far apart.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "heft/excite/excite.hpp"

namespace heft::excite {

/// One explanation of what a model lacks at a joint.
struct Rival {
  /// Id of a joint effect (core/effects/effects.hpp), "elasticity", "delay"; or "position", "velocity", "load": some smooth
  /// function of that.
  std::string kind;
  int joint{0};  ///< counted from 0
  /// By the names of the effect's kParameters, SI; of a function "rms", its torque [N·m, N].
  std::vector<std::pair<std::string, double>> parameters;
};

/// Explanations between which the logs so far do not decide: the first one against each of the others.
struct Question {
  std::vector<Rival> rivals;  ///< at least two
};

/// What a diagnosis left open.
struct Questions {
  std::vector<Question> all;
  Eigen::VectorXd noise;  ///< n: standard deviation of the residual that is left [N·m, N]
  std::vector<std::string> notes;
};

/// The questions in the JSON result of `heft diagnose`: each effect with its rivals and equivalents; where none has any,
/// whether the unexplained part of a joint goes with position, velocity or load.
/// @throws ModelError for a file that is none or is of another robot, NotIdentifiableError when nothing is open
Questions read_questions(const model::Robot& robot, const std::string& path);

/// Distance from which on a motion decides: with 5 standard deviations between two predictions the less likely one of the
/// two is taken in 0.6 % of logs, Φ(−5/2).
inline constexpr double kDecides = 5.0;
/// Rows a second that count as independent: residuals of arms are correlated over a tenth of a second.
inline constexpr double kIndependentRate = 10.0;

struct SeparateOptions {
  double duration{20.0};  ///< of Fourier motions [s]; strokes take as long as they need
  int motions{6};         ///< random motions of each period tried
  int steps{60};          ///< of the search from the best one
  Payload payload{};
  std::optional<Eigen::VectorXd> from{};  ///< as Options::from
  double rate{100.0};                     ///< rows a second of the log [Hz]
  bool rehearse{true};
  std::uint64_t seed{1};
  std::function<void(double)> progress{};  ///< done within 0..1
};

/// Two rivals and how far apart they are on a motion.
struct Separation {
  int joint{0};
  std::string first, second;
  double distance{0.0};  ///< see distance_of() [standard deviations]
  bool decides() const { return distance >= kDecides; }
};

struct SeparatingMotion : Motion {
  Questions asked;
  std::vector<Separation> pairs;
  std::string how;   ///< "Fourier series of 5 s", "strokes at constant speed"
  int tried{0};      ///< motions compared
  double median{0};  ///< smallest distance of any pair on the random motions, their median
};

/// How far apart the rivals are along a motion, pair by pair: T-optimality (A. C. Atkinson, V. V. Fedorov, Biometrika 62,
/// 1975). Of a pair, one is taken as true with the parameters given and everything else is fitted to its torque: rigid
/// bodies, rotor inertias, Coulomb and viscous friction, offsets, and the other one with all its parameters. What is left, in
/// standard deviations of the noise, is the distance; the smaller of the two directions counts. A rival that the fit holds
/// anyway (rotor inertia, offset) cannot be mistaken: then the other direction alone counts.
/// @param q,qd,qdd  m × n at an even rate [Hz]
std::vector<Separation> distances_of(const model::Robot& robot, const Questions& asked,
                                     const Eigen::MatrixXd& q, const Eigen::MatrixXd& qd,
                                     const Eigen::MatrixXd& qdd, double rate);

/// Designs a motion inside the limits that separates the rivals of all questions: the best of random Fourier motions of four
/// base frequencies and of strokes of the joints in question, bettered by a random search. Depends on no clock and no
/// number of threads.
/// @throws as design()
SeparatingMotion separate(const model::Robot& robot, const LimitsFile& limits, const Questions& asked,
                          const SeparateOptions& options = {});

}  // namespace heft::excite

/// @file
/// What was found of effects and of joints, for as long as the model is the same where it shows.
#pragma once

#include <memory>
#include <vector>

#include "engine.hpp"

namespace heft::diagnose {

/// A model as far as candidates for the place of one of its effects depend on it.
struct Present {
  Eigen::MatrixXd predicted;  ///< m × n: torque; 0 where a row does not count
  Eigen::VectorXd counted;    ///< n: rows that count
  bool weights_held{false}, masses_held{false};  ///< see Engine: next to what is held an effect is worth something else
};
std::shared_ptr<const Present> present_of(const Engine& engine);
/// Whether the torque that a model predicts in one of its joints has changed, since then, by less than matters to any candidate
/// there: a fiftieth of the joint's residual.
bool hardly_changed(const Problem& problem, const Present& before, const Present& now, int joint);

/// What was found of an accepted effect, for as long as it holds: the effect has its form, and the torque that the model predicts
/// has hardly changed in its joint, or in all joints where it reaches others.
struct Checked {
  Candidate own;                         ///< without columns
  std::shared_ptr<const Present> model;  ///< with the effect
};
/// @param own  with or without columns
Checked checked(Candidate own, std::shared_ptr<const Present> model);
bool still_holds(const Checked& found, const Candidate& own, const Engine& engine, const Present& now);

/// The model without an effect, and what could take its place.
struct Evidence {
  Checked of;
  Eigen::VectorXd noise_floor;
  std::vector<Candidate> taken, candidates;  ///< effects left; candidates that gain most first
  bool has_columns{true};                    ///< those of the candidates and of the effects left

  void drop_columns();
};

/// Evidence of several effects.
class EvidenceKept {
 public:
  /// In the place of what is there of the same effect.
  Evidence& keep(Evidence evidence);
  /// Evidence of an accepted effect that still holds; nullptr: there is none.
  /// @param now  present_of(engine)
  Evidence* of(const Engine& engine, const Present& now, std::size_t effect);

 private:
  std::vector<Evidence> kept_;
};

}  // namespace heft::diagnose

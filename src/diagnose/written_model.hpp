/// @file
/// The model that is written: what identify fits, together with the effects that were found, and never worse than identify.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "engine.hpp"
#include "identified.hpp"
#include "search.hpp"

namespace heft::diagnose {

/// Rigid bodies, rotor inertia, Coulomb, viscous, offset and the effects of a search. Rotor inertia and offset are in it
/// whether or not the search has named them.
///
/// It is made in several versions, of which the simplest is taken unless another one is better on the validation logs by
/// enough:
/// - masses and the friction of joints without an effect are identify's, so that no joint pays for the effect of another
///   one; or they are drawn to identify's; or all of it is fitted again together with the effects;
/// - its motion derived as for a model that does not say how, so that a joint without an effect is predicted as by
///   identify's model to the last digit; or with the cut-off of the search.
/// Where the validation logs repeat the motion of the training logs they cannot say what a version does in another one: it is
/// the simplest.
/// In each, a joint that is worse than with identify's model loses the effect that costs it most, until none is.
class WrittenModel {
 public:
  WrittenModel(Search& search, const Identified& identified);

  const Engine& engine() const { return *engine_; }
  /// With the motion that each effect was seen in: seen().
  const model::Robot& robot() const { return robot_; }
  /// Where a joint's rows of the training and validation logs lie that count: what an effect was fitted to, and judged on.
  SeenWithin<double> seen(int joint) const;
  /// The same of a cable's stretch.
  SeenInterval<double> seen(const JointCable<double>& cable) const;
  /// Whether its motion is derived as for a model that does not say how.
  bool is_ordinary() const { return chosen_.ordinary; }
  /// Whether the validation logs repeat the motion of the training logs.
  bool is_judged_on_a_repetition() const { return repeated_; }
  /// The validation logs as it reads them.
  const JudgedMotion& judged() const { return logs(chosen_.ordinary); }
  /// Whether it has an effect of the search.
  bool has(std::size_t effect) const { return chosen_.kept[effect]; }
  /// Why it has not; empty: it has.
  std::string why_not(std::size_t effect) const;
  /// The same with one of the search's effects, or without it.
  std::unique_ptr<Engine> with(std::size_t effect, bool in_place) const;

 private:
  /// A robot and its errors by what is derived how, see JudgedMotion::errors_by_kind(); none: not asked for yet.
  struct Made {
    model::Robot robot;
    std::map<bool, std::vector<Eigen::VectorXd>> errors;
  };
  /// Those of one weight by the effects kept: many of them are asked for more than once.
  using Robots = std::map<std::vector<bool>, Made>;
  struct Version {
    double weight;  ///< of identify's values
    bool ordinary;
    std::vector<bool> kept;               ///< effects of the search
    std::vector<Eigen::VectorXd> errors;  ///< see Made
    int worse;                            ///< joints that are, kinds of motion and logs counted
    double cost;                          ///< product of how much worse they are [1]
    std::vector<std::pair<std::size_t, std::string>> dropped;  ///< effects, and why
  };

  const JudgedMotion& logs(bool ordinary) const;
  std::unique_ptr<Engine> built(const std::vector<bool>& kept, double weight) const;
  std::vector<bool> anchored(const Engine& engine) const;
  Made& made(const Version& version, Robots& robots) const;
  Version found(double weight, bool ordinary, Robots& robots) const;
  void judge(Version& version, Robots& robots) const;
  bool drop_one(Version& version, Robots& robots) const;
  Version dropped(const Version& version, const std::vector<std::size_t>& effects, int joint, std::size_t row,
                  Robots& robots) const;
  double better_than(const Version& other, const Version& than) const;
  int own_column(std::size_t effect) const {
    return identified_.own_column(search_.engine().accepted[effect]);
  }
  bool reaches(std::size_t effect, int joint) const;

  const Search& search_;
  Identified identified_;
  std::vector<Eigen::VectorXd> limit_;  ///< errors of identify's model
  bool repeated_;
  Version chosen_;
  std::unique_ptr<const Engine> engine_;  ///< of the chosen version
  model::Robot robot_;                    ///< the same
  Eigen::MatrixXd load_;  ///< its rigid-body torque along the validation logs, m × n
};

}  // namespace heft::diagnose

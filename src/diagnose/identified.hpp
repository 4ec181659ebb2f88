/// @file
/// What identify makes of the training logs, and what a search has found beside it.
#pragma once

#include <memory>
#include <vector>

#include "engine.hpp"
#include "motion_scores.hpp"

namespace heft::diagnose {

/// What identify makes of the training logs.
struct Identified {
  std::shared_ptr<const BaseModel> base;
  Eigen::VectorXd beta;                ///< of `base`
  model::Robot robot;                  ///< with these
  const JudgedMotion* ordinary;        ///< the validation logs, read as for a model that does not say how
  std::shared_ptr<const BaseFit> fit;  ///< of `base` to the training logs as the search reads them

  /// Base column of what a search has named and the base has anyway; -1: none.
  int own_column(const Candidate& effect) const;
  /// That base with the effects of a search. build() comes after it.
  /// @param found  what the search ended with
  /// @param kept   which of its effects; of those that are base columns, which stay fitted
  std::unique_ptr<Engine> with_effects(const Engine& found, const std::vector<bool>& kept) const;
};

}  // namespace heft::diagnose

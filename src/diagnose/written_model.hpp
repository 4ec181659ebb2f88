/// @file
/// The model that is written: what identify fits, together with the effects that were found.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "engine.hpp"
#include "search.hpp"

namespace heft::diagnose {

/// Rigid bodies, rotor inertia, Coulomb, viscous, offset and the effects of a search, fitted to the training logs. Rotor
/// inertia and offset are in it whether or not the search has named them.
class WrittenModel {
 public:
  WrittenModel(const Search& search, std::shared_ptr<const BaseModel> base);

  const Engine& engine() const { return *engine_; }
  /// The same without one of the search's effects.
  std::unique_ptr<Engine> without(std::size_t effect) const;
  /// Coefficients of one of the search's effects as the model has them.
  Eigen::VectorXd coefficients(std::size_t effect) const;

 private:
  std::unique_ptr<Engine> built(std::ptrdiff_t without, double steady) const;
  /// Base column of what the search has named and the base has anyway; -1: none.
  int own_column(std::size_t effect) const;

  const Search& search_;
  std::shared_ptr<const BaseModel> base_;
  std::unique_ptr<Engine> engine_;
};

}  // namespace heft::diagnose

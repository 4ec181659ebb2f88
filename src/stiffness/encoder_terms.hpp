/// @file
/// Which terms the deflection of a joint is made of: each is tried together with the others on blocks that were not fitted.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "encoder_problem.hpp"

namespace heft::stiffness {

/// Significance at which a term is taken, and at which logs disagree.
inline constexpr double kLevel = 0.05;

inline constexpr std::array kCandidates{DeflectionTerm::kPosition,         DeflectionTerm::kEccentricity,
                                        DeflectionTerm::kSecondHarmonic,   DeflectionTerm::kDrift,
                                        DeflectionTerm::kStiffening,       DeflectionTerm::kBacklash,
                                        DeflectionTerm::kTorqueHysteresis, DeflectionTerm::kLoadFriction,
                                        DeflectionTerm::kDamping};

/// What adding a term would make of the terms used.
std::vector<DeflectionTerm> with(const std::vector<DeflectionTerm>& used, DeflectionTerm term);
std::vector<DeflectionTerm> without(const std::vector<DeflectionTerm>& used, DeflectionTerm term);

/// Why a term cannot be tried next to these; empty if it can.
std::string obstacle(const EncoderProblem& problem, const std::vector<DeflectionTerm>& used,
                     DeflectionTerm term);

/// Longest of the logs [s].
double correlation_time_of(const EncoderProblem& problem, const Eigen::VectorXd& residual);

/// Blocks as this residual asks for. @return factor on the variance
double set_blocks(EncoderProblem& problem, const Eigen::VectorXd& residual);

/// Effect of a term next to others, judged on blocks as the residual with it asks for: without a term that is
/// really there the residual has a long memory, few blocks are left, and nothing could be shown.
struct TermTrial {
  EncoderProblem::Fit fit;  ///< with the term
  bool possible{true};      ///< the coefficient has the sign that the effect must have
  double with{0.0};         ///< sum of squares on held-out blocks
  double without{0.0};
  double p_value{1.0};  ///< times the number of candidates
};
TermTrial try_term(EncoderProblem& problem, const std::vector<DeflectionTerm>& less, DeflectionTerm term);

/// Terms and weighting of a fit.
struct Chosen {
  std::vector<DeflectionTerm> terms;
  double memory{0.0};
  statistics::Interval compliance;
};

/// @param base    terms that the motion shows of the first four
/// @param given   terms, or null: to be chosen
/// @param memory  weighting, or none: to be chosen
/// @param other   the weighting that was not chosen, if there were two
Chosen choose_fit(EncoderProblem& problem, const std::vector<DeflectionTerm>& base,
                  const std::vector<DeflectionTerm>* given, std::optional<double> memory,
                  std::optional<Chosen>& other);

}  // namespace heft::stiffness

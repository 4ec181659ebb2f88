/// @file
/// The page of a diagnosis.
#pragma once

#include <Eigen/Core>

#include "diagnosis_result.hpp"
#include "heft/page/page.hpp"

namespace heft::report {

/// Amplitude density of an evenly sampled signal about its mean: averaged over half-overlapping Hann
/// segments of about a quarter of the signal, then over bands of a 24th of an octave.
struct AmplitudeDensity {
  Eigen::VectorXd frequency;  ///< [Hz], increasing, without 0
  Eigen::VectorXd density;    ///< [unit/√Hz]
};
/// @param rate  [Hz]
/// @return empty for fewer than 64 samples
AmplitudeDensity amplitude_density(const Eigen::VectorXd& signal, double rate);

/// Means of signals over bins of x, from 240 equal ones; bins that hold little are merged with their
/// neighbours.
struct BinnedMeans {
  Eigen::VectorXd x;      ///< mean x of a bin, b
  Eigen::MatrixXd means;  ///< b × columns
};
BinnedMeans binned_means(const Eigen::VectorXd& x, const Eigen::MatrixXd& values);

/// Verdict, ranking, residuals of the joints that have something to tell, errors before and after, refusals.
page::Page diagnosis_page(const diagnose::Diagnosis& diagnosis, const DiagnosisContext& context);

}  // namespace heft::report

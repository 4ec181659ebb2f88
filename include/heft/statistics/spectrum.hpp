/// @file
/// Spectra of evenly sampled signals.
#pragma once

#include <array>
#include <complex>
#include <memory>
#include <vector>

#include <Eigen/Core>

namespace heft::statistics {

/// Fourier transform of a signal less its mean behind a Hann window, padded with zeros.
class Periodogram {
 public:
  /// @param length  samples with the padding, at least 2; a power of two is quickest
  explicit Periodogram(Eigen::Index length);
  ~Periodogram();
  Periodogram(Periodogram&&) noexcept;
  Periodogram& operator=(Periodogram&&) noexcept;

  /// @param x       at most `length` samples; a shorter signal is padded
  /// @param mean    subtracted from every sample
  /// @param centre  place of sample k in the window of size n: (k + centre)/n. One half: symmetric; zero: the
  ///                window of which half-overlapping copies add up to a constant.
  /// @return half of the transform, length/2 + 1; valid until the next call. Cost: n log n.
  const std::vector<std::complex<double>>& of(const Eigen::Ref<const Eigen::VectorXd>& x, double mean,
                                              double centre = 0.5);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Power spectrum of one signal, averaged over half-overlapping Hann segments (P. D. Welch, The use of fast
/// Fourier transform for the estimation of power spectra, IEEE Transactions on Audio and Electroacoustics 15
/// (1967)), in bounded memory.
class Spectrum {
 public:
  /// @param length  of a segment, a multiple of 4
  explicit Spectrum(Eigen::Index length);

  void add(double value);
  /// Samples on both sides of a break share no segment.
  void interrupt() { pending_.clear(); }

  Eigen::Index length() const { return length_; }
  long segments() const { return segments_; }
  /// Mean |FFT|² of a segment, length/2 + 1 values. @pre segments() > 0
  Eigen::VectorXd power() const { return power_ / static_cast<double>(segments_); }
  /// The same with the mean of the whole signal taken out.
  Eigen::VectorXd power_about_mean() const;
  /// Autocorrelation at lags 0, 1, ... of a quarter of a segment, from the power; 1 at lag 0.
  Eigen::VectorXd autocorrelation(const Eigen::VectorXd& power) const;
  /// Σ w² of the window.
  double window_energy() const;

 private:
  Eigen::Index length_;
  Eigen::VectorXd power_;
  Eigen::VectorXcd window_transform_;
  std::array<std::complex<double>, 2> low_{};
  std::vector<double> pending_;
  Periodogram periodogram_;
  double sum_{0.0};
  long count_{0}, segments_{0};
};

/// Amplitude density of an evenly sampled signal about its mean: averaged over half-overlapping Hann
/// segments of about a quarter of the signal, then over bands of a 24th of an octave.
struct AmplitudeDensity {
  Eigen::VectorXd frequency;  ///< [Hz], increasing, without 0
  Eigen::VectorXd density;    ///< [unit/√Hz]
};
/// @param rate  [Hz]
/// @return empty for fewer than 64 samples
AmplitudeDensity amplitude_density(const Eigen::VectorXd& signal, double rate);

}  // namespace heft::statistics

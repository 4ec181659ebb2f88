#include "heft/statistics/spectrum.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <unsupported/Eigen/FFT>

namespace heft::statistics {

using Eigen::Index;

struct Periodogram::Impl {
  Eigen::FFT<double> fft;
  std::vector<double> windowed;
  std::vector<double> window;  ///< Hann's of the length and centre asked for last: seldom another
  double centre{0.0};

  void make_window(Index n, double around) {
    if (static_cast<Index>(window.size()) == n && centre == around) return;
    window.resize(static_cast<std::size_t>(n));
    centre = around;
    for (Index k = 0; k < n; ++k) {
      const double turn = (static_cast<double>(k) + centre) / static_cast<double>(n);
      window[static_cast<std::size_t>(k)] = 0.5 - 0.5 * std::cos(2.0 * std::numbers::pi * turn);
    }
  }
  std::vector<std::complex<double>> transform;
};

Periodogram::Periodogram(Index length) : impl_(std::make_unique<Impl>()) {
  impl_->windowed.resize(static_cast<std::size_t>(length));
  impl_->fft.SetFlag(Eigen::FFT<double>::HalfSpectrum);
}
Periodogram::~Periodogram() = default;
Periodogram::Periodogram(Periodogram&&) noexcept = default;
Periodogram& Periodogram::operator=(Periodogram&&) noexcept = default;

const std::vector<std::complex<double>>& Periodogram::of(const Eigen::Ref<const Eigen::VectorXd>& x,
                                                         double mean, double centre) {
  const Index n = x.size();
  impl_->make_window(n, centre);
  for (Index k = 0; k < n; ++k) {
    impl_->windowed[static_cast<std::size_t>(k)] = impl_->window[static_cast<std::size_t>(k)] * (x[k] - mean);
  }
  std::fill(impl_->windowed.begin() + n, impl_->windowed.end(), 0.0);
  impl_->fft.fwd(impl_->transform, impl_->windowed);
  return impl_->transform;
}

Spectrum::Spectrum(Index length)
    : length_(length), power_(Eigen::VectorXd::Zero(length / 2 + 1)), periodogram_(length) {
  const auto& window = periodogram_.of(Eigen::VectorXd::Ones(length), 0.0, 0.0);
  window_transform_ = Eigen::Map<const Eigen::VectorXcd>(window.data(), static_cast<Index>(window.size()));
  pending_.reserve(static_cast<std::size_t>(length));
}

void Spectrum::add(double value) {
  sum_ += value;
  ++count_;
  pending_.push_back(value);
  if (static_cast<Index>(pending_.size()) < length_) return;
  const auto& transform =
      periodogram_.of(Eigen::Map<const Eigen::VectorXd>(pending_.data(), length_), 0.0, 0.0);
  for (Index k = 0; k < power_.size(); ++k) power_[k] += std::norm(transform[static_cast<std::size_t>(k)]);
  // A Hann window leaks the mean into the two lowest bins alone.
  low_[0] += transform[0];
  low_[1] += transform[1];
  ++segments_;
  pending_.erase(pending_.begin(), pending_.begin() + length_ / 2);
}

Eigen::VectorXd Spectrum::power_about_mean() const {
  const double mean = count_ > 0 ? sum_ / static_cast<double>(count_) : 0.0;
  Eigen::VectorXd result = power();
  for (Index k = 0; k < 2; ++k) {
    const std::complex<double> W = window_transform_[k];
    // |X − m W|² = |X|² − 2 m Re(X W*) + m² |W|²
    result[k] += -2.0 * mean * std::real(low_[static_cast<std::size_t>(k)] * std::conj(W)) /
                     static_cast<double>(segments_) +
                 mean * mean * std::norm(W);
    result[k] = std::max(result[k], 0.0);
  }
  return result;
}

Eigen::VectorXd Spectrum::autocorrelation(const Eigen::VectorXd& power) const {
  // The inverse transform of |X|² is the circular autocovariance of the windowed segment; the window's own
  // takes its shape out. Circular wrapping is negligible while both ends of the window are near 0.
  Eigen::FFT<double> fft;
  fft.SetFlag(Eigen::FFT<double>::HalfSpectrum);
  Eigen::VectorXd of_signal, of_window;
  const Eigen::VectorXcd signal_power = power.cast<std::complex<double>>();
  const Eigen::VectorXcd window_power = window_transform_.cwiseAbs2().cast<std::complex<double>>();
  fft.inv(of_signal, signal_power, length_);
  fft.inv(of_window, window_power, length_);
  const Index lags = length_ / 4;
  Eigen::VectorXd rho = of_signal.head(lags).cwiseQuotient(of_window.head(lags));
  return rho / rho[0];
}

double Spectrum::window_energy() const {
  // Σ w² of a Hann window, w = ½ − ½ cos(2πk/n), is 3n/8.
  return 0.375 * static_cast<double>(length_);
}

AmplitudeDensity amplitude_density(const Eigen::VectorXd& signal, double rate) {
  constexpr Index kFewest = 64;
  AmplitudeDensity result;
  if (signal.size() < kFewest || !(rate > 0.0)) return result;
  Index length = kFewest / 4;
  while (4 * length <= signal.size() / 2) length *= 2;
  Spectrum spectrum(length);
  const double mean = signal.mean();
  for (const double value : signal) spectrum.add(value - mean);
  // One-sided density S = 2 |X|² / (rate Σ w²).
  const Eigen::VectorXd power = 2.0 / (rate * spectrum.window_energy()) * spectrum.power();
  const double band = std::exp2(1.0 / 24.0), resolution = rate / static_cast<double>(length);
  std::vector<double> frequency, density;
  // The lowest bin still holds the mean's leakage.
  for (Index k = 2; k <= length / 2;) {
    const double end = std::max(static_cast<double>(k) * band, static_cast<double>(k) + 0.5);
    Index last = k;
    double sum = 0.0;
    for (; last <= length / 2 && static_cast<double>(last) < end; ++last) sum += power[last];
    const auto count = static_cast<double>(last - k);
    frequency.push_back(0.5 * static_cast<double>(k + last - 1) * resolution);
    density.push_back(std::sqrt(sum / count));
    k = last;
  }
  result.frequency = Eigen::Map<Eigen::VectorXd>(frequency.data(), static_cast<Index>(frequency.size()));
  result.density = Eigen::Map<Eigen::VectorXd>(density.data(), static_cast<Index>(density.size()));
  return result;
}

}  // namespace heft::statistics

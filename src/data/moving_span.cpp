#include "moving_span.hpp"

#include <limits>

namespace heft::data {

template <typename Merge>
void MovingSpan::halve(std::vector<Sample>& samples, const Merge& merge) {
  std::size_t kept = 0;
  for (std::size_t k = 0; k + 1 < samples.size(); k += 2) samples[kept++] = merge(samples[k], samples[k + 1]);
  if (samples.size() % 2 == 1) samples[kept++] = samples.back();
  samples.resize(kept);
}

void MovingSpan::add(double time, double speed) {
  if (front_.empty() || speed > front_.back().speed) front_.push_back({time, speed});
  while (!back_.empty() && back_.back().speed <= speed) back_.pop_back();
  back_.push_back({time, speed});
  // When there are too many, two neighbours become one that moves for longer than either.
  if (front_.size() > kMost) {
    halve(front_, [](const Sample& a, const Sample& b) { return Sample{a.time, b.speed}; });
  }
  if (back_.size() > kMost) {
    halve(back_, [](const Sample& a, const Sample& b) { return Sample{b.time, a.speed}; });
  }
}

void MovingSpan::add(const MovingSpan& later) {
  // The fastest sample is the last of one list and the first of the other; what lies between them is of no account.
  for (const Sample& sample : later.front_) add(sample.time, sample.speed);
  for (const Sample& sample : later.back_) add(sample.time, sample.speed);
}

double MovingSpan::first_above(double threshold) const {
  for (const Sample& sample : front_) {
    if (sample.speed > threshold) return sample.time;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

double MovingSpan::last_above(double threshold) const {
  for (auto sample = back_.rbegin(); sample != back_.rend(); ++sample) {
    if (sample->speed > threshold) return sample->time;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

}  // namespace heft::data

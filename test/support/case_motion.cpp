#include "support/case_motion.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace heft::test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

class WorkPath : public Path {
 public:
  WorkPath(const model::Robot& robot, Random& random) : Path(robot.num_joints()) {
    pose_.resize(n_, kPoses);
    for (int i = 0; i < n_; ++i) {
      const model::RobotJoint& joint = robot.joints[static_cast<std::size_t>(i)];
      for (int k = 0; k < kPoses; ++k)
        pose_(i, k) = uniform(random, 0.88 * joint.lower + 0.12 * joint.upper, 0.12 * joint.lower + 0.88 * joint.upper);
    }
    double t = uniform(random, 0.0, 0.8);
    for (int k = 0; k < kPoses; ++k) {
      const VectorXd step = pose_.col((k + 1) % kPoses) - pose_.col(k);
      const double share = uniform(random, 0.5, 0.85);
      double time = 0.5;
      for (int i = 0; i < n_; ++i)
        time = std::max(time, 1.875 * std::abs(step[i]) / (share * robot.joints[static_cast<std::size_t>(i)].velocity_limit));
      top_ = top_.cwiseMax(1.875 / time * step.cwiseAbs());
      legs_.push_back({t, time});
      t += time + (chance(random, 0.5) ? uniform(random, 0.2, 0.5) : uniform(random, 0.5, 1.2));
    }
    cycle_ = t;
  }

  void slow_down(double factor) override { fast_ *= factor; }

 private:
  static constexpr int kPoses = 8;
  struct Leg {
    double start, time;
  };

  VectorXd position(double t) const override {
    const double u = std::fmod(fast_ * std::max(t, 0.0), cycle_);
    VectorXd q = pose_.col(0);
    for (std::size_t k = 0; k < legs_.size(); ++k) {
      const auto here = static_cast<Eigen::Index>(k);
      q += (pose_.col((here + 1) % pose_.cols()) - pose_.col(here)) * smooth_step((u - legs_[k].start) / legs_[k].time);
    }
    return q;
  }

  double cycle_{1.0}, fast_{1.0};
  MatrixXd pose_;  ///< n × poses
  std::vector<Leg> legs_;
};

class ExcitingPath : public Path {
 public:
  ExcitingPath(const model::Robot& robot, double duration, bool brisk, Random& random) : Path(robot.num_joints()) {
    period_ = uniform(random, 10.0, 16.0);
    constexpr int kTerms = 6;
    centre_.resize(n_);
    sine_.setZero(n_, kTerms);
    cosine_.setZero(n_, kTerms);
    harmonic_.resize(n_, kTerms);
    slow_amplitude_.resize(n_);
    slow_frequency_.resize(n_);
    slow_phase_.resize(n_);
    for (int i = 0; i < n_; ++i) {
      const model::RobotJoint& joint = robot.joints[static_cast<std::size_t>(i)];
      const bool prismatic = joint.joint.type == JointType::kPrismatic;
      const double room = joint.upper - joint.lower;
      for (int k = 0; k < kTerms; ++k) {
        harmonic_(i, k) = prismatic ? k + 3 : k + 1;
        const double size = 1.0 / std::pow(harmonic_(i, k), prismatic ? 0.5 : 0.65);
        sine_(i, k) = size * normal(random);
        cosine_(i, k) = size * normal(random);
      }
      double low = 1e9, high = -1e9, speed = 0.0;
      for (int k = 0; k <= 2000; ++k) {
        const double s = period_ * k / 2000.0;
        const double here = fourier(i, s);
        const double rate = (fourier(i, s + 1e-3) - here) / 1e-3;
        low = std::min(low, here);
        high = std::max(high, here);
        speed = std::max(speed, std::abs(rate));
      }
      const double wanted = uniform(random, 0.6, 0.85) * joint.velocity_limit;
      const double scale = std::min(wanted / speed, 0.75 * room / (high - low));
      sine_.row(i) *= scale;
      cosine_.row(i) *= scale;
      top_[i] = speed * scale;
      const double margin = 0.5 * (room - (high - low) * scale) - 0.08 * room;
      centre_[i] = 0.5 * (joint.upper + joint.lower) - 0.5 * (high + low) * scale +
                   uniform(random, -1.0, 1.0) * std::max(0.0, margin);
      slow_frequency_[i] = uniform(random, 0.25, 0.6);
      slow_amplitude_[i] = uniform(random, 0.025, 0.045) * top_[i] / (kTwoPi * slow_frequency_[i]);
      slow_phase_[i] = uniform(random, 0.0, kTwoPi);
    }
    offset_ = uniform(random, 0.0, period_);
    // Crawl first, then in turn.
    double t = uniform(random, 0.8, 1.4);
    knots_.push_back({t, true});
    while (t < duration) {
      t += uniform(random, 4.0, 6.5);
      knots_.push_back({t, false});
      const double crawl = uniform(random, 1.3, 2.5);
      if (brisk && chance(random, 0.75)) {
        Brisk move;
        move.time = uniform(random, 0.22, 0.4);
        move.go = t + kBlend + 0.1;
        move.back = move.go + move.time + uniform(random, 0.15, 0.35);
        move.step.setZero(n_);
        for (int i = 0; i < n_; ++i) {
          if (chance(random, 0.7))
            move.step[i] = either(random) * uniform(random, 0.5, 0.85) * top_[i] * move.time / 1.875;
        }
        moves_.push_back(move);
      }
      t += kBlend + crawl;
      knots_.push_back({t, true});
      t += kBlend;
    }
  }

  void slow_down(double factor) override {
    fast_ *= factor;
    for (Brisk& move : moves_) move.step *= factor * factor;
  }

 private:
  static constexpr double kBlend = 0.6;
  static constexpr double kCrawl = 0.01;
  struct Knot {
    double time;
    bool speed_up;
  };
  struct Brisk {
    double go, back, time;
    VectorXd step;
  };

  double fourier(int i, double s) const {
    double sum = 0.0;
    for (Eigen::Index k = 0; k < sine_.cols(); ++k) {
      const double angle = kTwoPi * harmonic_(i, k) * s / period_;
      sum += sine_(i, k) * std::sin(angle) + cosine_(i, k) * std::cos(angle);
    }
    return sum;
  }

  VectorXd position(double t) const override {
    double s = offset_ + kCrawl * t, share = 0.0;
    for (const Knot& knot : knots_) {
      const double u = (t - knot.time) / kBlend;
      const double sign = knot.speed_up ? 1.0 : -1.0;
      s += sign * (fast_ - kCrawl) * kBlend * smooth_step_integral(u);
      share += sign * smooth_step(u);
    }
    VectorXd q(n_);
    for (int i = 0; i < n_; ++i) {
      q[i] = centre_[i] + fourier(i, s) +
             (1.0 - share) * slow_amplitude_[i] * std::sin(kTwoPi * slow_frequency_[i] * t + slow_phase_[i]);
    }
    for (const Brisk& move : moves_) {
      q += move.step * (smooth_step((t - move.go) / move.time) - smooth_step((t - move.back) / move.time));
    }
    return q;
  }

  double period_{12.0}, offset_{0.0}, fast_{1.0};
  VectorXd centre_, slow_amplitude_, slow_frequency_, slow_phase_;
  MatrixXd sine_, cosine_, harmonic_;
  std::vector<Knot> knots_;
  std::vector<Brisk> moves_;
};

}  // namespace

std::shared_ptr<Path> exciting_path(const model::Robot& robot, double duration, bool brisk, Random& random) {
  return std::make_shared<ExcitingPath>(robot, duration, brisk, random);
}

std::shared_ptr<Path> work_path(const model::Robot& robot, Random& random) {
  return std::make_shared<WorkPath>(robot, random);
}

}  // namespace heft::test

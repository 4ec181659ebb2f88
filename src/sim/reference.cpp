#include "heft/sim/reference.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"

namespace heft::sim {
namespace {

using Eigen::MatrixXd;
using Eigen::Ref;
using Eigen::VectorXd;

/// Smooth step σ(x) = 10x³ − 15x⁴ + 6x⁵ on [0, 1] with its derivatives.
struct SmoothStep {
  double value, slope, curvature;
  explicit SmoothStep(double x) {
    x = std::clamp(x, 0.0, 1.0);
    value = x * x * x * (10.0 + x * (-15.0 + 6.0 * x));
    slope = 30.0 * x * x * (1.0 - x) * (1.0 - x);
    curvature = 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x);
  }
};

class Hold : public Reference {
 public:
  explicit Hold(VectorXd position) : position_(std::move(position)) {}
  int num_joints() const override { return static_cast<int>(position_.size()); }
  void evaluate(double, Ref<VectorXd> q, Ref<VectorXd> qd, Ref<VectorXd> qdd) const override {
    q = position_;
    qd.setZero();
    qdd.setZero();
  }

 private:
  VectorXd position_;
};

class Fourier : public Reference {
 public:
  explicit Fourier(FourierMotion motion) : motion_(std::move(motion)) {}
  int num_joints() const override { return static_cast<int>(motion_.q0.size()); }
  void evaluate(double t, Ref<VectorXd> q, Ref<VectorXd> qd, Ref<VectorXd> qdd) const override {
    for (Eigen::Index i = 0; i < motion_.q0.size(); ++i) {
      q[i] = motion_.q0[i];
      qd[i] = 0.0;
      qdd[i] = 0.0;
      for (Eigen::Index k = 0; k < motion_.amplitude.cols(); ++k) {
        const double omega = 2.0 * std::numbers::pi * motion_.frequency_hz(i, k);
        const double angle = omega * t + motion_.phase(i, k);
        const double s = motion_.amplitude(i, k) * std::sin(angle);
        q[i] += s;
        qd[i] += motion_.amplitude(i, k) * omega * std::cos(angle);
        qdd[i] -= omega * omega * s;
      }
    }
  }

 private:
  FourierMotion motion_;
};

class Quintic : public Reference {
 public:
  Quintic(VectorXd from, VectorXd to, double duration)
      : from_(std::move(from)), to_(std::move(to)), duration_(duration) {}
  int num_joints() const override { return static_cast<int>(from_.size()); }
  void evaluate(double t, Ref<VectorXd> q, Ref<VectorXd> qd, Ref<VectorXd> qdd) const override {
    const SmoothStep step(t / duration_);
    q = from_ + step.value * (to_ - from_);
    qd = step.slope / duration_ * (to_ - from_);
    qdd = step.curvature / (duration_ * duration_) * (to_ - from_);
  }

 private:
  VectorXd from_, to_;
  double duration_;
};

/// Knot values of position, velocity, acceleration; quintic Hermite pieces between them. A cubic piece is
/// the quintic through its own end accelerations, so one evaluation serves both.
class Waypoints : public Reference {
 public:
  Waypoints(std::vector<double> times, MatrixXd points, WaypointOrder order)
      : times_(std::move(times)), points_(std::move(points)) {
    const auto knots = static_cast<Eigen::Index>(times_.size());
    const Eigen::Index n = points_.rows();
    velocities_.setZero(n, knots);
    // Clamped cubic spline: the acceleration is continuous at inner knots,
    // v_{k-1}/h₀ + 2 v_k (1/h₀ + 1/h₁) + v_{k+1}/h₁ = 3 (p_k − p_{k-1})/h₀² + 3 (p_{k+1} − p_k)/h₁².
    if (knots > 2) {
      MatrixXd A = MatrixXd::Identity(knots, knots);
      MatrixXd b = MatrixXd::Zero(knots, n);
      for (Eigen::Index k = 1; k + 1 < knots; ++k) {
        const double h0 = step(k - 1);
        const double h1 = step(k);
        A(k, k - 1) = 1.0 / h0;
        A(k, k) = 2.0 / h0 + 2.0 / h1;
        A(k, k + 1) = 1.0 / h1;
        b.row(k) = (3.0 / (h0 * h0) * (points_.col(k) - points_.col(k - 1)) +
                    3.0 / (h1 * h1) * (points_.col(k + 1) - points_.col(k)))
                       .transpose();
      }
      velocities_ = solve_square(A, b).transpose();
    }
    accelerations_.setZero(n, knots);
    for (Eigen::Index k = 0; k < knots; ++k) {
      const bool end = k == 0 || k + 1 == knots;
      if (end && order == WaypointOrder::kQuintic) continue;
      if (k + 1 < knots) {
        const double h = step(k);
        accelerations_.col(k) = (6.0 / (h * h)) * (points_.col(k + 1) - points_.col(k)) -
                                (4.0 * velocities_.col(k) + 2.0 * velocities_.col(k + 1)) / h;
      } else {
        const double h = step(k - 1);
        accelerations_.col(k) = (-6.0 / (h * h)) * (points_.col(k) - points_.col(k - 1)) +
                                (2.0 * velocities_.col(k - 1) + 4.0 * velocities_.col(k)) / h;
      }
    }
  }
  /// With derivatives at the knots, n × knots each.
  Waypoints(std::vector<double> times, MatrixXd points, MatrixXd velocities, MatrixXd accelerations)
      : times_(std::move(times)),
        points_(std::move(points)),
        velocities_(std::move(velocities)),
        accelerations_(std::move(accelerations)) {}
  int num_joints() const override { return static_cast<int>(points_.rows()); }
  void evaluate(double t, Ref<VectorXd> q, Ref<VectorXd> qd, Ref<VectorXd> qdd) const override {
    if (t < times_.front() || t >= times_.back()) {
      q = t < times_.front() ? points_.col(0) : points_.col(points_.cols() - 1);
      qd.setZero();
      qdd.setZero();
      return;
    }
    const auto next = std::upper_bound(times_.begin(), times_.end(), t);
    const auto k = static_cast<Eigen::Index>(next - times_.begin()) - 1;
    const double h = step(k);
    const double x = (t - times_[static_cast<std::size_t>(k)]) / h;
    for (Eigen::Index i = 0; i < points_.rows(); ++i) {
      const double p0 = points_(i, k), p1 = points_(i, k + 1);
      const double v0 = velocities_(i, k) * h, v1 = velocities_(i, k + 1) * h;
      const double a0 = accelerations_(i, k) * h * h, a1 = accelerations_(i, k + 1) * h * h;
      const double d = p1 - p0;
      const double c3 = 10.0 * d - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1;
      const double c4 = -15.0 * d + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1;
      const double c5 = 6.0 * d - 3.0 * v0 - 3.0 * v1 - 0.5 * a0 + 0.5 * a1;
      q[i] = p0 + x * (v0 + x * (0.5 * a0 + x * (c3 + x * (c4 + x * c5))));
      qd[i] = (v0 + x * (a0 + x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5)))) / h;
      qdd[i] = (a0 + x * (6.0 * c3 + x * (12.0 * c4 + x * 20.0 * c5))) / (h * h);
    }
  }

 private:
  double step(Eigen::Index k) const {
    return times_[static_cast<std::size_t>(k) + 1] - times_[static_cast<std::size_t>(k)];
  }

  std::vector<double> times_;
  MatrixXd points_, velocities_, accelerations_;
};

class RampIn : public Reference {
 public:
  RampIn(std::shared_ptr<const Reference> motion, VectorXd start, double ramp)
      : motion_(std::move(motion)), start_(std::move(start)), ramp_(ramp) {}
  int num_joints() const override { return motion_->num_joints(); }
  void evaluate(double t, Ref<VectorXd> q, Ref<VectorXd> qd, Ref<VectorXd> qdd) const override {
    motion_->evaluate(t, q, qd, qdd);
    if (t >= ramp_) return;
    const SmoothStep step(t / ramp_);
    const double s1 = step.slope / ramp_;
    const double s2 = step.curvature / (ramp_ * ramp_);
    for (Eigen::Index i = 0; i < q.size(); ++i) {
      const double offset = q[i] - start_[i];
      qdd[i] = step.value * qdd[i] + 2.0 * s1 * qd[i] + s2 * offset;
      qd[i] = step.value * qd[i] + s1 * offset;
      q[i] = start_[i] + step.value * offset;
    }
  }

 private:
  std::shared_ptr<const Reference> motion_;
  VectorXd start_;
  double ramp_;
};

void require(bool holds, const char* message) {
  if (!holds) throw ModelError(message);
}

}  // namespace

std::shared_ptr<const Reference> make_hold(const VectorXd& position) {
  return std::make_shared<Hold>(position);
}

std::shared_ptr<const Reference> make_fourier(const FourierMotion& motion) {
  const auto same = [&](const MatrixXd& m) {
    return m.rows() == motion.q0.size() && m.cols() == motion.amplitude.cols();
  };
  require(same(motion.amplitude) && same(motion.frequency_hz) && same(motion.phase),
          "Fourier reference: found amplitude, frequency and phase of unequal size, expected one row per "
          "joint and the same number of terms in each; make the three lists alike");
  return std::make_shared<Fourier>(motion);
}

std::shared_ptr<const Reference> make_quintic(const VectorXd& from, const VectorXd& to, double duration) {
  require(
      from.size() == to.size() && duration > 0.0,
      "point-to-point reference: found ends of unequal size or a duration that is not positive, expected one "
      "value per joint at both ends and a positive duration; correct them");
  return std::make_shared<Quintic>(from, to, duration);
}

std::shared_ptr<const Reference> make_waypoints(const std::vector<double>& times, const MatrixXd& points,
                                                WaypointOrder order) {
  require(
      times.size() >= 2 && points.cols() == static_cast<Eigen::Index>(times.size()),
      "waypoint reference: found fewer than two times or not one point per time, expected one point per time "
      "and at least two; complete the list");
  for (std::size_t k = 1; k < times.size(); ++k) {
    require(times[k] > times[k - 1],
            "waypoint reference: found times that do not increase, expected strictly "
            "increasing times; sort the waypoints");
  }
  return std::make_shared<Waypoints>(times, points, order);
}

std::shared_ptr<const Reference> make_sampled(const VectorXd& times, const MatrixXd& q, const MatrixXd& qd,
                                              const MatrixXd& qdd) {
  const auto like_q = [&](const MatrixXd& m) { return m.rows() == q.rows() && m.cols() == q.cols(); };
  require(times.size() >= 2 && q.rows() == times.size() && like_q(qd) && like_q(qdd),
          "sampled reference: found fewer than two times or not one row of positions, velocities and accelerations "
          "each, expected one row per time and at least two; complete the samples");
  for (Eigen::Index k = 1; k < times.size(); ++k) {
    require(times[k] > times[k - 1],
            "sampled reference: found times that do not increase, expected strictly increasing times; sort the samples");
  }
  return std::make_shared<Waypoints>(std::vector<double>(times.begin(), times.end()), q.transpose(), qd.transpose(),
                                     qdd.transpose());
}

std::shared_ptr<const Reference> ramp_in(std::shared_ptr<const Reference> motion, const VectorXd& start,
                                         double ramp) {
  if (ramp <= 0.0) return motion;
  require(start.size() == motion->num_joints(),
          "ramp: found a start position of another size than the motion, expected one value per joint; "
          "correct it");
  return std::make_shared<RampIn>(std::move(motion), start, ramp);
}

}  // namespace heft::sim

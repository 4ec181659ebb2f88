#include <algorithm>
#include <cmath>
#include <utility>

#include "arm_search.hpp"
#include "deflection.hpp"
#include "engine.hpp"
#include "heft/host/parallel.hpp"

namespace heft::diagnose {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

void Engine::begin_near(const Engine& other, int fits) {
  const auto any = [&](auto is) { return std::any_of(accepted.begin(), accepted.end(), is); };
  nearby_.reset();
  if (!any([](const Candidate& e) { return e.is_elastic(); })) return;
  nearby_ = Nearby{other.rigid_, other.held_, {}, other.link_load_, fits};
  if (any([](const Candidate& e) { return e.takes_load(); })) nearby_->load = other.load();
}

/// The passes of elastic joints from a fit nearby: as many deflections, fewer fits.
void Engine::refit_near(const Nearby& nearby) {
  rigid_ = nearby.robot;
  held_ = nearby.held;
  link_load_ = nearby.link_load;
  if (nearby.load.size() > 0) lazy_load_ = nearby.load;
  loaded_.assign(static_cast<std::size_t>(table_.num_joints), true);
  for (int pass = nearby.fits; pass < kElasticPasses; ++pass) deflect_links();
  for (int fit = 0; fit < nearby.fits; ++fit) refit(true);
}

/// The links' motion where joints are elastic, from the torque that the present masses ask for.
void Engine::deflect_links() {
  std::vector<Candidate*> elastic;
  for (Candidate& e : accepted) {
    if (e.is_elastic()) elastic.push_back(&e);
  }
  std::vector<int> joints;
  for (const Candidate* e : elastic) joints.push_back(e->joint);
  LinkLoad now = link_load(rigid_, joints);
  if (!now.is_possible()) now = possible_near(std::move(now));
  for (std::size_t a = 0; a < elastic.size(); ++a) {
    const double mean = now.links.inertia(joints[a], joints[a]).mean();
    if (mean > 0.0) elastic[a]->inertia = mean;
  }
  put_deflections(now);
  link_load_ = std::move(now);
}

/// @param joints  k, of which no two are the same
Engine::LinkLoad Engine::link_load(const model::Robot& robot, const std::vector<int>& joints) const {
  LinkLoad by{masses_of(base_.parameters(robot)),
              link_torque(robot, motion_.link_q, motion_.link_qd, motion_.qdd, joints), {}};
  by.load = std::move(by.links.torque);
  for (std::size_t a = 0; a < joints.size(); ++a) {
    for (const int other : joints) {
      by.load.col(static_cast<Index>(a)) +=
          by.links.stiffness(joints[a], other).cwiseProduct(motion_.q.col(other) - motion_.link_q.col(other));
    }
  }
  return by;
}

/// Base parameters of links alone, b; others 0.
VectorXd Engine::masses_of(VectorXd beta) const {
  for (int c = 0; c < base_.columns(); ++c) {
    if (!base_.is_link(c)) beta[c] = 0.0;
  }
  return beta;
}

/// Whether the kinetic energy is positive, of each joint alone and of any two.
bool Engine::LinkLoad::is_possible() const {
  for (const int a : joints()) {
    const auto own = links.inertia(a, a).array();
    if (!(own.minCoeff() > 0.0)) return false;
    for (const int b : joints()) {
      if (b == a) break;
      if (!((own * links.inertia(b, b).array() - links.inertia(a, b).array().square()).minCoeff() > 0.0)) return false;
    }
  }
  return true;
}

/// A fit along a motion that is off may give masses that are physically impossible, which would deflect nothing. This goes half of
/// the way to them or less, from those that deflected last or, where there are none, from the given ones.
Engine::LinkLoad Engine::possible_near(LinkLoad wanted) const {
  const LinkLoad from =
      link_load_.joints() == wanted.joints() ? link_load_ : link_load(base_.robot(base_.prior()), wanted.joints());
  for (const double part : {0.5, 0.25, 0.125}) {
    const auto between = [&](const auto& a, const auto& b) { return (a + part * (b - a)).eval(); };
    LinkLoad there{between(from.masses, wanted.masses),
                   {wanted.joints(), {}, between(from.links.mass, wanted.links.mass), between(from.links.slope, wanted.links.slope)},
                   between(from.load, wanted.load)};
    if (there.is_possible()) return there;
  }
  return from;
}

/// The springs' numbers, one a joint.
VectorXd Engine::of_springs(double Candidate::*number) const {
  std::vector<double> all;
  for (const Candidate& e : accepted) {
    if (e.is_elastic()) all.push_back(e.*number);
  }
  return Eigen::Map<const VectorXd>(all.data(), static_cast<Index>(all.size()));
}

void Engine::put_deflections(const LinkLoad& by) {
  const auto k = static_cast<Index>(by.joints().size());
  const VectorXd stiffness = of_springs(&Candidate::shape), damping = of_springs(&Candidate::second);
  const Deflections all = deflections(table_, by.load, by.links.inertias(by.joints()), stiffness, damping, by.links.slopes(by.joints()));
  for (Index a = 0; a < k; ++a) {
    const int joint = by.joints()[static_cast<std::size_t>(a)];
    const VectorXd own = by.links.inertia(joint, joint);
    if (!(own.minCoeff() > 0.0)) continue;
    const auto put = [&](const auto& value, const auto& rate, const auto& acceleration) {
      motion_.link_q.col(joint) = motion_.q.col(joint) - value;
      motion_.link_qd.col(joint) = motion_.qd.col(joint) - rate;
      motion_.link_qdd.col(joint) = motion_.qdd.col(joint) - acceleration;
    };
    if (all.value.rows() > 0) {
      put(all.value.col(a), all.rate.col(a), all.acceleration.col(a));
    } else {  // the fitted masses are physically impossible together
      const Deflections one = deflections(table_, by.load.col(a), own, stiffness.segment(a, 1), damping.segment(a, 1),
                                          by.links.stiffness(joint, joint));
      if (one.value.rows() > 0) put(one.value, one.rate, one.acceleration);
    }
  }
}

/// The torque around the present deflection, linear in masses, stiffness and damping. Whatever moves a deflection by x = ∂e/∂p
/// moves the torque of joint i by -Σ_b (M_ib ẍ_b + G_ib x_b), and
///   M ẍ + D ẋ + (K + G) x = Y   for a mass, Y its column in the rows of the elastic joints,
///                         = -K e and -D ė   for the logarithms of stiffness and damping of a joint, in its own row.
/// What the small change of the links' positions does to Y, M and G is left out.
Engine::Linear Engine::linearised() const {
  const LinkLoad& by = link_load_;
  const auto k = static_cast<Index>(by.joints().size());
  const Index m = table_.rows();
  const int n = table_.num_joints;
  // Every mass that moves one of the joints.
  std::vector<int> masses;
  for (const int c : base_.places()[static_cast<std::size_t>(*std::min_element(by.joints().begin(), by.joints().end()))]) {
    if (base_.is_link(c)) masses.push_back(c);
  }
  const auto of_masses = static_cast<Index>(masses.size());
  const VectorXd stiffness = of_springs(&Candidate::shape), damping = of_springs(&Candidate::second);
  std::vector<MatrixXd> loads;
  for (Index b = 0; b < k; ++b) {
    const auto joint = static_cast<std::size_t>(by.joints()[static_cast<std::size_t>(b)]);
    const std::vector<int>& places = base_.places()[joint];
    MatrixXd load = MatrixXd::Zero(m, of_masses + 2 * k);
    for (Index c = 0; c < of_masses; ++c) {
      const auto found = std::find(places.begin(), places.end(), masses[static_cast<std::size_t>(c)]);
      if (found != places.end()) load.col(c) = (*rows_)[joint].col(found - places.begin());
    }
    const auto j = static_cast<Index>(joint);
    load.col(of_masses + 2 * b) = -stiffness[b] * (motion_.q.col(j) - motion_.link_q.col(j));
    load.col(of_masses + 2 * b + 1) = -damping[b] * (motion_.qd.col(j) - motion_.link_qd.col(j));
    loads.push_back(std::move(load));
  }
  const std::vector<ManyDeflections> moved = deflections_by_loads(table_, loads, by.links.inertias(by.joints()), stiffness, damping, by.links.slopes(by.joints()));
  loads.clear();
  Linear linear{rows_, base_.places(), MatrixXd::Zero(m, n), {}};
  if (moved.empty()) return linear;
  // Where what deflections do drowns in noise, so does what changes of them do: fits are faster without it.
  constexpr double kDrowns = 0.1;
  for (int i = 0; i < n; ++i) {
    VectorXd deflecting = VectorXd::Zero(m);
    for (Index b = 0; b < k; ++b) {
      const int joint = by.joints()[static_cast<std::size_t>(b)];
      deflecting += by.links.inertia(i, joint).cwiseProduct(motion_.qdd.col(joint) - motion_.link_qdd.col(joint)) +
                    by.links.stiffness(i, joint).cwiseProduct(motion_.q.col(joint) - motion_.link_q.col(joint));
    }
    const bool elastic = std::find(by.joints().begin(), by.joints().end(), i) != by.joints().end();
    if (elastic || deflecting.norm() > kDrowns * base_noise_[i] * std::sqrt(static_cast<double>(m))) linear.springs.joints.push_back(i);
  }
  linear.springs.values.assign(linear.springs.joints.size(), MatrixXd(m, 2 * k));
  auto rows = std::make_shared<BaseRows>(*rows_);
  host::for_each_parallel(linear.springs.joints.size(), [&](std::size_t s) {
    const int joint = linear.springs.joints[s];
    const auto i = static_cast<std::size_t>(joint);
    std::vector<int>& places = linear.places[i];
    MatrixXd& own = (*rows)[i];
    // Masses further in reach the joint through the deflection alone.
    for (const int mass : masses) {
      if (std::find(places.begin(), places.end(), mass) == places.end()) places.push_back(mass);
    }
    own.conservativeResize(Eigen::NoChange, static_cast<Index>(places.size()));
    own.rightCols(own.cols() - (*rows_)[i].cols()).setZero();
    VectorXd change(m);
    for (Index c = 0; c < of_masses + 2 * k; ++c) {
      change.setZero();
      for (Index b = 0; b < k; ++b) {
        const ManyDeflections& by_one = moved[static_cast<std::size_t>(b)];
        const int elastic = by.joints()[static_cast<std::size_t>(b)];
        change -= by_one.acceleration.col(c).cwiseProduct(by.links.inertia(joint, elastic)) +
                  by_one.value.col(c).cwiseProduct(by.links.stiffness(joint, elastic));
      }
      if (c >= of_masses) {
        linear.springs.values[s].col(c - of_masses) = change;
        continue;
      }
      const int mass = masses[static_cast<std::size_t>(c)];
      own.col(std::find(places.begin(), places.end(), mass) - places.begin()) += change;
      linear.constant.col(joint) -= by.masses[mass] * change;
    }
  });
  linear.rows = std::move(rows);
  return linear;
}

/// Takes over what the fit says of stiffness and damping. Where it asks for more than its columns may be trusted for, it is drawn
/// back, and the masses with it.
void Engine::turn_springs() {
  constexpr double kMostStiffness = 0.15, kMostDamping = 0.7;  // of the logarithm
  spring_step_ = 0.0;
  if (first_spring_column_ < 0) return;
  const auto steps = [&] {
    return VectorXd(problem_->theta().segment(first_spring_column_, linear_.springs.count()));
  };
  VectorXd step = steps();
  for (double weight = 0.03; weight < 1e3; weight *= 4.0) {
    bool within = step.allFinite();
    for (Index s = 0; s < step.size(); ++s) within = within && std::abs(step[s]) <= (s % 2 == 0 ? kMostStiffness : kMostDamping);
    if (within) break;
    problem_->lean(first_spring_column_, linear_.springs.count(), weight);
    problem_->reweight();
    step = steps();
  }
  if (!step.allFinite()) return;
  Index s = 0;
  for (Candidate& e : accepted) {
    if (!e.is_elastic()) continue;
    spring_step_ = std::max({spring_step_, std::abs(step[s]), 0.1 * std::abs(step[s + 1])});
    e.shape *= std::exp(std::clamp(step[s], -kMostStiffness, kMostStiffness));
    e.second *= std::exp(std::clamp(step[s + 1], -kMostDamping, kMostDamping));
    s += 2;
  }
}

std::vector<int> Engine::remove_impossible_motors() {
  std::vector<std::size_t> found;
  for (std::size_t e = 0; e < accepted.size(); ++e) {
    if (accepted[e].has_motor() && coefficients(e)[0] < 0.0) found.push_back(e);
  }
  std::vector<int> joints;
  for (const std::size_t e : found) {
    remove_motor(accepted[e].columns);
    joints.push_back(accepted[e].joint);
  }
  return joints;
}

}  // namespace heft::diagnose

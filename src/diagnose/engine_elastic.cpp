#include <algorithm>
#include <cmath>

#include "arm_search.hpp"
#include "deflection.hpp"
#include "engine.hpp"
#include "heft/host/parallel.hpp"
#include "heft/model/batch_dynamics.hpp"

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
  std::vector<const Candidate*> elastic;
  for (const Candidate& e : accepted) {
    if (e.is_elastic()) elastic.push_back(&e);
  }
  LinkLoad now = link_load(rigid_, elastic);
  if (!now.is_possible()) now = possible_near(std::move(now), elastic);
  hold_swing(now.inertia);
  put_deflections(elastic, now);
  link_load_ = std::move(now);
}

/// @param elastic  k joints, of which no two are the same
Engine::LinkLoad Engine::link_load(const model::Robot& robot, const std::vector<const Candidate*>& elastic) const {
  const auto k = static_cast<Index>(elastic.size());
  const auto joint = [&](Index a) { return elastic[static_cast<std::size_t>(a)]->joint; };
  const model::BatchDynamics dynamics(robot);
  LinkLoad by{{}, MatrixXd(table_.rows(), k), MatrixXd(table_.rows(), k * k)};
  for (const Candidate* e : elastic) by.joints.push_back(e->joint);
  constexpr Index kPiece = 256;  // rows of a job
  host::for_each_parallel(static_cast<std::size_t>((table_.rows() + kPiece - 1) / kPiece), [&](std::size_t piece) {
    const Index from = static_cast<Index>(piece) * kPiece, count = std::min(kPiece, table_.rows() - from);
    const auto q = motion_.link_q.middleRows(from, count), qd = motion_.link_qd.middleRows(from, count);
    MatrixXd asked = motion_.qdd.middleRows(from, count);
    const MatrixXd torque = dynamics.inverse_dynamics(q, qd, asked);
    for (Index b = 0; b < k; ++b) {
      by.load.col(b).segment(from, count) = torque.col(joint(b));
      // Entries of the mass matrix: what one more unit of acceleration asks for.
      asked.col(joint(b)).array() += 1.0;
      const MatrixXd more = dynamics.inverse_dynamics(q, qd, asked) - torque;
      asked.col(joint(b)) = motion_.qdd.col(joint(b)).segment(from, count);
      for (Index a = 0; a < k; ++a) by.inertia.col(a * k + b).segment(from, count) = more.col(joint(a));
    }
  });
  return by;
}

/// Whether the kinetic energy is positive, of each joint alone and of any two.
bool Engine::LinkLoad::is_possible() const {
  const Index k = load.cols();
  for (Index a = 0; a < k; ++a) {
    const auto own = inertia.col(a * k + a).array();
    if (!(own.minCoeff() > 0.0)) return false;
    for (Index b = 0; b < a; ++b) {
      if (!((own * inertia.col(b * k + b).array() - inertia.col(a * k + b).array().square()).minCoeff() > 0.0)) return false;
    }
  }
  return true;
}

/// A fit along a motion that is off may give masses that are physically impossible, which would deflect nothing. This goes half of
/// the way to them or less, from those that deflected last or, where there are none, from the given ones.
Engine::LinkLoad Engine::possible_near(LinkLoad wanted, const std::vector<const Candidate*>& elastic) const {
  const LinkLoad from = link_load_.joints == wanted.joints ? link_load_ : link_load(base_.robot(base_.prior()), elastic);
  for (const double part : {0.5, 0.25, 0.125}) {
    LinkLoad there{from.joints, from.load + part * (wanted.load - from.load),
                   from.inertia + part * (wanted.inertia - from.inertia)};
    if (there.is_possible()) return there;
  }
  return from;
}

/// Springs go with the masses: what a log shows is the frequency that a link swings at, and how that dies out. With the stiffness
/// held instead, masses that are off move the resonance away from where it is, and the next fit drives them further off.
void Engine::hold_swing(const MatrixXd& inertia) {
  Index a = 0;
  const auto k = static_cast<Index>(std::sqrt(static_cast<double>(inertia.cols())) + 0.5);
  for (Candidate& e : accepted) {
    if (!e.is_elastic()) continue;
    const auto own = inertia.col(a * k + a);
    ++a;
    if (!(own.minCoeff() > 0.0)) continue;
    const double change = own.mean() / e.inertia;
    e.shape *= change;
    e.second *= change;
    e.inertia = own.mean();
  }
}

void Engine::put_deflections(const std::vector<const Candidate*>& elastic, const LinkLoad& by) {
  const auto k = static_cast<Index>(elastic.size());
  VectorXd stiffness(k), damping(k);
  for (Index a = 0; a < k; ++a) {
    stiffness[a] = elastic[static_cast<std::size_t>(a)]->shape;
    damping[a] = elastic[static_cast<std::size_t>(a)]->second;
  }
  const Deflections all = deflections(table_, by.load, by.inertia, stiffness, damping);
  for (Index a = 0; a < k; ++a) {
    const Candidate& e = *elastic[static_cast<std::size_t>(a)];
    const VectorXd own = by.inertia.col(a * k + a);
    if (!(own.minCoeff() > 0.0)) continue;
    const auto put = [&](const auto& value, const auto& rate, const auto& acceleration) {
      motion_.link_q.col(e.joint) = motion_.q.col(e.joint) - value;
      motion_.link_qd.col(e.joint) = motion_.qd.col(e.joint) - rate;
      motion_.link_qdd.col(e.joint) = motion_.qdd.col(e.joint) - acceleration;
    };
    if (all.value.rows() > 0) {
      put(all.value.col(a), all.rate.col(a), all.acceleration.col(a));
    } else {  // the fitted masses are physically impossible together
      const Deflections one = deflections(table_, by.load.col(a), own, stiffness.segment(a, 1), damping.segment(a, 1));
      put(one.value, one.rate, one.acceleration);
    }
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

#include "encoder_terms.hpp"

#include <algorithm>

#include "heft/host/decompositions.hpp"
#include "heft/statistics/correlation.hpp"
#include "heft/statistics/distributions.hpp"
#include "heft/statistics/residual_statistics.hpp"

namespace heft::stiffness {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// Part of a term's power that the terms before it must leave for it to be tried.
constexpr double kOwnPower = 1e-7;

/// Chance that the coefficients of these columns are all 0: Wald statistic with the jackknife covariance of B
/// blocks, W (B − k)/(k (B − 1)) ~ F(k, B − k).
double wald_p_value(const EncoderProblem::Fit& f, const std::vector<Index>& columns, int blocks) {
  std::vector<Index> at;
  for (const Index j : columns) {
    const auto found = std::find(f.index.begin(), f.index.end(), j);
    if (found != f.index.end()) at.push_back(found - f.index.begin());
  }
  const auto k = static_cast<double>(at.size());
  if (at.empty() || blocks - k < 1) return 1.0;
  const VectorXd x = f.x(at);
  MatrixXd solution = x;
  if (!solve_positive(f.covariance(at, at), solution)) return 1.0;
  const double wald = x.dot(VectorXd(solution.col(0)));
  return statistics::fisher_tail(wald * (blocks - k) / (k * (blocks - 1.0)), k, blocks - k);
}

/// The columns whose coefficients decide on the term.
std::vector<Index> tested(const EncoderProblem& problem, const std::vector<DeflectionTerm>& used,
                          DeflectionTerm term) {
  const std::vector<Index>& all = problem.term(term)->columns;
  // Next to a straight line only the curvature is new.
  if (term == DeflectionTerm::kEccentricity && contains(used, DeflectionTerm::kPosition)) return {all.back()};
  return all;
}

/// Lost motion, friction and damping take energy out; the other way round they would put it in.
bool must_be_positive(DeflectionTerm term) {
  return term == DeflectionTerm::kBacklash || term == DeflectionTerm::kTorqueHysteresis ||
         term == DeflectionTerm::kLoadFriction || term == DeflectionTerm::kDamping;
}
}  // namespace

std::vector<DeflectionTerm> with(const std::vector<DeflectionTerm>& used, DeflectionTerm term) {
  std::vector<DeflectionTerm> result = used;
  // The first harmonic holds the straight line.
  if (term == DeflectionTerm::kEccentricity) std::erase(result, DeflectionTerm::kPosition);
  result.push_back(term);
  return result;
}

std::vector<DeflectionTerm> without(const std::vector<DeflectionTerm>& used, DeflectionTerm term) {
  std::vector<DeflectionTerm> result = used;
  std::erase(result, term);
  return result;
}

std::string obstacle(const EncoderProblem& problem, const std::vector<DeflectionTerm>& used,
                     DeflectionTerm term) {
  const Columns* columns = problem.term(term);
  if (columns == nullptr)
    return term == DeflectionTerm::kBacklash ? "the torque does not change its sign"
                                             : "the joint does not move";
  if (term == DeflectionTerm::kPosition && contains(used, DeflectionTerm::kEccentricity))
    return "contained in the first harmonic";
  if (term == DeflectionTerm::kSecondHarmonic && !contains(used, DeflectionTerm::kEccentricity))
    return "only together with the first harmonic";
  std::vector<DeflectionTerm> rest = with(used, term);
  std::erase(rest, term);
  if (problem.own_power(problem.indices(rest), columns->columns) < kOwnPower)
    return "this motion cannot distinguish it from the other terms";
  return {};
}

double correlation_time_of(const EncoderProblem& problem, const VectorXd& residual) {
  // Log by log: what follows the end of one is not the beginning of the next.
  double longest = 0.0;
  const std::vector<int>& log = problem.log_of_row();
  for (Index begin = 0; begin < residual.size();) {
    Index end = begin;
    while (end < residual.size() &&
           log[static_cast<std::size_t>(end)] == log[static_cast<std::size_t>(begin)])
      ++end;
    longest = std::max(
        longest, statistics::correlation_time(residual.segment(begin, end - begin), 1.0 / problem.rate()));
    begin = end;
  }
  return longest;
}

double set_blocks(EncoderProblem& problem, const VectorXd& residual) {
  statistics::ResidualStatistics statistics;
  statistics.correlation_time = VectorXd::Constant(1, correlation_time_of(problem, residual));
  // At least six blocks even of the shortest log.
  const double block = std::min(statistics.block_length(problem.duration()), problem.shortest_log() / 6.0);
  problem.set_blocks(block);
  return statistics.edge_factor(block);
}

TermTrial try_term(EncoderProblem& problem, const std::vector<DeflectionTerm>& less, DeflectionTerm term) {
  TermTrial t;
  const std::vector<DeflectionTerm> more = with(less, term);
  const double edge = set_blocks(problem, problem.fit(more).innovation);
  t.fit = problem.fit(more, edge);
  t.possible = !must_be_positive(term) || coefficients(problem, t.fit, term, 1.0).front().value > 0;
  t.with = t.fit.held_out;
  t.without = problem.fit(less).held_out;
  t.p_value = std::min(1.0, static_cast<double>(kCandidates.size()) *
                                wald_p_value(t.fit, tested(problem, less, term), problem.num_blocks()));
  return t;
}

namespace {

/// Terms one after the other, the one that predicts held-out blocks best first, as long as it does so better
/// than without and is not explained by chance.
std::vector<DeflectionTerm> choose(EncoderProblem& problem, std::vector<DeflectionTerm> used) {
  for (std::size_t round = 0; round < kCandidates.size(); ++round) {
    double best = 1.0;
    std::optional<DeflectionTerm> found;
    for (const DeflectionTerm term : kCandidates) {
      if (contains(used, term) || !obstacle(problem, used, term).empty()) continue;
      const TermTrial trial = try_term(problem, used, term);
      if (!trial.possible || trial.with >= best * trial.without || trial.p_value >= kLevel) continue;
      best = trial.with / trial.without;
      found = term;
    }
    if (!found) break;
    used = with(used, *found);
  }
  return used;
}

}  // namespace

Chosen choose_fit(EncoderProblem& problem, const std::vector<DeflectionTerm>& base,
                  const std::vector<DeflectionTerm>* given, std::optional<double> memory,
                  std::optional<Chosen>& other) {
  const auto attempt = [&](double weighting, double* next) {
    Chosen c;
    c.memory = weighting;
    problem.set_memory(weighting);
    problem.set_blocks(problem.block_length());
    c.terms = base;
    if (given == nullptr) {
      c.terms = choose(problem, base);
    } else {
      for (const DeflectionTerm term : kCandidates) {
        if (contains(*given, term) && obstacle(problem, c.terms, term).empty()) c.terms = with(c.terms, term);
      }
    }
    const EncoderProblem::Fit f = problem.fit(c.terms);
    if (next != nullptr) *next = 0.5 * correlation_time_of(problem, f.residual);
    const double edge = set_blocks(problem, f.innovation);
    c.compliance = coefficients(problem, problem.fit(c.terms, edge), DeflectionTerm::kCompliance,
                                statistics::interval_factor(problem.num_blocks() - 1))
                       .front();
    return c;
  };
  if (memory) return attempt(*memory, nullptr);
  double found = 0.0;
  Chosen plain = attempt(0.0, &found);
  if (!(found > problem.shortest_memory())) return plain;
  Chosen weighted = attempt(found, nullptr);
  const bool better = weighted.compliance.std < plain.compliance.std;
  other = better ? plain : weighted;
  return better ? weighted : plain;
}

}  // namespace heft::stiffness

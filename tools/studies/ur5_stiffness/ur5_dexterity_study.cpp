// How evenly the joints move the tool: the printed map and its zones, with the printed length and with a sound one.
#include <algorithm>
#include <cmath>
#include <functional>

#include <fmt/format.h>

#include "ur5_stiffness_setup.hpp"

namespace heft::studies {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double kPrintedRatio = 0.8488;      // read as metres
constexpr double kPrintedLength = 0.8488e-3;  // lengths of J in mm over 0.8488 [m]

/// The wrist of the map [rad].
VectorXd mapped_wrist() { return degrees({0, 0, 0, 45, 45, 45}); }

/// 1/k_F over joints 2 and 3: three degrees apart, whole turns.
stiffness::DexterityMap map_with(const model::Kinematics& kinematics, double length) {
  const stiffness::MapAxis theta2{1, -270 * kDegree, 90 * kDegree, 120}, theta3{2, 0.0, 360 * kDegree, 120};
  return stiffness::dexterity_map(kinematics, mapped_wrist(), theta2, theta3, length);
}

/// The region of a map that is most like a printed zone.
ZoneMatch best_match(const std::string& name, const ZoneAngles& printed,
                     const std::vector<stiffness::DexterityZone>& zones) {
  ZoneMatch match;
  match.name = name;
  match.printed = printed;
  for (const stiffness::DexterityZone& zone : zones) {
    ZoneAngles found{zone.first_low / kDegree, zone.first_high / kDegree, zone.second_low / kDegree,
                     zone.second_high / kDegree};
    // The same turn as the printed one.
    const double shift = 360.0 * std::round((printed[0] + printed[1] - found[0] - found[1]) / 720.0);
    found[0] += shift;
    found[1] += shift;
    const double common = overlap(printed, found);
    if (common > match.overlap) {
      match.overlap = common;
      match.found = found;
    }
  }
  return match;
}

/// Both zones of table 5 as a map with a threshold has them, and their mean overlap.
std::pair<double, std::vector<ZoneMatch>> matches_at(const stiffness::DexterityMap& map, double threshold) {
  const std::vector<stiffness::DexterityZone> zones = stiffness::zones(map, threshold);
  std::vector<ZoneMatch> matches;
  double sum = 0.0;
  for (const auto& [name, printed] : printed_zones()) {
    matches.push_back(best_match(name, printed, zones));
    sum += matches.back().overlap;
  }
  return {sum / static_cast<double>(matches.size()), matches};
}

/// The threshold with which the regions of the map are most like table 5.
void match_zones(DexterityStudy& study) {
  double best_overlap = -1.0;
  for (int step = 0; step <= 28; ++step) {
    const double threshold = 0.0028 + 0.0001 * step;
    auto [mean, matches] = matches_at(study.as_printed, threshold);
    if (mean <= best_overlap) continue;
    best_overlap = mean;
    study.matches = std::move(matches);
    study.matching_threshold = threshold;
  }
}

/// Shares of the map that the text calls low and high, and whether the elbow is singular stretched and folded.
void look_at_statements(const model::Kinematics& kinematics, DexterityStudy& study) {
  const MatrixXd& D = study.as_printed.dexterity;
  const auto count = static_cast<double>(D.size());
  study.share_called_bad = static_cast<double>((D.array() >= 0.001 && D.array() <= 0.005).count()) / count;
  study.share_called_good = static_cast<double>((D.array() >= 0.0035 && D.array() <= 0.005).count()) / count;
  for (Index i = 0; i < D.rows(); ++i) {
    VectorXd q = mapped_wrist();
    q[1] = study.as_printed.first_values[i];
    for (const auto& [angle, value] : {std::pair{0.0, &study.straight}, std::pair{180.0, &study.folded}}) {
      q[2] = angle * kDegree;
      *value = std::max(*value, stiffness::dexterity(kinematics.jacobian(q), study.length));
    }
  }
}

/// Values of both maps in a printed zone.
void look_inside(const DexterityStudy& study, ZoneMatch& match) {
  const MatrixXd& D = study.as_printed.dexterity;
  std::vector<double> values;
  for (Index i = 0; i < D.rows(); ++i) {
    for (Index j = 0; j < D.cols(); ++j) {
      if (!inside(match.printed, study.as_printed.first_values[i] / kDegree,
                  study.as_printed.second_values[j] / kDegree)) {
        continue;
      }
      values.push_back(D(i, j));
      match.best = std::max(match.best, study.sound.dexterity(i, j));
    }
  }
  std::sort(values.begin(), values.end());
  match.low = values.front();
  match.median = values[values.size() / 2];
  match.high = values.back();
}

/// As many points of the other map as are high in this one: do they lie at the same place?
double share_that_stays(const DexterityStudy& study) {
  const MatrixXd& D = study.as_printed.dexterity;
  const MatrixXd& other = study.sound.dexterity;
  std::vector<double> sorted(other.data(), other.data() + other.size());
  std::sort(sorted.begin(), sorted.end(), std::greater<>());
  const auto high = static_cast<std::size_t>((D.array() >= study.threshold).count());
  const double equal = sorted[std::min(high, sorted.size() - 1)];
  const auto both = static_cast<double>((D.array() >= study.threshold && other.array() > equal).count());
  return both / static_cast<double>(high);
}

PoseDexterity dexterity_at(const model::Kinematics& kinematics, const VectorXd& q, double length,
                           const std::string& name, bool measured) {
  const MatrixXd J = kinematics.jacobian(q);
  return {name, stiffness::dexterity(J, kPrintedLength), stiffness::dexterity(J, length), measured,
          in_a_zone(q)};
}

}  // namespace

DexterityStudy study_dexterity(const model::Kinematics& kinematics, const Ur5Measurements& measurements) {
  const std::vector<VectorXd> measured = poses_of(measurements.tool);
  DexterityStudy study;
  study.as_printed = map_with(kinematics, kPrintedLength);
  study.zones = stiffness::zones(study.as_printed, study.threshold);
  match_zones(study);
  study.in_metres = map_with(kinematics, kPrintedRatio).dexterity.maxCoeff();
  study.length = stiffness::shared_length(stiffness::loaded_poses(kinematics, measurements.tool));
  study.least = stiffness::characteristic_length(kinematics);
  study.sound = map_with(kinematics, study.length);
  look_at_statements(kinematics, study);
  for (ZoneMatch& match : study.matches) look_inside(study, match);
  study.zones_that_stay = share_that_stays(study);
  for (std::size_t k = 0; k < measured.size(); ++k) {
    study.poses.push_back(
        dexterity_at(kinematics, measured[k], study.length, fmt::format("{}", k + 1), true));
  }
  for (std::size_t k = 0; k < measurements.outside.size(); ++k) {
    study.poses.push_back(
        dexterity_at(kinematics, measurements.outside[k], study.length, fmt::format("13.{}", k + 1), false));
  }
  return study;
}

}  // namespace heft::studies

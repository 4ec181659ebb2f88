/// @file
/// What heft excite says of its motions: text, JSON, page.
#pragma once

#include <optional>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "heft/excite/excite.hpp"
#include "heft/page/page.hpp"

namespace heft::tools {

/// What random motions inside the same limits would reveal: medians.
struct RandomMotions {
  int count{0};
  double condition{0.0}, mean_std{0.0}, volume_std{0.0};
};

/// Settings that the words speak of.
struct ExciteWording {
  std::string cost;        ///< "d-optimal" or "condition"
  std::string noise;       ///< the torque noise, in words
  std::string parameters;  ///< what is sought, in words
  bool rows_by_noise{true};
  std::vector<std::string> given;                 ///< logs
  std::optional<excite::ExcitationScore> before;  ///< of the given logs alone
  std::optional<RandomMotions> random;
};

std::string excite_text(const excite::ExcitingMotion& motion, const ExciteWording& wording);
nlohmann::ordered_json excite_json(const excite::ExcitingMotion& motion, const ExciteWording& wording);
page::Page excite_page(const excite::ExcitingMotion& motion, const ExciteWording& wording);

std::string friction_text(const excite::FrictionMotion& motion);
nlohmann::ordered_json friction_json(const excite::FrictionMotion& motion);
page::Page friction_page(const excite::FrictionMotion& motion);

}  // namespace heft::tools

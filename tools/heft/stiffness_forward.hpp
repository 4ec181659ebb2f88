/// @file
/// What joint stiffnesses mean for the tool: text, JSON and page.
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>

#include "heft/data/log.hpp"
#include "heft/model/kinematics.hpp"
#include "heft/page/page.hpp"
#include "stiffness_jobs.hpp"

namespace heft::tools {

/// The log of --path; without samples when there is none.
data::Log read_path(const StiffnessCommandOptions& options, const model::Robot& robot);

/// A pose to look at.
struct NamedPose {
  std::string name;
  Eigen::VectorXd q;
};

struct ToolDescription {
  std::string text;  ///< for the terminal
  data::Log
      compensated;  ///< the path with compensated positions; without samples unless --compensated asks for it
};

/// Cartesian stiffness and extreme deflections at the poses; sag under the payload there and along the path, and the
/// compensated path.
/// @param stiffness  of each joint, infinite for a rigid one
/// @param path       as read_path gives it
ToolDescription describe_tool(const model::Kinematics& kinematics, const Eigen::VectorXd& stiffness,
                              const std::vector<NamedPose>& poses, const data::Log& path,
                              const StiffnessCommandOptions& options, nlohmann::ordered_json& json,
                              page::Page& page);

/// finish(), and writes the compensated path with it.
void finish_with_path(const Console& console, const StiffnessCommandOptions& options,
                      const nlohmann::ordered_json& json, const page::Page& page,
                      const data::Log& compensated, const std::function<void()>& write_model);

/// "9.12 kN·m/rad", "∞"; the unit of a prismatic joint is N/m.
std::string stiffness_in_words(double stiffness, bool prismatic);
/// "5.71 to 19.8 kN·m/rad", "at least 1.2 kN·m/rad" where the upper end is open, "–" where there is no lower one.
std::string stiffness_interval_in_words(double low, double high, bool prismatic);

/// The robot's joints as elastic ones with these stiffnesses (infinite or NaN: rigid), as a model file.
void write_elastic_model(const std::string& path, model::Robot robot, const Eigen::VectorXd& stiffness,
                         const std::string& method, const std::vector<std::string>& sources,
                         const std::vector<std::string>& notes);

}  // namespace heft::tools

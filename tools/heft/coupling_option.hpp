/// @file
/// --coupling: gear couplings as the commands take them.
#pragma once

#include <string>
#include <vector>

#include "command_line.hpp"
#include "heft/model/robot.hpp"

namespace heft::tools {

/// --coupling I,J[,RATIO], which may be given several times.
/// @param texts    gets what is given, for couplings_of()
/// @param meaning  of a coupling for this command, for the help text
void add_coupling_option(CommandLine line, std::vector<std::string>& texts, const std::string& meaning);

/// "5,6" or "5,6,0.7": joint 5 also turns the motor of joint 6. Whether the robot has these joints is not looked at.
/// @throws UsageError on anything but two whole numbers and at most a ratio
std::vector<GearCoupling<double>> couplings_of(const std::vector<std::string>& texts);

}  // namespace heft::tools

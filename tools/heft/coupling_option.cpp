#include "coupling_option.hpp"

#include <cmath>
#include <cstdlib>
#include <sstream>

#include <fmt/format.h>

namespace heft::tools {
namespace {

std::vector<double> numbers_of(const std::string& text) {
  std::vector<double> numbers;
  std::istringstream parts(text);
  for (std::string part; std::getline(parts, part, ',');) {
    char* end = nullptr;
    const double value = std::strtod(part.c_str(), &end);
    if (part.empty() || end != part.c_str() + part.size())
      throw UsageError(fmt::format("--coupling {}: \"{}\" is not a number", text, part));
    if (!std::isfinite(value)) {
      throw UsageError(fmt::format("--coupling {}: found {}, expected finite numbers: two joints and a ratio",
                                   text, part));
    }
    numbers.push_back(value);
  }
  return numbers;
}

GearCoupling<double> coupling_of(const std::string& text) {
  const std::vector<double> numbers = numbers_of(text);
  const auto whole = [](double number) { return std::floor(number) == number; };
  if (numbers.size() < 2 || numbers.size() > 3 || !whole(numbers[0]) || !whole(numbers[1])) {
    throw UsageError(
        fmt::format("--coupling {}: expected two joints and at most a ratio, as in 5,6 or 5,6,1.0 (joint 5 "
                    "also turns the motor of joint 6)",
                    text));
  }
  GearCoupling<double> coupling;
  coupling.driving = static_cast<int>(numbers[0]) - 1;
  coupling.driven = static_cast<int>(numbers[1]) - 1;
  if (numbers.size() == 3) coupling.ratio = numbers[2];
  return coupling;
}

}  // namespace

void add_coupling_option(CommandLine line, std::vector<std::string>& texts, const std::string& meaning) {
  line.add_option("--coupling", texts,
                  meaning + ": joint I also turns the motor of joint J (ratio: J's turn for one of I)")
      .type_name("I,J[,RATIO]");
}

std::vector<GearCoupling<double>> couplings_of(const std::vector<std::string>& texts) {
  std::vector<GearCoupling<double>> couplings;
  couplings.reserve(texts.size());
  for (const std::string& text : texts) couplings.push_back(coupling_of(text));
  return couplings;
}

}  // namespace heft::tools

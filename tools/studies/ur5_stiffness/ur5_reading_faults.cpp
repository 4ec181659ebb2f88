// What the tables of readings contradict among themselves.
#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "ur5_stiffness_faults.hpp"

namespace heft::studies {

namespace {

constexpr double kWeight = 18.6718;  // the weight [N]
constexpr int kToolTable = 7, kCantileverTable = 14, kPoses = 6;

std::vector<PrintedReading> table(const Ur5Measurements& m, int number) {
  std::vector<PrintedReading> rows;
  for (const PrintedReading& r : m.printed) {
    if (r.table == number) rows.push_back(r);
  }
  return rows;
}

double mean_difference(const std::vector<PrintedReading>& rows) {
  double sum = 0.0;
  for (const PrintedReading& r : rows) sum += r.difference();
  return sum / static_cast<double>(rows.size());
}

bool is_same(double a, double b) { return std::abs(a - b) < 5e-4; }  // tables have three decimals [mm]

/// Rows of a table whose printed deflection is not the difference of its readings.
int differing(const Ur5Measurements& m, int number) {
  const std::vector<PrintedReading> rows = table(m, number);
  return static_cast<int>(std::count_if(
      rows.begin(), rows.end(), [](const PrintedReading& r) { return !is_same(r.difference(), r.printed); }));
}

Fault table_10(const Ur5Measurements& m) {
  const std::vector<PrintedReading> rows = table(m, 10);
  const PrintedReading& last = rows.back();
  return {"table-10",
          "data",
          "table 10, column 6",
          fmt::format("{:.3f} mm", last.printed),
          fmt::format("{:.3f} - ({:.3f}) = {:.3f} mm", last.unloaded, last.loaded, last.difference()),
          {last.difference(), last.printed},
          differing(m, 10) == 1 && !is_same(last.difference(), last.printed)};
}

Fault table_14(const Ur5Measurements& m) {
  const std::vector<PrintedReading> rows = table(m, 14);
  int absolutes = 0;
  for (const PrintedReading& r : rows) {
    absolutes += is_same(std::abs(r.loaded) - std::abs(r.unloaded), r.printed) ? 1 : 0;
  }
  const PrintedReading& first = rows.front();
  return {"table-14",
          "data",
          "table 14",
          fmt::format("deflections such as {:.3f} mm", first.printed),
          fmt::format("{} of 6 are |loaded| - |unloaded| although the reading went through zero; "
                      "the difference is {:.3f} mm "
                      "in column 1",
                      absolutes, first.difference()),
          {static_cast<double>(absolutes), first.difference()},
          absolutes == 6 && differing(m, 14) == 6};
}

Fault sign_lost(const Ur5Measurements& m) {
  int lost = 0;
  for (const int number : {16, 18}) {
    for (const PrintedReading& r : table(m, number)) lost += is_same(-r.difference(), r.printed) ? 1 : 0;
  }
  return {"sign-lost",
          "data",
          "tables 16 and 18",
          "deflections of the cantilever's end without sign",
          fmt::format("All {} are loaded minus unloaded, in every other table it is the other way round: the "
                      "end went {:.3f} and {:.3f} mm against the direction in which the tool went {:.3f} and "
                      "{:.3f} mm",
                      lost, -mean_difference(table(m, 16)), -mean_difference(table(m, 18)),
                      mean_difference(table(m, 9)), mean_difference(table(m, 11))),
          {static_cast<double>(lost)},
          lost == 12};
}

/// Work of the load: w · δd = F d + M (d_c - d)/0.5, from what was read alone; Σ τ²/k for springs, never negative.
Fault work_negative(const Ur5Measurements& m) {
  std::vector<double> work;
  std::vector<std::string> negative;
  for (int pose = 0; pose < kPoses; ++pose) {
    const double d = mean_difference(table(m, kToolTable + pose)),
                 end = mean_difference(table(m, kCantileverTable + pose));
    work.push_back(kWeight * d + 9.336 * (end - d) / 0.5);  // [mJ], twice the stored energy
    if (work.back() < 0.0) negative.push_back(fmt::format("{} ({:.1f} mJ)", pose + 1, work.back()));
  }
  return {"work-negative",
          "data",
          "tables 7 to 12 with 14 to 19",
          "force and moment (135) bend an arm of springs by what both tables say",
          fmt::format("F d + M (d_end - d)/0.5 m is what the load gives, from readings alone. It is negative "
                      "at poses {}: no stiffness gives that. Load, direction or one of the tables is not as "
                      "stated",
                      fmt::join(negative, " and ")),
          work,
          !negative.empty()};
}

/// A series of readings at the tool and the one at the cantilever's end.
struct Pair {
  int pose;
  bool loaded;
  int count;     ///< of columns that differ by the most frequent shift
  double shift;  ///< [mm]
};

double reading(const PrintedReading& r, bool loaded) { return loaded ? r.loaded : r.unloaded; }

/// How the second set of tables repeats the first.
Pair compare(const Ur5Measurements& m, int pose, bool loaded) {
  const auto first = table(m, kToolTable + pose), second = table(m, kCantileverTable + pose);
  std::map<int, int> shifts;  // [µm]
  for (std::size_t k = 0; k < first.size(); ++k) {
    ++shifts[static_cast<int>(std::lround(1e3 * (reading(second[k], loaded) - reading(first[k], loaded))))];
  }
  const auto most = std::max_element(shifts.begin(), shifts.end(),
                                     [](const auto& a, const auto& b) { return a.second < b.second; });
  return {pose, loaded, most->second, 1e-3 * most->first};
}

/// Standard deviation of a single reading at the tool about the mean of its series [µm].
double scatter_of_readings(const Ur5Measurements& m) {
  double pooled = 0.0;
  int freedom = 0;
  for (int pose = 0; pose < kPoses; ++pose) {
    const auto rows = table(m, kToolTable + pose);
    for (const bool loaded : {false, true}) {
      double mean = 0.0;
      for (const PrintedReading& r : rows) mean += reading(r, loaded) / static_cast<double>(rows.size());
      for (const PrintedReading& r : rows) {
        pooled += (reading(r, loaded) - mean) * (reading(r, loaded) - mean);
      }
      freedom += static_cast<int>(rows.size()) - 1;
    }
  }
  return 1e3 * std::sqrt(pooled / freedom);
}

/// Chance that six differences of independent readings, rounded to 1 µm, agree: Σ_k p_k⁶ with a normal of √2 σ.
/// @param sigma  [µm]
double chance_of_agreement(double sigma) {
  double chance = 0.0;
  for (int k = -200; k <= 200; ++k) {
    const double s = 2.0 * sigma;  // √2 of the difference times √2 of erf
    chance += std::pow(0.5 * (std::erf((k + 0.5) / s) - std::erf((k - 0.5) / s)), 6);
  }
  return chance;
}

Fault repeated(const Ur5Measurements& m) {
  std::vector<Pair> pairs;
  for (int pose = 0; pose < kPoses; ++pose) {
    for (const bool loaded : {false, true}) pairs.push_back(compare(m, pose, loaded));
  }
  const double sigma = scatter_of_readings(m);
  const double chance = chance_of_agreement(sigma);
  std::string list;
  int all_six = 0, all_but_one = 0;
  for (const Pair& p : pairs) {
    if (p.count < 5) continue;
    (p.count == 6 ? all_six : all_but_one) += 1;
    list += fmt::format("{}{}/{} {} {:+.3f} mm ({} of 6)", list.empty() ? "" : ", ", kToolTable + p.pose,
                        kCantileverTable + p.pose, p.loaded ? "loaded" : "unloaded", p.shift, p.count);
  }
  return {"repeated",
          "data",
          "tables 7 to 12 against 14 to 19",
          "the deflection of the cantilever's end was measured separately, six times a pose",
          fmt::format("{} of 12 series are a series at the tool plus a constant, to the "
                      "micrometre, in all six columns, {} more in all but one: {}. Single readings "
                      "scatter by {:.1f} µm; independent ones would agree like this once in {:.0e} "
                      "series. They are not independent measurements",
                      all_six, all_but_one, list, sigma, 1.0 / chance),
          {static_cast<double>(all_six), static_cast<double>(all_but_one), chance},
          all_six >= 5 && chance < 1e-4};
}

}  // namespace

std::vector<Fault> faults_of_readings(const Ur5Measurements& m) {
  return {table_10(m), table_14(m), sign_lost(m), work_negative(m), repeated(m)};
}

}  // namespace heft::studies

#include "refuse_unsound.hpp"

#include <cmath>
#include <string>
#include <string_view>

#include <fmt/format.h>
#include <Eigen/Core>

#include "heft/host/error.hpp"

namespace heft::data {

using Eigen::Index;

void refuse_unsound(const Log& log) {
  const std::string& path = log.path;
  const Index rows = log.time.size();
  const auto check = [&](const Eigen::MatrixXd& matrix, std::string_view name, bool required) {
    if (matrix.cols() == 0 && !required) return;
    if (matrix.cols() != log.q.cols() || matrix.cols() == 0 || matrix.rows() != rows) {
      throw DataError(
          fmt::format("{}: {} is {} x {}; expected {} rows as time has and a column for each joint", path,
                      name, matrix.rows(), matrix.cols(), rows));
    }
    for (Index c = 0; c < matrix.cols(); ++c) {
      for (Index k = 0; k < rows; ++k) {
        if (!std::isfinite(matrix(k, c))) {
          throw DataError(fmt::format("{}: row {}, column '{}{}': found {}; expected a finite number", path,
                                      k + 1, name, c + 1, matrix(k, c)));
        }
      }
    }
  };
  check(log.q, "q", true);
  check(log.tau, "tau", false);
  check(log.qd, "qd", false);
  check(log.qdd, "qdd", false);
  for (Index k = 0; k < rows; ++k) {
    if (!std::isfinite(log.time[k]) || (k > 0 && !(log.time[k] > log.time[k - 1]))) {
      throw DataError(fmt::format(
          "{}: row {}, column 'time': found {}{}; expected finite time that increases with every row", path,
          k + 1, log.time[k], k > 0 ? fmt::format(" after {}", log.time[k - 1]) : ""));
    }
  }
}

}  // namespace heft::data

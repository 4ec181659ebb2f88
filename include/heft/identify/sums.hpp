/// @file
/// The sums behind a fit: what one pass over logs leaves of them. They can be saved, sent to another process and merged,
/// so that many machines fit one model to the logs of a fleet.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "heft/data/log_set.hpp"
#include "heft/data/motion_stream.hpp"
#include "heft/host/verdict.hpp"
#include "heft/identify/fit.hpp"
#include "heft/identify/identify.hpp"
#include "heft/model/robot.hpp"
#include "heft/regression/observations.hpp"
#include "heft/regression/regression_columns.hpp"
#include "heft/regression/triangular_factor.hpp"

namespace heft::identify {

/// What sums keep of one log beside its rows.
struct LogShare {
  data::StreamSummary summary;       ///< without its gaps
  long key{0};                       ///< of what the log holds, whatever its name and its clock
  Eigen::VectorXd correlation_time;  ///< n: of the residual of the log's own fit [s]
  host::Judgement torque{};          ///< what is known against the torque of the log
};

/// Triangular factors of the rows of logs by joint and block, and what a fit asks of each log.
///
/// Merged in whatever order and grouping, sums hold the same logs and the same blocks; the parameters of a fit agree to
/// rounding (1e-10 of the largest and better, where no ridge is needed). Memory is bounded in the rows, at most 96 blocks
/// however many logs there are, beside some hundred bytes for each log.
struct Sums {
  std::string robot;          ///< name, for messages
  std::uint64_t geometry{0};  ///< tells robots, and columns, apart
  data::TorqueAt torque_at{data::TorqueAt::kMotor};
  regression::ModelStructure structure{};
  regression::ObservationOptions observation{};
  std::vector<LogShare> logs;  ///< by key
  regression::BlockFactors factors{0, 0, 0.0};
};

/// Two passes over each of LogSet::train.
/// @param options  of the fit: structure, observation and ridge are used; torque goes to every log
/// @throws DataError when a log is given twice or does not fit the robot
Sums sums_of(const model::Robot& robot, const data::LogSet& logs, const Options& options = {});

/// The sums of the logs of both.
/// @throws DataError when they are of different robots or settings, or a log is in both
Sums merged(Sums a, const Sums& b);

/// As bytes, without what is zero in every triangle; numbers as this machine holds them (little endian).
std::string to_bytes(const Sums& sums);
/// @param name  of the file, for messages
/// @throws DataError when these are no sums, of another version, cut or changed on the way
Sums sums_from_bytes(std::string_view bytes, const std::string& name = "sums");

/// The fit of all logs in the sums, as fit() of the logs gives it but for
/// - the block length behind the intervals, which is that of the logs' own residuals, not of the common model's,
/// - the test for bias by noise in the motion, which is left out: it simulates the motion of every log.
/// @throws InputError for a method that needs the rows (irls, iv), DataError when the sums are of another robot
Fit fit(const model::Robot& robot, const Sums& sums, const FitOptions& options = {});

/// Fits a model to sums and judges it on LogSet::judge. The errors on the logs in the sums stay unknown: `train` and
/// `trained` are empty.
/// @param judge  its logs to fit to are not used; none to judge on: the model is not judged
/// @throws as fit(); DataError when a log to judge on is in the sums
Identification identify(const model::Robot& robot, const Sums& sums, const data::LogSet& judge,
                        const Options& options = {});

}  // namespace heft::identify

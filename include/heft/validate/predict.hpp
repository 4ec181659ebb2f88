/// @file
/// The torque that a model expects along a logged motion: the one prediction that everything is judged by.
#pragma once

#include <memory>

#include <Eigen/Core>

#include "heft/data/differentiate.hpp"
#include "heft/data/log.hpp"
#include "heft/data/motion_stream.hpp"
#include "heft/model/robot.hpp"

namespace heft::validate {

/// Width of friction's sign in every prediction that is judged [rad/s]: a joint that rests with a noisy velocity has no
/// friction.
inline constexpr double kSignWidth = 0.005;
/// Largest one of prismatic joints [m/s], which move at tenths of a m/s and creep, in the pauses of a gripper, at less than
/// a mm/s.
inline constexpr double kPrismaticSignWidth = 5e-4;

struct PredictOptions {
  /// The sign of friction is tanh(velocity / width) [rad/s, m/s]; 0: the sharp sign, 0 at standstill. Of prismatic joints
  /// kPrismaticSignWidth at most.
  double sign_width{kSignWidth};
};

/// Rows of a motion in time order.
struct MotionRows {
  Eigen::VectorXd time;        ///< [s]
  Eigen::MatrixXd q, qd, qdd;  ///< rows × n, motor side
  Eigen::MatrixXd tau;         ///< rows × n as measured [N·m, N]; no columns: not known
  /// As MotionChunk::displacement; no columns: friction's memory goes by q.
  Eigen::MatrixXd displacement;
  /// rows × n, of the joints [°C]; no columns: not known.
  Eigen::MatrixXd temperature{};
};

/// Predicts a log piece by piece in time order; friction's memory, deflections and delay go on from piece to piece.
/// Friction's memory begins with what the log's first half second shows of joints that rest; where the torque is not
/// known, at 0.
class Predictor {
 public:
  /// @param begin  time of the log's first row [s]
  Predictor(const model::Robot& robot, double begin, const PredictOptions& options = {});
  ~Predictor();
  Predictor(Predictor&&) noexcept;
  Predictor& operator=(Predictor&&) noexcept;

  /// Torque of the log's own rows of the next piece, rows × n [N·m, N].
  Eigen::MatrixXd rows(const data::MotionChunk& piece);
  /// The same of rows from elsewhere.
  Eigen::MatrixXd rows(const MotionRows& piece);
  /// Torque of the rows of the even grid that belong to the next piece, count × n [N·m, N]; independent of rows().
  Eigen::MatrixXd grid(const data::MotionChunk& piece);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The rows of a whole log, with the displacement and the temperature that friction of this robot goes by, where the log shows
/// them.
/// @param motion  what derive_motion did; as it is by default: velocity and acceleration are the log's own
MotionRows rows_of(const model::Robot& robot, const data::Log& log, const data::MotionReport& motion);
/// Torque of a whole motion, samples × n [N·m, N]. Friction's memory begins at 0, so that the torque of a motion does
/// not depend on torque that its log may hold.
/// @param motion  as in rows_of()
Eigen::MatrixXd predict(const model::Robot& robot, const data::Log& log, const data::MotionReport& motion,
                        const PredictOptions& options = {});

}  // namespace heft::validate

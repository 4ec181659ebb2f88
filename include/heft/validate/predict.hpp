/// @file
/// The torque that a model expects along a logged motion: the one prediction that everything is judged by.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/data/log_set.hpp"
#include "heft/data/motion_stream.hpp"
#include "heft/model/model_file.hpp"
#include "heft/model/robot.hpp"

namespace heft::validate {

/// Width of friction's sign in every prediction that is judged [rad/s, m/s]: a joint that rests with a noisy velocity
/// has no friction.
inline constexpr double kSignWidth = 0.005;

struct PredictOptions {
  /// The sign of friction is tanh(velocity / width) [rad/s, m/s]; 0: the sharp sign, 0 at standstill.
  double sign_width{kSignWidth};
};

/// Predicts a log piece by piece in time order; friction's memory, deflections and delay go on from piece to piece.
/// Friction's memory begins with what the log's first half second shows of joints that rest.
class Predictor {
 public:
  /// @param begin  time of the log's first row [s]
  Predictor(const model::Robot& robot, double begin, const PredictOptions& options = {});
  ~Predictor();
  Predictor(Predictor&&) noexcept;
  Predictor& operator=(Predictor&&) noexcept;

  /// Torque of the log's own rows of the next piece, rows × n [N·m, N].
  Eigen::MatrixXd rows(const data::MotionChunk& piece);
  /// Torque of the rows of the even grid that belong to the next piece, count × n [N·m, N]; independent of rows().
  Eigen::MatrixXd grid(const data::MotionChunk& piece);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Torque of the log's own rows of one piece, nothing known of what was before [N·m, N].
Eigen::MatrixXd predict(const model::Robot& robot, const data::MotionChunk& piece,
                        const PredictOptions& options = {});
/// Torque of a whole motion, samples × n [N·m, N]. Friction's memory begins at 0, so that the torque of a motion does
/// not depend on torque that its log may hold.
/// @param motion  what derive_motion did; as it is by default: velocity and acceleration are the log's own
Eigen::MatrixXd predict(const model::Robot& robot, const data::Log& log, const data::MotionReport& motion,
                        const PredictOptions& options = {});

/// The robot whose joint torque is what was measured there: a sensor behind the gears sees rigid bodies only, unless the
/// model was fitted to such a sensor; then the friction that it has is friction that the sensor saw.
/// @param fit    of the model file that the robot's parameters come from; null: from a URDF
/// @param notes  gets a line when the model lacks what a motor's torque holds; may be null
model::Robot as_measured(const model::Robot& robot, const model::FitRecord* fit, data::TorqueAt at,
                         std::vector<std::string>* notes = nullptr);

}  // namespace heft::validate

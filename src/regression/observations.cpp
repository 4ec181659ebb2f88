#include "heft/regression/observations.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "heft/data/decimate.hpp"
#include "heft/host/error.hpp"
#include "heft/regression/recorded_rows.hpp"
#include "heft/regression/rests.hpp"

namespace heft::regression {
namespace {

/// Whether a column can be other than zero in a joint's row.
bool reaches(const RegressionColumns& columns, const Column& column, int joint) {
  switch (column.kind) {
    case ColumnKind::kLink: return column.joint >= joint;
    case ColumnKind::kCouplingInertia:
    case ColumnKind::kCouplingCoulomb:
    case ColumnKind::kCouplingViscous: {
      const GearCoupling<double>& coupling =
          columns.structure().couplings[static_cast<std::size_t>(column.coupling)];
      return joint == coupling.driven || joint == coupling.driving;
    }
    default: return column.joint == joint;
  }
}

/// For each joint the places within `selected` that reach it.
std::vector<std::vector<int>> places_by_joint(const RegressionColumns& columns,
                                              const std::vector<int>& selected) {
  std::vector<std::vector<int>> places(static_cast<std::size_t>(columns.num_joints()));
  for (int joint = 0; joint < columns.num_joints(); ++joint) {
    for (int s = 0; s < static_cast<int>(selected.size()); ++s) {
      if (reaches(columns, columns[selected[static_cast<std::size_t>(s)]], joint)) {
        places[static_cast<std::size_t>(joint)].push_back(s);
      }
    }
  }
  return places;
}

/// q, q̇, q̈, m × n each.
struct Motion {
  const Eigen::MatrixXd &q, &qd, &qdd;
};

/// Signals of a piece that pass the low-pass, side by side: torques, then the entries of the regressor that can be other
/// than zero, joint by joint.
class Signals {
 public:
  Signals(const RegressionColumns& columns, const std::vector<int>& selected)
      : columns_(columns), places_(places_by_joint(columns, selected)) {
    for (const std::vector<int>& places : places_) {
      std::vector<int>& list = lists_.emplace_back();
      for (const int place : places) list.push_back(selected[static_cast<std::size_t>(place)]);
      entries_ += static_cast<Eigen::Index>(list.size());
    }
  }

  /// Columns of the regressor that reach a joint, by their place among the selected.
  const std::vector<int>& places(Eigen::Index joint) const { return places_[static_cast<std::size_t>(joint)]; }

  /// Rows of a piece in which friction takes up what it likes.
  Eigen::Array<bool, Eigen::Dynamic, 1> rests(const data::MotionChunk& chunk, const data::StreamSummary& log,
                                              Eigen::Index joint) const {
    const bool prismatic =
        columns_.robot().joints[static_cast<std::size_t>(joint)].joint.type == JointType::kPrismatic;
    if (columns_.structure().coulomb && moves(log, joint, prismatic))
      return resting_rows(chunk.qd.col(joint), chunk.sample_rate, prismatic);
    return Eigen::Array<bool, Eigen::Dynamic, 1>::Constant(chunk.time.size(), false);
  }

  /// Kept rows of the regressor behind the low-pass.
  struct Filtered {
    data::DecimatedLowPass::Kept tau, entries;
  };
  /// @param motion  m × n
  /// @param tau     m × n, or no columns
  /// @param rate    of its rows [Hz]
  Filtered filtered(const Motion& motion, const Eigen::MatrixXd& tau, double rate, double cutoff, const KeptRows& kept) const {
    const Eigen::Index torques = tau.cols(), rows = motion.q.rows();
    const Eigen::Index signals = (torques + entries_ + 1) / 2 * 2;
    Filtered out;
    std::optional<data::DecimatedLowPass> low_pass;
    data::DecimatedLowPass::Kept all;
    if (cutoff > 0.0) {
      low_pass.emplace(rate, cutoff, signals, rows, kept.first, kept.step);
    } else {
      all.resize(rows, signals);  // every row is kept
    }
    const std::vector<double> zeros(static_cast<std::size_t>(kRowsAtOnce), 0.0);
    std::vector<const double*> signal;
    model::RegressorRows joints;
    for (Eigen::Index row = 0; row < rows; row += kRowsAtOnce) {
      const Eigen::Index count = std::min(kRowsAtOnce, rows - row);
      columns_.fill(motion.q, motion.qd, motion.qdd, row, count, lists_, joints);
      signal.clear();
      for (Eigen::Index j = 0; j < torques; ++j) signal.push_back(tau.col(j).data() + row);
      for (std::size_t j = 0; j < joints.size(); ++j) {
        const model::RegressorRows::ConstMatrix entries = std::as_const(joints)[j];
        for (Eigen::Index c = 0; c < entries.cols(); ++c) signal.push_back(entries.col(c).data());
      }
      signal.resize(static_cast<std::size_t>(signals), zeros.data());
      if (low_pass) {
        low_pass->add_columns(signal.data(), count);
      } else {
        for (Eigen::Index s = 0; s < signals; ++s)
          all.col(s).segment(row, count) = Eigen::Map<const Eigen::VectorXd>(signal[static_cast<std::size_t>(s)], count);
      }
    }
    if (low_pass) all = low_pass->finish();
    out.tau = all.leftCols(torques);
    out.entries = all.middleCols(torques, entries_);
    return out;
  }

 private:
  /// Rows that stay in the cache until they have passed the low-pass.
  static constexpr Eigen::Index kRowsAtOnce = 64;

  const RegressionColumns& columns_;
  std::vector<std::vector<int>> places_;
  std::vector<std::vector<int>> lists_;  ///< the same among all parameters
  Eigen::Index entries_{0};
};

/// Rows of a piece that a joint may use: usable, and neither slower than standstill nor at rest within the reach of the filter.
std::vector<bool> rows_in_use(const data::MotionChunk& chunk, Eigen::Index joint, double standstill,
                              const Eigen::Array<bool, Eigen::Dynamic, 1>& rests, double cutoff) {
  const Eigen::Index size = chunk.time.size();
  std::vector<bool> use(static_cast<std::size_t>(size), true);
  // Half the main lobe of the forth-and-back filter's impulse response.
  const Eigen::Index reach =
      cutoff > 0.0 ? static_cast<Eigen::Index>(std::ceil(0.35 * chunk.sample_rate / cutoff)) : 0;
  for (Eigen::Index i = 0; i < size; ++i) {
    if (chunk.usable[i] && std::abs(chunk.qd(i, joint)) >= standstill && !rests[i]) continue;
    const Eigen::Index around = chunk.usable[i] ? reach : 0;
    for (Eigen::Index k = std::max<Eigen::Index>(0, i - around); k <= std::min(size - 1, i + around); ++k) {
      use[static_cast<std::size_t>(k)] = false;
    }
  }
  return use;
}

/// What a log's rows are made with.
struct Behind {
  const data::StreamSummary& log;
  double cutoff{0.0};     ///< [Hz]; 0: no low-pass
  Eigen::Index step{1};   ///< every step-th row of the grid is kept
};

Behind behind(const data::StreamSummary& log, const ObservationOptions& options) {
  const double chosen = options.cutoff > 0.0 ? options.cutoff : log.cutoff;
  // A cut-off near half the sample rate is no filter.
  if (!(chosen > 0.0 && chosen < 0.45 * log.sample_rate)) return {log};
  const double rows = std::floor(log.sample_rate / (options.rows_per_cutoff * chosen));
  return {log, chosen, std::max<Eigen::Index>(1, static_cast<Eigen::Index>(rows))};
}

/// Rows of a piece that are kept: every step-th of the log's grid.
KeptRows kept_rows(const data::MotionChunk& chunk, Eigen::Index step) {
  const Eigen::Index number = chunk.first - chunk.begin;  // of the piece's first row, from the start of the log
  return {(step - number % step) % step, step};
}

/// The kept rows by their number among those of another motion.
KeptRows kept_of(const ThinnedMotion& motion, const KeptRows& kept) {
  if (motion.stride < 1 || kept.step % motion.stride != 0 || motion.first > kept.first ||
      (kept.first - motion.first) % motion.stride != 0) {
    throw DataError(fmt::format("instruments on rows {}, {}, ...; expected rows {}, {}, ... among them", motion.first,
                                motion.first + motion.stride, kept.first, kept.first + kept.step));
  }
  return {(kept.first - motion.first) / motion.stride, kept.step / motion.stride};
}

/// Rows of every joint from one piece of a log; none of joints that have no row to use.
/// @param own          whether torque and regressor of the motion itself are wanted
/// @param instruments  another motion, or null
std::vector<ObservationRows> rows_of(const Signals& signals, Eigen::Index selected, const data::MotionChunk& chunk,
                                     const KeptRows& kept_of_piece, bool own, const ThinnedMotion* instruments,
                                     const Behind& log, const ObservationOptions& options) {
  Signals::Filtered measured, other;
  if (own)
    measured = signals.filtered({chunk.q, chunk.qd, chunk.qdd}, chunk.tau, chunk.sample_rate, log.cutoff, kept_of_piece);
  if (instruments != nullptr) {
    other = signals.filtered({instruments->q, instruments->qd, instruments->qdd}, Eigen::MatrixXd(),
                             chunk.sample_rate / static_cast<double>(instruments->stride), log.cutoff,
                             kept_of(*instruments, kept_of_piece));
  }
  std::vector<ObservationRows> rows;
  Eigen::Index first_entry = 0;
  for (Eigen::Index j = 0; j < chunk.q.cols(); ++j) {
    const std::vector<int>& list = signals.places(j);
    const Eigen::Index from = first_entry;
    first_entry += static_cast<Eigen::Index>(list.size());
    const std::vector<bool> use = rows_in_use(chunk, j, options.standstill_speed, signals.rests(chunk, log.log, j), log.cutoff);
    std::vector<Eigen::Index> picked, kept;  // rows of the piece, and of what was kept of them
    for (Eigen::Index k = 0, i = kept_of_piece.first; i < chunk.begin + chunk.count; ++k, i += kept_of_piece.step) {
      if (i < chunk.begin || !use[static_cast<std::size_t>(i)]) continue;
      picked.push_back(i);
      kept.push_back(k);
    }
    if (picked.empty()) continue;
    const auto spread = [&](const data::DecimatedLowPass::Kept& entries) {
      Eigen::MatrixXd W = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(picked.size()), selected);
      for (std::size_t c = 0; c < list.size(); ++c)
        W.col(list[c]) = entries.col(from + static_cast<Eigen::Index>(c))(kept);
      return W;
    };
    ObservationRows out;
    out.joint = static_cast<int>(j);
    out.time = chunk.time(picked);
    if (own) out.tau = measured.tau.col(j)(kept);
    if (own) out.W = spread(measured.entries);
    if (instruments != nullptr) out.Z = spread(other.entries);
    rows.push_back(std::move(out));
  }
  return rows;
}

/// Completes rows that have only instruments.
void take_recorded(RecordedRows::Pass& before, ObservationRows& rows) {
  Eigen::MatrixXd Z = std::move(rows.Z);
  const int log = rows.log, joint = rows.joint;
  const Eigen::Index count = rows.time.size();
  if (!before.next(rows) || rows.log != log || rows.joint != joint || rows.time.size() != count) {
    throw DataError("rows of a log differ from those recorded before; expected the same logs and settings");
  }
  rows.Z = std::move(Z);
}

}  // namespace

void for_each_observation(const RegressionColumns& columns, const std::vector<int>& selected,
                          const std::vector<const data::MotionStream*>& logs,
                          const ObservationOptions& options,
                          const std::function<void(const ObservationRows&)>& rows,
                          const InstrumentMotion& instruments, const RecordedRows* recorded) {
  std::vector<int> wanted = selected;
  if (wanted.empty()) {
    wanted.resize(static_cast<std::size_t>(columns.count()));
    std::iota(wanted.begin(), wanted.end(), 0);
  }
  const Signals signals(columns, wanted);
  static const RecordedRows none;
  if (!instruments || (recorded != nullptr && !recorded->is_usable())) recorded = nullptr;
  RecordedRows::Pass before(recorded != nullptr ? *recorded : none);
  const auto p = static_cast<Eigen::Index>(wanted.size());
  for (std::size_t log = 0; log < logs.size(); ++log) {
    const Behind how = behind(logs[log]->summary(), options);
    logs[log]->for_each<std::vector<ObservationRows>>(
        [&](const data::MotionChunk& chunk) {
          const KeptRows kept = kept_rows(chunk, how.step);
          if (!instruments) return rows_of(signals, p, chunk, kept, true, nullptr, how, options);
          const ThinnedMotion other = instruments(static_cast<int>(log), chunk, kept);
          return rows_of(signals, p, chunk, kept, recorded == nullptr, &other, how, options);
        },
        [&](std::vector<ObservationRows>& piece) {
          for (ObservationRows& of_joint : piece) {
            of_joint.log = static_cast<int>(log);
            if (recorded != nullptr) take_recorded(before, of_joint);
            rows(of_joint);
          }
        });
  }
}

}  // namespace heft::regression

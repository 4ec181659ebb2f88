#include "heft/regression/observations.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "heft/data/differentiate.hpp"

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

/// Rows of every joint, unfiltered, on the whole grid of a piece: rows × places of the joint.
std::vector<Eigen::MatrixXd> all_rows(const RegressionColumns& columns, const std::vector<int>& selected,
                                      const std::vector<std::vector<int>>& places,
                                      const data::MotionChunk& chunk) {
  std::vector<Eigen::MatrixXd> rows;
  for (const std::vector<int>& list : places) {
    rows.emplace_back(chunk.time.size(), static_cast<Eigen::Index>(list.size()));
  }
  for (Eigen::Index i = 0; i < chunk.time.size(); ++i) {
    const Eigen::MatrixXd Y = columns.regressor(chunk.q.row(i).transpose(), chunk.qd.row(i).transpose(),
                                                chunk.qdd.row(i).transpose());
    for (std::size_t j = 0; j < places.size(); ++j) {
      for (std::size_t c = 0; c < places[j].size(); ++c) {
        rows[j](i, static_cast<Eigen::Index>(c)) =
            Y(static_cast<Eigen::Index>(j), selected[static_cast<std::size_t>(places[j][c])]);
      }
    }
  }
  return rows;
}

/// Rows of a piece that a joint may use: usable, and faster than standstill within the reach of the filter.
std::vector<bool> rows_in_use(const data::MotionChunk& chunk, Eigen::Index joint, double standstill,
                              double cutoff) {
  const Eigen::Index size = chunk.time.size();
  std::vector<bool> use(static_cast<std::size_t>(size), true);
  // Half the main lobe of the forth-and-back filter's impulse response.
  const Eigen::Index reach =
      cutoff > 0.0 ? static_cast<Eigen::Index>(std::ceil(0.35 * chunk.sample_rate / cutoff)) : 0;
  for (Eigen::Index i = 0; i < size; ++i) {
    if (chunk.usable[i] && std::abs(chunk.qd(i, joint)) >= standstill) continue;
    const Eigen::Index around = chunk.usable[i] ? reach : 0;
    for (Eigen::Index k = std::max<Eigen::Index>(0, i - around); k <= std::min(size - 1, i + around); ++k) {
      use[static_cast<std::size_t>(k)] = false;
    }
  }
  return use;
}

}  // namespace

void for_each_observation(const RegressionColumns& columns, const std::vector<int>& selected,
                          const std::vector<const data::MotionStream*>& logs,
                          const ObservationOptions& options,
                          const std::function<void(const ObservationRows&)>& rows,
                          const InstrumentMotion& instruments) {
  std::vector<int> wanted = selected;
  if (wanted.empty()) {
    wanted.resize(static_cast<std::size_t>(columns.count()));
    std::iota(wanted.begin(), wanted.end(), 0);
  }
  const std::vector<std::vector<int>> places = places_by_joint(columns, wanted);
  const auto n = static_cast<Eigen::Index>(columns.num_joints());
  const auto p = static_cast<Eigen::Index>(wanted.size());

  for (std::size_t log = 0; log < logs.size(); ++log) {
    const double chosen = options.cutoff > 0.0 ? options.cutoff : logs[log]->summary().cutoff;
    const double rate = logs[log]->summary().sample_rate;
    // A cut-off near half the sample rate is no filter.
    const double cutoff = chosen < 0.45 * rate ? chosen : 0.0;
    const auto step =
        cutoff > 0.0
            ? std::max<Eigen::Index>(
                  1, static_cast<Eigen::Index>(std::floor(rate / (options.rows_per_cutoff * cutoff))))
            : Eigen::Index{1};
    logs[log]->for_each([&](const data::MotionChunk& chunk) {
      std::vector<Eigen::MatrixXd> Y = all_rows(columns, wanted, places, chunk);
      std::vector<Eigen::MatrixXd> instrument_rows;
      if (instruments) {
        data::MotionChunk other = chunk;
        instruments(static_cast<int>(log), other);
        instrument_rows = all_rows(columns, wanted, places, other);
      }
      const auto smooth = [&](const Eigen::MatrixXd& signal) {
        return cutoff > 0.0 ? data::low_pass_zero_phase(signal, chunk.sample_rate, cutoff) : signal;
      };
      const Eigen::MatrixXd tau = smooth(chunk.tau);
      for (Eigen::Index j = 0; j < n; ++j) {
        const auto& list = places[static_cast<std::size_t>(j)];
        const std::vector<bool> use = rows_in_use(chunk, j, options.standstill_speed, cutoff);
        std::vector<Eigen::Index> picked;
        for (Eigen::Index i = chunk.begin; i < chunk.begin + chunk.count; ++i) {
          if ((chunk.first + i - chunk.begin) % step == 0 && use[static_cast<std::size_t>(i)])
            picked.push_back(i);
        }
        if (picked.empty()) continue;
        const auto spread = [&](const Eigen::MatrixXd& dense) {
          Eigen::MatrixXd W = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(picked.size()), p);
          for (std::size_t c = 0; c < list.size(); ++c) {
            W.col(list[c]) = dense.col(static_cast<Eigen::Index>(c))(picked);
          }
          return W;
        };
        ObservationRows out;
        out.log = static_cast<int>(log);
        out.joint = static_cast<int>(j);
        out.time = chunk.time(picked);
        out.tau = tau.col(j)(picked);
        out.W = spread(smooth(Y[static_cast<std::size_t>(j)]));
        if (instruments) out.Z = spread(smooth(instrument_rows[static_cast<std::size_t>(j)]));
        Y[static_cast<std::size_t>(j)].resize(0, 0);
        rows(out);
      }
    });
  }
}

}  // namespace heft::regression

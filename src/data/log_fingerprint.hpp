/// @file
/// Finds samples that two logs share, in bounded memory.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include <Eigen/Core>

namespace heft::data {

/// Hashes of all runs of eight rows of a log: bits of position and torque, not of time. Of a long log a sample is
/// kept, chosen by the hash itself, so that two logs with the same runs keep the same ones (A. Broder, On the
/// resemblance and containment of documents, 1997).
class LogFingerprint {
 public:
  /// Rows in a run.
  static constexpr int kRun = 8;

  /// The next rows; tau may have no columns.
  void add(const Eigen::Ref<const Eigen::MatrixXd>& q, const Eigen::Ref<const Eigen::MatrixXd>& tau);
  long rows() const { return rows_; }

  /// Relation of this log to another.
  enum class Relation { kNone, kSame, kPart, kWhole, kOverlap };
  /// Once all rows of both are added; from several threads at once, too.
  Relation relation_to(const LogFingerprint& other) const;

 private:
  struct Run {
    std::uint64_t hash : 63;
    std::uint64_t moves : 1;  ///< q changes in at least half of its rows
    bool operator<(const Run& other) const { return hash < other.hash; }
    bool operator==(const Run& other) const { return hash == other.hash; }
  };
  void keep(const Run& run);
  void thin_out();
  /// Kept runs in ascending order, each once. Sorted when first asked for: a log by itself is compared with none.
  const std::vector<Run>& sorted_runs() const;
  static void sort(std::vector<Run>& runs);

  mutable std::vector<Run> runs_;
  std::unique_ptr<std::once_flag> sorted_{std::make_unique<std::once_flag>()};
  std::uint64_t mask_{0};  ///< kept are hashes without these bits
  std::vector<std::uint64_t> factors_;         ///< of the numbers in a row
  std::array<std::uint64_t, kRun> recent_{};   ///< hashes of the last rows
  std::array<bool, kRun> changed_{};           ///< whether q changed in them
  std::uint64_t run_{0};                       ///< of the last rows together
  int changes_{0};                             ///< of them in which q changed
  std::vector<double> last_q_;
  long rows_{0};
};

}  // namespace heft::data

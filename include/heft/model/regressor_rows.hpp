/// @file
/// Where dynamics in lanes write rows of regressors.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace heft::model {

/// A matrix for each joint, m × its columns. All lie in one storage where every column begins on a cache line: lanes that write
/// across two lines take a third longer.
class RegressorRows {
 public:
  using Matrix = Eigen::Map<Eigen::MatrixXd, Eigen::Unaligned, Eigen::OuterStride<>>;
  using ConstMatrix = Eigen::Map<const Eigen::MatrixXd, Eigen::Unaligned, Eigen::OuterStride<>>;

  RegressorRows() = default;
  RegressorRows(RegressorRows&&) noexcept = default;
  RegressorRows& operator=(RegressorRows&&) noexcept = default;

  /// Makes room; storage that is large enough is used again, with what is in it.
  /// @param rows     m
  /// @param columns  how many of each joint
  /// @param room     rows that may be written, where lanes need more than m
  void resize(Eigen::Index rows, const std::vector<Eigen::Index>& columns, Eigen::Index room = 0) {
    constexpr Eigen::Index kLine = kLineBytes / static_cast<Eigen::Index>(sizeof(double));
    rows_ = rows;
    // An odd number of lines: columns a power of two apart would drive each other out of the cache.
    const Eigen::Index lines = (std::max(rows, room) + kLine - 1) / kLine;
    stride_ = kLine * (lines + (lines % 2 == 0 ? 1 : 0));
    first_.assign(1, 0);
    for (const Eigen::Index count : columns) first_.push_back(first_.back() + count);
    const auto wanted = static_cast<std::size_t>(stride_ * (first_.back() + 1) + kLine);
    if (storage_.size() < wanted) storage_.resize(wanted);
  }

  std::size_t size() const { return first_.empty() ? 0 : first_.size() - 1; }  ///< joints
  Eigen::Index rows() const { return rows_; }                                  ///< m
  Matrix operator[](std::size_t joint) {
    return {begin(storage_.data()) + stride_ * first_[joint], rows_, first_[joint + 1] - first_[joint],
            Eigen::OuterStride<>(stride_)};
  }
  ConstMatrix operator[](std::size_t joint) const {
    return {begin(storage_.data()) + stride_ * first_[joint], rows_, first_[joint + 1] - first_[joint],
            Eigen::OuterStride<>(stride_)};
  }

  /// A column that belongs to no joint, for entries that nobody wants. @pre resize() was called
  double* spare() { return begin(storage_.data()) + stride_ * first_.back(); }

 private:
  static constexpr Eigen::Index kLineBytes = 64;
  /// The first number on a cache line.
  template <typename T>
  static T* begin(T* storage) {
    const auto over = static_cast<Eigen::Index>(reinterpret_cast<std::uintptr_t>(storage) % kLineBytes);
    return storage + (kLineBytes - over) % kLineBytes / static_cast<Eigen::Index>(sizeof(double));
  }

  std::vector<double> storage_;
  std::vector<Eigen::Index> first_;  ///< column of each joint's first
  Eigen::Index rows_{0}, stride_{0};
};

}  // namespace heft::model

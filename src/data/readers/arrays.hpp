/// @file
/// Logs that are named arrays (NumPy, MATLAB, HDF5): one variable is time, matrices have a column a joint. Read row by
/// row, however the file orders them, so that memory does not grow with the log.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "../log_reader.hpp"
#include "input_bytes.hpp"

namespace heft::data {

/// Values of one variable.
class ArrayValues {
 public:
  virtual ~ArrayValues() = default;
  /// Reads rows [first, first + count); column c of row first + k goes to to[k * stride + c] where wanted[c]. `first`
  /// never decreases from call to call.
  virtual void read(std::size_t first, std::size_t count, double* to, std::size_t stride,
                    const char* wanted) = 0;
};

struct ArrayVariable {
  std::string name;                    ///< "q", "data.q"
  std::vector<std::uint64_t> shape{};  ///< without the lengths that are 1; empty: one number
  std::string unusable{};              ///< why it is left out: "text", "complex numbers"; "" for real numbers
  /// Of a variable of 64-bit integers, its first: what a double cannot hold is counted from there.
  std::optional<std::int64_t> first{};
  /// Units of such integers in a second, where the file says so (datetime64[ns]: 1e9); 0 otherwise.
  double per_second{0.0};
  /// Opens the variable with rows along axis 0 or 1 of `shape`; values are divided by `divisor` after `base` was
  /// subtracted.
  std::function<std::unique_ptr<ArrayValues>(int axis, std::int64_t base, double divisor)> open{};
};

struct ArrayFile {
  std::string path;
  std::string format;  ///< "NumPy npz"
  std::vector<ArrayVariable> variables;
  std::string how_to_save;  ///< for messages: how such a file is written as it should be
};

/// @throws DataError when no variable is time, or lengths do not match
std::unique_ptr<LogReader> read_arrays(ArrayFile file, const ReadAs& as);

/// A type of numbers in a file.
struct NumberType {
  enum Kind : char { kFloat = 'f', kSigned = 'i', kUnsigned = 'u' };
  Kind kind{kFloat};
  std::size_t size{8};  ///< [bytes]
  bool swapped{false};
};

/// Bytes of an array in a file, opened at several places at a time: each goes on from a copy of the one before, so that
/// compressed data are not decompressed from their beginning for every column.
class ArrayBytes {
 public:
  /// @param kind  how the `count` bytes at `at` are stored
  enum Kind { kPlain, kZlib, kDeflate };
  ArrayBytes(SharedBytes file, std::uint64_t at, std::uint64_t count, Kind kind);
  /// The bytes from `offset` (of what is decompressed) on.
  std::unique_ptr<ByteStream> open_at(std::uint64_t offset);

 private:
  SharedBytes file_;
  std::uint64_t at_, count_;
  Kind kind_;
  std::unique_ptr<ByteStream> last_;
  std::uint64_t last_offset_{0};
};

/// An array in a stream of bytes.
struct StreamedArray {
  std::shared_ptr<ArrayBytes> bytes;
  NumberType type;
  std::uint64_t offset{0};  ///< of the first number
  std::size_t rows{0}, columns{1};
  bool by_rows{true};          ///< the numbers of a row are side by side; otherwise those of a column
  std::uint64_t row_bytes{0};  ///< from row to row where by_rows; 0: no more than the numbers
  std::int64_t base{0};
  double divisor{1.0};
};
/// Opens an array with rows along `axis` of its shape; rows, columns and by_rows are set from that.
/// @param adjacent  whether the numbers of such a row are side by side
std::unique_ptr<ArrayValues> streamed_values(StreamedArray array, const std::vector<std::uint64_t>& shape,
                                             int axis, bool adjacent, std::int64_t base, double divisor);

/// Converts `count` numbers, `stride` bytes apart; `base` is subtracted from integers of 64 bits, exactly.
void decode_numbers(const NumberType& type, const char* from, std::size_t stride, std::size_t count,
                    std::int64_t base, double* to, std::size_t to_stride);

/// The first number of an array of integers.
std::int64_t first_integer(ArrayBytes& bytes, std::uint64_t offset, const NumberType& type);

/// Numbers in an array of this shape. @return nothing where that is beyond any file
std::optional<std::uint64_t> count_of(const std::vector<std::uint64_t>& shape);

/// A shape without the lengths that are 1.
std::vector<std::uint64_t> squeezed(const std::vector<std::uint64_t>& shape);

bool recognises_npy(std::string_view head);
bool recognises_npz(std::string_view head);
ArrayFile open_numpy(SharedBytes file);

bool recognises_mat5(std::string_view head);
ArrayFile open_mat5(SharedBytes file);

bool recognises_hdf5(std::string_view head);
ArrayFile open_hdf5(SharedBytes file);

}  // namespace heft::data

#include "arrays.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/ranges.h>

namespace heft::data {
namespace {

/// More columns than any log has: an array that is wider is no log.
constexpr std::uint64_t kMostArrayColumns = 2000;

/// Numbers decoded at a time.
constexpr std::size_t kBlockNumbers = std::size_t{1} << 16;

/// Lengths that differ by less than this part of a log are those of a recording that was stopped: the tail is cut.
constexpr double kCutPart = 0.01;

/// Integers beyond this are not exact in double precision.
constexpr std::int64_t kExact = std::int64_t{1} << 53;

template <typename T>
void convert(const char* from, std::size_t stride, std::size_t count, bool swapped, double* to,
             std::size_t to_stride) {
  for (std::size_t k = 0; k < count; ++k)
    to[k * to_stride] = static_cast<double>(number_at<T>(from + k * stride, swapped));
}

/// Integers of 64 bits less `base`; the difference is exact where a double can hold it.
template <typename T>
void convert_from(const char* from, std::size_t stride, std::size_t count, bool swapped, std::int64_t base,
                  double* to, std::size_t to_stride) {
  for (std::size_t k = 0; k < count; ++k) {
    const T value = number_at<T>(from + k * stride, swapped);
    const auto difference = static_cast<std::uint64_t>(value) - static_cast<std::uint64_t>(base);
    to[k * to_stride] = static_cast<double>(static_cast<std::int64_t>(difference));
  }
}

class StreamedValues final : public ArrayValues {
 public:
  explicit StreamedValues(const StreamedArray& array)
      : array_(array), places_(array.by_rows ? 1 : array.columns) {}

  void read(std::size_t first, std::size_t count, double* to, std::size_t stride,
            const char* wanted) override {
    const std::size_t size = array_.type.size;
    if (array_.by_rows) {
      const std::size_t row = static_cast<std::size_t>(array_.row_bytes);
      bytes_.resize(count * row);
      go_to(places_[0], array_.offset, first, row);
      // Behind the last number of the last row there may be nothing.
      const std::size_t needed = (count - 1) * row + array_.columns * size;
      places_[0].stream->read(bytes_.data(), needed);
      places_[0].skipped = row - array_.columns * size;
      places_[0].row = first + count;
      for (std::size_t c = 0; c < array_.columns; ++c) {
        if (wanted[c] != 0) decode(bytes_.data() + c * size, row, count, to + c, stride);
      }
      return;
    }
    bytes_.resize(count * size);
    for (std::size_t c = 0; c < array_.columns; ++c) {
      if (wanted[c] == 0) continue;
      go_to(places_[c], array_.offset + c * std::uint64_t{array_.rows} * size, first, size);
      places_[c].stream->read(bytes_.data(), bytes_.size());
      places_[c].row = first + count;
      decode(bytes_.data(), size, count, to + c, stride);
    }
  }

 private:
  struct Place {
    std::unique_ptr<ByteStream> stream;
    std::size_t row{0};
    std::size_t skipped{0};  ///< bytes of the row before that were not read yet
  };
  void go_to(Place& place, std::uint64_t begin, std::size_t row, std::size_t row_bytes) {
    if (!place.stream) place.stream = array_.bytes->open_at(begin);
    const std::uint64_t ahead = std::uint64_t{row - place.row} * row_bytes + place.skipped;
    if (ahead > 0) place.stream->skip(ahead);
    place.skipped = 0;
  }
  void decode(const char* from, std::size_t stride, std::size_t count, double* to,
              std::size_t to_stride) const {
    decode_numbers(array_.type, from, stride, count, array_.base, to, to_stride);
    if (array_.divisor == 1.0) return;
    for (std::size_t k = 0; k < count; ++k) to[k * to_stride] /= array_.divisor;
  }

  StreamedArray array_;
  std::vector<Place> places_;
  std::vector<char> bytes_;
};

/// "0.001" as a division: exact to the last digit where a product is not.
double divisor_of(double factor) {
  for (const double divisor : {1e3, 1e6, 1e9}) {
    if (factor == 1.0 / divisor) return divisor;
  }
  return 1.0;
}

std::string shown_shape(const ArrayVariable& variable) {
  return variable.shape.empty() ? "one number" : fmt::format("{}", fmt::join(variable.shape, "x"));
}

/// The part of a name that is the variable's own: "q" of "data.q".
std::string own_name(const std::string& name) { return name.substr(name.rfind('.') + 1); }

/// Columns in heft's words; what --map says counts only where it speaks of one of these columns or groups.
std::vector<LogColumn> words_for(const std::string& name, const std::vector<std::string>& headers,
                                 ReadAs as) {
  std::erase_if(as.map, [&](const std::pair<std::string, std::string>& each) {
    return each.second != name && std::find(headers.begin(), headers.end(), each.second) == headers.end();
  });
  return in_heft_words(headers, as);
}

/// What a variable is, in heft's words: "q" of "q", or of another program's name for positions; "" for anything else.
std::string channel_of(const std::string& header, const ReadAs& as) {
  static constexpr std::array<std::string_view, 8> kPrefixes{"q",   "tau",  "i",     "qd",
                                                             "qdd", "qref", "qdref", "temp"};
  std::string word = words_for(header, {header + "[0]", header + "[1]"}, as).front().name;
  word = word.substr(0, word.find_first_of("0123456789["));
  return std::find(kPrefixes.begin(), kPrefixes.end(), word) != kPrefixes.end() ? word : "";
}

class ArrayReader final : public LogReader {
 public:
  ArrayReader(ArrayFile file, const ReadAs& as) : file_(std::move(file)) {
    const std::optional<std::size_t> time = find_time(as);
    choose_columns(time, as);
    name_columns(time, as);
    wanted_.assign(columns_.size(), 1);
    block_rows_ = std::clamp<std::size_t>(kBlockNumbers / columns_.size(), 16, 4096);
    block_.resize(block_rows_ * columns_.size());
  }

  std::string format() const override { return file_.format; }
  const std::vector<LogColumn>& columns() const override { return columns_; }
  void want_only(const std::vector<std::size_t>& columns) override {
    std::fill(wanted_.begin(), wanted_.end(), '\0');
    for (const std::size_t c : columns) wanted_[c] = 1;
  }
  bool next(double* values) override {
    if (row_ == rows_) return false;
    if (row_ == block_end_) fill();
    const double* const row = block_.data() + (row_ - block_begin_) * columns_.size();
    for (std::size_t c = 0; c < columns_.size(); ++c) {
      if (wanted_[c] != 0) values[c] = row[c];
    }
    ++row_;
    return true;
  }
  std::string place() const override { return fmt::format("{}: row {}", file_.path, row_); }
  double part_read() const override {
    return rows_ == 0 ? 1.0 : static_cast<double>(row_) / static_cast<double>(rows_);
  }
  std::vector<std::string> notes() const override { return notes_; }

 private:
  /// A variable that is read.
  struct Part {
    std::size_t variable{0};
    int axis{0};
    std::size_t columns{1};
    std::size_t begin{0};  ///< its first column in the row
    std::unique_ptr<ArrayValues> values;
  };

  [[noreturn]] void refuse_timeless() const;
  std::optional<std::size_t> find_time(const ReadAs& as) const;
  std::uint64_t longest_channel(const ReadAs& as) const;
  void choose_columns(std::optional<std::size_t> time, const ReadAs& as);
  void name_columns(std::optional<std::size_t> time, const ReadAs& as);
  void set_clock(const ArrayVariable& time, const LogColumn& word, std::int64_t& base, double& divisor);
  std::string header_of(const ArrayVariable& variable) const;
  std::string list() const;
  void fill();

  ArrayFile file_;
  std::vector<Part> parts_;
  std::vector<LogColumn> columns_;
  std::vector<char> wanted_;
  std::vector<std::string> notes_;
  std::size_t rows_{0}, row_{0};
  std::vector<double> block_;
  std::size_t block_rows_{0}, block_begin_{0}, block_end_{0};
};

/// The name of a variable as a header: without the struct, where that is clear.
std::string ArrayReader::header_of(const ArrayVariable& variable) const {
  const std::string own = own_name(variable.name);
  const auto same = std::count_if(file_.variables.begin(), file_.variables.end(),
                                  [&](const ArrayVariable& v) { return own_name(v.name) == own; });
  return same > 1 ? variable.name : own;
}

std::string ArrayReader::list() const {
  constexpr std::size_t kMost = 20;
  std::string text;
  for (std::size_t i = 0; i < std::min(file_.variables.size(), kMost); ++i) {
    const ArrayVariable& variable = file_.variables[i];
    text += fmt::format("{}{} ({})", text.empty() ? "" : ", ", variable.name.substr(0, 60),
                        variable.unusable.empty() ? shown_shape(variable) : variable.unusable);
  }
  if (file_.variables.size() > kMost) text += fmt::format(", ... ({} in all)", file_.variables.size());
  return text.empty() ? "no variable" : text;
}

/// The variable that is time; nothing where the user gave the rate of the rows.
std::optional<std::size_t> ArrayReader::find_time(const ReadAs& as) const {
  static constexpr std::array<std::string_view, 5> kNames{"time", "t", "timestamp", "timestamps", "stamp"};
  std::vector<std::string> headers;
  std::vector<std::size_t> vectors;
  for (std::size_t i = 0; i < file_.variables.size(); ++i) {
    const ArrayVariable& variable = file_.variables[i];
    if (!variable.unusable.empty() || variable.shape.size() != 1) continue;
    vectors.push_back(i);
    headers.push_back(header_of(variable));
  }
  ReadAs time_only = as;
  std::erase_if(time_only.map, [](const auto& each) { return each.first != "time"; });
  const std::vector<LogColumn> words = words_for("", headers, time_only);
  for (std::size_t i = 0; i < vectors.size(); ++i) {
    if (words[i].name == "time") return vectors[i];
  }
  for (const std::string_view name : kNames) {
    for (const std::size_t i : vectors) {
      std::string own = own_name(file_.variables[i].name);
      std::transform(own.begin(), own.end(), own.begin(),
                     [](char c) { return c >= 'A' && c <= 'Z' ? char(c + 32) : c; });
      if (own == name) return i;
    }
  }
  for (const auto& [ours, theirs] : as.map) {
    if (ours == "time" && (theirs.ends_with("Hz") || theirs.ends_with("hz"))) return std::nullopt;
  }
  refuse_timeless();
}

void ArrayReader::refuse_timeless() const {
  throw DataError(fmt::format(
      "{}: found {}; expected a variable 'time' [s] with one value a row; {}, name the one that it is with --map "
      "time=NAME, or give the rate of the rows (--map time=500Hz)",
      file_.path, list(), file_.how_to_save));
}

/// Length of the longest variable that is a channel, where no time says how many rows there are.
std::uint64_t ArrayReader::longest_channel(const ReadAs& as) const {
  std::uint64_t longest = 0;
  for (const ArrayVariable& variable : file_.variables) {
    if (!variable.unusable.empty() || variable.shape.empty() || variable.shape.size() > 2) continue;
    if (channel_of(header_of(variable), as).empty()) continue;
    longest = std::max(longest, *std::max_element(variable.shape.begin(), variable.shape.end()));
  }
  if (longest == 0) refuse_timeless();
  return longest;
}

void ArrayReader::choose_columns(std::optional<std::size_t> time, const ReadAs& as) {
  const std::uint64_t rows = time ? file_.variables[*time].shape[0] : longest_channel(as);
  const std::string clock = time ? file_.variables[*time].name : "the longest";
  std::uint64_t fewest = rows;
  std::vector<std::string> left_out, shorter;
  if (time) parts_.push_back({*time, 0, 1, 0, nullptr});
  const auto is_near = [rows](std::uint64_t length) {
    const double difference = std::abs(static_cast<double>(length) - static_cast<double>(rows));
    return difference < kCutPart * static_cast<double>(rows);
  };
  for (std::size_t i = 0; i < file_.variables.size(); ++i) {
    const ArrayVariable& variable = file_.variables[i];
    if (i == time || (variable.unusable.empty() && variable.shape.empty())) continue;
    if (!variable.unusable.empty() || variable.shape.size() > 2) {
      left_out.push_back(fmt::format("{} ({})", variable.name,
                                     variable.unusable.empty() ? shown_shape(variable) : variable.unusable));
      continue;
    }
    const std::vector<std::uint64_t>& shape = variable.shape;
    int axis = -1;
    for (int a = static_cast<int>(shape.size()) - 1; a >= 0; --a) {
      if (is_near(shape[static_cast<std::size_t>(a)])) axis = a;
    }
    for (int a = static_cast<int>(shape.size()) - 1; a >= 0; --a) {
      if (shape[static_cast<std::size_t>(a)] == rows) axis = a;
    }
    const std::uint64_t columns = axis < 0 || shape.size() < 2 ? 1 : shape[axis == 0 ? 1 : 0];
    if (axis < 0 && !channel_of(header_of(variable), as).empty()) {
      throw DataError(fmt::format(
          "{}: variable '{}' has {} values, '{}' has {}; expected as many rows of both; resample it to the times of "
          "'{}', or save it to a log of its own with its times",
          file_.path, variable.name, shown_shape(variable), clock, rows, clock));
    }
    if (axis < 0 || columns == 0 || columns > kMostArrayColumns) {
      left_out.push_back(fmt::format("{} ({})", variable.name, shown_shape(variable)));
      continue;
    }
    const std::uint64_t length = shape[static_cast<std::size_t>(axis)];
    if (length != rows) shorter.push_back(fmt::format("{} ({})", variable.name, length));
    fewest = std::min(fewest, length);
    parts_.push_back({i, axis, static_cast<std::size_t>(columns), 0, nullptr});
  }
  if (parts_.empty()) refuse_timeless();
  rows_ = static_cast<std::size_t>(fewest);
  if (!left_out.empty()) {
    notes_.push_back(fmt::format("variables left out: {}", fmt::join(left_out, ", ")));
  }
  if (!shorter.empty()) {
    notes_.push_back(fmt::format("lengths differ from the {} of '{}': {}; the first {} rows are read", rows,
                                 clock, fmt::join(shorter, ", "), rows_));
  }
}

/// What a clock of whole numbers counts from, and in what unit: stamps of the time since 1970 show theirs by their size.
void ArrayReader::set_clock(const ArrayVariable& time, const LogColumn& word, std::int64_t& base,
                            double& divisor) {
  constexpr double kYear2001 = 1e9, kYear2100 = 4.1e9;
  if (!time.first) return;
  const double first = static_cast<double>(*time.first);
  std::string_view unit = "as they are";
  if (time.per_second > 0.0) divisor = time.per_second;
  if (divisor == 1.0 && word.factor == 1.0) {
    for (const double candidate : {1e3, 1e6, 1e9}) {
      if (first >= kYear2001 * candidate && first < kYear2100 * candidate) divisor = candidate;
    }
  }
  if (divisor == 1e3) unit = "in milliseconds";
  if (divisor == 1e6) unit = "in microseconds";
  if (divisor == 1e9) unit = "in nanoseconds";
  if (*time.first > kExact || *time.first < -kExact) base = *time.first;
  if (base != 0) {
    notes_.push_back(
        fmt::format("time is counted from the first value of '{}', {}, and read {}", time.name, base, unit));
  } else if (divisor != 1.0 && word.factor == 1.0) {
    notes_.push_back(fmt::format("time is read {} from '{}'", unit, time.name));
  }
}

void ArrayReader::name_columns(std::optional<std::size_t> time, const ReadAs& as) {
  std::vector<std::string> headers, origins;
  for (Part& part : parts_) {
    const ArrayVariable& variable = file_.variables[part.variable];
    const std::string header = header_of(variable);
    part.begin = headers.size();
    for (std::size_t c = 0; c < part.columns; ++c) {
      const std::string index = variable.shape.size() == 2 ? fmt::format("[{}]", c) : "";
      headers.push_back(header + index);
      origins.push_back(variable.name + index);
    }
  }
  columns_ = in_heft_words(headers, as);
  for (std::size_t c = 0; c < columns_.size(); ++c) columns_[c].origin = origins[c];
  if (time) columns_[0].name = "time";
  for (Part& part : parts_) {
    std::int64_t base = 0;
    double divisor = 1.0;
    if (part.variable == time) set_clock(file_.variables[*time], columns_[part.begin], base, divisor);
    part.values = file_.variables[part.variable].open(part.axis, base, divisor);
  }
}

void ArrayReader::fill() {
  const std::size_t count = std::min(block_rows_, rows_ - row_);
  for (const Part& part : parts_) {
    const char* const wanted = wanted_.data() + part.begin;
    if (std::none_of(wanted, wanted + part.columns, [](char each) { return each != 0; })) continue;
    part.values->read(row_, count, block_.data() + part.begin, columns_.size(), wanted);
  }
  block_begin_ = row_;
  block_end_ = row_ + count;
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    const LogColumn& column = columns_[c];
    if (column.factor == 1.0 && column.shift == 0.0) continue;
    const double divisor = divisor_of(column.factor);
    for (std::size_t k = 0; k < count; ++k) {
      double& value = block_[k * columns_.size() + c];
      value = (divisor != 1.0 ? value / divisor : value * column.factor) + column.shift;
    }
  }
}

}  // namespace

ArrayBytes::ArrayBytes(SharedBytes file, std::uint64_t at, std::uint64_t count, Kind kind)
    : file_(std::move(file)), at_(at), count_(count), kind_(kind) {}

std::unique_ptr<ByteStream> ArrayBytes::open_at(std::uint64_t offset) {
  if (!last_ || offset < last_offset_) {
    last_ = kind_ == kPlain ? plain_stream(file_, at_, count_)
                            : inflated_stream(file_, at_, count_, kind_ == kDeflate);
    last_offset_ = 0;
  }
  last_->skip(offset - last_offset_);
  last_offset_ = offset;
  return last_->copy();
}

std::unique_ptr<ArrayValues> streamed_values(StreamedArray array, const std::vector<std::uint64_t>& shape,
                                             int axis, bool adjacent, std::int64_t base, double divisor) {
  array.base = base;
  array.divisor = divisor;
  array.rows = static_cast<std::size_t>(shape[static_cast<std::size_t>(axis)]);
  array.columns = shape.size() < 2 ? 1 : static_cast<std::size_t>(shape[axis == 0 ? 1 : 0]);
  array.by_rows = shape.size() < 2 || adjacent;
  if (array.row_bytes == 0) array.row_bytes = array.columns * array.type.size;
  return std::make_unique<StreamedValues>(array);
}

void decode_numbers(const NumberType& type, const char* from, std::size_t stride, std::size_t count,
                    std::int64_t base, double* to, std::size_t to_stride) {
  const bool swapped = type.swapped;
  if (type.kind == NumberType::kFloat) {
    if (type.size == 8) convert<double>(from, stride, count, swapped, to, to_stride);
    if (type.size == 4) convert<float>(from, stride, count, swapped, to, to_stride);
  } else if (type.kind == NumberType::kSigned) {
    if (type.size == 1) convert<std::int8_t>(from, stride, count, swapped, to, to_stride);
    if (type.size == 2) convert<std::int16_t>(from, stride, count, swapped, to, to_stride);
    if (type.size == 4) convert<std::int32_t>(from, stride, count, swapped, to, to_stride);
    if (type.size == 8) convert_from<std::int64_t>(from, stride, count, swapped, base, to, to_stride);
  } else {
    if (type.size == 1) convert<std::uint8_t>(from, stride, count, swapped, to, to_stride);
    if (type.size == 2) convert<std::uint16_t>(from, stride, count, swapped, to, to_stride);
    if (type.size == 4) convert<std::uint32_t>(from, stride, count, swapped, to, to_stride);
    if (type.size == 8) convert_from<std::uint64_t>(from, stride, count, swapped, base, to, to_stride);
  }
}

std::int64_t first_integer(ArrayBytes& bytes, std::uint64_t offset, const NumberType& type) {
  std::array<char, 8> number{};
  bytes.open_at(offset)->read(number.data(), number.size());
  return number_at<std::int64_t>(number.data(), type.swapped);
}

std::optional<std::uint64_t> count_of(const std::vector<std::uint64_t>& shape) {
  // Ten bits less than a file can have bytes, so that sizes in bytes do not overflow either.
  constexpr std::uint64_t kMost = std::uint64_t{1} << 53;
  std::uint64_t count = 1;
  for (const std::uint64_t length : shape) {
    if (__builtin_mul_overflow(count, length, &count) || count > kMost) return std::nullopt;
  }
  return count;
}

std::vector<std::uint64_t> squeezed(const std::vector<std::uint64_t>& shape) {
  std::vector<std::uint64_t> kept;
  for (const std::uint64_t length : shape) {
    if (length != 1) kept.push_back(length);
  }
  return kept;
}

std::unique_ptr<LogReader> read_arrays(ArrayFile file, const ReadAs& as) {
  const std::string path = file.path;
  try {
    return std::make_unique<ArrayReader>(std::move(file), as);
  } catch (const DataError& error) {  // of what names of columns mean, which knows no file
    const std::string message = error.what();
    if (message.starts_with(path)) throw;
    throw DataError(path + ": " + message);
  }
}

}  // namespace heft::data

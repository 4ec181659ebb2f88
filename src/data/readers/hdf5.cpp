/// @file
/// Variables of MATLAB's files of version 7.3 and of other HDF5 files: data contiguous, compact or in chunks, deflated and
/// shuffled or not. Groups (structs) are looked into one level deep.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "hdf5_file.hpp"

namespace heft::data {
namespace {

/// Most axes of a data set.
constexpr std::size_t kMostAxes = 32;

/// Most bytes of chunks side by side, which are decompressed at a time; MATLAB's have 64 kB to 1 MB.
constexpr std::uint64_t kLargestBand = std::uint64_t{1} << 28;

/// Filters that are undone here.
constexpr std::uint16_t kDeflateFilter = 1, kShuffleFilter = 2, kChecksumFilter = 3;

/// The axes that are longer than 1: rows and columns.
std::vector<std::size_t> long_axes(const std::vector<std::uint64_t>& shape) {
  std::vector<std::size_t> axes;
  for (std::size_t a = 0; a < shape.size(); ++a) {
    if (shape[a] != 1) axes.push_back(a);
  }
  return axes;
}

/// Numbers in chunks: those side by side (a band of rows) are decompressed at a time.
class ChunkedValues final : public ArrayValues {
 public:
  ChunkedValues(std::shared_ptr<const Hdf5File> file, std::string name, Hdf5Set set, int axis,
                std::int64_t base, double divisor)
      : file_(std::move(file)), name_(std::move(name)), set_(std::move(set)), base_(base), divisor_(divisor) {
    const std::vector<std::size_t> axes = long_axes(set_.shape);
    row_axis_ = axes.at(static_cast<std::size_t>(axis));
    column_axis_ = axes.size() < 2 ? row_axis_ : axes[axis == 0 ? 1 : 0];
    columns_ = axes.size() < 2 ? 1 : static_cast<std::size_t>(set_.shape[column_axis_]);
    band_rows_ = static_cast<std::size_t>(set_.chunk[row_axis_]);
    const std::optional<std::uint64_t> numbers = count_of(set_.chunk);
    if (!numbers || *numbers > kLargestBand / set_.type.size || band_rows_ > kLargestBand / 8 / columns_) {
      throw DataError(fmt::format(
          "{}: variable '{}' is kept in chunks of more than {} bytes; expected smaller ones; save "
          "it with 'save -v7.3'",
          file_->bytes().path(), name_, kLargestBand));
    }
    chunk_bytes_ = static_cast<std::size_t>(*numbers) * set_.type.size;
    for (Hdf5Chunk& chunk : file_->chunks_of(set_)) {
      const std::uint64_t number = chunk.begin[row_axis_] / band_rows_;
      bands_[number].push_back(std::move(chunk));
    }
  }

  void read(std::size_t first, std::size_t count, double* to, std::size_t stride,
            const char* wanted) override {
    for (std::size_t k = 0; k < count; ++k) {
      const std::size_t row = first + k, number = row / band_rows_;
      if (!has_band_ || number != band_number_) load(number);
      const double* const values = band_.data() + (row - number * band_rows_) * columns_;
      for (std::size_t c = 0; c < columns_; ++c) {
        if (wanted[c] != 0) to[k * stride + c] = values[c];
      }
    }
  }

 private:
  void load(std::size_t number) {
    band_.assign(band_rows_ * columns_, 0.0);  // a chunk that was never written holds zeros
    const auto found = bands_.find(number);
    if (found != bands_.end()) {
      for (const Hdf5Chunk& chunk : found->second) place(chunk);
    }
    band_number_ = number;
    has_band_ = true;
  }

  /// Puts the numbers of a chunk to their places in the band.
  void place(const Hdf5Chunk& chunk) {
    const std::string bytes = undo_filters(chunk);
    std::size_t row_step = 1, column_step = 1, step = 1;
    for (std::size_t a = set_.chunk.size(); a-- > 0;) {
      if (a == row_axis_) row_step = step;
      if (a == column_axis_) column_step = step;
      step *= static_cast<std::size_t>(set_.chunk[a]);
    }
    const bool is_vector = columns_ == 1;
    const std::uint64_t begin = is_vector ? 0 : chunk.begin[column_axis_];
    if (begin >= columns_) return;
    const std::size_t width =
        is_vector
            ? 1
            : static_cast<std::size_t>(std::min<std::uint64_t>(set_.chunk[column_axis_], columns_ - begin));
    const std::size_t size = set_.type.size;
    for (std::size_t c = 0; c < width; ++c) {
      decode_numbers(set_.type, bytes.data() + c * column_step * size, row_step * size, band_rows_, base_,
                     band_.data() + begin + c, columns_);
      for (std::size_t k = 0; divisor_ != 1.0 && k < band_rows_; ++k)
        band_[k * columns_ + begin + c] /= divisor_;
    }
  }

  std::string undo_filters(const Hdf5Chunk& chunk) const {
    std::string bytes;
    std::uint64_t stored = chunk.bytes;
    bool inflated = false;
    const auto applied = [&](std::size_t f) { return (chunk.without >> f & 1) == 0; };
    for (std::size_t f = set_.filters.size(); f-- > 0;) {
      if (!applied(f)) continue;
      if (set_.filters[f] == kChecksumFilter && bytes.empty() && stored >= 4) stored -= 4;
      if (set_.filters[f] == kDeflateFilter && !inflated) {
        if (chunk.at > file_->bytes().size())
          file_->fail(chunk.at, "found a chunk beyond the end of the file");
        constexpr std::uint64_t kMostDeflation = 1100;  // 1032 is what the method allows
        if (chunk_bytes_ / kMostDeflation > stored) {
          file_->fail(chunk.at, "variable '{}': found a chunk of {} bytes; expected {} when inflated", name_,
                      stored, chunk_bytes_);
        }
        bytes.resize(chunk_bytes_ + checksums_before(f, chunk));
        inflated_stream(file_->shared(), file_->base() + chunk.at, stored, false)
            ->read(bytes.data(), bytes.size());
        bytes.resize(chunk_bytes_);
        inflated = true;
      }
      if (set_.filters[f] == kShuffleFilter) {
        if (bytes.empty()) bytes = whole_chunk(chunk.at, stored);
        bytes = unshuffled(bytes);
      }
    }
    return bytes.empty() ? whole_chunk(chunk.at, stored) : bytes;
  }
  std::size_t checksums_before(std::size_t filter, const Hdf5Chunk& chunk) const {
    std::size_t bytes = 0;
    for (std::size_t f = 0; f < filter; ++f) {
      if (set_.filters[f] == kChecksumFilter && (chunk.without >> f & 1) == 0) bytes += 4;
    }
    return bytes;
  }
  std::string whole_chunk(std::uint64_t at, std::uint64_t stored) const {
    if (stored != chunk_bytes_)
      file_->fail(at, "variable '{}': found a chunk of {} bytes; expected {}", name_, stored, chunk_bytes_);
    return file_->read(at, stored);
  }
  /// First bytes of all numbers, then their second bytes, ...: put together again.
  std::string unshuffled(const std::string& bytes) const {
    const std::size_t size = set_.type.size, count = bytes.size() / size;
    std::string numbers(bytes.size(), '\0');
    for (std::size_t b = 0; b < size; ++b) {
      const char* const from = bytes.data() + b * count;
      for (std::size_t i = 0; i < count; ++i) numbers[i * size + b] = from[i];
    }
    return numbers;
  }

  std::shared_ptr<const Hdf5File> file_;
  std::string name_;
  Hdf5Set set_;
  std::int64_t base_;
  double divisor_;
  std::size_t row_axis_{0}, column_axis_{0}, columns_{1}, band_rows_{1}, chunk_bytes_{0};
  std::map<std::uint64_t, std::vector<Hdf5Chunk>> bands_;
  std::vector<double> band_;
  std::size_t band_number_{0};
  bool has_band_{false};
};

// --- what a data set says of itself ---

void read_dataspace(const std::string& content, Hdf5Set& set) {
  const int version = content.size() < 4 ? 0 : content[0];
  const std::size_t axes = content.size() < 4 ? 0 : static_cast<unsigned char>(content[1]);
  const std::size_t begin = version == 1 ? 8 : 4;
  if ((version != 1 && version != 2) || axes > kMostAxes || content.size() < begin + 8 * axes) {
    set.unusable = "damaged";
    return;
  }
  const bool has_most = (content[2] & 1) != 0 && content.size() >= begin + 16 * axes;
  for (std::size_t a = 0; a < axes; ++a) {
    const char* const length = content.data() + begin + 8 * a;
    set.shape.push_back(number_at<std::uint64_t>(length));
    set.most.push_back(has_most ? number_at<std::uint64_t>(length + 8 * axes) : set.shape.back());
  }
}

void read_datatype(const std::string& content, Hdf5Set& set) {
  constexpr int kInteger = 0, kReal = 1, kText = 3, kCompound = 6, kReference = 7;
  if (content.size() < 8) {
    set.unusable = "damaged";
    return;
  }
  const int kind = content[0] & 0x0F;
  const std::uint32_t size = number_at<std::uint32_t>(content.data() + 4);
  set.type = {kind == kReal           ? NumberType::kFloat
              : (content[1] & 8) != 0 ? NumberType::kSigned
                                      : NumberType::kUnsigned,
              size, (content[1] & 1) != 0};
  const bool fits = kind == kReal ? (size == 4 || size == 8) && (content[1] & 0x40) == 0
                                  : size == 1 || size == 2 || size == 4 || size == 8;
  if (kind == kText) set.unusable = "text";
  if (kind == kCompound) set.unusable = "complex numbers or records";
  if (kind == kReference) set.unusable = "a cell array";
  if (set.unusable.empty() && ((kind != kInteger && kind != kReal) || !fits)) set.unusable = "no numbers";
}

/// Chunks of newer files: lengths as long as they need, the kind of index, what it needs to be read, its address.
void read_chunks(const std::string& content, Hdf5Set& set) {
  if (content.size() < 5) return;
  const int flags = content[2];
  const std::size_t axes = static_cast<unsigned char>(content[3]);  // and the size of a number behind them
  const std::size_t bytes = static_cast<unsigned char>(content[4]), kind_at = 5 + axes * bytes;
  if (axes < 2 || axes > kMostAxes + 1 || bytes == 0 || bytes > 8 || content.size() < kind_at + 9) return;
  for (std::size_t a = 0; a + 1 < axes; ++a) {
    set.chunk.push_back(hdf5_number(content.data() + 5 + a * bytes, bytes));
    if (set.chunk.back() == 0) return;
  }
  const int kind = content[kind_at];
  if (kind < 1 || kind > 5) return;
  set.index = static_cast<Hdf5Index>(kind);
  const bool is_filtered_single = set.index == Hdf5Index::kSingle && (flags & 2) != 0;
  const std::array<std::size_t, 6> setting_bytes{0, is_filtered_single ? 12U : 0U, 0, 1, 5, 6};
  const std::size_t address = kind_at + 1 + setting_bytes[static_cast<std::size_t>(kind)];
  if (content.size() < address + 8) return;
  if (is_filtered_single) {
    set.single_bytes = number_at<std::uint64_t>(content.data() + kind_at + 1);
    set.single_without = number_at<std::uint32_t>(content.data() + kind_at + 9);
  }
  set.at = number_at<std::uint64_t>(content.data() + address);
  set.bare_edges = (flags & 1) != 0;
  set.chunked = true;
  set.unusable.clear();
}

void read_layout(const Hdf5Message& message, Hdf5Set& set) {
  const std::string& content = message.content;
  constexpr int kCompact = 0, kContiguous = 1, kChunked = 2;
  const int version = content.size() < 2 ? 0 : content[0], kind = content.size() < 2 ? -1 : content[1];
  set.unusable = "damaged";
  const bool is_known = version >= 3 && version <= 5 && kind >= kCompact && kind <= kChunked;
  if (!is_known) {
    set.unusable = "stored in a way that is not read here (h5repack --low=0 --high=0 OLD NEW rewrites it)";
  } else if (version > 3 && kind == kChunked) {
    read_chunks(content, set);
  } else if (kind == kCompact && content.size() >= 4) {
    set.at = message.at + 4;
    set.bytes = number_at<std::uint16_t>(content.data() + 2);
    if (set.bytes <= content.size() - 4) set.unusable.clear();
  } else if (kind == kContiguous && content.size() >= 18) {
    set.at = number_at<std::uint64_t>(content.data() + 2);
    set.bytes = number_at<std::uint64_t>(content.data() + 10);
    set.unusable = set.at == kHdf5Nowhere ? "never written" : "";
  } else if (kind == kChunked && content.size() >= 11) {
    const std::size_t axes = static_cast<unsigned char>(content[2]);  // and the size of a number behind them
    if (axes < 2 || axes > kMostAxes + 1 || content.size() < 11 + 4 * axes) return;
    set.chunked = true;
    set.at = number_at<std::uint64_t>(content.data() + 3);
    for (std::size_t a = 0; a + 1 < axes; ++a) {
      set.chunk.push_back(number_at<std::uint32_t>(content.data() + 11 + 4 * a));
      if (set.chunk.back() == 0) return;
    }
    set.unusable.clear();
  }
}

void read_filters(const std::string& content, Hdf5Set& set) {
  const int version = content.size() < 2 ? 0 : content[0];
  const std::size_t count = content.size() < 2 ? 0 : static_cast<unsigned char>(content[1]);
  constexpr std::size_t kMostFilters = 32;  // which they did not go through is said in as many bits
  std::size_t at = version == 1 ? 8 : 2;
  for (std::size_t i = 0; i < count; ++i) {
    const bool is_short =
        version != 1 && content.size() >= at + 6 && number_at<std::uint16_t>(content.data() + at) < 256;
    if (content.size() < at + (is_short ? 6 : 8) || count > kMostFilters) {
      set.unusable = "damaged";
      return;
    }
    const std::uint16_t filter = number_at<std::uint16_t>(content.data() + at);
    const bool has_name = !is_short;
    const std::size_t name = has_name ? number_at<std::uint16_t>(content.data() + at + 2) : 0;
    const std::size_t values = number_at<std::uint16_t>(content.data() + at + (has_name ? 6 : 4));
    at += (has_name ? 8U : 6U) + (version == 1 ? (name + 7) / 8 * 8 : name) + 4 * values;
    if (version == 1 && values % 2 == 1) at += 4;
    set.filters.push_back(filter);
    if (filter != kDeflateFilter && filter != kShuffleFilter && filter != kChecksumFilter) {
      set.unusable = fmt::format("compressed by filter {}", filter);
    }
  }
}

/// MATLAB's class of a variable, where the attribute is it.
void read_attribute(const std::string& content, Hdf5Set& set) {
  if (content.size() < 9) return;
  const int version = content[0];
  const auto filled = [version](std::size_t size) { return version == 1 ? (size + 7) / 8 * 8 : size; };
  const std::size_t name = number_at<std::uint16_t>(content.data() + 2),
                    type = number_at<std::uint16_t>(content.data() + 4),
                    space = number_at<std::uint16_t>(content.data() + 6), begin = version == 3 ? 9 : 8;
  const std::size_t data = begin + filled(name) + filled(type) + filled(space);
  if (data > content.size()) return;
  const std::string_view called(content.data() + begin, name);
  if (called.starts_with("MATLAB_empty")) set.unusable = "empty";
  if (!called.starts_with("MATLAB_class")) return;
  set.matlab = content.substr(data, 32);
  set.matlab = set.matlab.substr(0, set.matlab.find('\0'));
}

Hdf5Set set_of(const std::vector<Hdf5Message>& messages) {
  Hdf5Set set;
  std::string attributes;  // what they say counts where nothing else is wrong
  for (const Hdf5Message& message : messages) {
    Hdf5Set part;
    if (message.shared && message.kind == kHdf5Datatype) part.unusable = "of a type that is named elsewhere";
    else if (message.kind == kHdf5Dataspace) {
      read_dataspace(message.content, part);
      set.shape = part.shape;
      set.most = part.most;
    } else if (message.kind == kHdf5Datatype) read_datatype(message.content, part), set.type = part.type;
    else if (message.kind == kHdf5Filters) read_filters(message.content, part), set.filters = part.filters;
    else if (message.kind == kHdf5Attribute) read_attribute(message.content, part);
    else if (message.kind == kHdf5Layout) {
      read_layout(message, part);
      set.chunked = part.chunked;
      set.at = part.at;
      set.bytes = part.bytes;
      set.chunk = part.chunk;
      set.index = part.index;
      set.single_bytes = part.single_bytes;
      set.single_without = part.single_without;
      set.bare_edges = part.bare_edges;
    }
    if (!part.matlab.empty()) set.matlab = part.matlab;
    if (!part.unusable.empty()) set.unusable = part.unusable;
  }
  if (set.matlab == "char") set.unusable = "text";
  if (set.matlab == "cell") set.unusable = "a cell array";
  return set;
}

void add_set(const std::shared_ptr<const Hdf5File>& file, const std::string& name,
             const std::vector<Hdf5Message>& messages, ArrayFile& to) {
  ArrayVariable variable;
  variable.name = name;
  Hdf5Set set = set_of(messages);
  variable.shape = squeezed(set.shape);
  variable.unusable = set.unusable;
  const std::optional<std::uint64_t> count = count_of(set.shape);
  if (variable.unusable.empty() && (!count || (set.chunked && set.chunk.size() != set.shape.size())))
    variable.unusable = "damaged";
  if (variable.unusable.empty() && !set.chunked &&
      (set.bytes != *count * set.type.size || !file->bytes().has(file->base() + set.at, set.bytes))) {
    file->fail(set.at, "variable '{}': found {} bytes of numbers; expected {} inside the file", name,
               set.bytes, *count * set.type.size);
  }
  if (variable.unusable.empty() && set.chunked) {
    variable.open = [file, name, set](int axis, std::int64_t base, double divisor) {
      return std::make_unique<ChunkedValues>(file, name, set, axis, base, divisor);
    };
  } else if (variable.unusable.empty()) {
    StreamedArray array;
    array.bytes =
        std::make_shared<ArrayBytes>(file->shared(), file->base() + set.at, set.bytes, ArrayBytes::kPlain);
    array.type = set.type;
    variable.open = [array, shape = variable.shape](int axis, std::int64_t base, double divisor) {
      return streamed_values(array, shape, axis, axis == 0, base, divisor);
    };
  }
  if (variable.open && variable.shape.size() == 1 && variable.shape[0] > 0 &&
      set.type.kind != NumberType::kFloat && set.type.size == 8) {
    // The first value, as far as a double holds it, and what that lacks.
    constexpr double kMost = 9e18;
    double first = 0.0, rest = 0.0;
    const char wanted = 1;
    variable.open(0, 0, 1.0)->read(0, 1, &first, 1, &wanted);
    const std::int64_t near = std::abs(first) < kMost ? static_cast<std::int64_t>(first) : 0;
    if (near != 0) variable.open(0, near, 1.0)->read(0, 1, &rest, 1, &wanted);
    variable.first = near + static_cast<std::int64_t>(rest);
  }
  if (to.variables.size() >= kMostHdf5Objects)
    file->fail(0, "found more than {} variables", kMostHdf5Objects);
  to.variables.push_back(std::move(variable));
}

}  // namespace

bool recognises_hdf5(std::string_view head) {
  // Behind a header of the user's: MATLAB's has 512 bytes.
  for (std::size_t at = 0; at + kHdf5Signature.size() <= head.size(); at = at == 0 ? 512 : 2 * at) {
    if (head.substr(at, kHdf5Signature.size()) == kHdf5Signature) return true;
  }
  return false;
}

ArrayFile open_hdf5(SharedBytes bytes) {
  ArrayFile arrays;
  arrays.path = bytes->path();
  arrays.how_to_save = "save with save('NAME.mat', 'time', 'q', 'tau', '-v7.3')";
  std::array<char, 128> head{};
  const std::size_t count = bytes->read_some(0, head.data(), head.size());
  arrays.format =
      std::string_view(head.data(), count).starts_with("MATLAB") ? "MATLAB (version 7.3)" : "HDF5";
  const auto file = std::make_shared<const Hdf5File>(std::move(bytes));
  const std::vector<Hdf5Message> root = file->messages_of(file->root());
  if (!Hdf5File::is_group(root)) file->fail(file->root(), "found no table of what is in the file");
  for (const auto& [name, header] : file->objects_in(root)) {
    if (name.empty() || name[0] == '#') continue;  // MATLAB's own
    const std::vector<Hdf5Message> messages = file->messages_of(header);
    if (!Hdf5File::is_group(messages)) {
      add_set(file, name, messages, arrays);
      continue;
    }
    for (const auto& [field, field_header] : file->objects_in(messages)) {
      const std::vector<Hdf5Message> of_field = file->messages_of(field_header);
      if (!Hdf5File::is_group(of_field)) add_set(file, name + "." + field, of_field, arrays);
    }
  }
  return arrays;
}

}  // namespace heft::data

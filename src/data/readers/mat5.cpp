/// @file
/// MATLAB's files of version 5 (save -v6, -v7; MathWorks, "MAT-File Format", 2022): elements `type:uint32, bytes:uint32,
/// content`, those of matrices in turn elements for flags, lengths, name and numbers, column by column; compressed by zlib one
/// variable at a time. Structs are looked into one level deep.
#include <algorithm>
#include <array>

#include "arrays.hpp"

namespace heft::data {
namespace {

constexpr std::uint64_t kMatHead = 128;

/// Types of elements.
enum MatType : std::uint32_t {
  kMatInt8 = 1,
  kMatInt32 = 5,
  kMatUint32 = 6,
  kMatMatrix = 14,
  kMatCompressed = 15
};

/// Classes of arrays.
enum MatClass : unsigned char {
  kMatCell = 1,
  kMatStruct = 2,
  kMatChar = 4,
  kMatSparse = 5,
  kMatDouble = 6,
  kMatUint64 = 15
};

/// More fields than any struct of measurements has.
constexpr std::uint64_t kMostFields = 10000;

struct MatTag {
  std::uint32_t type{0};
  std::uint64_t bytes{0};
  std::array<char, 4> small{};  ///< the content where it is in the tag
  bool is_small{false};
};

/// Elements from front to back, of a file or of what is decompressed.
class MatElements {
 public:
  MatElements(const InputBytes& file, std::uint64_t at, std::unique_ptr<ByteStream> stream, bool swapped)
      : file_(file), at_(at), stream_(std::move(stream)), swapped_(swapped) {}

  std::uint64_t position() const { return position_; }
  MatTag tag() {
    std::array<char, 8> head{};
    read(head.data(), head.size());
    MatTag tag;
    tag.type = number_at<std::uint32_t>(head.data(), swapped_);
    tag.bytes = number_at<std::uint32_t>(head.data() + 4, swapped_);
    if ((tag.type >> 16) != 0) {
      tag.is_small = true;
      tag.bytes = tag.type >> 16;
      tag.type &= 0xFFFF;
      std::copy(head.begin() + 4, head.end(), tag.small.begin());
      if (tag.bytes > 4) fail("found a short element of {} bytes; expected at most 4", tag.bytes);
    }
    return tag;
  }
  /// The content of a short list, with what follows it up to a multiple of eight bytes.
  std::string content(std::uint32_t type, std::uint64_t most, std::string_view what) {
    const MatTag tag = this->tag();
    if (tag.type != type || tag.bytes > most) {
      fail("found an element of type {} with {} bytes; expected {} (type {}, at most {} bytes)", tag.type,
           tag.bytes, what, type, most);
    }
    if (tag.is_small) return {tag.small.data(), static_cast<std::size_t>(tag.bytes)};
    std::string bytes(static_cast<std::size_t>(tag.bytes), '\0');
    read(bytes.data(), bytes.size());
    skip((8 - tag.bytes % 8) % 8);
    return bytes;
  }
  void read(char* to, std::size_t count) {
    stream_->read(to, count);
    position_ += count;
  }
  void skip(std::uint64_t count) {
    stream_->skip(count);
    position_ += count;
  }
  template <typename... Args>
  [[noreturn]] void fail(fmt::format_string<Args...> format, Args&&... args) const {
    file_.fail(at_, "{}; the file is damaged", fmt::format(format, std::forward<Args>(args)...));
  }
  bool swapped() const { return swapped_; }

 private:
  const InputBytes& file_;
  std::uint64_t at_;
  std::unique_ptr<ByteStream> stream_;
  bool swapped_;
  std::uint64_t position_{0};
};

struct MatHead {
  unsigned char kind{0};  ///< MatClass
  bool complex{false};
  std::vector<std::uint64_t> shape;
  std::string name;
};

MatHead read_head(MatElements& elements) {
  MatHead head;
  const std::string flags = elements.content(kMatUint32, 8, "flags");
  if (flags.size() != 8) elements.fail("found {} bytes of flags; expected 8", flags.size());
  const std::uint32_t bits = number_at<std::uint32_t>(flags.data(), elements.swapped());
  head.kind = static_cast<unsigned char>(bits & 0xFF);
  head.complex = (bits & 0x0800) != 0;
  const std::string lengths = elements.content(kMatInt32, 4 * 32, "lengths");
  for (std::size_t i = 0; i + 4 <= lengths.size(); i += 4) {
    const std::int32_t length = number_at<std::int32_t>(lengths.data() + i, elements.swapped());
    if (length < 0) elements.fail("found the length {}; expected 0 or more", length);
    head.shape.push_back(static_cast<std::uint64_t>(length));
  }
  head.name = elements.content(kMatInt8, 4096, "a name");
  return head;
}

std::string_view why_not(const MatHead& head) {
  if (head.kind == kMatCell) return "a cell array";
  if (head.kind == kMatStruct) return "a struct";
  if (head.kind == kMatChar) return "text";
  if (head.kind == kMatSparse) return "a sparse matrix";
  if (head.kind < kMatDouble || head.kind > kMatUint64) return "an object";
  return head.complex ? "complex numbers" : "";
}

bool number_type(std::uint32_t type, NumberType& number) {
  switch (type) {
    case 1: number = {NumberType::kSigned, 1}; return true;
    case 2: number = {NumberType::kUnsigned, 1}; return true;
    case 3: number = {NumberType::kSigned, 2}; return true;
    case 4: number = {NumberType::kUnsigned, 2}; return true;
    case 5: number = {NumberType::kSigned, 4}; return true;
    case 6: number = {NumberType::kUnsigned, 4}; return true;
    case 7: number = {NumberType::kFloat, 4}; return true;
    case 9: number = {NumberType::kFloat, 8}; return true;
    case 12: number = {NumberType::kSigned, 8}; return true;
    case 13: number = {NumberType::kUnsigned, 8}; return true;
    default: return false;
  }
}

/// The variable whose numbers come next. `bytes`: what the elements are read from.
ArrayVariable read_numbers(MatElements& elements, const MatHead& head, const std::string& name,
                           const std::shared_ptr<ArrayBytes>& bytes) {
  ArrayVariable variable;
  variable.name = name;
  variable.shape = squeezed(head.shape);
  variable.unusable = why_not(head);
  if (!variable.unusable.empty()) return variable;
  const MatTag tag = elements.tag();
  StreamedArray array;
  const std::optional<std::uint64_t> count = count_of(head.shape);
  if (!number_type(tag.type, array.type) || !count || *count != tag.bytes / array.type.size ||
      tag.bytes % array.type.size != 0) {
    elements.fail(
        "variable '{}': found {} bytes of numbers of type {}; expected as many as its lengths state", name,
        tag.bytes, tag.type);
  }
  array.type.swapped = elements.swapped();
  array.bytes = bytes;
  array.offset = elements.position() - (tag.is_small ? 4 : 0);
  if (array.type.kind != NumberType::kFloat && array.type.size == 8 && *count > 0) {
    variable.first = first_integer(*bytes, array.offset, array.type);
  }
  variable.open = [array, shape = variable.shape](int axis, std::int64_t base, double divisor) {
    return streamed_values(array, shape, axis, axis == 1, base, divisor);
  };
  return variable;
}

/// The fields of a struct, where it is one and not a list of them.
void read_struct(MatElements& elements, const MatHead& head, const std::shared_ptr<ArrayBytes>& bytes,
                 ArrayFile& to) {
  if (count_of(head.shape) != 1) {
    ArrayVariable variable;
    variable.name = head.name;
    variable.unusable = "a list of structs";
    to.variables.push_back(std::move(variable));
    return;
  }
  const std::string length_bytes = elements.content(kMatInt32, 4, "the length of names");
  const std::int32_t length =
      length_bytes.size() == 4 ? number_at<std::int32_t>(length_bytes.data(), elements.swapped()) : 0;
  if (length < 1 || length > 4096) elements.fail("found names of {} bytes; expected 1 to 4096", length);
  const std::uint64_t width = static_cast<std::uint64_t>(length);
  const std::string names = elements.content(kMatInt8, kMostFields * width, "names of fields");
  for (std::size_t i = 0; i + width <= names.size(); i += width) {
    std::string field = names.substr(i, width);
    field = field.substr(0, field.find('\0'));
    const MatTag tag = elements.tag();
    if (tag.type != kMatMatrix)
      elements.fail("field '{}': found type {}; expected a matrix", field, tag.type);
    if (tag.bytes == 0) continue;  // an empty one
    const std::uint64_t end = elements.position() + tag.bytes;
    const MatHead inner = read_head(elements);
    ArrayVariable variable = read_numbers(elements, inner, head.name + "." + field, bytes);
    if (inner.kind == kMatStruct) variable.unusable = "a struct inside a struct";
    to.variables.push_back(std::move(variable));
    if (end < elements.position())
      elements.fail("field '{}': found more than its {} bytes", field, tag.bytes);
    elements.skip(end - elements.position());
  }
}

void read_variable(MatElements& elements, const std::shared_ptr<ArrayBytes>& bytes, ArrayFile& to) {
  const MatHead head = read_head(elements);
  if (head.kind == kMatStruct) {
    read_struct(elements, head, bytes, to);
  } else if (!head.name.empty()) {  // without a name it is MATLAB's own
    to.variables.push_back(read_numbers(elements, head, head.name, bytes));
  }
}

}  // namespace

bool recognises_mat5(std::string_view head) {
  if (head.size() < kMatHead) return false;
  const std::string_view end = head.substr(124, 4);
  return end == std::string_view("\0\1IM", 4) || end == std::string_view("\1\0MI", 4);
}

ArrayFile open_mat5(SharedBytes file) {
  constexpr std::size_t kMostVariables = 10000;
  ArrayFile arrays;
  arrays.path = file->path();
  arrays.format = "MATLAB (version 5)";
  arrays.how_to_save = "save with save('NAME.mat', 'time', 'q', 'tau')";
  std::array<char, 2> order{};
  file->read(126, order.data(), order.size());
  const bool swapped = order[0] == 'M';
  for (std::uint64_t at = kMatHead; at < file->size();) {
    MatElements outer(*file, at, plain_stream(file, at, file->size() - at), swapped);
    const MatTag tag = outer.tag();
    const std::uint64_t begin = at + 8;
    if (tag.is_small || !file->has(begin, tag.bytes)) {
      file->fail(at, "found a variable of {} bytes, more than the file has; the file was cut or is damaged",
                 tag.bytes);
    }
    if (arrays.variables.size() > kMostVariables) {
      file->fail(at, "found more than {} variables; expected a log; save the variables that are the log",
                 kMostVariables);
    }
    if (tag.type == kMatCompressed) {
      const auto bytes = std::make_shared<ArrayBytes>(file, begin, tag.bytes, ArrayBytes::kZlib);
      MatElements inner(*file, at, bytes->open_at(0), swapped);
      const MatTag matrix = inner.tag();
      if (matrix.type != kMatMatrix) inner.fail("found type {} compressed; expected a matrix", matrix.type);
      read_variable(inner, bytes, arrays);
    } else if (tag.type == kMatMatrix) {
      const auto bytes = std::make_shared<ArrayBytes>(file, begin, tag.bytes, ArrayBytes::kPlain);
      MatElements inner(*file, at, bytes->open_at(0), swapped);
      read_variable(inner, bytes, arrays);
    }
    at = begin + tag.bytes;
    // Uncompressed elements are filled up to a multiple of eight bytes.
    if (tag.type != kMatCompressed) at += (8 - tag.bytes % 8) % 8;
  }
  return arrays;
}

}  // namespace heft::data

/// @file
/// NumPy's arrays: `.npy` (a line of Python that states type, order and shape, then the numbers; numpy.lib.format, versions
/// 1 to 3) alone with named fields, or several of them in a zip file (`.npz`; PKWARE's APPNOTE 6.3.10, with zip64), stored or
/// deflated.
#include <algorithm>
#include <array>
#include <charconv>

#include "arrays.hpp"

namespace heft::data {
namespace {

constexpr std::string_view kNpyMagic = "\x93NUMPY";

/// Longest header taken [bytes]: NumPy refuses more than 10 000 itself.
constexpr std::uint64_t kLongestNpyHeader = std::uint64_t{1} << 16;

/// Most files in a zip file.
constexpr std::uint64_t kMostMembers = 20000;

/// A field of a structured array, or the array itself (name "").
struct NpyField {
  std::string name;
  std::string type;  ///< "<f8"
  std::vector<std::uint64_t> shape;
};

struct NpyHeader {
  std::vector<NpyField> fields;
  bool structured{false};
  bool columns_first{false};  ///< Fortran's order
  std::vector<std::uint64_t> shape;
  std::uint64_t begin{0};  ///< of the numbers
};

/// Python literals as NumPy writes them: strings, numbers, tuples, True and False. No nesting beyond that of the header.
class NpyText {
 public:
  explicit NpyText(std::string_view text) : text_(text) {}
  bool take(char c) {
    skip_blanks();
    if (at_ >= text_.size() || text_[at_] != c) return false;
    ++at_;
    return true;
  }
  bool word(std::string_view word) {
    skip_blanks();
    if (!text_.substr(at_).starts_with(word)) return false;
    at_ += word.size();
    return true;
  }
  bool string(std::string& value) {
    skip_blanks();
    if (at_ >= text_.size() || (text_[at_] != '\'' && text_[at_] != '"')) return false;
    const std::size_t end = text_.find(text_[at_], at_ + 1);
    if (end == std::string_view::npos) return false;
    value = text_.substr(at_ + 1, end - at_ - 1);
    at_ = end + 1;
    return true;
  }
  bool number(std::uint64_t& value) {
    skip_blanks();
    const char* const begin = text_.data() + at_;
    const auto [end, error] = std::from_chars(begin, text_.data() + text_.size(), value);
    if (error != std::errc()) return false;
    at_ += static_cast<std::size_t>(end - begin);
    take('L');  // Python 2
    return true;
  }
  /// "(3, 4)", "(3,)", "()"
  bool tuple(std::vector<std::uint64_t>& values) {
    values.clear();
    if (!take('(')) return false;
    while (!take(')')) {
      std::uint64_t value = 0;
      if (!number(value) || values.size() > 32) return false;
      values.push_back(value);
      if (!take(',')) return take(')');
    }
    return true;
  }

 private:
  void skip_blanks() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\n' || text_[at_] == '\t')) ++at_;
  }
  std::string_view text_;
  std::size_t at_{0};
};

/// "[('time', '<f8'), ('q', '<f8', (6,))]"
bool read_fields(NpyText& text, std::vector<NpyField>& fields) {
  while (!text.take(']')) {
    NpyField field;
    if (!text.take('(')) return false;
    if (text.take('(')) {  // a title before the name
      std::string title;
      if (!text.string(title) || !text.take(',') || !text.string(field.name) || !text.take(')')) return false;
    } else if (!text.string(field.name)) {
      return false;
    }
    if (!text.take(',') || !text.string(field.type)) return false;
    if (text.take(',')) {
      std::uint64_t length = 0;
      if (text.number(length)) {
        field.shape = {length};
      } else if (!text.tuple(field.shape)) {
        return false;
      }
    }
    if (!text.take(')')) return false;
    fields.push_back(std::move(field));
    if (!text.take(',')) return text.take(']');
  }
  return true;
}

bool parse_header(std::string_view line, NpyHeader& header) {
  NpyText text(line);
  if (!text.take('{')) return false;
  bool has_type = false, has_order = false, has_shape = false;
  while (!text.take('}')) {
    std::string key;
    if (!text.string(key) || !text.take(':')) return false;
    if (key == "descr") {
      header.structured = text.take('[');
      NpyField alone;
      if (header.structured ? !read_fields(text, header.fields) : !text.string(alone.type)) return false;
      if (!header.structured) header.fields.push_back(alone);
      has_type = true;
    } else if (key == "fortran_order") {
      header.columns_first = text.word("True");
      if (!header.columns_first && !text.word("False")) return false;
      has_order = true;
    } else if (key == "shape") {
      if (!text.tuple(header.shape)) return false;
      has_shape = true;
    } else {
      return false;
    }
    if (!text.take(',')) {
      if (!text.take('}')) return false;
      break;
    }
  }
  return has_type && has_order && has_shape;
}

/// Reads the header at the front of a stream. `at` is for messages.
NpyHeader read_header(const InputBytes& file, std::uint64_t at, ByteStream& stream) {
  std::array<char, 12> head{};
  stream.read(head.data(), 10);
  if (std::string_view(head.data(), kNpyMagic.size()) != kNpyMagic) {
    file.fail(
        at,
        "found no array of NumPy; expected '\\x93NUMPY' in front; save it with numpy.save or numpy.savez");
  }
  const int version = head[6];
  if (version < 1 || version > 3) {
    file.fail(at,
              "found version {} of NumPy's format; expected 1 to 3; save it with another version of NumPy",
              version);
  }
  std::uint64_t length = number_at<std::uint16_t>(head.data() + 8), before = 10;
  if (version > 1) {
    stream.read(head.data() + 10, 2);
    length = number_at<std::uint32_t>(head.data() + 8);
    before = 12;
  }
  if (length > kLongestNpyHeader) {
    file.fail(at, "found a header of {} bytes; expected at most {}; the file is damaged", length,
              kLongestNpyHeader);
  }
  std::string line(static_cast<std::size_t>(length), '\0');
  stream.read(line.data(), line.size());
  NpyHeader header;
  if (!parse_header(line, header)) {
    file.fail(
        at,
        "found a header that cannot be read ('{}'); expected NumPy's, with types of numbers side by side; "
        "save plain arrays",
        line.substr(0, 60));
  }
  header.begin = before + length;
  return header;
}

/// What "<f8" means. @return bytes of an element, 0 when that cannot be known
std::size_t read_type(const std::string& text, NumberType& type, std::string& unusable, double& per_second) {
  std::uint64_t size = 0;
  if (text.size() < 2) return 0;
  const bool has_order = text.find_first_of("<>|=") == 0;
  const char kind = has_order ? text[1] : text[0];
  const char* const digits = text.data() + (has_order ? 2 : 1);
  const auto [end, error] = std::from_chars(digits, text.data() + text.size(), size);
  if (kind == 'O') {
    unusable = "Python objects";
    return 8;
  }
  if (error != std::errc() || size > (std::uint64_t{1} << 31)) return 0;
  type.swapped = text[0] == '>';
  type.size = static_cast<std::size_t>(size);
  const std::string_view rest(end, static_cast<std::size_t>(text.data() + text.size() - end));
  switch (kind) {
    case 'f':
      type.kind = NumberType::kFloat;
      if (size != 4 && size != 8) unusable = fmt::format("numbers of {} bits", 8 * size);
      return type.size;
    case 'u': type.kind = NumberType::kUnsigned; break;
    case 'b': type.kind = NumberType::kUnsigned; break;
    case 'i': type.kind = NumberType::kSigned; break;
    case 'M':
    case 'm':
      type.kind = NumberType::kSigned;
      per_second = rest == "[ns]"   ? 1e9
                   : rest == "[us]" ? 1e6
                   : rest == "[ms]" ? 1e3
                   : rest == "[s]"  ? 1.0
                                    : 0.0;
      if (per_second == 0.0) unusable = "dates";
      break;
    case 'c': unusable = "complex numbers"; return type.size;
    case 'S': unusable = "text"; return type.size;
    case 'U': unusable = "text"; return 4 * type.size;
    default: unusable = "no numbers"; return type.size;
  }
  if (size != 1 && size != 2 && size != 4 && size != 8) return 0;
  return type.size;
}

/// Adds the variables of one array: itself, or its fields.
void add_variables(const InputBytes& file, std::uint64_t at, const std::string& name, const NpyHeader& header,
                   const std::shared_ptr<ArrayBytes>& bytes, std::optional<std::uint64_t> length,
                   ArrayFile& to) {
  struct Item {
    ArrayVariable variable;
    StreamedArray array;
    std::vector<std::uint64_t> shape;
  };
  std::vector<Item> items;
  std::uint64_t record = 0;  // bytes of an element with all fields
  for (const NpyField& field : header.fields) {
    Item item;
    item.variable.name = name.empty() ? field.name : field.name.empty() ? name : name + "." + field.name;
    const std::size_t size =
        read_type(field.type, item.array.type, item.variable.unusable, item.variable.per_second);
    const std::optional<std::uint64_t> count = count_of(field.shape);
    if (size == 0 || !count || *count > (std::uint64_t{1} << 40) / size) {
      file.fail(at, "array '{}': found the type '{}'; expected numbers such as '<f8'; save it as float64",
                name, field.type.substr(0, 40));
    }
    item.array.offset = header.begin + record;
    item.array.bytes = bytes;
    record += *count * size;
    item.shape = header.shape;
    item.shape.insert(item.shape.end(), field.shape.begin(), field.shape.end());
    items.push_back(std::move(item));
  }
  const std::optional<std::uint64_t> count = count_of(header.shape);
  std::uint64_t all = 0;
  if (!count || __builtin_mul_overflow(*count, record, &all) || (length && all > *length - header.begin)) {
    file.fail(
        at,
        "array '{}': found a shape of more numbers than the file has; expected at most {} bytes; the file is "
        "damaged or was cut",
        name, length ? *length - header.begin : 0);
  }
  for (Item& item : items) {
    ArrayVariable& variable = item.variable;
    variable.shape = squeezed(item.shape);
    const bool nested = header.structured && (header.shape.size() != 1 || variable.shape.size() > 2);
    if (nested && variable.unusable.empty()) variable.unusable = "records in more than one row";
    const NumberType type = item.array.type;
    if (variable.unusable.empty() && type.kind != NumberType::kFloat && type.size == 8 && all > 0) {
      variable.first = first_integer(*bytes, item.array.offset, type);
    }
    const bool columns_first = header.columns_first && !header.structured;
    if (header.structured) item.array.row_bytes = record;
    variable.open = [array = item.array, shape = variable.shape, columns_first](int axis, std::int64_t base,
                                                                                double divisor) {
      return streamed_values(array, shape, axis, (axis == 0) != columns_first, base, divisor);
    };
    to.variables.push_back(std::move(variable));
  }
}

// --- zip ---

struct ZipMember {
  std::string name;
  std::uint64_t stored{0}, size{0}, header{0};
  std::uint16_t method{0}, flags{0};
};

struct ZipDirectory {
  std::uint64_t at{0}, size{0}, count{0};
};

ZipDirectory find_directory(const InputBytes& file) {
  constexpr std::size_t kEnd = 22, kLongestComment = 65535;
  const std::size_t length =
      static_cast<std::size_t>(std::min<std::uint64_t>(file.size(), kEnd + kLongestComment));
  std::vector<char> tail(length);
  const std::uint64_t begin = file.size() - length;
  file.read(begin, tail.data(), tail.size());
  const std::size_t found = std::string_view(tail.data(), tail.size()).rfind(std::string_view("PK\5\6", 4));
  if (found == std::string_view::npos || tail.size() - found < kEnd) {
    file.fail(file.size(),
              "found no list of files at the end; expected that of a zip file (npz); it was cut");
  }
  const char* const end = tail.data() + found;
  ZipDirectory directory;
  directory.count = number_at<std::uint16_t>(end + 10);
  directory.size = number_at<std::uint32_t>(end + 12);
  directory.at = number_at<std::uint32_t>(end + 16);
  constexpr std::size_t kLocator = 20, kEnd64 = 56;
  if (found >= kLocator && std::string_view(end - kLocator, 4) == std::string_view("PK\6\7", 4)) {
    const std::uint64_t at = number_at<std::uint64_t>(end - kLocator + 8);
    std::array<char, kEnd64> end64{};
    file.read(at, end64.data(), end64.size());
    if (std::string_view(end64.data(), 4) != std::string_view("PK\6\6", 4)) {
      file.fail(at, "found no end of a zip64 list of files; the file is damaged");
    }
    directory.count = number_at<std::uint64_t>(end64.data() + 32);
    directory.size = number_at<std::uint64_t>(end64.data() + 40);
    directory.at = number_at<std::uint64_t>(end64.data() + 48);
  }
  if (!file.has(directory.at, directory.size) || directory.count > kMostMembers) {
    file.fail(begin + found,
              "found a list of {} files at byte {}; expected it inside the file; it is damaged",
              directory.count, directory.at);
  }
  return directory;
}

/// Sizes that did not fit into 32 bits are in an extra field, in this order.
void read_zip64(std::string_view extra, ZipMember& member) {
  constexpr std::uint32_t kElsewhere = 0xFFFFFFFF;
  while (extra.size() >= 4) {
    const std::uint16_t id = number_at<std::uint16_t>(extra.data());
    const std::size_t length = number_at<std::uint16_t>(extra.data() + 2);
    if (length > extra.size() - 4) return;
    std::string_view field = extra.substr(4, length);
    extra.remove_prefix(4 + length);
    if (id != 1) continue;
    for (std::uint64_t* value : {&member.size, &member.stored, &member.header}) {
      if (*value != kElsewhere || field.size() < 8) continue;
      *value = number_at<std::uint64_t>(field.data());
      field.remove_prefix(8);
    }
  }
}

std::vector<ZipMember> read_members(const InputBytes& file) {
  constexpr std::size_t kEntry = 46;
  const ZipDirectory directory = find_directory(file);
  std::vector<char> bytes(static_cast<std::size_t>(directory.size));
  file.read(directory.at, bytes.data(), bytes.size());
  std::vector<ZipMember> members;
  std::size_t at = 0;
  for (std::uint64_t i = 0; i < directory.count; ++i) {
    const std::size_t left = bytes.size() - at;
    const char* const entry = bytes.data() + at;
    std::size_t name = 0, extra = 0, comment = 0;
    if (left >= kEntry && std::string_view(entry, 4) == std::string_view("PK\1\2", 4)) {
      name = number_at<std::uint16_t>(entry + 28);
      extra = number_at<std::uint16_t>(entry + 30);
      comment = number_at<std::uint16_t>(entry + 32);
    }
    if (name == 0 || name + extra + comment > left - kEntry) {
      file.fail(directory.at + at,
                "found {} bytes left for file {} of {} in the list; expected a name; the file is "
                "damaged",
                left, i + 1, directory.count);
    }
    ZipMember member;
    member.flags = number_at<std::uint16_t>(entry + 8);
    member.method = number_at<std::uint16_t>(entry + 10);
    member.stored = number_at<std::uint32_t>(entry + 20);
    member.size = number_at<std::uint32_t>(entry + 24);
    member.header = number_at<std::uint32_t>(entry + 42);
    member.name = std::string(entry + kEntry, name);
    read_zip64({entry + kEntry + name, extra}, member);
    members.push_back(std::move(member));
    at += kEntry + name + extra + comment;
  }
  return members;
}

void add_member(const SharedBytes& file, const ZipMember& member, ArrayFile& to) {
  constexpr std::size_t kLocal = 30;
  constexpr std::uint16_t kEncrypted = 1;
  if (!member.name.ends_with(".npy")) return;
  const std::string name = member.name.substr(0, member.name.size() - 4);
  std::array<char, kLocal> local{};
  file->read(member.header, local.data(), local.size());
  if (std::string_view(local.data(), 4) != std::string_view("PK\3\4", 4)) {
    file->fail(member.header, "found no file of a zip here; expected '{}'; the file is damaged", member.name);
  }
  if ((member.flags & kEncrypted) != 0 || (member.method != 0 && member.method != 8)) {
    file->fail(member.header,
               "array '{}': found {}; expected it stored or deflated; save it with numpy.savez", name,
               (member.flags & kEncrypted) != 0 ? std::string("a password")
                                                : fmt::format("compression {}", member.method));
  }
  const std::uint64_t begin = member.header + kLocal + number_at<std::uint16_t>(local.data() + 26) +
                              number_at<std::uint16_t>(local.data() + 28);
  const auto kind = member.method == 0 ? ArrayBytes::kPlain : ArrayBytes::kDeflate;
  const auto bytes = std::make_shared<ArrayBytes>(file, begin, member.stored, kind);
  const std::unique_ptr<ByteStream> stream = bytes->open_at(0);
  const NpyHeader header = read_header(*file, begin, *stream);
  const std::uint64_t length = member.method == 0 ? member.stored : member.size;
  add_variables(*file, begin, name, header, bytes, std::max(length, header.begin), to);
}

}  // namespace

bool recognises_npy(std::string_view head) { return head.starts_with(kNpyMagic); }
bool recognises_npz(std::string_view head) { return head.starts_with(std::string_view("PK\3\4", 4)); }

ArrayFile open_numpy(SharedBytes file) {
  ArrayFile arrays;
  arrays.path = file->path();
  arrays.how_to_save = "save with numpy.savez(NAME, time=t, q=q, tau=tau)";
  std::array<char, 6> head{};
  const std::size_t count = file->read_some(0, head.data(), head.size());
  if (recognises_npy({head.data(), count})) {
    arrays.format = "NumPy npy";
    const auto bytes = std::make_shared<ArrayBytes>(file, 0, file->size(), ArrayBytes::kPlain);
    const std::unique_ptr<ByteStream> stream = bytes->open_at(0);
    const NpyHeader header = read_header(*file, 0, *stream);
    add_variables(*file, 0, header.structured ? "" : "unnamed", header, bytes, file->size(), arrays);
    return arrays;
  }
  arrays.format = "NumPy npz";
  for (const ZipMember& member : read_members(*file)) add_member(file, member, arrays);
  return arrays;
}

}  // namespace heft::data

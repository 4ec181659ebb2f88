#include "text_layout.hpp"

#include <cstdlib>

#include <sys/ioctl.h>
#include <unistd.h>

namespace heft::tools {
namespace {

constexpr int kNarrowest = 40;

/// Columns that a text takes: bytes that begin a letter of UTF-8.
int columns_of(std::string_view text) {
  int count = 0;
  for (const char c : text) count += (static_cast<unsigned char>(c) & 0xC0) != 0x80 ? 1 : 0;
  return count;
}

struct Gaps {
  std::size_t indent{0};  ///< spaces in front
  std::size_t second{0};  ///< where the text behind the first wide gap begins; 0: there is none
  int count{0};           ///< wide gaps
};

Gaps gaps_of(std::string_view line) {
  Gaps gaps;
  while (gaps.indent < line.size() && line[gaps.indent] == ' ') ++gaps.indent;
  for (std::size_t at = gaps.indent; at + 1 < line.size(); ++at) {
    if (line[at] != ' ' || line[at + 1] != ' ') continue;
    while (at < line.size() && line[at] == ' ') ++at;
    if (++gaps.count == 1) gaps.second = at;
  }
  return gaps;
}

bool is_command(std::string_view line) {
  while (!line.empty() && line.front() == ' ') line.remove_prefix(1);
  return line.substr(0, 5) == "heft " || line.substr(0, 14) == "Example: heft ";
}

void add_wrapped(std::string_view line, int width, bool tables_too, std::string& out) {
  const Gaps gaps = gaps_of(line);
  if (columns_of(line) <= width || (gaps.count > 1 && !tables_too)) {
    out += line;
    return;
  }
  const bool command = is_command(line);
  std::size_t hang = gaps.indent + (command ? 4 : 0);
  if (gaps.count >= 1 && static_cast<int>(gaps.second) <= width / 3) hang = gaps.second;
  const int room = width - (command ? 2 : 0);
  std::size_t from = 0;
  std::string indent;
  while (columns_of(line.substr(from)) + static_cast<int>(indent.size()) > width) {
    // The last space that leaves the line short enough; else the first one there is.
    std::size_t cut = std::string_view::npos;
    int column = static_cast<int>(indent.size());
    for (std::size_t at = from; at < line.size(); ++at) {
      if (line[at] == ' ' && at > from && (from > 0 || at >= hang) && (at == 0 || line[at - 1] != ' ')) {
        if (column > room && cut != std::string_view::npos) break;
        cut = at;
        if (column > room) break;
      }
      column += columns_of(line.substr(at, 1));
    }
    if (cut == std::string_view::npos) break;
    out += indent;
    out += line.substr(from, cut - from);
    out += command ? " \\\n" : "\n";
    from = cut;
    while (from < line.size() && line[from] == ' ') ++from;
    indent = std::string(hang, ' ');
  }
  out += indent;
  out += line.substr(from);
}

template <typename Action>
void for_each_line(std::string_view text, const Action& action) {
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    action(text.substr(0, end), end != std::string_view::npos);
    if (end == std::string_view::npos) return;
    text.remove_prefix(end + 1);
  }
}

}  // namespace

int terminal_width(std::FILE* stream, int otherwise) {
  winsize size{};
  const int descriptor = ::fileno(stream);
  if (::isatty(descriptor) != 0 && ::ioctl(descriptor, TIOCGWINSZ, &size) == 0 && size.ws_col >= kNarrowest)
    return size.ws_col;
  const char* const columns = std::getenv("COLUMNS");
  const int asked = columns != nullptr ? std::atoi(columns) : 0;
  return asked >= kNarrowest ? asked : otherwise;
}

namespace {

std::string wrap(std::string_view text, int width, bool tables_too) {
  std::string out;
  for_each_line(text, [&](std::string_view line, bool ended) {
    add_wrapped(line, width, tables_too, out);
    if (ended) out += '\n';
  });
  return out;
}

}  // namespace

std::string wrapped(std::string_view text, int width) { return wrap(text, width, false); }

std::string reflowed(std::string_view text, int width) {
  constexpr int kFull = 60;  // a shorter line ended where it was meant to
  std::string joined;
  int before = 0;
  for_each_line(text, [&](std::string_view line, bool) {
    const bool prose = !line.empty() && line.front() != ' ' && !is_command(line);
    if (prose && before >= kFull) {
      joined += ' ';
    } else if (!joined.empty()) {
      joined += '\n';
    }
    joined += line;
    before = prose && line.back() != ':' ? columns_of(line) : 0;
  });
  return wrap(joined, width, true);
}

}  // namespace heft::tools

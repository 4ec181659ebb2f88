/// @file
/// A recording in several files: the folder that `ros2 bag record` makes, with metadata.yaml beside the bags, read one
/// after the other in the order of the numbers at the ends of their names. Also one file, by its content.
#include <algorithm>
#include <array>
#include <charconv>
#include <filesystem>

#include "bag.hpp"

namespace heft::data {
namespace {

namespace fs = std::filesystem;

/// A bag by its content; null where it is none.
std::unique_ptr<MessageSource> bag_in(SharedBytes file) {
  std::array<char, 16> head{};
  const std::string_view content(head.data(), file->read_some(0, head.data(), head.size()));
  if (recognises_mcap(content)) return open_mcap(std::move(file));
  if (recognises_sqlite(content)) return open_sqlite_bag(std::move(file));
  return nullptr;
}

std::unique_ptr<MessageSource> bag_in_any(const std::string& path) {
  auto file = std::make_shared<InputBytes>(path);
  std::array<char, 4> head{};
  const std::size_t count = file->read_some(0, head.data(), head.size());
  if (recognises_zstd({head.data(), count}))
    file = std::make_shared<InputBytes>(decompress_zstd(*file), path);
  std::unique_ptr<MessageSource> source = bag_in(file);
  if (!source) {
    file->fail(
        0,
        "found neither MCAP nor rosbag2's SQLite; expected a bag of ROS 2; take the file out of the folder");
  }
  return source;
}

/// The number at the end of a bag's name ("run_12.mcap"), 0 without.
long number_of(const fs::path& file) {
  std::string name = file.filename().string();
  name = name.substr(0, name.find('.', name.rfind('_') == std::string::npos ? 0 : name.rfind('_')));
  const std::size_t begin = name.find_last_not_of("0123456789") + 1;
  long number = 0;
  std::from_chars(name.data() + begin, name.data() + name.size(), number);
  return number;
}

std::vector<std::string> bags_of(const std::string& folder) {
  std::vector<fs::path> files;
  std::error_code ignored;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, ignored)) {
    const std::string name = entry.path().filename().string();
    const auto ends = [&](std::string_view end) { return name.ends_with(end); };
    if (ends(".mcap") || ends(".db3") || ends(".mcap.zstd") || ends(".db3.zstd"))
      files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end(), [](const fs::path& a, const fs::path& b) {
    return std::pair(number_of(a), a) < std::pair(number_of(b), b);
  });
  return {files.begin(), files.end()};
}

/// Bags one after the other, one of them open.
class BagFolder final : public MessageSource {
 public:
  explicit BagFolder(const std::string& path) : path_(path), files_(bags_of(path)) { open(0); }

  const std::string& path() const override { return path_; }
  std::string format() const override {
    return fmt::format("{} in {} files", source_->format(), files_.size());
  }
  std::vector<BagTopic> topics(bool) override {
    std::vector<BagTopic> all;
    for (std::size_t i = 0; i < files_.size(); ++i) {
      open(i);
      for (BagTopic& topic : source_->topics(true)) {
        const auto same =
            std::find_if(all.begin(), all.end(), [&](const BagTopic& t) { return t.name == topic.name; });
        if (same == all.end()) {
          all.push_back(std::move(topic));
        } else if (topic.messages > 0) {
          same->first = same->messages > 0 ? std::min(same->first, topic.first) : topic.first;
          same->last = same->messages > 0 ? std::max(same->last, topic.last) : topic.last;
          same->messages += topic.messages;
        }
      }
    }
    return all;
  }
  void choose(const std::string& topic) override {
    topic_ = topic;
    notes_.clear();
    open(0);
  }
  bool next(BagMessage& message) override {
    while (!source_->next(message)) {
      if (at_ + 1 == files_.size()) return false;
      add_notes(notes_);
      open(at_ + 1);
    }
    return true;
  }
  double part_read() const override {
    return (static_cast<double>(at_) + source_->part_read()) / static_cast<double>(files_.size());
  }
  std::vector<std::string> notes() const override {
    std::vector<std::string> all = notes_;
    add_notes(all);
    return all;
  }

 private:
  void add_notes(std::vector<std::string>& to) const {
    const std::string name = fs::path(files_[at_]).filename().string();
    for (const std::string& note : source_->notes()) to.push_back(fmt::format("{}: {}", name, note));
  }
  void open(std::size_t index) {
    at_ = index;
    source_ = bag_in_any(files_[index]);
    const std::vector<BagTopic> topics = source_->topics(false);  // which a bag without index reads first
    if (!topic_.empty()) source_->choose(topic_);
  }

  std::string path_;
  std::vector<std::string> files_;
  std::size_t at_{0};
  std::unique_ptr<MessageSource> source_;
  std::string topic_;
  std::vector<std::string> notes_;
};

}  // namespace

bool recognises_zstd(std::string_view head) { return head.starts_with("\x28\xB5\x2F\xFD"); }

bool is_bag_folder(const std::string& path) {
  std::error_code ignored;
  return fs::is_directory(path, ignored) && fs::exists(path + "/metadata.yaml", ignored) &&
         !bags_of(path).empty();
}

std::unique_ptr<MessageSource> open_bag(const std::string& path) {
  if (is_bag_folder(path)) return std::make_unique<BagFolder>(path);
  return bag_in_any(path);
}

}  // namespace heft::data

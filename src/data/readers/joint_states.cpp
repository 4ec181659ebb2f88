/// @file
/// sensor_msgs/JointState as CDR (OMG DDSI-RTPS 2.5, section 10; OMG CORBA 3.4, part 2, section 9.3): four bytes that
/// name the encoding, then `int32 sec, uint32 nanosec, string frame_id, string[] name, float64[] position, velocity,
/// effort`, each number aligned to its size. Joints are matched by name, message by message.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <memory>

#include <fmt/ranges.h>
#include <zstd.h>

#include "bag.hpp"

namespace heft::data {
namespace {

/// More joints than any robot has: what states more is damaged.
constexpr std::uint32_t kMostNames = 10000;

constexpr std::int64_t kNanoseconds = 1'000'000'000;

struct JointArray {
  const char* data{nullptr};
  std::uint32_t count{0};
};

/// Where a message has what.
struct JointStateView {
  std::int64_t stamp{0};   ///< [ns]
  std::string_view names;  ///< the bytes of the list of names, to compare lists
  std::uint32_t num_names{0};
  std::array<JointArray, 3> arrays;  ///< position, velocity, effort
  bool swapped{false};
  std::string_view problem;  ///< "" where it could be read

  double value(std::size_t array, std::uint32_t joint) const {
    return number_at<double>(arrays[array].data + 8 * std::size_t{joint}, swapped);
  }
};

class CdrFields {
 public:
  explicit CdrFields(std::string_view data) : data_(data) {
    if (data.size() < 4 || data[0] != 0 || (data[1] != 0 && data[1] != 1)) {
      problem = "no CDR";
      return;
    }
    swapped = data[1] == 0;
    data_.remove_prefix(4);
  }

  template <typename T>
  T number() {
    align(sizeof(T));
    const char* const at = take(sizeof(T));
    return at == nullptr ? T{} : number_at<T>(at, swapped);
  }
  /// The text of a string, which ends in a zero byte.
  std::string_view text() {
    const std::uint32_t count = number<std::uint32_t>();
    const char* const at = take(count);
    if (at == nullptr || count == 0) return {};
    return {at, count - (at[count - 1] == '\0' ? 1U : 0U)};
  }
  JointArray doubles() {
    const std::uint32_t count = number<std::uint32_t>();
    if (count > 0) align(8);
    return {take(8 * std::uint64_t{count}), count};
  }
  std::size_t used() const { return used_; }
  std::string_view since(std::size_t begin) const { return data_.substr(begin, used_ - begin); }

  std::string_view problem;
  bool swapped{false};

 private:
  void align(std::size_t size) { take((size - used_ % size) % size); }
  const char* take(std::uint64_t count) {
    if (!problem.empty()) return nullptr;
    if (count > data_.size() - used_) {
      problem = "a message that ends too early";
      return nullptr;
    }
    const char* const at = data_.data() + used_;
    used_ += static_cast<std::size_t>(count);
    return at;
  }

  std::string_view data_;
  std::size_t used_{0};
};

JointStateView view_of(std::string_view data) {
  JointStateView view;
  CdrFields fields(data);
  const std::int64_t seconds = fields.number<std::int32_t>();
  view.stamp = seconds * kNanoseconds + fields.number<std::uint32_t>();
  fields.text();  // the frame
  view.num_names = fields.number<std::uint32_t>();
  const std::size_t begin = fields.used();
  if (view.num_names > kMostNames) fields.problem = "more than 10000 joints";
  for (std::uint32_t i = 0; i < view.num_names && fields.problem.empty(); ++i) fields.text();
  view.names = fields.since(begin);
  for (JointArray& array : view.arrays) array = fields.doubles();
  view.swapped = fields.swapped;
  view.problem = fields.problem;
  for (const JointArray& array : view.arrays) {
    if (array.count > kMostNames && view.problem.empty()) view.problem = "more than 10000 joints";
  }
  return view;
}

/// The names of a message that could be read.
std::vector<std::string> names_in(std::string_view data) {
  CdrFields fields(data);
  fields.number<std::int32_t>();
  fields.number<std::uint32_t>();
  fields.text();
  std::vector<std::string> names(fields.number<std::uint32_t>());
  for (std::string& name : names) name = fields.text();
  return names;
}

struct JointChannel {
  std::string_view field, prefix;  ///< in the message; in heft's words
};
constexpr std::array<JointChannel, 3> kJointChannels{
    {{"position", "q"}, {"velocity", "qd"}, {"effort", "tau"}}};

class JointStateReader final : public LogReader {
 public:
  JointStateReader(std::unique_ptr<MessageSource> source, const ReadAs& as)
      : source_(std::move(source)), as_(as) {
    choose_topic();
    look_at_first_messages();
    choose_channels();
    name_columns();
    source_->choose(topic_);
    number_ = 0;
    left_out_ = 0;
  }

  std::string format() const override { return source_->format() + ", topic " + topic_; }
  const std::vector<LogColumn>& columns() const override { return columns_; }
  void want_only(const std::vector<std::size_t>& columns) override {
    std::fill(wanted_.begin(), wanted_.end(), false);
    for (const std::size_t c : columns) wanted_[c] = true;
  }
  bool next(double* values) override;
  std::string place() const override {
    return fmt::format("{}: message {} of {}", source_->path(), number_, topic_);
  }
  double part_read() const override { return source_->part_read(); }
  std::vector<std::string> notes() const override;

 private:
  template <typename... Args>
  [[noreturn]] void fail(fmt::format_string<Args...> format, Args&&... args) const {
    throw DataError(fmt::format("{}: {}", place(), fmt::format(format, std::forward<Args>(args)...)));
  }
  [[noreturn]] void refuse_topics(const std::vector<BagTopic>& topics, std::string_view found) const;
  void choose_topic();
  void look_at_first_messages();
  void choose_channels();
  void name_columns();
  bool next_message();
  bool next_of_robot(JointStateView& view);
  bool match(const JointStateView& view);
  bool match_names(const JointStateView& view);
  void check_lengths(const JointStateView& view) const;
  std::int64_t stamp_of(const JointStateView& view) const {
    return by_recorder_ ? message_.recorded : view.stamp;
  }

  std::unique_ptr<MessageSource> source_;
  ReadAs as_;
  std::string topic_;
  std::vector<std::string> joints_;  ///< read, in order; empty where messages do not name them
  std::uint32_t num_joints_{0};
  std::array<bool, 3> has_{};          ///< channels that the log has
  std::array<bool, 3> not_numbers_{};  ///< channels left out since they are NaN
  std::vector<std::string> others_;    ///< joints of messages that are left out
  std::vector<LogColumn> columns_;
  std::vector<bool> wanted_;
  bool by_recorder_{false};  ///< stamps are not set
  std::int64_t first_stamp_{0};

  BagMessage message_;
  std::string unpacked_;       ///< its data where they were compressed
  std::string matched_names_;  ///< bytes of the names for which `order_` holds
  std::uint32_t matched_count_{0};
  bool matched_{false}, matched_any_{false};
  std::vector<std::uint32_t> order_;  ///< joint read -> place in the message
  std::string last_;                  ///< the message read last
  std::uint64_t number_{0}, left_out_{0}, repeats_{0};
};

/// One line a topic, for messages.
std::string listed_topics(const std::vector<BagTopic>& topics) {
  constexpr std::size_t kMost = 20;
  std::string list;
  for (std::size_t i = 0; i < std::min(topics.size(), kMost); ++i) {
    const BagTopic& topic = topics[i];
    const double span = 1e-9 * (static_cast<double>(topic.last) - static_cast<double>(topic.first));
    list += fmt::format("{}{} ({}", list.empty() ? "" : ", ", topic.name.substr(0, 100),
                        topic.type.substr(0, 100));
    if (topic.messages > 0) list += fmt::format(", {} messages", topic.messages);
    if (topic.messages > 1 && span > 0.0) {
      list += fmt::format(", {:.4g} Hz", static_cast<double>(topic.messages - 1) / span);
    }
    list += ")";
  }
  if (topics.size() > kMost) list += fmt::format(", ... ({} in all)", topics.size());
  return list.empty() ? "no topic" : list;
}

void JointStateReader::refuse_topics(const std::vector<BagTopic>& topics, std::string_view found) const {
  throw DataError(fmt::format("{}: found {}: {}; expected one topic of sensor_msgs/msg/JointState; {}",
                              source_->path(), found, listed_topics(topics),
                              found == "several topics of joint states"
                                  ? "name it with --topic"
                                  : "record one, or name it with --topic"));
}

void JointStateReader::choose_topic() {
  std::vector<BagTopic> topics = source_->topics(false), states;
  const auto name_is = [&](const BagTopic& topic) {
    return topic.name == as_.topic || topic.name == "/" + as_.topic;
  };
  for (const BagTopic& topic : topics) {
    if (as_.topic.empty() ? topic.holds_joint_states() : name_is(topic)) states.push_back(topic);
  }
  if (states.size() > 1) {
    std::erase_if(states, [](const BagTopic& topic) { return topic.messages == 0; });
    if (states.size() > 1) refuse_topics(states, "several topics of joint states");
  }
  if (states.empty()) {
    refuse_topics(source_->topics(true), as_.topic.empty() ? std::string("no topic of joint states")
                                                           : "no topic '" + as_.topic + "'");
  }
  const BagTopic& topic = states.front();
  if (!topic.holds_joint_states()) refuse_topics(states, "a topic of another type");
  if (topic.encoding != "cdr") {
    throw DataError(
        fmt::format("{}: topic {}: found messages encoded as '{}'; expected 'cdr', as ROS 2 writes; "
                    "convert the recording with 'rosbags-convert'",
                    source_->path(), topic.name, topic.encoding.substr(0, 40)));
  }
  topic_ = topic.name;
  source_->choose(topic_);
}

/// Joints, and whether stamps are set: where the first two are 0, they are not.
void JointStateReader::look_at_first_messages() {
  JointStateView view;
  joints_ = as_.joint_names;
  if (joints_.empty()) {
    if (!next_message()) {
      throw DataError(
          fmt::format("{}: topic {} has no message that can be read; expected joint states; record it "
                      "again",
                      source_->path(), topic_));
    }
    view = view_of(message_.data);
    if (!view.problem.empty())
      fail("found {}; expected joint states in CDR; the file is damaged", view.problem);
    joints_ = names_in(message_.data);
    num_joints_ = joints_.empty()
                      ? std::max({view.arrays[0].count, view.arrays[1].count, view.arrays[2].count})
                      : static_cast<std::uint32_t>(joints_.size());
    for (std::size_t i = 0; i < joints_.size(); ++i) {
      if (std::find(joints_.begin(), joints_.begin() + static_cast<std::ptrdiff_t>(i), joints_[i]) !=
          joints_.begin() + static_cast<std::ptrdiff_t>(i)) {
        fail("found joint '{}' twice; expected each once; correct what publishes it", joints_[i]);
      }
    }
    if (num_joints_ == 0) fail("found no joint; expected their names and positions; record another topic");
    source_->choose(topic_);
    number_ = 0;
  } else {
    num_joints_ = static_cast<std::uint32_t>(joints_.size());
  }
  if (!next_of_robot(view)) {
    std::string shown;
    for (const std::string& name : others_) shown += (shown.empty() ? "'" : ", '") + name + "'";
    throw DataError(fmt::format(
        "{}: topic {}: found {}; expected messages with the robot's joints '{}'; name the "
        "right topic or robot, or convert the log first (heft log), which keeps the order of its joints",
        source_->path(), topic_, shown.empty() ? "no message" : "the joints " + shown,
        fmt::join(joints_, "', '")));
  }
}

void JointStateReader::choose_channels() {
  JointStateView view = view_of(message_.data);
  for (std::size_t k = 0; k < has_.size(); ++k) {
    has_[k] = view.arrays[k].count > 0;
    not_numbers_[k] = has_[k] && std::all_of(order_.begin(), order_.end(), [&](std::uint32_t joint) {
                        return std::isnan(view.value(k, joint));
                      });
    has_[k] = has_[k] && !not_numbers_[k];
  }
  first_stamp_ = view.stamp;
  const std::int64_t recorded = message_.recorded;
  if (view.stamp == 0 && next_of_robot(view) && view.stamp == 0) {
    by_recorder_ = true;
    first_stamp_ = recorded;
  }
}

void JointStateReader::name_columns() {
  std::vector<std::string> headers{"time"};
  columns_.push_back({"time", by_recorder_ ? "time of recording" : "header.stamp"});
  for (std::size_t k = 0; k < has_.size(); ++k) {
    for (std::uint32_t joint = 0; has_[k] && joint < num_joints_; ++joint) {
      headers.push_back(fmt::format("{}[{}]", kJointChannels[k].field, joint));
      const std::string of =
          joints_.empty() ? fmt::format("[{}]", joint) : fmt::format(" of '{}'", joints_[joint]);
      columns_.push_back({fmt::format("{}{}", kJointChannels[k].prefix, joint + 1),
                          fmt::format("{}{}", kJointChannels[k].field, of)});
    }
  }
  // The user may mean something else by a field (--map i=effort, where a driver gives currents).
  const std::vector<LogColumn> words = in_heft_words(headers, as_);
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    if (words[c].name == headers[c]) continue;
    columns_[c].name = words[c].name;
    columns_[c].factor = words[c].factor;
    columns_[c].shift = words[c].shift;
  }
  wanted_.assign(columns_.size(), true);
}

/// The next message of the topic, decompressed where rosbag2 was told to compress each. @return false at the end
bool JointStateReader::next_message() {
  constexpr std::uint64_t kLargestMessage = std::uint64_t{1} << 22;
  if (!source_->next(message_)) return false;
  ++number_;
  if (!recognises_zstd(message_.data)) return true;
  const std::uint64_t size = ZSTD_getFrameContentSize(message_.data.data(), message_.data.size());
  if (size > kLargestMessage)
    fail(
        "found a compressed message of unknown size or more than {} bytes; expected joint "
        "states; decompress the recording with 'ros2 bag convert'",
        kLargestMessage);
  unpacked_.resize(static_cast<std::size_t>(size));
  const std::size_t result =
      ZSTD_decompress(unpacked_.data(), unpacked_.size(), message_.data.data(), message_.data.size());
  if (ZSTD_isError(result) != 0 || result != unpacked_.size()) {
    fail("found a message that cannot be decompressed; expected zstd; the file is damaged");
  }
  message_.data = unpacked_;
  return true;
}

/// The next message that has the robot's joints. @return false at the end
bool JointStateReader::next_of_robot(JointStateView& view) {
  while (next_message()) {
    view = view_of(message_.data);
    if (!view.problem.empty())
      fail("found {}; expected joint states in CDR; the file is damaged", view.problem);
    if (match(view)) return true;
    ++left_out_;
  }
  return false;
}

/// Finds the joints in a message. @return false where none of them is in it
bool JointStateReader::match(const JointStateView& view) {
  if (!matched_any_ || view.num_names != matched_count_ || view.names != matched_names_) {
    matched_names_ = view.names;
    matched_count_ = view.num_names;
    matched_any_ = true;
    matched_ = match_names(view);
  }
  if (matched_) check_lengths(view);
  return matched_;
}

bool JointStateReader::match_names(const JointStateView& view) {
  const std::vector<std::string> names = names_in(message_.data);
  order_.clear();
  if (names.empty() && (joints_.empty() || as_.joint_names.size() == joints_.size())) {
    const std::uint32_t count = std::max({view.arrays[0].count, view.arrays[1].count, view.arrays[2].count});
    if (count != num_joints_) {
      fail("found {} joints without names; expected {}; have what publishes them name them", count,
           num_joints_);
    }
    for (std::uint32_t joint = 0; joint < num_joints_; ++joint) order_.push_back(joint);
    return true;
  }
  std::map<std::string_view, std::uint32_t> places;
  for (std::uint32_t i = 0; i < names.size(); ++i) {
    if (!places.emplace(names[i], i).second) {
      fail("found joint '{}' twice; expected each once; correct what publishes it", names[i]);
    }
  }
  const std::string* missing = nullptr;
  for (const std::string& joint : joints_) {
    const auto found = places.find(joint);
    if (found != places.end()) {
      order_.push_back(found->second);
    } else if (missing == nullptr) {
      missing = &joint;
    }
  }
  for (const std::string& name : names) {
    if (others_.size() < kMostNames && std::find(joints_.begin(), joints_.end(), name) == joints_.end() &&
        std::find(others_.begin(), others_.end(), name) == others_.end()) {
      others_.push_back(name);
    }
  }
  if (order_.empty()) return false;
  if (missing != nullptr) {
    fail(
        "joint '{}' is missing; found '{}'; expected every joint in one message; record a topic that has them all, or "
        "name the robot that has these joints",
        *missing, fmt::join(names, "', '"));
  }
  return true;
}

void JointStateReader::check_lengths(const JointStateView& view) const {
  const std::uint32_t count = view.num_names > 0 ? view.num_names : num_joints_;
  for (std::size_t k = 0; k < has_.size(); ++k) {
    const std::uint32_t found = view.arrays[k].count;
    const std::string_view field = kJointChannels[k].field;
    if (found != 0 && found != count) {
      fail(
          "found {} values of {} for {} joints; expected one a joint, or none in the whole log; correct what "
          "publishes them",
          found, field, count);
    }
    if (!columns_.empty() && found == 0 && has_[k]) {
      fail("found no {}; expected {} as in the first message; cut the recording before it", field, count);
    }
    if (!columns_.empty() && found != 0 && !has_[k] && !not_numbers_[k]) {
      fail("found {} values of {}; expected none as in the first message; cut the recording before it", found,
           field);
    }
  }
}

bool JointStateReader::next(double* values) {
  JointStateView view;
  for (;;) {
    if (!next_of_robot(view)) return false;
    if (message_.data != last_) break;
    ++repeats_;
  }
  last_.assign(message_.data);
  std::int64_t since = 0;
  if (__builtin_sub_overflow(stamp_of(view), first_stamp_, &since)) {
    fail("found the stamp {} ns, which is beyond any clock; the file is damaged", stamp_of(view));
  }
  // A whole number divided: as exact as the same time read from decimals.
  if (wanted_[0]) values[0] = static_cast<double>(since) / static_cast<double>(kNanoseconds);
  std::size_t column = 1;
  for (std::size_t k = 0; k < has_.size(); ++k) {
    if (!has_[k]) continue;
    for (const std::uint32_t joint : order_) {
      if (wanted_[column]) {
        values[column] = view.value(k, joint) * columns_[column].factor + columns_[column].shift;
      }
      ++column;
    }
  }
  return true;
}

std::vector<std::string> JointStateReader::notes() const {
  std::vector<std::string> notes = source_->notes();
  notes.push_back(
      fmt::format("time is counted from the first {}, {}.{:09} s",
                  by_recorder_ ? "message as recorded, since header.stamp is never set" : "header.stamp",
                  first_stamp_ / kNanoseconds, std::abs(first_stamp_ % kNanoseconds)));
  if (!others_.empty()) {
    notes.push_back(fmt::format("joints of {} that are left out: {}", topic_, fmt::join(others_, ", ")));
  }
  if (left_out_ > 0) {
    notes.push_back(
        fmt::format("{} messages of {} are left out, as they have none of the joints", left_out_, topic_));
  }
  if (repeats_ > 0) {
    notes.push_back(fmt::format("{} exact repeats of a message are left out", repeats_));
  }
  for (std::size_t k = 0; k < not_numbers_.size(); ++k) {
    if (!not_numbers_[k]) continue;
    notes.push_back(fmt::format("{} is left out: the first message of {} has 'nan' for every joint",
                                kJointChannels[k].field, topic_));
  }
  return notes;
}

}  // namespace

std::unique_ptr<LogReader> read_joint_states(std::unique_ptr<MessageSource> source, const ReadAs& as) {
  const std::string path = source->path();
  try {
    return std::make_unique<JointStateReader>(std::move(source), as);
  } catch (const DataError& error) {  // of what names of columns mean, which knows no file
    const std::string message = error.what();
    if (message.starts_with(path)) throw;
    throw DataError(path + ": " + message);
  }
}

}  // namespace heft::data

/// @file
/// Recordings of ROS 2: messages of a topic, whatever container they are in, and joint states read from them.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "../log_reader.hpp"
#include "input_bytes.hpp"

namespace heft::data {

/// A topic of a recording.
struct BagTopic {
  std::string name, type, encoding;  ///< "/joint_states", "sensor_msgs/msg/JointState", "cdr"
  std::uint64_t messages{0};         ///< where counted
  std::int64_t first{0}, last{0};    ///< when recorded [ns], where counted

  bool holds_joint_states() const {
    return type == "sensor_msgs/msg/JointState" || type == "sensor_msgs/JointState" ||
           type == "sensor_msgs::msg::dds_::JointState_";
  }
};

struct BagMessage {
  std::int64_t recorded{0};  ///< [ns]
  std::string_view data;     ///< valid until the next is read
  std::uint64_t at{0};       ///< byte of the file, or row of the table
};

/// Messages of a recording from front to back. Memory: one chunk or message.
class MessageSource {
 public:
  virtual ~MessageSource() = default;
  virtual const std::string& path() const = 0;
  /// "MCAP (zstd)"; known in full once a message was read.
  virtual std::string format() const = 0;
  /// Every topic. `counted`: with the numbers of messages, which may take reading the whole file.
  virtual std::vector<BagTopic> topics(bool counted) = 0;
  /// Messages of this topic only, from the first on.
  virtual void choose(const std::string& topic) = 0;
  virtual bool next(BagMessage& message) = 0;
  virtual double part_read() const = 0;
  /// Without the file's name.
  virtual std::vector<std::string> notes() const = 0;
};

bool recognises_mcap(std::string_view head);
std::unique_ptr<MessageSource> open_mcap(SharedBytes file);

bool recognises_sqlite(std::string_view head);
std::unique_ptr<MessageSource> open_sqlite_bag(SharedBytes file);

/// A bag compressed as a whole.
bool recognises_zstd(std::string_view head);

/// A folder with metadata.yaml and bags.
bool is_bag_folder(const std::string& path);

/// A bag of any kind, compressed as a whole or not, or a folder of them. @throws DataError
std::unique_ptr<MessageSource> open_bag(const std::string& path);

/// The topic of joint states that `as` names or that is the only one, as a log.
/// @throws DataError that lists the topics where none or several may be meant
std::unique_ptr<LogReader> read_joint_states(std::unique_ptr<MessageSource> source, const ReadAs& as);

}  // namespace heft::data

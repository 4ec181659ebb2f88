// Logs in formats of other programs, written by their own libraries (foreign/make_binary.py): each equals the CSV to the
// last bit that the format carries; what is damaged or ambiguous ends in one message.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/data/log.hpp"
#include "heft/host/error.hpp"
#include "log_reader.hpp"
#include "support/temporary_folder.hpp"

namespace heft::data {
namespace {

using heft::test::message_of;
using heft::test::TemporaryFolder;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;

const std::string kFolder = std::string(HEFT_SOURCE_DIR) + "/test/data/foreign/binary/";
const std::vector<std::string> kArm = {"shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint",
                                       "wrist_1_joint",      "wrist_2_joint",       "wrist_3_joint"};

std::string content_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

const LogFormat& format_of(const std::string& path) {
  if (const LogFormat* folder = folder_format(path)) return *folder;
  const std::string content = content_of(path).substr(0, 65536);
  for (const LogFormat& format : binary_formats()) {
    if (format.recognises(content)) return format;
  }
  throw DataError(path + ": no format recognises it");
}

struct Table {
  std::string format;
  std::vector<LogColumn> columns;
  std::vector<std::vector<double>> rows;
  std::string notes;

  /// A column by its name, or by what the file calls it.
  Eigen::VectorXd column(const std::string& name, const std::string& origin) const {
    for (std::size_t c = 0; c < columns.size(); ++c) {
      if (columns[c].name != name && columns[c].origin != origin) continue;
      Eigen::VectorXd values(static_cast<Eigen::Index>(rows.size()));
      for (std::size_t k = 0; k < rows.size(); ++k) values[static_cast<Eigen::Index>(k)] = rows[k][c];
      return values;
    }
    ADD_FAILURE() << "no column " << name << " (" << origin << ")";
    return {};
  }
  bool has(const std::string& name, const std::string& origin) const {
    return std::any_of(columns.begin(), columns.end(),
                       [&](const LogColumn& c) { return c.name == name || c.origin == origin; });
  }
};

Table read_path(const std::string& path, const ReadAs& as = {}) {
  const LogFormat& format = format_of(path);
  const std::unique_ptr<LogReader> reader = format.open(path, as);
  Table table;
  table.columns = reader->columns();
  std::vector<double> row(table.columns.size(), 0.0);
  while (reader->next(row.data())) table.rows.push_back(row);
  EXPECT_EQ(reader->part_read(), 1.0) << path;
  table.format = reader->format();
  for (const std::string& note : reader->notes()) table.notes += note + "\n";
  return table;
}

Table read(const std::string& name, const ReadAs& as = {}) { return read_path(kFolder + name, as); }

std::string refusal(const std::string& name, const ReadAs& as = {}) {
  return message_of<DataError>([&] { read(name, as); });
}

/// The refusal of a file with this content.
std::string refusal_of(const std::string& content) {
  const TemporaryFolder folder;
  const std::string path = folder.write("log", content);
  const std::string message = message_of<DataError>([&] { read_path(path); });
  return message.starts_with(path) ? message.substr(path.size()) : "no file named: " + message;
}

/// Expects time, q, qd and tau of the CSV, bit by bit.
void expect_run(const Table& table, int rows = 40) {
  const Log csv = read_log(kFolder + "run.csv", {});
  ASSERT_EQ(csv.num_samples(), 40);
  ASSERT_EQ(static_cast<int>(table.rows.size()), rows);
  EXPECT_EQ(table.column("time", "time"), csv.time.head(rows));
  for (int joint = 0; joint < 6; ++joint) {
    const std::string number = std::to_string(joint + 1), index = "[" + std::to_string(joint) + "]";
    const auto expect = [&](const std::string& name, const Eigen::MatrixXd& values) {
      EXPECT_EQ(table.column(name + number, name + index), values.col(joint).head(rows)) << name << number;
    };
    expect("q", csv.q);
    expect("qd", csv.qd);
    expect("tau", csv.tau);
  }
}

// --- bags of ROS 2 ---

TEST(Bags, OfEveryContainerEqualTheCsvToTheLastBit) {
  const std::vector<std::pair<std::string, std::string>> files = {
      {"none.mcap", "MCAP, topic /joint_states"},
      {"lz4.mcap", "MCAP (lz4), topic /joint_states"},
      {"zstd.mcap", "MCAP (zstd), topic /joint_states"},
      {"no_summary.mcap", "MCAP, topic /joint_states"},
      {"big_endian.mcap", "MCAP (zstd), topic /joint_states"},
      {"rosbag2.db3", "rosbag2 (SQLite), topic /joint_states"},
      {"old.db3", "rosbag2 (SQLite), topic /joint_states"},
      {"messages.db3", "rosbag2 (SQLite), topic /joint_states"},
      {"rosbag2.db3.zstd", "rosbag2 (SQLite), topic /joint_states"},
      {"two_files", "MCAP in 2 files, topic /joint_states"},
  };
  for (const auto& [name, format] : files) {
    SCOPED_TRACE(name);
    const Table table = read(name);
    EXPECT_EQ(table.format, format);
    EXPECT_EQ(table.columns[3].origin, "position of 'elbow_joint'");
    EXPECT_EQ(table.notes, "time is counted from the first header.stamp, 1700000000.123456789 s\n");
    expect_run(table);
  }
}

TEST(Bags, HaveTheirJointsMatchedByNameInEveryMessage) {
  ReadAs as;
  as.joint_names = kArm;
  const Table table = read("shuffled.mcap", as);
  EXPECT_THAT(table.notes, HasSubstr("joints of /joint_states that are left out: gripper_finger\n"));
  expect_run(table);

  as.joint_names = {"elbow_joint", "shoulder_pan_joint"};
  const Table two = read("none.mcap", as);
  const Log csv = read_log(kFolder + "run.csv", {});
  EXPECT_EQ(two.columns.size(), 7U);
  EXPECT_EQ(two.column("q1", ""), csv.q.col(2));
  EXPECT_EQ(two.column("tau2", ""), csv.tau.col(0));
}

TEST(Bags, WithoutTheRobotsJointsNameThem) {
  ReadAs as;
  as.joint_names = {"elbow_joint", "joint_7"};
  EXPECT_THAT(refusal("none.mcap", as),
              AllOf(HasSubstr("none.mcap: message 1 of /joint_states: joint 'joint_7' is missing; found "
                              "'shoulder_pan_joint', 'shoulder_lift_joint'"),
                    HasSubstr("; expected every joint in one message; ")));
  as.joint_names = {"joint_7"};
  EXPECT_THAT(refusal("none.mcap", as),
              AllOf(HasSubstr("found the joints 'shoulder_pan_joint'"),
                    HasSubstr("expected messages with the robot's joints 'joint_7'; name the right "
                              "topic or robot, or convert")));
}

TEST(Bags, WithSeveralTopicsListThemWithRates) {
  EXPECT_THAT(refusal("two_topics.mcap"),
              HasSubstr("two_topics.mcap: found several topics of joint states: /left/joint_states "
                        "(sensor_msgs/msg/JointState, 40 messages, 500 Hz), /right/joint_states "
                        "(sensor_msgs/msg/JointState, 20 messages, 243.6 Hz); expected one topic of "
                        "sensor_msgs/msg/JointState; name it with --topic"));
  ReadAs as;
  as.topic = "left/joint_states";
  expect_run(read("two_topics.mcap", as));
  as.topic = "/right/joint_states";
  const Table right = read("two_topics.mcap", as);
  EXPECT_EQ(right.rows.size(), 20U);
  EXPECT_TRUE(right.has("qd6", ""));
  EXPECT_FALSE(right.has("tau1", "")) << "its effort is empty";
  as.topic = "/arm";
  EXPECT_THAT(refusal("two_topics.mcap", as), HasSubstr("found no topic '/arm': /left/joint_states"));
  as.topic = "/rosout";
  EXPECT_THAT(refusal("rosbag2.db3", as),
              HasSubstr("found a topic of another type: /rosout (std_msgs/msg/String)"));
}

TEST(Bags, ThatWereCutAreReadAsFarAsTheyAreWhole) {
  const TemporaryFolder folder;
  const std::string whole = content_of(kFolder + "no_summary.mcap");
  const std::string path = folder.write("cut.mcap", whole.substr(0, whole.size() / 2));
  const Table table = read_path(path);
  EXPECT_THAT(table.notes, HasSubstr("the file was cut; what is whole was read, up to byte "));
  EXPECT_GT(table.rows.size(), 15U);
  expect_run(table, static_cast<int>(table.rows.size()));

  const std::string chunks = content_of(kFolder + "lz4.mcap");
  const Table part = read_path(folder.write("chunks.mcap", chunks.substr(0, chunks.size() / 2)));
  EXPECT_THAT(part.notes, HasSubstr("the file was cut"));
  EXPECT_GT(part.rows.size(), 10U);
  expect_run(part, static_cast<int>(part.rows.size()));
}

TEST(Bags, ThatAreDamagedSayWhere) {
  // A length that leads beyond a file that was written to its end is damage, not a cut tail.
  std::string mcap = content_of(kFolder + "no_summary.mcap");
  const std::size_t message = mcap.find(std::string("\5\x5A\1\0\0\0\0\0\0", 9));
  ASSERT_NE(message, std::string::npos) << "no message of 346 bytes in the fixture";
  mcap[message + 6] = 1;
  EXPECT_EQ(refusal_of(mcap),
            ": byte " + std::to_string(message) +
                ": found a record of 1099511628122 bytes, more than the file has; expected a shorter "
                "one, as the file was written to its end; it is damaged");
  std::string chunk = content_of(kFolder + "lz4.mcap");
  chunk.replace(chunk.find("lz4"), 3, "bz2");
  EXPECT_THAT(refusal_of(chunk),
              HasSubstr("found a chunk compressed by 'bz2'; expected lz4, zstd or none; "));
  std::string flipped = content_of(kFolder + "none.mcap");
  flipped[flipped.find("elbow_joint")] ^= 1;
  EXPECT_THAT(refusal_of(flipped), HasSubstr("the checksum of this chunk is wrong; the file is damaged"));
  const std::string bag = content_of(kFolder + "rosbag2.db3");
  EXPECT_THAT(refusal_of(bag.substr(0, 3000)), HasSubstr("failed (database disk image is malformed)"));
  const std::string packed = content_of(kFolder + "rosbag2.db3.zstd");
  EXPECT_THAT(refusal_of(packed.substr(0, 5000)),
              HasSubstr(": byte 5000: found the end of the file inside a zstd frame; "));
}

/// A recording as small as can be, by the specifications of MCAP and CDR.
class SmallBag {
 public:
  SmallBag() {
    record(1, text("ros2") + text(""));
    record(3, number<std::uint16_t>(1) + text("sensor_msgs/msg/JointState") + text("ros2msg") + text(""));
    record(4, number<std::uint16_t>(0) + number<std::uint16_t>(1) + text("/arm") + text("cdr") + text(""));
  }
  SmallBag& add(std::int32_t seconds, std::uint32_t nanoseconds, const std::vector<std::string>& names,
                const std::vector<std::vector<double>>& arrays) {
    std::string cdr = number(seconds) + number(nanoseconds);
    const auto align = [&](std::size_t size) { cdr.resize((cdr.size() + size - 1) / size * size, '\0'); };
    const auto add_text = [&](const std::string& value) {
      align(4);
      cdr += number(static_cast<std::uint32_t>(value.size() + 1)) + value + '\0';
    };
    add_text("");
    align(4);
    cdr += number(static_cast<std::uint32_t>(names.size()));
    for (const std::string& name : names) add_text(name);
    for (const std::vector<double>& array : arrays) {
      align(4);
      cdr += number(static_cast<std::uint32_t>(array.size()));
      if (!array.empty()) align(8);
      for (const double value : array) cdr += number(value);
    }
    ++count_;
    const std::string times =
        number<std::uint64_t>(5'000'000'000 + 10'000'000 * count_) + number<std::uint64_t>(0);
    record(5, number<std::uint16_t>(0) + number<std::uint32_t>(0) + times + std::string("\0\1\0\0", 4) + cdr);
    return *this;
  }
  Table read(const ReadAs& as = {}) const {
    const TemporaryFolder folder;
    return read_path(folder.write("small.mcap", content_), as);
  }
  std::string refusal() const {
    const TemporaryFolder folder;
    const std::string path = folder.write("small.mcap", content_);
    return message_of<DataError>([&] { read_path(path); }).substr(path.size());
  }

 private:
  template <typename T>
  static std::string number(T value) {
    return {reinterpret_cast<const char*>(&value), sizeof value};
  }
  static std::string text(const std::string& value) {
    return number(static_cast<std::uint32_t>(value.size())) + value;
  }
  void record(char kind, const std::string& content) {
    content_ += kind + number<std::uint64_t>(content.size()) + content;
  }
  std::string content_ = "\x89MCAP0\r\n";
  std::uint64_t count_{0};
};

TEST(Bags, LeaveOutRepeatsAndMessagesOfOtherJoints) {
  SmallBag bag;
  bag.add(7, 0, {"a", "b"}, {{1, 2}, {}, {}})
      .add(7, 0, {"a", "b"}, {{1, 2}, {}, {}})
      .add(7, 1, {"hand"}, {{9}, {}, {}});
  bag.add(7, 500, {"b", "a"}, {{4, 3}, {}, {}});
  const Table table = bag.read();
  EXPECT_EQ(table.rows, (std::vector<std::vector<double>>{{0.0, 1.0, 2.0}, {500e-9, 3.0, 4.0}}));
  EXPECT_THAT(table.notes,
              AllOf(HasSubstr("joints of /arm that are left out: hand\n"),
                    HasSubstr("1 messages of /arm are left out, as they have none of the joints\n"),
                    HasSubstr("1 exact repeats of a message are left out\n")));
}

TEST(Bags, WithoutStampsTakeTheTimeOfRecording) {
  const Table table = SmallBag().add(0, 0, {"a"}, {{1}, {}, {}}).add(0, 0, {"a"}, {{2}, {}, {}}).read();
  EXPECT_EQ(table.rows, (std::vector<std::vector<double>>{{0.0, 1.0}, {0.01, 2.0}}));
  EXPECT_THAT(table.notes,
              HasSubstr("time is counted from the first message as recorded, since header.stamp is never "
                        "set, 5.010000000 s\n"));
}

TEST(Bags, HaveTheChannelsOfTheirFirstMessage) {
  const double nan = std::nan("");
  const Table table = SmallBag().add(1, 0, {"a"}, {{1}, {2}, {nan}}).add(2, 0, {"a"}, {{3}, {4}, {5}}).read();
  EXPECT_EQ(table.rows, (std::vector<std::vector<double>>{{0.0, 1.0, 2.0}, {1.0, 3.0, 4.0}}));
  EXPECT_THAT(table.notes,
              HasSubstr("effort is left out: the first message of /arm has 'nan' for every joint"));
  EXPECT_EQ(
      SmallBag().add(1, 0, {"a"}, {{1}, {}, {2}}).add(2, 0, {"a"}, {{1}, {}, {}}).refusal(),
      ": message 2 of /arm: found no effort; expected 1 as in the first message; cut the recording before it");
  EXPECT_EQ(
      SmallBag().add(1, 0, {"a"}, {{1}, {}, {}}).add(2, 0, {"a"}, {{1}, {3}, {}}).refusal(),
      ": message 2 of /arm: found 1 values of velocity; expected none as in the first message; cut the recording "
      "before it");
  EXPECT_EQ(
      SmallBag().add(1, 0, {"a", "b"}, {{1}, {}, {}}).refusal(),
      ": message 1 of /arm: found 1 values of position for 2 joints; expected one a joint, or none in the whole log; "
      "correct what publishes them");
  EXPECT_EQ(SmallBag().add(1, 0, {"a", "a"}, {{1, 2}, {}, {}}).refusal(),
            ": message 1 of /arm: found joint 'a' twice; expected each once; correct what publishes it");
  EXPECT_EQ(SmallBag().refusal(),
            ": topic /arm has no message that can be read; expected joint states; record it again");
}

TEST(Bags, WithoutNamesAreReadInTheirOrder) {
  SmallBag bag;
  bag.add(1, 0, {}, {{1, 2}, {}, {}}).add(2, 0, {}, {{3, 4}, {}, {}});
  EXPECT_EQ(bag.read().rows, (std::vector<std::vector<double>>{{0.0, 1.0, 2.0}, {1.0, 3.0, 4.0}}));
  EXPECT_EQ(bag.read().columns[2].origin, "position[1]");
  ReadAs as;
  as.joint_names = {"x", "y"};
  EXPECT_EQ(bag.read(as).rows.size(), 2U);
  as.joint_names = {"x", "y", "z"};
  EXPECT_THAT(message_of<DataError>([&] { bag.read(as); }),
              HasSubstr("found 2 joints without names; expected 3; "));
}

TEST(Bags, InSqliteLeaveNothingBeside) {
  const TemporaryFolder folder;
  std::filesystem::copy(kFolder + "rosbag2.db3", folder.path("run.db3"));
  std::filesystem::permissions(folder.path("run.db3"), std::filesystem::perms::owner_read);
  expect_run(read_path(folder.path("run.db3")));
  EXPECT_EQ(folder.num_entries(), 1U);
}

// --- arrays ---

TEST(Arrays, OfNumPyEqualTheCsvToTheLastBit) {
  const Table stored = read("stored.npz");
  EXPECT_EQ(stored.format, "NumPy npz");
  EXPECT_THAT(stored.notes, IsEmpty());
  expect_run(stored);
  expect_run(read("zip64.npz"));
  // Transposed, in Fortran's order, compressed, time called t.
  const Table deflated = read("deflated.npz");
  EXPECT_EQ(deflated.notes, "variables left out: robot (text), picture (3x4x5)\n");
  expect_run(deflated);
  const Table structured = read("structured.npy");
  EXPECT_EQ(structured.format, "NumPy npy");
  EXPECT_EQ(structured.notes, "variables left out: note (text)\n");
  const Log csv = read_log(kFolder + "run.csv", {});
  EXPECT_EQ(structured.column("time", "time"), csv.time);
  EXPECT_EQ(structured.column("q6", "q[5]"), csv.q.col(5));
  EXPECT_EQ(structured.column("tau1", "tau[0]"), csv.tau.col(0));
}

TEST(Arrays, OfOtherTypesOfNumbersEqualWhatTheseCarry) {
  const Table table = read("other_types.npz");
  const Log csv = read_log(kFolder + "run.csv", {});
  EXPECT_EQ(table.notes,
            "variables left out: phase (complex numbers)\n"
            "time is counted from the first value of 'time', 1700000000123456789, and read in nanoseconds\n");
  EXPECT_EQ(table.column("time", "time"), csv.time);
  EXPECT_EQ(table.column("q3", "q[2]"), csv.q.col(2));
  EXPECT_EQ(table.column("qd4", "qd[3]"), csv.qd.col(3).cast<float>().cast<double>());
  EXPECT_EQ(table.column("tau2", "tau[1]"), csv.tau.col(1).array().round().matrix());
}

TEST(Arrays, OfMatlabEqualTheCsvToTheLastBit) {
  const Table plain = read("plain.mat");
  EXPECT_EQ(plain.format, "MATLAB (version 5)");
  EXPECT_EQ(plain.notes, "variables left out: robot (text)\n");
  expect_run(plain);
  const Table compressed = read("compressed.mat");
  EXPECT_EQ(compressed.notes, "variables left out: robot (text), z (complex numbers)\n");
  expect_run(compressed);
  const Table structure = read("struct.mat");
  EXPECT_EQ(structure.columns[1].origin, "data.q[0]");
  EXPECT_EQ(structure.notes, "variables left out: data.joints (a cell array)\n");
  for (const std::string name : {"v73.mat", "v73_chunked.mat"}) {
    SCOPED_TRACE(name);
    const Table table = read(name);
    EXPECT_EQ(table.format, "MATLAB (version 7.3)");
    EXPECT_THAT(table.notes, AllOf(HasSubstr("variables left out: "), HasSubstr("robot (text)")));
    if (name == "v73.mat") {
      expect_run(table);
    } else {
      EXPECT_THAT(table.notes,
                  HasSubstr("time is counted from the first value of 'data.time', 1700000000123456789, and "
                            "read in nanoseconds\n"));
    }
  }
  const Log csv = read_log(kFolder + "run.csv", {});
  for (const Table& table : {structure, read("v73_chunked.mat")}) {
    ASSERT_EQ(table.rows.size(), 40U);
    EXPECT_EQ(table.column("time", ""), csv.time);
    EXPECT_EQ(table.column("q3", "data.q[2]"), csv.q.col(2));
    EXPECT_EQ(table.column("qd5", "data.qd[4]"), csv.qd.col(4));
    EXPECT_EQ(table.column("tau6", "data.tau[5]"), csv.tau.col(5));
  }
}

TEST(Arrays, OfNewerHdf5EqualTheCsvToTheLastBit) {
  const Log csv = read_log(kFolder + "run.csv", {});
  for (const auto& [name, in] : {std::pair("latest.h5", "run."), std::pair("v110.h5", "")}) {
    SCOPED_TRACE(name);
    const Table table = read(name);
    EXPECT_EQ(table.format, "HDF5");
    ASSERT_EQ(table.rows.size(), 40U);
    EXPECT_EQ(table.column("time", ""), csv.time);
    for (int joint = 0; joint < 6; ++joint) {
      EXPECT_EQ(table.column(fmt::format("q{}", joint + 1), fmt::format("{}q[{}]", in, joint)),
                csv.q.col(joint));
      EXPECT_EQ(table.column(fmt::format("qd{}", joint + 1), fmt::format("{}qd[{}]", in, joint)),
                csv.qd.col(joint));
      EXPECT_EQ(table.column(fmt::format("tau{}", joint + 1), fmt::format("{}tau[{}]", in, joint)),
                csv.tau.col(joint));
    }
  }
  const Table in_order = read("v110.h5");
  EXPECT_EQ(in_order.column("qref4", "qref[3]"), csv.q.col(3));
}

TEST(Arrays, OfMoreChunksThanAPageOfTheirIndexAreWhole) {
  const Table table = read("pages.h5");
  ASSERT_EQ(table.rows.size(), 1100U);
  const Eigen::VectorXd rows = Eigen::VectorXd::LinSpaced(1100, 0, 1099);
  EXPECT_EQ(table.column("q1", "q"), rows);
  EXPECT_EQ(table.column("time", ""), rows / 125.0);
}

TEST(Arrays, WithOtherNumbersOfRowsAreCutOrRefused) {
  const Table table = read("cut_tail.npz");
  EXPECT_EQ(table.rows.size(), 995U);
  EXPECT_EQ(table.notes, "lengths differ from the 1000 of 'time': tau (995); the first 995 rows are read\n");
  EXPECT_THAT(
      refusal("other_rate.npz"),
      HasSubstr("other_rate.npz: variable 'tau' has 500x6 values, 'time' has 1000; expected as many rows of "
                "both; resample it to the times of 'time', or save it"));
}

TEST(Arrays, WithoutTimeSayWhatThereIs) {
  EXPECT_THAT(
      refusal("matrix.npy"),
      HasSubstr(
          "matrix.npy: found unnamed (40x6); expected a variable 'time' [s] with one value a row; save "
          "with numpy.savez(NAME, time=t, q=q, tau=tau), name the one that it is with --map time=NAME, or "
          "give the rate of the rows (--map time=500Hz)"));
}

TEST(Arrays, WithoutTimeAreReadWhereTheRateIsGiven) {
  const TemporaryFolder folder;
  const std::string mat = content_of(kFolder + "plain.mat");
  std::string timeless = mat;  // the name of the variable, in a short element
  timeless.replace(timeless.find("time"), 4, "tame");
  ReadAs as;
  as.map = {{"time", "500Hz"}};
  const Table table = read_path(folder.write("timeless.mat", timeless), as);
  const Log csv = read_log(kFolder + "run.csv", {});
  EXPECT_FALSE(table.has("time", "time"));
  EXPECT_EQ(table.column("q2", "q[1]"), csv.q.col(1));
}

TEST(Arrays, ThatWereCutSayWhere) {
  const std::string npz = content_of(kFolder + "deflated.npz");
  EXPECT_THAT(refusal_of(npz.substr(0, npz.size() / 2)),
              HasSubstr("found no list of files at the end; expected that of a zip file (npz); it was cut"));
  const std::string npy = content_of(kFolder + "structured.npy");
  EXPECT_THAT(refusal_of(npy.substr(0, 2000)), HasSubstr("found a shape of more numbers than the file has"));
  const std::string mat = content_of(kFolder + "plain.mat");
  EXPECT_THAT(refusal_of(mat.substr(0, 3000)),
              HasSubstr("more than the file has; the file was cut or is damaged"));
  const std::string hdf5 = content_of(kFolder + "v73.mat");
  EXPECT_THAT(
      refusal_of(hdf5.substr(0, 3000)),
      HasSubstr(
          "variable 'q': found 1920 bytes of numbers; expected 1920 inside the file; the file is damaged or was cut"));
}

// --- of all formats ---

TEST(BinaryFormats, SkipWhatIsNotWantedAndNamePlaces) {
  const std::vector<std::pair<std::string, std::string>> files = {
      {"zstd.mcap", ": message 3 of /joint_states"},
      {"rosbag2.db3", ": message 3 of /joint_states"},
      {"deflated.npz", ": row 3"},
      {"compressed.mat", ": row 3"},
      {"v73.mat", ": row 3"}};
  const Log csv = read_log(kFolder + "run.csv", {});
  for (const auto& [name, place] : files) {
    SCOPED_TRACE(name);
    const std::unique_ptr<LogReader> reader = format_of(kFolder + name).open(kFolder + name, {});
    const std::vector<LogColumn>& columns = reader->columns();
    const auto third = std::find_if(columns.begin(), columns.end(), [](const LogColumn& column) {
      return column.name == "q3" || column.origin == "q[2]";
    });
    const std::size_t wanted = static_cast<std::size_t>(third - columns.begin());
    reader->want_only({wanted});
    std::vector<double> row(columns.size(), -7.0);
    for (int k = 0; k < 3; ++k) ASSERT_TRUE(reader->next(row.data()));
    for (std::size_t c = 0; c < row.size(); ++c) EXPECT_EQ(row[c], c == wanted ? csv.q(2, 2) : -7.0);
    EXPECT_EQ(reader->place(), kFolder + name + place);
    EXPECT_GT(reader->part_read(), 0.0);
    EXPECT_LE(reader->part_read(), 1.0);
  }
}

TEST(BinaryFormats, TakeNoText) {
  for (const LogFormat& format : binary_formats()) {
    EXPECT_FALSE(format.recognises("time,q1,tau1\n0,1,2\n")) << format.id;
    EXPECT_FALSE(format.recognises("")) << format.id;
    EXPECT_FALSE(format.recognises(std::string(70000, '\0'))) << format.id;
  }
}

}  // namespace
}  // namespace heft::data

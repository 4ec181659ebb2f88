#include <array>

#include "log_reader.hpp"
#include "readers/arrays.hpp"
#include "readers/bag.hpp"

namespace heft::data {
namespace {

std::unique_ptr<LogReader> open_bag_log(const std::string& path, const ReadAs& as) {
  return read_joint_states(open_bag(path), as);
}

template <ArrayFile (*open)(SharedBytes)>
std::unique_ptr<LogReader> open_array_log(const std::string& path, const ReadAs& as) {
  return read_arrays(open(std::make_shared<InputBytes>(path)), as);
}

}  // namespace

std::span<const LogFormat> binary_formats() {
  static constexpr std::array<LogFormat, 7> kFormats{{
      {"mcap", recognises_mcap, open_bag_log},
      {"rosbag2", recognises_sqlite, open_bag_log},
      {"rosbag2.zstd", recognises_zstd, open_bag_log},
      {"npz", recognises_npz, open_array_log<open_numpy>},
      {"npy", recognises_npy, open_array_log<open_numpy>},
      {"mat5", recognises_mat5, open_array_log<open_mat5>},
      {"hdf5", recognises_hdf5, open_array_log<open_hdf5>},
  }};
  return kFormats;
}

const LogFormat* folder_format(const std::string& path) {
  static constexpr LogFormat kFolder{"rosbag2 folder", [](std::string_view) { return false; }, open_bag_log};
  return is_bag_folder(path) ? &kFolder : nullptr;
}

}  // namespace heft::data
